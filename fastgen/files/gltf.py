"""A small writer of binary glTF 2.0 (Khronos Group 2021): meshes, textures, cameras, extras.

Coordinates here are glTF's own: y up, metres, cameras look along -z.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FLOAT, _UINT = 5126, 5125
_VERTEX_DATA, _INDEX_DATA = 34962, 34963
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}
_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942


class Glb:
    """Collects a scene's parts; `data` gives the file. Each add_* returns a glTF index."""

    def __init__(self, generator: str) -> None:
        self._bytes = bytearray()
        self._tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": generator}}

    def add_texture(self, name: str, png: bytes) -> int:
        """A texture from PNG bytes, repeating and smoothly filtered."""
        view = self._view(png)
        image = {"name": name, "mimeType": "image/png", "bufferView": view}
        return self._add("textures", {"source": self._add("images", image)})

    def add_material(self, material: dict[str, Any]) -> int:
        """A material, a glTF `material` object as it is."""
        return self._add("materials", material)

    def add_mesh(
        self,
        name: str,
        material: int,
        triangles: NDArray[np.integer],
        attributes: Mapping[str, NDArray[np.floating]],
    ) -> None:
        """A mesh as a node of the scene.

        triangles: [T, 3]. attributes: vertex data [V, n] by glTF's names, as in POSITION.
        """
        indices = np.ascontiguousarray(triangles, np.uint32)
        accessors = {
            key: self._accessor(np.ascontiguousarray(array, np.float32), _FLOAT, _VERTEX_DATA)
            for key, array in attributes.items()
        }
        primitive = {
            "attributes": accessors,
            "indices": self._accessor(indices.reshape(-1, 1), _UINT, _INDEX_DATA),
            "material": material,
        }
        mesh = self._add("meshes", {"name": name, "primitives": [primitive]})
        self._node({"name": name, "mesh": mesh})

    def add_camera(
        self,
        name: str,
        yfov: float,
        aspect_ratio: float,
        pose: NDArray[np.floating],
        extras: dict[str, Any],
    ) -> None:
        """A camera as a node of the scene. yfov: radians. pose: [4, 4], camera to world."""
        perspective = {"yfov": yfov, "aspectRatio": aspect_ratio, "znear": 0.1, "zfar": 1000.0}
        camera = {"name": name, "type": "perspective", "perspective": perspective}
        number = self._add("cameras", camera)
        matrix = [float(value) for value in np.asarray(pose, np.float64).T.ravel()]
        self._node({"name": name, "camera": number, "matrix": matrix, "extras": extras})

    def data(self, extras: dict[str, Any]) -> bytes:
        """The file. extras: anything that JSON takes, kept with the scene."""
        nodes = list(range(len(self._tree["nodes"])))
        tree = self._tree | {
            "scene": 0,
            "scenes": [{"nodes": nodes, "extras": extras}],
            "buffers": [{"byteLength": len(self._bytes)}],
        }
        text = json.dumps(tree, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(self._bytes)
        head = struct.pack("<III", _MAGIC, 2, total)
        text_head = struct.pack("<II", len(text), _JSON_CHUNK)
        binary_head = struct.pack("<II", len(self._bytes), _BINARY_CHUNK)
        return head + text_head + text + binary_head + bytes(self._bytes)

    def _add(self, kind: str, item: dict[str, Any]) -> int:
        items: list[dict[str, Any]] = self._tree.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def _node(self, node: dict[str, Any]) -> None:
        self._add("nodes", node)

    def _view(self, data: bytes, target: int | None = None) -> int:
        view = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(data)}
        self._bytes += data + b"\0" * (-len(data) % 4)
        return self._add("bufferViews", view | ({"target": target} if target else {}))

    def _accessor(self, array: NDArray[Any], component: int, target: int) -> int:
        return self._add(
            "accessors",
            {
                "bufferView": self._view(array.tobytes(), target),
                "componentType": component,
                "count": len(array),
                "type": _SHAPES[array.shape[1]],
                "min": array.min(axis=0).tolist(),
                "max": array.max(axis=0).tolist(),
            },
        )

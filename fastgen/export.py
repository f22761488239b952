"""Export of a scene as a GLB file (binary glTF 2.0) for Blender and other tools.

The file contains the damaged container, the spreader, their baked textures, the seals and the
cameras. If the damage tears holes, it also contains the inside of the container.

Data that glTF has no place for is stored as `extras`. The extras of the glTF scene are the
environment and the Scene; those of a camera's node are its exposure and lens distortion. Viewers
show each camera as a pinhole.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.exchange import gltf
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

import fastgen
from fastgen.camera.projection import view_of
from fastgen.errors import ConfigError, OutputError
from fastgen.files.images import png, write
from fastgen.formats.scene_file import view_values
from fastgen.generator import Generator
from fastgen.geometry.damage_law import variant
from fastgen.geometry.damaged_mesh import DamagedMesh, damaged_mesh
from fastgen.geometry.mesh import MATERIALS, Mesh
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.constants import INSIDE_ALBEDO
from fastgen.render.passes.bake import Atlas, atlas_size, least_texel_mm
from fastgen.render.surface_values import SEAL_STEEL_ALBEDO
from fastgen.scene import Camera, Scene
from fastgen.scene.check import check_camera, check_scene
from fastgen.scene.limits import MM
from fastgen.validation import to_plain

SHEET_MM = 2.0
"""Thickness of the steel: the distance between the outside and the exported inside."""

_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""Rotation from z up to y up (glTF 2.0, section 3.4)."""

_IMAGE_NAMES = {"baseColorTexture": "base_color", "metallicRoughnessTexture": "surface"}

_FLOOR_SLOPE = 0.7
"""Inside faces whose normal has a larger z than this are the wooden floor."""


def export_glb(
    generator: Generator,
    scene: Scene,
    path: str | Path,
    cameras: Iterable[Camera] | None = None,
    texel_mm: float = 4.0,
) -> None:
    """Write `scene` as a GLB file, in metres and with y up.

    Args:
        generator: Bakes the textures. Its image size sets the aspect ratio of the cameras.
        scene: The scene. If its damage tears holes, the file also has the inside, in one color for
            the floor and one for the rest.
        path: The GLB file.
        cameras: Cameras to write; by default all cameras of the scene.
        texel_mm: Width of a texel of the container's textures, in millimetres. The spreader's
            texels are wider if its atlas would be too large otherwise.

    Raises:
        ConfigError: The texel is too small, the scene cannot be drawn, or it has no container.
        OutputError: The file cannot be written.
    """
    check_scene(scene)
    if not scene.container.present:
        raise ConfigError(
            f"scene {scene.index}: has no container to export; take another, or set "
            "container.absent to 0"
        )
    cameras = scene.cameras if cameras is None else cameras
    chosen = [check_camera(camera, scene) for camera in cameras]
    path = Path(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: no folder {path.parent}; make it first")
    prepared = PreparedScene(scene)
    mesh = prepared.container
    atlas_size(mesh, texel_mm)  # raises ConfigError before the slow steps
    body = damaged_mesh(mesh, scene.damages)
    atlas = generator.bake(scene, texel_mm)
    parts = {"container": _baked_part(body, atlas, scene.surface.paint.name)}
    if variant(scene.damages) == "holed":
        parts |= _inside(body)
    if prepared.spreader is not None:
        spreader = prepared.spreader.mesh
        baked = generator.bake_spreader(scene, max(texel_mm, least_texel_mm(spreader)))
        assert baked is not None
        parts["spreader"] = _baked_part(spreader, baked, "spreader")
    if prepared.seals is not None:
        parts |= _seals(prepared.seals.mesh)

    def complete(tree: dict[str, Any]) -> None:
        tree["asset"]["generator"] = f"fastgen {fastgen.__version__}"
        _complete_materials(tree, scene)
        for camera in chosen:
            _append_camera(tree, generator, scene, camera)

    exported = trimesh.Scene(metadata=_scene_extras(scene))
    for name, part in parts.items():
        exported.add_geometry(part, node_name=name, geom_name=name)
    write(path, gltf.export_glb(exported, include_normals=True, tree_postprocessor=complete))


class _Texture:
    """Encoded PNG in the place of a PIL image, which takes trimesh five times as long to write."""

    format = "PNG"

    def __init__(self, pixels: NDArray[np.uint8]) -> None:
        self._data = png(pixels)

    def save(self, stream: BinaryIO, format: str) -> None:
        stream.write(self._data)


def _baked_part(mesh: Mesh | DamagedMesh, atlas: Atlas, material: str) -> trimesh.Trimesh:
    uv = atlas.uv(mesh.atlas_mm)
    uv[:, 1] = 1 - uv[:, 1]  # trimesh has v up and flips it when it writes
    baked = PBRMaterial(
        name=material,
        baseColorTexture=_Texture(atlas.base_color),
        metallicRoughnessTexture=_Texture(atlas.surface),
    )
    return _part(mesh.positions_mm, mesh.normals, mesh.triangles, TextureVisuals(uv, baked))


def _inside(body: DamagedMesh) -> dict[str, trimesh.Trimesh]:
    """Return the backs of all triangles, which the renderer shows through holes."""
    up = -body.normals[body.triangles].mean(axis=1)[:, 2]
    parts = {}
    for name, chosen in (("wood", up > _FLOOR_SLOPE), ("primer", up <= _FLOOR_SLOPE)):
        used, triangles = np.unique(body.triangles[chosen][:, ::-1], return_inverse=True)
        normals = body.normals[used]
        plain = PBRMaterial(f"inside_{name}", metallicFactor=0.0, roughnessFactor=1.0)
        parts[plain.name] = _part(
            body.positions_mm[used] - SHEET_MM * normals,
            -normals,
            triangles.reshape(-1, 3),
            TextureVisuals(material=plain),
        )
    return parts


def _seals(mesh: Mesh) -> dict[str, trimesh.Trimesh]:
    """Return the triangles of each material of seals. The materials have one color each."""
    parts = {}
    of_vertices = np.array([chart.material_index for chart in mesh.charts])[mesh.chart]
    of_triangles = of_vertices[mesh.triangles[:, 0]]
    for number in np.unique(of_triangles).tolist():
        used, triangles = np.unique(mesh.triangles[of_triangles == number], return_inverse=True)
        plain = PBRMaterial(
            MATERIALS[number],
            metallicFactor=0.8 if MATERIALS[number] == "seal_steel" else 0.0,
            roughnessFactor=0.4,
        )
        parts[plain.name] = _part(
            mesh.positions_mm[used],
            mesh.normals[used],
            triangles.reshape(-1, 3),
            TextureVisuals(material=plain),
        )
    return parts


def _part(
    positions_mm: NDArray[np.floating],
    normals: NDArray[np.floating],
    triangles: NDArray[np.integer],
    visual: TextureVisuals,
) -> trimesh.Trimesh:
    """Return a mesh in metres with y up, from arrays in millimetres with z up."""
    return trimesh.Trimesh(
        positions_mm * MM @ _Y_UP.T,
        triangles,
        vertex_normals=normals @ _Y_UP.T,
        visual=visual,
        process=False,
    )


def _scene_extras(scene: Scene) -> dict[str, Any]:
    return {
        "environment": {
            "name": scene.environment.name,
            "yaw_deg": scene.environment.yaw_deg,
            "convention": "z up: radiance(d) = map(Rz(-yaw) d), the map's middle is +x",
        },
        "scene": to_plain(scene),
    }


def _complete_materials(tree: dict[str, Any], scene: Scene) -> None:
    """Name the images, and set the exact colors that trimesh has rounded to 8 bits."""
    colors = {f"inside_{name}": albedo for name, albedo in INSIDE_ALBEDO.items()}
    colors["seal_steel"] = SEAL_STEEL_ALBEDO
    colors |= {f"seal_{seal.hasp}": seal.albedo for seal in scene.seals}
    for material in tree["materials"]:
        values = material["pbrMetallicRoughness"]
        if "baseColorTexture" not in values:
            values["baseColorFactor"] = [*colors[material["name"]], 1.0]
            continue
        for key, image in _IMAGE_NAMES.items():
            texture = tree["textures"][values[key]["index"]]
            tree["images"][texture["source"]]["name"] = f"{material['name']}_{image}"


def _append_camera(
    tree: dict[str, Any], generator: Generator, scene: Scene, camera: Camera
) -> None:
    """Add a camera with its node; trimesh writes one camera at most, and no extras."""
    width, height = generator.size
    view = view_of(camera, generator.size)
    right, down, forward = view.rotation
    pose = np.eye(4)  # to the world from the glTF camera, which looks along -z
    pose[:3, :3] = _Y_UP @ np.stack([right, -down, -forward], axis=1)
    pose[:3, 3] = _Y_UP @ view.position_m
    extras: dict[str, Any] = {
        "exposure": generator.exposure(scene, camera),
        "size": [width, height],
    }
    if view.distortion:
        extras |= {key: view_values(view)[key] for key in ("distortion_model", "distortion")}
    perspective = {
        "yfov": 2 * float(np.arctan(height / 2 / view.focal_px)),
        "aspectRatio": width / height,
        "znear": 0.1,
        "zfar": 1000.0,
    }
    cameras = tree.setdefault("cameras", [])
    node = {
        "name": camera.name,
        "camera": len(cameras),
        "matrix": pose.T.ravel().tolist(),
        "extras": extras,
    }
    cameras.append({"name": camera.name, "type": "perspective", "perspective": perspective})
    tree["scenes"][0]["nodes"].append(len(tree["nodes"]))
    tree["nodes"].append(node)

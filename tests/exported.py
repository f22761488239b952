"""Exported GLB files as trimesh reads them, for rays through their cameras."""

import json
import struct

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

TO_Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
"""Rotation from glTF's frame, whose y axis points up, to the frame of scenes."""


def tree_of(path):
    """Return the JSON part of a GLB, as laid out in section 4.4 of the glTF 2.0 specification."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    return json.loads(data[20 : 20 + size])


class Exported:
    """An exported file as geometry for rays: z up, in metres."""

    def __init__(self, path):
        self.tree = tree_of(path)
        loaded = trimesh.load(path, process=False)
        self.parts = dict(loaded.geometry)
        bodies = []
        for part in self.parts.values():
            bodies.append(trimesh.Trimesh(part.vertices @ TO_Z_UP.T, part.faces, process=False))
        self.outside = bodies[0]
        self.whole = trimesh.util.concatenate(bodies)
        self.visual = self.parts["container"].visual
        self._hits = {}

    def rays(self, name):
        """Return the origin [3] and pixel ray directions [H * W, 3] of the glTF camera."""
        node = next(n for n in self.tree["nodes"] if n["name"] == name and "camera" in n)
        lens = self.tree["cameras"][node["camera"]]["perspective"]
        width, height = node["extras"]["size"]
        pose = np.array(node["matrix"]).reshape(4, 4).T
        top = np.tan(lens["yfov"] / 2)
        x = ((np.arange(width) + 0.5) / width * 2 - 1) * top * lens["aspectRatio"]
        y = (1 - (np.arange(height) + 0.5) / height * 2) * top
        local = np.stack(np.broadcast_arrays(x[None], y[:, None], -1.0), axis=-1).reshape(-1, 3)
        return TO_Z_UP @ pose[:3, 3], local @ pose[:3, :3].T @ TO_Z_UP.T

    def first_hits(self, name, body):
        """Return triangle of `body` (-1 for none) and depth along the view axis, [H * W] each."""
        key = name, id(body)
        if key not in self._hits:
            self._hits[key] = self._cast(name, body)
        return self._hits[key]

    def _cast(self, name, body):
        origin, rays = self.rays(name)
        origins = np.tile(origin, (len(rays), 1))
        lengths = np.linalg.norm(rays, axis=1, keepdims=True)
        triangle = RayMeshIntersector(body).intersects_first(origins, rays / lengths)
        corners = body.triangles[triangle]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((corners[:, 0] - origin) * normal).sum(1) / (rays * normal).sum(1)
        return triangle, np.where(triangle >= 0, depth, np.inf)

    def texel(self, image, name):
        """Return bilinear texture values [H * W, C] at a camera's ray hits, NaN for misses."""
        triangle, depth = self.first_hits(name, self.outside)
        origin, rays = self.rays(name)
        points = origin + np.where(triangle >= 0, depth, 0)[:, None] * rays
        weights = trimesh.triangles.points_to_barycentric(self.outside.triangles[triangle], points)
        uv = np.einsum("rc,rck->rk", weights, self.visual.uv[self.outside.faces[triangle]])
        pixels = np.asarray(image, float)
        height, width = pixels.shape[:2]
        # v points up in trimesh, image rows go down
        place = np.stack([uv[:, 0] * width, (1 - uv[:, 1]) * height], axis=1) - 0.5
        place = np.clip(np.nan_to_num(place), 0, (width - 1.001, height - 1.001))
        x, y = np.floor(place).astype(int).T
        right, down = (place % 1).T[:, :, None]
        above = pixels[y, x] * (1 - right) + pixels[y, x + 1] * right
        below = pixels[y + 1, x] * (1 - right) + pixels[y + 1, x + 1] * right
        return np.where(triangle[:, None] >= 0, above * (1 - down) + below * down, np.nan)

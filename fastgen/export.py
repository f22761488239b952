"""A scene as a GLB file, for Blender and others: damaged container, spreader, their baked
atlases, cameras, light.

What glTF has no place for stands in `extras`: of the scene the environment and the Scene itself,
of each camera node the exposure and its lens's distortion; to viewers it is a pinhole.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import fastgen
from fastgen.camera.projection import view_of
from fastgen.errors import OutputError
from fastgen.files.gltf import Glb
from fastgen.files.images import png, write
from fastgen.formats import view_values
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.damage_law import variant
from fastgen.geometry.damaged_mesh import DamagedMesh, damaged_mesh
from fastgen.render.bake import Atlas, atlas_size, least_texel_mm
from fastgen.render.programs import INSIDE_ALBEDO
from fastgen.render.shapes import spreader_mesh
from fastgen.scene import Camera, Scene
from fastgen.scene.check import check_camera, check_scene
from fastgen.scene.limits import MM
from fastgen.validation import to_plain

_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""glTF 2.0, section 3.4: y is up."""

SHEET_MM = 2.0
"""Thickness of the steel: where there are holes, the inside lies this far behind the outside."""

_FLOOR_SLOPE = 0.7
"""What faces up more than this on the inside is the wooden floor."""


def export_glb(
    generator: Generator,
    scene: Scene,
    path: str | Path,
    cameras: Iterable[Camera] | None = None,
    texel_mm: float = 4.0,
) -> None:
    """Write `scene` as glTF in metres, y up, with cameras for images of the generator's size.

    cameras: by default all of the scene. texel_mm: width of a texel of the baked atlases. Scenes
    with holes get insides, of one colour for the floor and one for the rest. Raises ConfigError for
    a texel too small or a scene that cannot be drawn, OutputError when the file cannot be written.
    """
    check_scene(scene)
    cameras = scene.cameras if cameras is None else cameras
    chosen = [check_camera(camera, scene.container) for camera in cameras]
    path = Path(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: no folder {path.parent}; make it first")
    mesh = build_container(scene.container.kind, scene.container.profiles)
    atlas_size(mesh, texel_mm)  # refuses a bad size before any work
    body = damaged_mesh(mesh, scene.damages)
    atlas = generator.bake(scene, texel_mm)
    glb = Glb(f"fastgen {fastgen.__version__}")
    painted = _baked_material(glb, scene.surface.paint.name, atlas)
    glb.add_mesh(
        "container",
        painted,
        body.triangles,
        {
            "POSITION": body.positions_mm * MM @ _Y_UP.T,
            "NORMAL": body.normals @ _Y_UP.T,
            "TEXCOORD_0": atlas.uv(body.atlas_mm),
        },
    )
    if variant(scene.damages) == "holed":
        _add_inside(glb, body)
    _add_spreader(glb, generator, scene, texel_mm)
    for camera in chosen:
        _add_camera(glb, generator, scene, camera)
    data = glb.data(
        {
            "environment": {
                "name": scene.environment.name,
                "yaw_deg": scene.environment.yaw_deg,
                "convention": "z up: radiance(d) = map(Rz(-yaw) d), the map's middle is +x",
            },
            "scene": to_plain(scene),
        }
    )
    write(path, data)


def _baked_material(glb: Glb, name: str, atlas: Atlas, prefix: str = "") -> int:
    textures = {"base_color": atlas.base_color, "surface": atlas.surface}
    color, surface = (glb.add_texture(prefix + key, png(image)) for key, image in textures.items())
    return glb.add_material(
        {
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": color},
                "metallicRoughnessTexture": {"index": surface},
            },
        }
    )


def _add_spreader(glb: Glb, generator: Generator, scene: Scene, texel_mm: float) -> None:
    """What the container hangs on. Its atlas may be larger than the container's."""
    mesh = spreader_mesh(scene)
    if mesh is None:
        return
    atlas = generator.bake_spreader(scene, max(texel_mm, least_texel_mm(mesh)))
    assert atlas is not None
    glb.add_mesh(
        "spreader",
        _baked_material(glb, "spreader", atlas, "spreader_"),
        mesh.triangles,
        {
            "POSITION": mesh.positions_mm * MM @ _Y_UP.T,
            "NORMAL": mesh.normals @ _Y_UP.T,
            "TEXCOORD_0": atlas.uv(mesh.atlas_mm),
        },
    )


def _add_inside(glb: Glb, body: DamagedMesh) -> None:
    """The backs of all triangles, as the renderer shows them through holes."""
    positions = (body.positions_mm - SHEET_MM * body.normals) * MM @ _Y_UP.T
    up = -body.normals[body.triangles].mean(axis=1)[:, 2]
    parts = {"wood": up > _FLOOR_SLOPE, "primer": up <= _FLOOR_SLOPE}
    for name, chosen in parts.items():
        plain = {
            "baseColorFactor": [*INSIDE_ALBEDO[name], 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        }
        material = glb.add_material({"name": f"inside_{name}", "pbrMetallicRoughness": plain})
        used, triangles = np.unique(body.triangles[chosen][:, ::-1], return_inverse=True)
        glb.add_mesh(
            f"inside_{name}",
            material,
            triangles.reshape(-1, 3),
            {"POSITION": positions[used], "NORMAL": -body.normals[used] @ _Y_UP.T},
        )


def _add_camera(glb: Glb, generator: Generator, scene: Scene, camera: Camera) -> None:
    width, height = generator.size
    view = view_of(camera, generator.size)
    right, down, forward = view.rotation
    pose = np.eye(4)
    pose[:3, :3] = _Y_UP @ np.stack([right, -down, -forward], axis=1)
    pose[:3, 3] = _Y_UP @ view.position_m
    extras: dict[str, Any] = {
        "exposure": generator.exposure(scene, camera),
        "size": [width, height],
    }
    if view.distortion:
        extras |= {key: view_values(view)[key] for key in ("distortion_model", "distortion")}
    yfov = 2 * float(np.arctan(height / 2 / view.focal_px))
    glb.add_camera(camera.name, yfov, width / height, pose, extras)

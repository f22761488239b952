"""Export of a scene as a GLB file (binary glTF 2.0) for Blender and other tools, and to trimesh.

The file contains all damaged containers, the spreader, the ground and the props on it, their baked
textures, the seals and the cameras. A container with holes also has its inside. The ground is a
square whose alpha falls to 0 where the environment replaces it.

Data that glTF has no place for is stored as `extras`. The extras of the glTF scene are the
environment and the Scene; those of a camera's node are its exposure and lens distortion. Viewers
show each camera as a pinhole.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.exchange import gltf
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

import fastgen
from fastgen.camera.projection import view_of
from fastgen.errors import ConfigError
from fastgen.files.images import check_folder, png, write
from fastgen.formats.scene_file import view_values
from fastgen.generator import Generator
from fastgen.geometry.damage_law import variant
from fastgen.geometry.damaged_mesh import DamagedMesh, damaged_mesh
from fastgen.geometry.mesh import MATERIALS, Mesh
from fastgen.geometry.prepared_scene import Member, PreparedScene
from fastgen.geometry.unit_solids import unit_solid
from fastgen.render.constants import GROUND_FADE_START, INSIDE_ALBEDO
from fastgen.render.passes.bake import Atlas, atlas_size, least_texel_mm
from fastgen.render.surface_values import SEAL_STEEL_ALBEDO
from fastgen.scene import Camera, Color, Ground, Pose, Prop, Scene
from fastgen.scene.boxes import rotation_of
from fastgen.scene.check import check_camera
from fastgen.scene.limits import MM
from fastgen.validation import to_plain

SHEET_MM = 2.0
"""Thickness of the steel: the distance between the outside and the exported inside."""

_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""Rotation from z up to y up (glTF 2.0, section 3.4)."""

TO_Z_UP = _Y_UP.T
"""Rotation from the frame of exported files to that of scenes."""

_IMAGE_NAMES = {"baseColorTexture": "base_color", "metallicRoughnessTexture": "surface"}

_FLOOR_SLOPE = 0.7
"""Inside faces whose normal has a larger z than this are the wooden floor."""

_WATER_SPECULAR = 0.5
"""Reflectance of water (2 %) as a share of the 4 % of other materials; KHR_materials_specular."""


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
            the floor and one for the rest. Neighbours are nodes that begin with "neighbour_1",
            "neighbour_2" and so on, and props are "prop_0" and so on.
        path: The GLB file.
        cameras: Cameras to write; by default all cameras of the scene.
        texel_mm: Width of a texel of the containers' textures, in millimetres. The texels of
            spreader and ground are wider if their textures would be too large otherwise.

    Raises:
        ConfigError: The texel is too small, the scene cannot be drawn, or it has no container.
        OutputError: The file cannot be written.
    """
    scene = generator.checked(scene)
    cameras = scene.cameras if cameras is None else cameras
    chosen = [check_camera(camera, scene) for camera in cameras]
    path = Path(path)
    check_folder(path)
    exported, colors = _geometry(generator, scene, texel_mm)
    exported.metadata.update(_scene_extras(scene))
    ground = scene.ground

    def complete(tree: dict[str, Any]) -> None:
        tree["asset"]["generator"] = f"fastgen {fastgen.__version__}"
        _complete_materials(tree, colors)
        if ground is not None:
            _set_specular(tree, "ground", _WATER_SPECULAR if ground.wetness else 0.0)
        for camera in chosen:
            _append_camera(tree, generator, scene, camera)

    write(path, gltf.export_glb(exported, include_normals=True, tree_postprocessor=complete))


def to_trimesh(generator: Generator, scene: Scene, texel_mm: float = 4.0) -> trimesh.Scene:
    """Return a scene with its textures for trimesh's viewer and for pyrender, without cameras.

    Example:
        to_trimesh(generator, generator.scene(17)).show()

    Args:
        generator: Bakes the textures.
        scene: The scene.
        texel_mm: Width of a texel of the containers' textures, in millimetres.

    Returns:
        Geometry in metres and with y up. Its names are those of `export_glb`.

    Raises:
        ConfigError: As in `export_glb`.
    """
    made, colors = _geometry(generator, generator.checked(scene), texel_mm)
    for part in made.geometry.values():
        material = part.visual.material
        if material.name in colors:
            material.baseColorFactor = np.array([*colors[material.name], 1.0])
        for name in _IMAGE_NAMES:
            texture = getattr(material, name)
            if texture is not None:
                setattr(material, name, Image.fromarray(texture.pixels))
    return made


def _geometry(
    generator: Generator, scene: Scene, texel_mm: float
) -> tuple[trimesh.Scene, dict[str, Color]]:
    """Return everything of a scene except its cameras, and the colors of untextured materials.

    Textures are instances of _Texture.
    """
    if not (scene.container.present or scene.neighbours or scene.ground):
        raise ConfigError(
            f"scene {scene.index}: has no container to export; take another, or set "
            "container.absent to 0"
        )
    prepared = PreparedScene(scene)
    present = [each for each in prepared.members if each.prepared.scene.container.present]
    for member in present:
        atlas_size(member.prepared.container, texel_mm)  # raises ConfigError before the slow steps
    made = trimesh.Scene()
    colors = {f"inside_{name}": albedo for name, albedo in INSIDE_ALBEDO.items()}
    colors["seal_steel"] = SEAL_STEEL_ALBEDO

    def add(parts: dict[str, trimesh.Trimesh], pose: Pose) -> None:
        for name, part in parts.items():
            made.add_geometry(part, name, name, transform=_transform(pose))

    for member in present:
        add(_member(generator, member, texel_mm), member.pose)
        seals = member.prepared.scene.seals
        colors |= {_named(f"seal_{seal.hasp}", member.number): seal.albedo for seal in seals}
    if prepared.spreader is not None:
        spreader = prepared.spreader.mesh
        baked = generator.bake_spreader(scene, max(texel_mm, least_texel_mm(spreader)))
        assert baked is not None
        add({"spreader": _baked_part(spreader, baked, "spreader")}, Pose())
    for number, prop in enumerate(scene.props):
        add({f"prop_{number}": _prop(prop, f"prop_{number}")}, prop.pose)
        colors[f"prop_{number}"] = prop.albedo
    ground = scene.ground
    if ground is not None:
        baked = generator.bake_ground(scene, texel_mm)
        assert baked is not None
        add({"ground": _ground_part(ground, baked)}, Pose((0.0, 0.0, ground.height_mm)))
    return made, colors


class _Texture:
    """Pixels in the place of a PIL image, which takes trimesh five times as long to write."""

    format = "PNG"

    def __init__(self, pixels: NDArray[np.uint8]) -> None:
        self.pixels = pixels

    def save(self, stream: BinaryIO, format: str) -> None:
        stream.write(png(self.pixels))


def _member(generator: Generator, member: Member, texel_mm: float) -> dict[str, trimesh.Trimesh]:
    """Return the parts of a container by their names in the file, in its own frame."""
    scene, number = member.prepared.scene, member.number
    body = damaged_mesh(member.prepared.container, scene.damages)
    paint = _named(scene.surface.paint.name, number)
    # cameras are in the frame of the first container, where they need not be outside of this one
    atlas = generator.bake(replace(scene, cameras=()) if number else scene, texel_mm)
    parts = {"container": _baked_part(body, atlas, paint)}
    if variant(scene.damages) == "holed":
        parts |= _inside(body)
    if member.prepared.seals is not None:
        parts |= _seals(member.prepared.seals.mesh, number)
    return {_named(name, number): part for name, part in parts.items()}


def _named(name: str, number: int) -> str:
    """Return the name in the file of something that container `number` has."""
    return f"neighbour_{number}_{name}" if number else name


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


def _seals(mesh: Mesh, number: int) -> dict[str, trimesh.Trimesh]:
    """Return the triangles of each material of a container's seals, which have one color each."""
    parts = {}
    of_vertices = np.array([chart.material_index for chart in mesh.charts])[mesh.chart]
    of_triangles = of_vertices[mesh.triangles[:, 0]]
    for index in np.unique(of_triangles).tolist():
        used, triangles = np.unique(mesh.triangles[of_triangles == index], return_inverse=True)
        steel = MATERIALS[index] == "seal_steel"
        plain = PBRMaterial(
            MATERIALS[index] if steel else _named(MATERIALS[index], number),
            metallicFactor=0.8 if steel else 0.0,
            roughnessFactor=0.4,
        )
        parts[MATERIALS[index]] = _part(
            mesh.positions_mm[used],
            mesh.normals[used],
            triangles.reshape(-1, 3),
            TextureVisuals(material=plain),
        )
    return parts


def _prop(prop: Prop, name: str) -> trimesh.Trimesh:
    """Return a prop in its own frame."""
    solid = unit_solid(prop.shape)
    half_mm = np.array(prop.size_mm) / 2
    plain = PBRMaterial(name, metallicFactor=0.0, roughnessFactor=float(prop.roughness))
    visual = TextureVisuals(material=plain)
    return _part(solid.corners * half_mm, solid.normals, solid.triangles, visual)


def _ground_part(ground: Ground, atlas: Atlas) -> trimesh.Trimesh:
    """Return the ground as a square around the origin, with alpha where it fades."""
    rows, columns = atlas.base_color.shape[:2]
    away = np.abs(np.arange(columns) + 0.5 - ground.reach_mm / atlas.texel_mm)
    away = np.hypot(away, away[:rows, None]) * (atlas.texel_mm / ground.reach_mm)
    x = np.clip((away - GROUND_FADE_START) / (1 - GROUND_FADE_START), 0, 1)
    alpha = 255 * (1 - x * x * (3 - 2 * x))  # smoothstep, as seen_plane.glsl does
    color = np.dstack([atlas.base_color, np.rint(alpha)[::-1].astype(np.uint8)])
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * ground.reach_mm
    uv = atlas.uv(square[:, :2] + ground.reach_mm)
    uv[:, 1] = 1 - uv[:, 1]
    material = PBRMaterial(
        name="ground",
        alphaMode="BLEND",
        baseColorTexture=_Texture(color),
        metallicRoughnessTexture=_Texture(atlas.surface),
    )
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    return _part(square, up, np.array([[0, 1, 2], [0, 2, 3]]), TextureVisuals(uv, material))


def _transform(pose: Pose) -> NDArray[np.float64]:
    """Return the matrix [4, 4] of a node at a pose, in metres with y up."""
    matrix = np.eye(4)
    matrix[:3, :3] = _Y_UP @ rotation_of(pose) @ _Y_UP.T
    matrix[:3, 3] = _Y_UP @ pose.position_mm * MM
    return matrix


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


def _complete_materials(tree: dict[str, Any], colors: Mapping[str, Color]) -> None:
    """Name the images, and set the exact colors that trimesh has rounded to 8 bits."""
    for material in tree["materials"]:
        values = material["pbrMetallicRoughness"]
        if "baseColorTexture" not in values:
            values["baseColorFactor"] = [*colors[material["name"]], 1.0]
            continue
        for key, image in _IMAGE_NAMES.items():
            texture = tree["textures"][values[key]["index"]]
            tree["images"][texture["source"]]["name"] = f"{material['name']}_{image}"


def _set_specular(tree: dict[str, Any], name: str, share: float) -> None:
    """Scale the reflectance of a material, which is 4 % otherwise; glTF KHR_materials_specular."""
    extension = "KHR_materials_specular"
    tree.setdefault("extensionsUsed", []).append(extension)
    material = next(each for each in tree["materials"] if each["name"] == name)
    material["extensions"] = {extension: {"specularFactor": share}}


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
        "yfov": 2 * float(np.arctan(height / 2 / view.focals_px[1])),
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

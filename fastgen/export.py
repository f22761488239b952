"""A scene's container as a GLB file, for Blender and others: deformed geometry and atlas UVs."""

from pathlib import Path

import numpy as np
import trimesh

from fastgen.camera import MM
from fastgen.container import build_container
from fastgen.damage import deform
from fastgen.encode import write
from fastgen.errors import OutputError
from fastgen.scene import Scene

_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""glTF 2.0, section 3.4: y is up."""


def export_glb(scene: Scene, path: Path) -> None:
    """Write the container in metres, y up, with its paint's base colour and its UV atlas.

    Holes of perforations stay closed, and no decal texture is baked yet. Raises OutputError when
    the file cannot be written.
    """
    mesh = build_container(scene.container.kind, scene.container.profiles)
    positions = deform(scene.damages, mesh.positions_mm) * MM @ _Y_UP.T
    material = trimesh.visual.material.PBRMaterial(
        name=scene.surface.paint.name,
        baseColorFactor=[*scene.surface.paint.albedo, 1.0],
        metallicFactor=0.0,
        roughnessFactor=scene.surface.paint.roughness,
    )
    uv = mesh.atlas_mm / np.array(mesh.atlas_size_mm)
    body = trimesh.Trimesh(
        positions,
        mesh.triangles,
        process=False,
        visual=trimesh.visual.TextureVisuals(uv=uv, material=material),
    )
    whole = trimesh.Scene()
    whole.add_geometry(body, node_name="container", geom_name="container")
    data = whole.export(file_type="glb")
    try:
        write(path, data)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None

"""Export of fastgen scenes as job folders for any renderer: GLB, HDR light and cameras.

The container is exported as by `fastgen export`, with surface layers and decals baked into
textures. Other renderers can only label separate objects, so every marker is also a mesh of its
own. It follows the corrugation 3 mm in front of the sheet, textured with the marker's artwork.
Damage and spreader are removed.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from fastgen import Generator
from fastgen.camera.projection import View
from fastgen.export import export_glb
from fastgen.geometry.container import build_container
from fastgen.geometry.damage_law import deform
from fastgen.geometry.mesh import Mesh
from fastgen.light.hdri import bundled_hdris, load_radiance
from fastgen.resources import asset_path
from fastgen.scene import Decal, Scene, Spreader
from fastgen.scene.limits import MM
from fastgen.scene.object_ids import object_ids

_LIFT_MM = 3.0
_CELLS = 24
_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)


def write_jobs(
    generator: Generator, indices: list[int], cameras: list[str], repeats: int, folder: Path
) -> list[tuple[int, str, NDArray[np.uint16]]]:
    """Write a job folder.

    Args:
        generator: Generator of the scenes.
        indices: Scene indices.
        cameras: Camera names.
        repeats: Number of draws per view.
        folder: Folder to write.

    Returns:
        Scene index, camera name and fastgen's own ids [H, W] of each view.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scenes, truths = [], []
    for index in indices:
        # fastgen must draw the same scene as its peers, which get no damage and no spreader
        scene = replace(generator.scene(index), damages=(), spreader=Spreader())
        markers = _markers(scene)
        _write_glb(generator, scene, markers, folder / f"{index:06d}.glb")
        (folder / f"{index:06d}.json").write_text(scene.to_json(), encoding="utf-8")
        _write_hdr(scene, folder / f"{index:06d}.hdr")
        shots = []
        for name in cameras:
            sample = generator.render(scene=scene, camera=name)
            visible = set(np.unique(sample.ids).tolist())
            exposure = generator.exposure(scene, scene.camera(name))
            seen = sorted(visible & markers.keys())
            shots.append(shot(name, sample.view, exposure, seen))
            keep = [0, 1, *markers]
            # peers have no separate objects for texts, so these count as container
            ids = np.where(np.isin(sample.ids, keep), sample.ids, 1).astype(np.uint16)
            truths.append((index, name, ids))
        scenes.append(
            {
                "index": index,
                "glb": f"{index:06d}.glb",
                "hdri": f"{index:06d}.hdr",
                "yaw_deg": scene.environment.yaw_deg,
                "shots": shots,
            }
        )
    plain = {"seed": generator.seed, "size": generator.size, "repeats": repeats}
    job = {**plain, "samples": 0, "scenes": scenes}
    (folder / "job.json").write_text(json.dumps(job, indent=1), encoding="utf-8")
    return truths


def with_effort(folder: Path, samples: int, repeats: int) -> None:
    """Set the samples per pixel and the number of draws per view of a job folder."""
    path = folder / "job.json"
    job = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**job, "samples": samples, "repeats": repeats}), encoding="utf-8")


def _markers(scene: Scene) -> dict[int, Decal]:
    """Return the scene's markers by id."""
    numbered = zip(object_ids(scene), scene.decals, strict=True)
    return {number: decal for number, decal in numbered if decal.kind == "marker"}


def shot(name: str, view: View, exposure: float, markers: list[int]) -> dict[str, Any]:
    """Return a view in the form that peer_renderers/measure.py reads."""
    pose = np.eye(4)
    right, down, forward = view.rotation
    pose[:3, :3] = np.stack([right, -down, -forward], axis=1)
    pose[:3, 3] = view.position_m
    return {
        "camera": name,
        "pose": pose.tolist(),
        "focal_px": view.focal_px,
        "exposure": exposure,
        "markers": markers,
    }


def _write_hdr(scene: Scene, path: Path) -> None:
    radiance = load_radiance(bundled_hdris()[scene.environment.name])
    cv2.imwrite(str(path), np.ascontiguousarray(radiance[..., ::-1]))


def _write_glb(generator: Generator, scene: Scene, markers: dict[int, Decal], path: Path) -> None:
    mesh = build_container(scene.container.kind, scene.container.profiles)
    export_glb(generator, scene, path, cameras=())
    (container,) = trimesh.load_scene(path, process=False).geometry.values()
    whole = trimesh.Scene()
    whole.add_geometry(container, node_name="container", geom_name="container")
    for number, decal in markers.items():
        name = f"marker_{number}"
        whole.add_geometry(_marker_mesh(scene, mesh, decal), node_name=name, geom_name=name)
    path.write_bytes(whole.export(file_type="glb"))


def _marker_mesh(scene: Scene, mesh: Mesh, decal: Decal) -> trimesh.Trimesh:
    """Return the marker's diamond as a grid of triangles in front of the sheet, metres, y up."""
    steps = np.linspace(-0.5, 0.5, _CELLS + 1)
    s, t = (a.ravel() for a in np.meshgrid(steps, steps))
    local = np.stack([s - t, s + t], axis=-1) / 2  # a diamond within [-1/2, 1/2] on both axes
    sheet = local * decal.size_mm @ decal.turn.T + decal.center_mm
    positions, normals = mesh.sheet_to_surface(decal.face, sheet)
    lifted = (deform(scene.damages, positions) + _LIFT_MM * normals) * MM @ _Y_UP.T
    corner = np.arange(_CELLS)[:, None] * (_CELLS + 1) + np.arange(_CELLS)
    a, b, c, d = (corner.ravel() + o for o in (0, 1, _CELLS + 2, _CELLS + 1))
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    artwork = Image.open(asset_path("markers", f"{decal.art}.png")).convert("RGB")
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=artwork.resize((256, 256)), metallicFactor=0.0, roughnessFactor=0.5
    )
    visual = trimesh.visual.TextureVisuals(uv=local + 0.5, material=material)
    return trimesh.Trimesh(lifted, triangles, process=False, visual=visual)

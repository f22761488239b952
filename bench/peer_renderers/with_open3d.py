"""Open3D's Filament on Vulkan, colour and painted ids: python with_open3d.py JOB OUT."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import trimesh
from measure import Recorder, id_colors, nearest_id, object_id, read_job
from open3d.visualization import rendering


def mesh_of(part: trimesh.Trimesh) -> o3d.geometry.TriangleMesh:
    """Return a GLB node as a mesh with Open3D's texture coordinates, one per triangle corner."""
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.asarray(part.vertices)),
        o3d.utility.Vector3iVector(np.asarray(part.faces)),
    )
    visual: Any = part.visual
    uv = np.asarray(visual.uv)[part.faces].reshape(-1, 2)
    mesh.triangle_uvs = o3d.utility.Vector2dVector(uv * [1, -1] + [0, 1])
    mesh.compute_vertex_normals()
    return mesh


def fill(
    scene: rendering.Open3DScene, glb: Path
) -> tuple[list[tuple[str, str]], dict[int, tuple[int, int, int]]]:
    """Add every node of a GLB to the scene twice: once shaded, once painted with its id's colour.

    The light is Open3D's own, because it reads no HDR files, only maps prepared by Filament.

    Returns:
        The names of both copies of each node, and the colour of each id.
    """
    loaded: Any = trimesh.load(glb, process=False)
    parts = loaded.geometry
    colors = id_colors([object_id(name) for name in parts])
    names = []
    for name, part in parts.items():
        mesh, source = mesh_of(part), part.visual.material
        material = rendering.MaterialRecord()
        material.shader = "defaultLit"
        texture = np.ascontiguousarray(source.baseColorTexture.convert("RGB"))
        material.albedo_img = o3d.geometry.Image(texture)
        # glTF omits a factor of 1
        roughness = 1.0 if source.roughnessFactor is None else source.roughnessFactor
        material.base_roughness, material.base_metallic = roughness, 0.0
        scene.add_geometry(name, mesh, material)
        flat = rendering.MaterialRecord()
        flat.shader = "defaultUnlit"
        flat.base_color = (*(np.array(colors[object_id(name)]) / 255), 1.0)
        scene.add_geometry(f"{name} id", mesh, flat)
        names.append((name, f"{name} id"))
    return names, colors


def show(scene: rendering.Open3DScene, names: list[tuple[str, str]], painted: bool) -> None:
    """Show the shaded scene or the painted ids, the latter without any post-processing."""
    for shaded_name, painted_name in names:
        scene.show_geometry(shaded_name, not painted)
        scene.show_geometry(painted_name, painted)
    scene.view.set_post_processing(not painted)
    scene.view.set_antialiasing(not painted)
    scene.set_background([0, 0, 0, 1] if painted else [0.5, 0.5, 0.5, 1])


def as_painted(colors: dict[int, tuple[int, int, int]]) -> dict[int, tuple[int, int, int]]:
    """Return the colours as they are read back.

    Without post-processing, Filament writes half of the linear value.
    """
    found = {}
    for number, color in colors.items():
        linear = ((np.array(color) / 255 + 0.055) / 1.055) ** 2.4 * (np.array(color) > 0)
        red, green, blue = (int(v) for v in np.rint(linear * 127.5))
        found[number] = (red, green, blue)
    return found


def main(folder: Path, out: Path) -> None:
    """Render every view."""
    job = read_job(folder)
    width, height = job.size
    recorder = Recorder(out, f"{o3d.__version__}, Filament")
    renderer = rendering.OffscreenRenderer(width, height)
    scene = renderer.scene
    for scene_job in job.scenes:
        with recorder.lap("set-up"):
            scene.clear_geometry()
            names, colors = fill(scene, scene_job.glb)
            show(scene, names, painted=False)
            renderer.render_to_image()
        for shot in scene_job.shots:
            intrinsics = np.array(
                [[shot.focal_px, 0, width / 2], [0, shot.focal_px, height / 2], [0, 0, 1]]
            )
            # Open3D's camera looks along +z with y down
            extrinsics = np.linalg.inv(shot.pose_y_up @ np.diag([1.0, -1.0, -1.0, 1.0]))
            renderer.setup_camera(intrinsics, extrinsics, width, height)
            for _ in range(job.repeats):
                with recorder.lap("colour"):
                    show(scene, names, painted=False)
                    image = np.asarray(renderer.render_to_image())
                with recorder.lap("labels"):
                    show(scene, names, painted=True)
                    painted = np.asarray(renderer.render_to_image())
            recorder.keep(scene_job, shot, image, nearest_id(painted, as_painted(colors)))
    recorder.save()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

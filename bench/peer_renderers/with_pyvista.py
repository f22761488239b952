"""PyVista with physically based shading and image-based light: python with_pyvista.py JOB OUT.

The light keeps VTK's own rotation about the vertical; rotating it would not change the cost.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import trimesh
import vtk
from measure import (
    Job,
    Recorder,
    SceneJob,
    Shot,
    id_colors,
    nearest_id,
    object_id,
    read_job,
)


def open_scene(
    job: Job, scene: SceneJob
) -> tuple[pv.Plotter, pv.Plotter, dict[int, tuple[int, int, int]]]:
    """Return a plotter that shades the scene, one that paints the ids, and the ids' colours."""
    shaded = pv.Plotter(off_screen=True, window_size=job.size, lighting="none")
    painted = pv.Plotter(off_screen=True, window_size=job.size, lighting="none")
    painted.render_window.SetMultiSamples(0)  # blending two ids would give a third
    painted.background_color = "black"
    loaded: Any = trimesh.load(scene.glb, process=False)
    parts = loaded.geometry
    colors = id_colors([object_id(name) for name in parts])
    for name, part in parts.items():
        mesh = pv.wrap(trimesh.Trimesh(part.vertices, part.faces, process=False))
        mesh.active_texture_coordinates = np.asarray(part.visual.uv, np.float32)
        material = part.visual.material
        texture = pv.Texture(np.asarray(material.baseColorTexture.convert("RGB")))
        texture.SetUseSRGBColorSpace(True)
        actor = shaded.add_mesh(mesh, pbr=True, metallic=0.0, roughness=material.roughnessFactor)
        actor.prop.SetBaseColorTexture(texture)
        painted.add_mesh(mesh, color=colors[object_id(name)], lighting=False)
    radiance = pv.read(scene.hdri)
    # VTK has no exposure outside its tone mapping
    radiance.active_scalars[:] = radiance.active_scalars * scene.shots[0].exposure
    sky = pv.Texture(radiance)
    sky.SetColorModeToDirectScalars()
    sky.MipmapOn()
    sky.InterpolateOn()
    shaded.set_environment_texture(sky, show_background=False)
    dome = vtk.vtkSkybox()
    dome.SetTexture(sky)
    dome.SetProjectionToSphere()
    shaded.renderer.AddActor(dome)
    return shaded, painted, colors


def aim(plotter: pv.Plotter, shot: Shot, height: int) -> None:
    """Place the camera at the shot's pose, in the frame of the GLB."""
    pose = shot.pose_y_up
    camera = plotter.camera
    camera.position = pose[:3, 3]
    camera.focal_point = pose[:3, 3] - pose[:3, 2]
    camera.up = pose[:3, 1]
    camera.view_angle = float(np.rad2deg(2 * np.arctan(height / 2 / shot.focal_px)))
    camera.clipping_range = (0.1, 200.0)


def draw(plotter: pv.Plotter) -> np.ndarray:
    """Return a frame, uint8 [H, W, 3]."""
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True))[..., :3]


def main(folder: Path, out: Path) -> None:
    """Render every view."""
    job = read_job(folder)
    recorder = Recorder(out, f"{pv.__version__}, VTK {pv.vtk_version_info}")
    for scene in job.scenes:
        with recorder.lap("set-up"):
            shaded, painted, colors = open_scene(job, scene)
            for plotter in (shaded, painted):
                aim(plotter, scene.shots[0], job.size[1])
                draw(plotter)
        for shot in scene.shots:
            for plotter in (shaded, painted):
                aim(plotter, shot, job.size[1])
            for _ in range(job.repeats):
                with recorder.lap("colour"):
                    image = draw(shaded)
                with recorder.lap("labels"):
                    flat = draw(painted)
            recorder.keep(scene, shot, image, nearest_id(flat, colors))
        shaded.close()
        painted.close()
    recorder.save()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

"""pyrender on EGL, with a colour and a segmentation pass: python with_pyrender.py JOB OUT."""

import os
import sys
from pathlib import Path
from typing import Any

os.environ["PYOPENGL_PLATFORM"] = "egl"

import numpy as np
import pyrender
import trimesh
from measure import Recorder, id_colors, nearest_id, object_id, read_job
from OpenGL.GL import GL_RENDERER, glGetString


def load(glb: Path) -> tuple[pyrender.Scene, dict[pyrender.Node, int]]:
    """Return the scene of a GLB under an even ambient light, and the id of each node.

    pyrender has no image-based light. A directional light replaces the brighter side of the sky.
    """
    scene = pyrender.Scene(ambient_light=[0.5, 0.5, 0.5], bg_color=[0.5, 0.5, 0.5, 1.0])
    ids = {}
    loaded: Any = trimesh.load(glb, process=False)
    for name, part in loaded.geometry.items():
        ids[scene.add(pyrender.Mesh.from_trimesh(part, smooth=True), name=name)] = object_id(name)
    return scene, ids


def main(folder: Path, out: Path) -> None:
    """Render every view."""
    job = read_job(folder)
    width, height = job.size
    renderer = pyrender.OffscreenRenderer(width, height)
    recorder = Recorder(out, f"{pyrender.__version__}, {glGetString(GL_RENDERER).decode()}")
    for scene_job in job.scenes:
        with recorder.lap("set-up"):
            scene, ids = load(scene_job.glb)
            light = scene.add(pyrender.DirectionalLight(intensity=3.0))
            intrinsics = pyrender.IntrinsicsCamera(1, 1, width / 2, height / 2, 0.1, 200.0)
            camera = scene.add(intrinsics)
            colors = id_colors(list(ids.values()))
            segments = {node: colors[number] for node, number in ids.items()}
            renderer.render(scene)
        for shot in scene_job.shots:
            intrinsics.fx = intrinsics.fy = shot.focal_px
            scene.set_pose(camera, shot.pose_y_up)
            scene.set_pose(light, shot.pose_y_up)
            for _ in range(job.repeats):
                with recorder.lap("colour"):
                    image, _depth = renderer.render(scene)
                with recorder.lap("labels"):
                    painted, _ = renderer.render(
                        scene, flags=pyrender.RenderFlags.SEG, seg_node_map=segments
                    )
            recorder.keep(scene_job, shot, image, nearest_id(np.asarray(painted), colors))
    recorder.save()
    renderer.delete()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

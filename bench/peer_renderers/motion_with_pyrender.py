"""Views half a pixel apart by pyrender, small and large: python motion_with_pyrender.py JOB OUT."""

import os
import sys
from pathlib import Path

os.environ["PYOPENGL_PLATFORM"] = "egl"

import numpy as np
import pyrender
from measure import read_job
from with_pyrender import load

TIMES = 4
"""Size of the larger images relative to the job's."""


def main(folder: Path, out: Path) -> None:
    """Save uint8 images [2, H, W, 3] of each shot, from half a pixel apart, at both sizes."""
    job = read_job(folder)
    out.mkdir(parents=True, exist_ok=True)
    for times in (1, TIMES):
        width, height = (times * side for side in job.size)
        renderer = pyrender.OffscreenRenderer(width, height)
        for scene_job in job.scenes:
            scene, _ = load(scene_job.glb)
            light = scene.add(pyrender.DirectionalLight(intensity=3.0))
            for shot in scene_job.shots:
                scene.set_pose(light, shot.pose_y_up)
                images = []
                for shift in (0.0, 0.5):
                    focal, middle = times * shot.focal_px, width / 2 + times * shift
                    camera = pyrender.IntrinsicsCamera(focal, focal, middle, height / 2, 0.1, 200.0)
                    node = scene.add(camera, pose=shot.pose_y_up)
                    images.append(renderer.render(scene)[0])
                    scene.remove_node(node)
                name = f"{scene_job.index:06d}_{shot.camera}_{times}.npy"
                np.save(out / name, np.stack(images))
        renderer.delete()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

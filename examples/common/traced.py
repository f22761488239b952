"""Cycles images of given scenes, rendered in one process and cached."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from fastgen import Generator
from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.export import export_glb
from fastgen.light.hdri import bundled_hdris
from fastgen.scene import Scene

TEXEL_MM = 6.0
"""Texel size of the exported textures. A pixel of the images covers 13 to 20 mm."""

SAMPLES = 32
"""Paths per pixel before denoising. Twice as many take 50 % longer and look the same."""


@dataclass(frozen=True, eq=False)
class Traced:
    """One Cycles image.

    Attributes:
        scene: The scene shown.
        camera: Camera name.
        radiance: Linear, without exposure, float32 [H, W, 3].
        core_s: CPU seconds of its render call.
    """

    scene: Scene
    camera: str
    radiance: NDArray[np.float32]
    core_s: float


def display(radiance: NDArray[np.float32], exposure: float) -> NDArray[np.uint8]:
    """Convert linear radiance [H, W, 3] to sRGB like fastgen's images."""
    return tone_map_and_encode((radiance * exposure).astype(np.float32))


def trace(
    generator: Generator,
    scenes: Sequence[Scene],
    cameras: Sequence[str],
    folder: Path,
    python: Path,
) -> None:
    """Render every scene through every camera, unless `folder` already has the image.

    The scene is stored with its images, and `kept` reads both.

    Args:
        generator: Generator that exports the scenes.
        scenes: Scenes to render.
        cameras: Camera names.
        folder: Folder of the images.
        python: A Python 3.11 with bpy.
    """
    folder.mkdir(parents=True, exist_ok=True)
    hdris = bundled_hdris()
    jobs = []
    for scene in scenes:
        outs = {c: folder / f"{scene.seed}_{scene.index}_{c}.exr" for c in cameras}
        if all(out.exists() for out in outs.values()):
            continue
        glb = folder / f"{scene.seed}_{scene.index}.glb"
        export_glb(generator, scene, glb, [scene.camera(c) for c in cameras], TEXEL_MM)
        (folder / f"{scene.seed}_{scene.index}.scene.json").write_text(scene.to_json())
        hdri = hdris[scene.environment.name]
        jobs.append({"glb": str(glb), "hdri": str(hdri), "seed": 1})
        jobs[-1]["views"] = [{"camera": c, "out": str(out)} for c, out in outs.items()]
    if not jobs:
        return
    listed = folder / "jobs.json"
    listed.write_text(json.dumps(jobs))
    tracer = Path(__file__).parents[2] / "bench/path_traced_many.py"
    command = [str(python), str(tracer), str(listed), "--samples", str(SAMPLES)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for job in jobs:
        Path(str(job["glb"])).unlink()


def kept(folder: Path, seed: int, index: int, cameras: Sequence[str]) -> list[Traced]:
    """Return the stored images of one scene, or none if a camera is missing."""
    stem = f"{seed}_{index}"
    outs = [folder / f"{stem}_{camera}.exr" for camera in cameras]
    if not all(out.exists() for out in outs):
        return []
    scene = Scene.from_json((folder / f"{stem}.scene.json").read_text())
    made = []
    for camera, out in zip(cameras, outs, strict=True):
        channels = OpenEXR.File(str(out)).channels()
        pixels = next(iter(channels.values())).pixels[..., :3].astype(np.float32)
        spent = json.loads(out.with_suffix(".json").read_text())["core_s"]
        made.append(Traced(scene, camera, pixels, spent))
    return made

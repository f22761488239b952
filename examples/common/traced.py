"""Cycles images of given scenes, rendered in batches of one process and kept."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from fastgen import Generator
from fastgen.camera.tone_curve import displayed
from fastgen.export import export_glb
from fastgen.light.hdri import bundled_hdris
from fastgen.scene import Scene

TEXEL_MM = 6.0
"""Of the exported textures: a pixel of the images shows 13 to 20 mm."""

SAMPLES = 32
"""Paths a pixel, denoised: twice as many took half as long again and look the same."""


@dataclass(frozen=True, eq=False)
class Traced:
    """One Cycles image. radiance: float32 [H, W, 3], linear, without exposure. core_s: seconds of
    all cores that its render call took."""

    scene: Scene
    camera: str
    radiance: NDArray[np.float32]
    core_s: float


def display(radiance: NDArray[np.float32], exposure: float) -> NDArray[np.uint8]:
    """Linear radiance [H, W, 3] as our images show it."""
    return displayed((radiance * exposure).astype(np.float32))


def trace(
    generator: Generator,
    scenes: Sequence[Scene],
    cameras: Sequence[str],
    folder: Path,
    python: Path,
) -> None:
    """Render every scene through every camera that `folder` does not hold yet.

    python: a Python 3.11 with bpy. The scene is kept with its images: `kept` reads it back.
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
    """The images of one scene that `folder` holds, of none or of all cameras."""
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

"""Render many exported scenes with Cycles in one process, like for a training set.

    PYTHON bench/path_traced_many.py JOBS.json --samples 64

PYTHON is a Python 3.11 with bpy (see path_traced.py). JOBS is a list of objects with the fields
glb, hdri, seed, and views; each view has a camera and an out. Images are denoised with Open Image
Denoise, guided by albedo and normals. The EXR files contain scene-linear radiance in half floats.

A JSON file next to each EXR holds the cost: core_s is the CPU time in seconds of the render call,
without start-up, import and export.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import bpy
from path_traced import load


def prepare(samples: int, threads: int) -> None:
    """Set the current scene up for denoised images with `samples` paths per pixel."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = threads
    scene.render.use_persistent_data = True  # the second view reuses the scene data
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    image = scene.render.image_settings
    image.file_format = "OPEN_EXR"
    image.color_depth = "16"


def trace(view: dict[str, Any]) -> float:
    """Render the current scene into the view's file; return the CPU seconds."""
    out = Path(view["out"])
    aside = out.with_suffix(".part.exr")
    scene = bpy.context.scene
    scene.camera = bpy.data.objects[view["camera"]]
    scene.render.filepath = str(aside)
    began = time.process_time()
    bpy.ops.render.render(write_still=True)
    spent = time.process_time() - began
    out.with_suffix(".json").write_text(json.dumps({"core_s": spent}))
    aside.replace(out)
    return spent


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("jobs", type=Path)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    os.nice(19)
    for job in json.loads(options.jobs.read_text()):
        views = [view for view in job["views"] if not Path(view["out"]).exists()]
        if not views:
            continue
        load(Path(job["glb"]), views[0]["camera"], Path(job["hdri"]))
        prepare(options.samples, options.threads)
        bpy.context.scene.cycles.seed = job["seed"]
        for view in views:
            print(f"{view['out']}: {trace(view):.1f} CPU seconds", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()

"""Path-trace the references that `bench/accuracy.py` compares with.

    python bench/trace_references.py --blender-python PYTHON [--cases 8] [--twice 2] [--series 8]
    python bench/trace_references.py --blender-python PYTHON --only 32,33,34,35,36,37,38

Run it once, in the background: a reference takes 150 to 1,500 CPU seconds. PYTHON is a Python 3.11
with bpy==4.5.15. Existing files are not traced again, so an interrupted run can be continued. Cases
that are already in bench/references keep the scene stored there.

--only traces the cases with these numbers, once each. From 32 on they are the cases of
surrounded_cases.py, which have a ground.

Cycles writes into --raw; `bench/pack_references.py` then makes bench/references from it. The first
--twice cases are traced a second time with another seed, to measure Cycles' own noise. The first
--series cases are also traced at 1 to 256 samples, with and without denoising.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from reference_set import FOLDER, SAMPLES, SCALE, SEED, SIZE, Case, cases, load
from surrounded_cases import every_case, surrounded_cases

from fastgen import Generator
from fastgen.export import export_glb
from fastgen.light.hdri import bundled_hdris
from fastgen.scene import Scene

SERIES = {"spp": (1, 2, 4, 8, 16, 32, 64, 128, 256), "denoised": (1, 2, 4, 8, 16, 32, 64)}
BACKGROUND_SAMPLES = 16
"""Samples per half pixel outside the rectangle around all objects.

Only the environment is visible there: it is smooth, and its light hits nothing on the way.
"""


class Tracer:
    """Renderer of cases with Cycles into a folder, each file once."""

    def __init__(self, python: Path, folder: Path, threads: int) -> None:
        self._python = python
        self._folder = folder
        self._threads = threads
        folder.mkdir(parents=True, exist_ok=True)

    def reference(self, case: Case, seed: int) -> None:
        """Write NN_seed.exr, and for seed 1 also NN_centers.exr.

        Of a scene with nothing around the container, NN_seed.exr shows the objects only, and
        NN_seed_whole.exr the whole image.
        """
        name = f"{case.number:02d}"
        done = self._folder / f"{name}_{seed}.exr"
        if done.exists():
            return
        part = self._folder / f"part_{name}_{seed}.exr"
        self._exported(case)
        scene = Scene.from_json((self._folder / f"{name}.json").read_text(encoding="utf-8"))
        more: list[object] = ["--scale", SCALE]
        if not (scene.ground or scene.neighbours):
            more += ["--background", BACKGROUND_SAMPLES]
            more += ["--whole", self._folder / f"{name}_{seed}_whole.exr"]
        if seed == 1:
            more += ["--centers", self._folder / f"{name}_centers.exr"]
        self._run(case, part, seed, str(SAMPLES // SCALE**2), more)
        part.replace(done)

    def series(self, case: Case, way: str) -> None:
        """Write NN_way_N.exr for each number N of samples, and their CPU seconds to NN_way.json.

        Args:
            case: The case to trace.
            way: A key of SERIES.
        """
        name = f"{case.number:02d}_{way}"
        seconds = self._folder / f"{name}.json"
        if seconds.exists():
            return
        counts = ",".join(str(n) for n in SERIES[way])
        more = ["--denoise"] if way == "denoised" else []
        found = self._run(case, self._folder / f"{name}_{{samples}}.exr", 7, counts, more)
        seconds.write_text(found, encoding="utf-8")

    def _run(self, case: Case, out: Path, seed: int, samples: str, more: Sequence[object]) -> str:
        """Run the tracer and return the CPU seconds that it prints."""
        glb = self._exported(case)
        tracer = Path(__file__).with_name("path_traced.py")
        command = [self._python, tracer, glb, "--camera", case.camera]
        command += ["--hdri", bundled_hdris()[case.light], "-o", out]
        command += ["--samples", samples, "--seed", seed, "--threads", self._threads, *more]
        done = subprocess.run(
            [str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True
        )
        (line,) = (line for line in done.stdout.splitlines() if line.startswith("seconds "))
        print(f"{case.number:02d} {case.camera:2s} {case.light:8s} {out.name} {line}", flush=True)
        return line.removeprefix("seconds ")

    def _exported(self, case: Case) -> Path:
        """Return the GLB file of a case; its scene is stored next to it."""
        glb = self._folder / f"{case.number:02d}.glb"
        if not glb.exists():
            stored = (FOLDER / f"{case.number:02d}.npz").exists()
            scene = load(case.number).scene if stored else case.drawn()
            aside = glb.with_suffix(".part")
            with Generator(case.config, SEED, SIZE) as generator:
                export_glb(generator, scene, aside, [scene.camera(case.camera)], case.texel_mm)
            text = json.dumps(json.loads(scene.to_json()))
            glb.with_suffix(".json").write_text(text, encoding="utf-8")
            aside.replace(glb)
        return glb


def main() -> None:
    """Trace the missing references."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--blender-python", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--twice", type=int, default=2)
    parser.add_argument("--series", type=int, default=8)
    parser.add_argument("--only", help="numbers of the cases to trace, such as 32,33")
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--raw", type=Path, default=Path(__file__).parent / ".raw_references")
    options = parser.parse_args()
    os.nice(19)
    tracer = Tracer(options.blender_python, options.raw, options.threads)
    if options.only:
        for number in options.only.split(","):
            tracer.reference(every_case()[int(number)], 1)
        return
    for case in [*cases()[: options.cases], *surrounded_cases()]:
        tracer.reference(case, 1)
    for case in cases()[: options.series]:
        for way in SERIES:
            tracer.series(case, way)
    for case in cases()[: options.twice]:
        tracer.reference(case, 2)


if __name__ == "__main__":
    main()

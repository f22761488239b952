"""Path-traces what `bench/accuracy.py` compares with; run once, in the background.

    python bench/trace_references.py --blender-python PYTHON [--cases 32] [--twice 8] [--series 8]

PYTHON is a Python 3.11 with bpy==4.5.15. What is there already is not traced again, so a run that
was stopped goes on where it was; as is, it takes 45 minutes of two cores. What Cycles writes goes
to --raw; `bench/pack_references.py` makes bench/references from it. `--twice`: so many cases are
traced a second time with another seed, to know Cycles' own noise. `--series`: of so many, images at
1 to 256 samples follow, with denoising and without.
"""

import argparse
import json
import os
import subprocess
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")

from reference_set import SAMPLES, SCALE, SEED, SIZE, Case, cases

from fastgen import Generator
from fastgen.environment import bundled_hdris
from fastgen.export import export_glb

SERIES = (1, 2, 4, 8, 16, 32, 64, 128, 256)
TEXEL_MM = 3.0
"""A quarter of the closest camera's pixel: finer than what 320 pixels a side can show."""

CENTER_SAMPLES = 16  # of ambient occlusion; depth and index take the first


class Tracer:
    """Renders cases with Cycles into a folder, each file once."""

    def __init__(self, python: Path, folder: Path, threads: int) -> None:
        self._python = python
        self._folder = folder
        self._threads = threads
        folder.mkdir(parents=True, exist_ok=True)

    def reference(self, case: Case, seed: int) -> None:
        """NN_seed.exr, and of the first seed NN_centers.exr and NN.json, the scene."""
        name = f"{case.number:02d}"
        samples = str(SAMPLES // SCALE**2)
        self._trace(case, f"{name}_{seed}.exr", seed, samples, ["--scale", str(SCALE)])
        if seed == 1:
            self._trace(case, f"{name}_centers.exr", seed, str(CENTER_SAMPLES), ["--centers"])

    def series(self, case: Case, denoise: bool) -> None:
        """NN_spp_N.exr for each N of SERIES, or NN_denoised_N.exr, and the seconds as JSON."""
        name = f"{case.number:02d}_{'denoised' if denoise else 'spp'}"
        seconds = self._folder / f"{name}.json"
        if seconds.exists():
            return
        counts = ",".join(str(n) for n in SERIES)
        found = self._run(case, f"{name}_{{samples}}.exr", 7, counts, ["--denoise"] * denoise)
        seconds.write_text(found, encoding="utf-8")

    def _trace(self, case: Case, name: str, seed: int, samples: str, more: list[str]) -> None:
        if (self._folder / name).exists():
            return
        self._run(case, f"part_{name}", seed, samples, more)
        (self._folder / f"part_{name}").replace(self._folder / name)

    def _run(self, case: Case, out: str, seed: int, samples: str, more: list[str]) -> str:
        """What the tracer says of its seconds."""
        glb = self._exported(case)
        tracer = Path(__file__).with_name("path_traced.py")
        command = [self._python, tracer, glb, "--camera", case.camera]
        command += ["--hdri", bundled_hdris()[case.light], "-o", self._folder / out]
        command += ["--samples", samples, "--seed", str(seed), "--threads", str(self._threads)]
        done = subprocess.run(
            [str(word) for word in [*command, *more]], check=True, stdout=subprocess.PIPE, text=True
        )
        (line,) = (line for line in done.stdout.splitlines() if line.startswith("seconds "))
        print(f"{case.number:02d} {case.camera:2s} {case.light:8s} {out} {line}", flush=True)
        return line.removeprefix("seconds ")

    def _exported(self, case: Case) -> Path:
        """The GLB file, beside it the scene that it was made from."""
        glb = self._folder / f"{case.number:02d}.glb"
        if not glb.exists():
            scene = case.drawn()
            aside = glb.with_suffix(".part")
            with Generator(case.config, SEED, SIZE) as generator:
                export_glb(generator, scene, aside, [scene.camera(case.camera)], TEXEL_MM)
            text = json.dumps(json.loads(scene.to_json()))
            glb.with_suffix(".json").write_text(text, encoding="utf-8")
            aside.replace(glb)
        return glb


def main() -> None:
    """Trace what is missing."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--blender-python", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=32)
    parser.add_argument("--twice", type=int, default=8)
    parser.add_argument("--series", type=int, default=8)
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--raw", type=Path, default=Path(__file__).parent / ".raw_references")
    options = parser.parse_args()
    os.nice(19)
    tracer = Tracer(options.blender_python, options.raw, options.threads)
    for case in cases()[: options.cases]:
        tracer.reference(case, 1)
    for case in cases()[: options.series]:
        for denoise in (False, True):
            tracer.series(case, denoise)
    for case in cases()[: options.twice]:
        tracer.reference(case, 2)


if __name__ == "__main__":
    main()

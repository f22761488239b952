"""Make the small files of bench/references from the output of `bench/trace_references.py`.

    python bench/pack_references.py [--raw bench/.raw_references]

Each case becomes NN.exr and NN.npz (see reference_set.py). cycles.json stores the errors of Cycles'
own images with their CPU seconds: at SAMPLES samples with another seed, and at 1 to 256 samples.
The images themselves need not be kept. Prints the error that compression adds.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import OpenEXR
from image_error import Comparison, displayed
from numpy.typing import NDArray
from reference_set import (
    DEPTH_STEP,
    FOLDER,
    SAMPLES,
    SEED,
    SIZE,
    Case,
    Reference,
    filtered,
    load,
    save,
)
from surrounded_cases import every_case

from fastgen import Generator
from fastgen.scene import Scene

Array = NDArray[np.floating]


def channels(path: Path) -> dict[str, Array]:
    """Return the planes [H, W] of an EXR file by Cycles' channel name."""
    file = OpenEXR.File(str(path), separate_channels=True)
    return {name.removeprefix("ViewLayer."): c.pixels for name, c in file.channels().items()}


def radiance(path: Path) -> tuple[Array, NDArray[np.bool_]]:
    """Return linear radiance [H, W, 3] of a Cycles file, and a mask of the rendered pixels."""
    planes = channels(path)
    return np.stack([planes[f"Combined.{c}"] for c in "RGB"], axis=-1), planes["Combined.A"] > 0.5


def whole_radiance(raw: Path, number: int, seed: int) -> Array:
    """Return the whole image; the finer render may cover only the rectangle around the objects."""
    finer, there = radiance(raw / f"{number:02d}_{seed}.exr")
    background = raw / f"{number:02d}_{seed}_whole.exr"
    if not background.exists():
        return finer
    whole, _ = radiance(background)
    return np.where(there[..., None], finer, whole)


def traced(raw: Path, case: Case) -> Reference:
    """Return the reference of a traced case before compression."""
    number = case.number
    centers = channels(raw / f"{number:02d}_centers.exr")
    index = np.rint(centers["IndexOB.X"])
    depth_m = np.where(index > 0, centers["Depth.Z"], np.inf)[::DEPTH_STEP, ::DEPTH_STEP]
    scene = Scene.from_json((raw / f"{number:02d}.json").read_text(encoding="utf-8"))
    images = filtered(whole_radiance(raw, number, 1))
    return Reference(scene, exposure_of(case, scene), images, index == 1, depth_m, centers["AO.R"])


def exposure_of(case: Case, scene: Scene) -> float:
    """Return the exposure of the case's camera."""
    with Generator(case.config, SEED, SIZE) as generator:
        return generator.exposure(scene, scene.camera(case.camera))


def floor(raw: Path, number: int, reference: Reference) -> dict[str, Any]:
    """Return the measures between two seeds by filter; empty if the second was not traced."""
    exposure = reference.exposure
    if not (raw / f"{number:02d}_2.exr").exists():
        return {}
    return {
        name: Comparison.of(
            displayed(reference.radiance[name], exposure), displayed(image, exposure)
        ).both(reference.inside)
        for name, image in filtered(whole_radiance(raw, number, 2)).items()
    }


def series(raw: Path, number: int, reference: Reference) -> dict[str, Any]:
    """Return CPU seconds and measures by way ("spp" or "denoised") and number of samples.

    The measures compare with the reference's box filter.
    """
    exposure = reference.exposure
    expected = displayed(reference.radiance["box"], exposure)
    found: dict[str, Any] = {}
    for way in ("spp", "denoised"):
        timed = raw / f"{number:02d}_{way}.json"
        if not timed.exists():
            continue
        found[way] = {}
        for samples, seconds in json.loads(timed.read_text(encoding="utf-8")).items():
            light, _ = radiance(raw / f"{number:02d}_{way}_{samples}.exr")
            image = displayed(light, exposure)
            both = Comparison.of(expected, image).both(reference.inside)
            found[way][samples] = {"seconds": seconds, "measures": both}
    return found


def loss(whole: Reference, stored: Reference) -> float:
    """Return the largest mean FLIP over object pixels between the traced and the stored images."""
    pairs = (
        [displayed(reference.radiance[name], whole.exposure) for reference in (whole, stored)]
        for name in stored.radiance
    )
    return max(Comparison.of(*pair).both(whole.inside)[3] for pair in pairs)


def main() -> None:
    """Pack the cases that were traced since the last run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--raw", type=Path, default=Path(__file__).parent / ".raw_references")
    options = parser.parse_args()
    listing = FOLDER / "cycles.json"
    known: dict[str, Any] = {"samples": SAMPLES, "floor": {}, "series": {}}
    if listing.exists():
        known = json.loads(listing.read_text(encoding="utf-8"))
    last = listing.stat().st_mtime if listing.exists() else 0.0
    for case in every_case():
        name = f"{case.number:02d}"
        files = list(options.raw.glob(f"{name}_*.*"))
        traced_already = (options.raw / f"{name}_1.exr").exists()
        if not traced_already or max(file.stat().st_mtime for file in files) < last:
            continue
        whole = traced(options.raw, case)
        save(whole, FOLDER, case.number)
        size = sum(path.stat().st_size for path in FOLDER.glob(f"{name}.*"))
        lost = loss(whole, load(case.number))
        print(f"{name} {size / 1e3:.0f} kB, FLIP of compression {lost:.4f}", flush=True)
        for kind, of in (("floor", floor), ("series", series)):
            figures = of(options.raw, case.number, whole)
            if figures:
                known[kind][str(case.number)] = figures
    listing.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""What is each modelled element worth, and what does it cost?

    python bench/ablation.py [--cases 16] [--only WORD] [--repeats 5]

Takes one element at a time out of the scenes of bench/references (ablation_elements.py says how)
and draws them again. Printed are the FLIP that this changes over the pixels of container and
spreader at 640x640, mean over the cases and worst case; the share of those pixels that change
visibly, by more than VISIBLE; by how much the image without it is farther from Cycles' reference at
320x320 (negative: nearer); and the processor time of a draw that is saved, a mean with its standard
error. Elements that a case does not have count as no change. Leaves bench/results/ablation.json.
"""

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from ablation_elements import ELEMENTS, Absence, Element
from image_error import displayed, flip
from numpy.typing import NDArray
from reference_set import FILTERS, FOLDER, SEED, SIZE, Case, Reference, cases, load
from results import machine, parse_size, save

from fastgen import Config, Generator
from fastgen.sample import Frame
from fastgen.scene import Scene

QUALITY = "balanced"
VISIBLE = 0.1

Array = NDArray[np.floating]


class Drawer:
    """Draws scenes with or without an element; a context manager over a generator of its own."""

    def __init__(self, absence: Absence) -> None:
        self._absence = absence
        self._generator = Generator(Config.preset(), SEED, SIZE, quality=QUALITY)

    def __enter__(self) -> "Drawer":
        return self

    def __exit__(self, *_: object) -> None:
        self._generator.close()

    def frame(self, case: Case, scene: Scene, size: tuple[int, int]) -> Frame:
        """The case's view of the scene."""
        with self._absence.gone():
            renderer = self._generator._open()
            return renderer.render(self._absence.scene(scene), scene.camera(case.camera), size)

    def seconds(self, case: Case, scene: Scene, size: tuple[int, int]) -> float:
        """Processor time of a draw that is warm."""
        with self._absence.gone():
            renderer = self._generator._open()
            less, camera = self._absence.scene(scene), scene.camera(case.camera)
            renderer._ctx.finish()
            began = time.process_time()
            renderer.draw(less, camera, size)
            renderer._ctx.finish()
            return time.process_time() - began

    def exposure(self, case: Case, scene: Scene) -> float:
        """Of the case's camera."""
        return self._generator.exposure(scene, scene.camera(case.camera))


def error_to(reference: Reference, exposure: float, frame: Frame) -> float:
    """Mean FLIP to Cycles' image over the pixels of objects."""
    expected = displayed(reference.radiance[FILTERS[QUALITY]], exposure)
    return float(flip(expected, frame.image / 255.0)[reference.inside].mean())


def without(
    element: Element,
    chosen: list[Case],
    full: Drawer,
    size: tuple[int, int],
    repeats: int,
) -> dict[str, Any]:
    """The row of an element."""
    absence = Absence(element)
    changes, visible, farther, saved = [], [], [], []
    with Drawer(absence) as less:
        for case in chosen:
            reference = load(case.number)
            scene = reference.scene
            whole, part = full.frame(case, scene, size), less.frame(case, scene, size)
            change = flip(whole.image / 255.0, part.image / 255.0)[whole.ids > 0]
            changes.append(float(change.mean()))
            visible.append(float((change > VISIBLE).mean()))
            exposure = full.exposure(case, scene)
            errors = [
                error_to(reference, exposure, d.frame(case, scene, SIZE)) for d in (less, full)
            ]
            farther.append(errors[0] - errors[1])
            pairs = [
                [drawer.seconds(case, scene, size) for drawer in (full, less)]
                for _ in range(repeats)
            ]
            saved.append(float(np.median(np.subtract(*np.transpose(pairs)))) * 1e3)
    absence.check()
    return {
        "group": element.group,
        "flip": float(np.mean(changes)),
        "worst": max(changes),
        "visible": float(np.mean(visible)),
        "farther": float(np.mean(farther)),
        "saved_ms": float(np.mean(saved)),
        "saved_error_ms": float(np.std(saved, ddof=1) / len(saved) ** 0.5) if saved[1:] else 0.0,
    }


def main() -> None:
    """Print the table as it grows."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=16)
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--only", default="", help="elements whose group or name holds this")
    options = parser.parse_args()
    size = parse_size(options.size)
    chosen = [c for c in cases()[: options.cases] if (FOLDER / f"{c.number:02d}.npz").exists()]
    about = machine()
    print(f"{len(chosen)} cases, draws at {options.size}, {QUALITY}, {about}\n")
    print(
        "| without | FLIP of objects, mean (worst case) | visible change | farther from Cycles "
        "| core-ms saved |\n| --- | --- | --- | --- | --- |"
    )
    rows: dict[str, Any] = {}
    with Drawer(Absence(Element("", "nothing"))) as full:
        for element in ELEMENTS:
            if options.only not in f"{element.group} {element.name}":
                continue
            row = rows[element.name] = without(element, chosen, full, size, options.repeats)
            print(
                f"| {element.name} | {row['flip']:.4f} ({row['worst']:.4f}) | {row['visible']:.2%} "
                f"| {row['farther']:+.4f} | {row['saved_ms']:.1f} ± {row['saved_error_ms']:.1f} |",
                flush=True,
            )
    save(
        "ablation",
        {"machine": about, "size": options.size, "cases": len(chosen), "elements": rows},
    )


if __name__ == "__main__":
    main()

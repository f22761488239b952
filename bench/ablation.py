"""Measure what each modelled element changes in the image and what it costs.

    python bench/ablation.py [--cases 16] [--only WORD] [--repeats 6]

Removes one element at a time from the scenes of bench/references (see ablation_elements.py) and
renders them again. Prints a row for each element:

FLIP between the images with and without the element, over the pixels of container and spreader at
640x640 (mean over the cases, and the worst case).

Visible change: the share of these pixels with a FLIP above VISIBLE.

Farther from Cycles: how much the FLIP to the Cycles reference at 320x320 rises without the element
(negative: it falls).

CPU time saved per draw: mean and standard error.

Cases that do not contain an element count as no change. The row "nothing" compares two identical
draws. Writes the table to docs/accuracy.md and bench/results/ablation.json, unless --only is given.
"""

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from ablation_elements import ELEMENTS, Element, gpu_session
from image_error import displayed, flip
from numpy.typing import NDArray
from reference_set import FILTERS, SIZE, Case, Reference, load, traced
from reporting import heading, origin, parse_size, save, write_section

from fastgen.frame import Frame
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.session import GpuSession
from fastgen.scene import Scene

NOTHING = Element("", "nothing")
QUALITY = "balanced"
VISIBLE = 0.1
MARGIN_PX = 32
"""Margin around the objects, wide enough for FLIP's filters."""


Array = NDArray[np.floating]


class Drawer:
    """Context manager that renders scenes without one element.

    Args:
        element: The element to remove.
        whole: A Drawer with all elements. Its renderer is shared if only the scene differs.
    """

    def __init__(self, element: Element, whole: "Drawer | None" = None) -> None:
        self._element = element
        self._shapes = element.shapes()
        self._latest: PreparedScene | None = None
        self._shared = whole is not None and element.scene is not None
        self._session: GpuSession
        if whole is not None and self._shared:
            self._session = whole._session
        else:
            self._session = gpu_session([element], QUALITY)

    def __enter__(self) -> "Drawer":
        return self

    def __exit__(self, *_: object) -> None:
        if not self._shared:
            self._session.close()

    def frame(self, case: Case, scene: Scene, size: tuple[int, int]) -> Frame:
        """Render the case's view of a scene."""
        with self._element.light_removed():
            renderer = self._session.renderer()
            return renderer.render(self._prepared(scene), scene.camera(case.camera), size)

    def seconds(self, case: Case, scene: Scene, size: tuple[int, int]) -> float:
        """Return the CPU time in seconds of one draw with warm caches."""
        with self._element.light_removed():
            renderer = self._session.renderer()
            prepared, camera = self._prepared(scene), scene.camera(case.camera)
            renderer.draw(prepared, camera, size)
            renderer.ctx.finish()
            began = time.process_time()
            renderer.draw(prepared, camera, size)
            renderer.ctx.finish()
            return time.process_time() - began

    def _prepared(self, scene: Scene) -> PreparedScene:
        """Return the scene without the element."""
        less = self._element.scene(scene) if self._element.scene else scene
        if self._latest is None or self._latest.scene != less:
            self._latest = PreparedScene(less, self._shapes)
        return self._latest

    def exposure(self, case: Case, scene: Scene) -> float:
        """Return the exposure of the case's camera."""
        return self._session.renderer().exposure(scene, scene.camera(case.camera), SIZE).factor


@dataclass(frozen=True, eq=False)
class Whole:
    """A case rendered with every element.

    Attributes:
        image: sRGB [H, W, 3] in 0..1 at the requested size.
        there: Mask [H, W] of the pixels of objects.
        window: Window that contains all objects.
        error: Mean FLIP to the Cycles image over the objects, at 320x320.
    """

    case: Case
    reference: Reference
    exposure: float
    image: Array
    there: NDArray[np.bool_]
    window: tuple[slice, slice]
    error: float

    @staticmethod
    def of(case: Case, full: Drawer, size: tuple[int, int]) -> "Whole":
        """Render a case with `full`, a Drawer that removes nothing."""
        reference = load(case.number)
        frame = full.frame(case, reference.scene, size)
        there = frame.ids > 0
        window = tuple(
            slice(max(places.min() - MARGIN_PX, 0), places.max() + MARGIN_PX)
            for places in np.nonzero(there)
        )
        exposure = full.exposure(case, reference.scene)
        error = error_to(reference, exposure, full.frame(case, reference.scene, SIZE))
        image = frame.image / 255.0
        return Whole(case, reference, exposure, image, there, (window[0], window[1]), error)


def error_to(reference: Reference, exposure: float, frame: Frame) -> float:
    """Return the mean FLIP to the Cycles image over the pixels of objects."""
    expected = displayed(reference.radiance[FILTERS[QUALITY]], exposure)
    return float(flip(expected, frame.image / 255.0)[reference.inside].mean())


def without(
    element: Element, wholes: list[Whole], full: Drawer, size: tuple[int, int], repeats: int
) -> dict[str, Any]:
    """Return the table row of an element, averaged over the cases."""
    changes, visible, farther, saved = [], [], [], []
    with Drawer(element, full) as less:
        for whole in wholes:
            case, scene = whole.case, whole.reference.scene
            part = less.frame(case, scene, size).image / 255.0
            error = flip(whole.image[whole.window], part[whole.window])
            change = error[whole.there[whole.window]]
            changes.append(float(change.mean()))
            visible.append(float((change > VISIBLE).mean()))
            small = less.frame(case, scene, SIZE)
            farther.append(error_to(whole.reference, whole.exposure, small) - whole.error)
            spent: dict[Drawer, list[float]] = {full: [], less: []}
            for turn in range(repeats):
                # the second draw finds warmer caches, so the order alternates
                for drawer in (full, less) if turn % 2 else (less, full):
                    spent[drawer].append(drawer.seconds(case, scene, size))
            saved.append(1e3 * float(np.median(spent[full]) - np.median(spent[less])))
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
    """Print each row as soon as it is measured, then write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=16)
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument(
        "--only", default="", help="measure only elements whose group or name contains this"
    )
    options = parser.parse_args()
    size = parse_size(options.size)
    chosen = traced(options.cases)
    lines = [
        f"{len(chosen)} cases, draws at {options.size}, {QUALITY}, {heading()}.",
        "",
        "| without | FLIP of objects, mean (worst case) | visible change | farther from Cycles "
        "| CPU ms saved |",
        "| --- | --- | --- | --- | --- |",
    ]
    rows: dict[str, Any] = {}
    with Drawer(NOTHING) as full:
        wholes = [Whole.of(case, full, size) for case in chosen]
        for element in (NOTHING, *ELEMENTS):
            if options.only not in f"{element.group} {element.name}":
                continue
            row = rows[element.name] = without(element, wholes, full, size, options.repeats)
            lines.append(
                f"| {element.name} | {row['flip']:.4f} ({row['worst']:.4f}) | {row['visible']:.2%} "
                f"| {row['farther']:+.4f} | {row['saved_ms']:.1f} ± {row['saved_error_ms']:.1f} |"
            )
            print(lines[-1], file=sys.stderr, flush=True)
    if options.only:
        return
    write_section("ablation", lines)
    figures = {**origin(), "size": options.size, "cases": len(chosen), "elements": rows}
    save("ablation", figures)


if __name__ == "__main__":
    main()

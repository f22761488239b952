"""Test whether fast rendering costs accuracy, with marker classifiers trained on both renderers.

    python examples/fast_or_true.py --blender-python PYTHON     # PYTHON: a Python with bpy 4.5

One classifier is trained on our images and one on Cycles'. Both are tested on Cycles' images of
other scenes. The renderers get the same scenes, so only the light differs. The tables answer three
questions: what the same number of images teaches, what the same rendering time teaches, and what
each element of realism contributes.

Every intermediate result is stored in the cache of the results folder, so the run can be stopped
and continued. Without --blender-python, only existing Cycles images are used.
"""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

# set before Mesa and PyTorch load: cost is measured in CPU seconds, so one core draws
os.environ.setdefault("LP_NUM_THREADS", "0")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
import torch
from common import charts
from common.crop_classifier import fit, named
from common.crop_sets import CropSet, ours, stored, traced
from common.intervals import Mean, interval
from common.marker_walls import CAMERAS, CONFIG, ELEMENTS, SHADE, crowded, without
from common.run import RESULTS, Table
from common.traced import SAMPLES, kept, trace
from numpy.typing import NDArray

from fastgen import Generator
from fastgen.classes import MARKER_CLASSES
from fastgen.errors import ConfigError
from fastgen.scene import Scene

SCENE_SEED = 11
FIRST_TRAINING = 10000
SIZE = (192, 192)
VIEWS = len(CAMERAS)
LONG = ", long"


@dataclass(frozen=True)
class Study:
    """Sizes of the experiment.

    Attributes:
        test: Test scenes, rendered by both renderers.
        train: Training scenes, rendered by both renderers.
        numbers: Numbers of training scenes to compare at equal number.
        more: Larger numbers of training scenes, which only fastgen renders.
        steps: Steps of each training.
        long_steps: Steps of the additional long trainings on the largest sets.
        seeds: Trainings per comparison.
        few_seeds: Trainings per element, and per long training.
        elements: Names of the elements to remove.
    """

    test: int
    train: int
    numbers: tuple[int, ...]
    more: tuple[int, ...]
    steps: int
    long_steps: int
    seeds: int
    few_seeds: int
    elements: tuple[str, ...] = tuple(ELEMENTS)


STUDIES = {
    "cpu": Study(30, 60, (5, 20, 60), (250, 750, 2500), 250, 3000, 5, 3),
    "smoke": Study(1, 2, (1, 2), (3,), 4, 8, 2, 2, ("spreader", SHADE)),
}


@dataclass(frozen=True)
class Work:
    """Settings from the command line, and paths."""

    study: Study
    mode: str
    folder: Path
    cache: Path
    references: Path
    python: Path | None


@dataclass(frozen=True, eq=False)
class Outcome:
    """Correctness of a training's answer for each test crop, bool [N].

    Attributes:
        on_traced: In Cycles' images.
        on_ours: In our images.
    """

    on_traced: NDArray[np.bool_]
    on_ours: NDArray[np.bool_]


@dataclass(eq=False)
class Trainings:
    """The trainings that were run, and their stored outcomes."""

    work: Work
    tests: tuple[CropSet, CropSet]
    done: dict[tuple[str, int], list[Outcome]] = field(default_factory=dict)

    def add(self, name: str, crops: CropSet, scenes: int, seed: int) -> None:
        """Train on `scenes` scenes of a set.

        The seed selects the scenes, the initial weights and the order. A name that ends in LONG
        trains for the study's long_steps.
        """
        path = self.work.cache / f"run_{name}_{scenes}_{seed}.npz".replace(" ", "_")
        if not path.exists():
            every = np.unique(crops.scenes)
            chosen = np.random.default_rng(seed).permutation(every)[:scenes]
            part = crops.of(chosen.tolist())
            pixels, classes = torch.from_numpy(part.pixels), torch.from_numpy(part.classes)
            study = self.work.study
            steps = study.long_steps if name.endswith(LONG) else study.steps
            net = fit(pixels, classes, steps, seed, len(MARKER_CLASSES))
            right = [
                named(net, torch.from_numpy(test.pixels)).numpy() == test.classes
                for test in self.tests
            ]
            np.savez(path, traced=right[0], ours=right[1])
            print(
                f"{name}, {scenes * VIEWS} images, seed {seed}: {right[0].mean():.1%}", flush=True
            )
        with np.load(path) as found:
            self.done.setdefault((name, scenes), []).append(Outcome(found["traced"], found["ours"]))

    def right(self, name: str, scenes: int, where: str = "on_traced") -> NDArray[np.float64]:
        """Return the correct classifications for `interval`, float64 [seeds, N]."""
        return np.stack([getattr(o, where) for o in self.done[name, scenes]]).astype(float)

    def mean(self, name: str, scenes: int, where: str = "on_traced") -> Mean:
        """Return the score of a training in percent."""
        return interval(self.right(name, scenes, where), self.tests[0].scenes)

    def difference(self, a: tuple[str, int], b: tuple[str, int]) -> Mean:
        """Return the score of `a` minus that of `b` on the same Cycles crops, in percentage
        points."""
        right_a, right_b = self.right(*a), self.right(*b)
        seeds = min(len(right_a), len(right_b))  # `a` or `b` may have fewer
        return interval(right_a[:seeds] - right_b[:seeds], self.tests[0].scenes)


def parsed(argv: Sequence[str] | None) -> Work:
    """Parse the command line."""
    first, _, rest = (__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(
        description=first, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blender-python", type=Path, help="Python 3.11 with bpy 4.5")
    parser.add_argument("--smoke", action="store_true", help="run only a few steps, as a test")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(argv)
    mode = "smoke" if options.smoke else "cpu"
    cache = options.results / "cache" / f"fast_or_true_{mode}"
    cache.mkdir(parents=True, exist_ok=True)
    references = options.results / "cache" / "traced"
    return Work(STUDIES[mode], mode, options.results, cache, references, options.blender_python)


def rendered(work: Work, generator: Generator) -> dict[str, CropSet]:
    """Return all sets of crops by name.

    They are the test and training sets of both renderers, more of ours, and ours without each
    element.

    Raises:
        ConfigError: Cycles images are missing and no Python with bpy was given.
    """
    study = work.study
    indices = {
        "test": range(study.test),
        "train": range(FIRST_TRAINING, FIRST_TRAINING + study.train),
        "more": range(FIRST_TRAINING, FIRST_TRAINING + max(study.more)),
    }

    def scenes(which: str) -> Iterator[Scene]:
        return (crowded(generator.scene(index)) for index in indices[which])

    found: dict[str, CropSet] = {}

    def add(name: str, make: Callable[..., CropSet], source: Iterable[Any]) -> None:
        path = work.cache / f"{name}.npz".replace(" ", "_")
        found[name] = stored(path, partial(make, generator, source))

    for which in ("test", "train"):
        if work.python:
            trace(generator, list(scenes(which)), CAMERAS, work.references, work.python)
        images = [
            image
            for index in indices[which]
            for image in kept(work.references, SCENE_SEED, index, CAMERAS)
        ]
        if len(images) < VIEWS * len(indices[which]):
            raise ConfigError(
                f"{work.references}: has {len(images)} of {VIEWS * len(indices[which])} Cycles "
                f"images of the {which} set; render the rest with --blender-python PYTHON"
            )
        same = [image.scene for image in images[::VIEWS]]
        add(f"traced {which}", traced, images)
        add(f"ours {which}", ours, same)
    for name in study.elements:
        with without(name):
            add(f"no {name}", ours, map(ELEMENTS[name], same))
    add("ours more", ours, scenes("more"))
    return found


def trained(work: Work, sets: dict[str, CropSet]) -> Trainings:
    """Run all trainings of the study, one seed after the other."""
    study = work.study
    made = Trainings(work, (sets["traced test"], sets["ours test"]))
    for seed in range(study.seeds):
        for scenes in study.numbers:
            made.add("traced", sets["traced train"], scenes, seed)
            made.add("ours", sets["ours train"], scenes, seed)
        for scenes in study.more:
            made.add("ours", sets["ours more"], scenes, seed)
        if seed < study.few_seeds:
            for name in study.elements:
                made.add(f"no {name}", sets[f"no {name}"], study.train, seed)
            for source in ("traced", "ours"):
                made.add(source + LONG, sets[f"{source} train"], study.train, seed)
            made.add("ours" + LONG, sets["ours more"], max(study.more), seed)
    return made


def equal_number(made: Trainings) -> Table:
    """Return a table of the scores after training on the same number of images of the same
    scenes."""
    study, rows = made.work.study, []
    for end, scenes in [*(("", n) for n in study.numbers), (LONG, study.train)]:
        a, b = ("ours" + end, scenes), ("traced" + end, scenes)
        images = f"{scenes * VIEWS}{end}"
        row = [
            images,
            len(made.done[a]),
            with_interval(made.mean(*a)),
            with_interval(made.mean(*b)),
        ]
        row += [signed(made.difference(a, b))]
        rows.append(
            [*row, with_interval(made.mean(*a, "on_ours")), with_interval(made.mean(*b, "on_ours"))]
        )
    heads = [
        "images",
        "seeds",
        "ours",
        "Cycles'",
        "difference",
        "ours, on ours",
        "Cycles', on ours",
    ]
    return Table("The same number of images, %", heads, rows)


def equal_time(made: Trainings, costs: dict[str, float]) -> Table:
    """Return a table of the scores after the same rendering time.

    Each row compares with our largest training set that this time allows.
    """
    study, rows = made.work.study, []
    for end, scenes in [*(("", n) for n in study.numbers), (LONG, study.train)]:
        spent = scenes * VIEWS * costs["traced"]
        sizes = [n for n in (*study.numbers, *study.more) if ("ours" + end, n) in made.done]
        most = max([n for n in sizes if n * VIEWS * costs["ours"] <= spent], default=0)
        if most == 0:
            continue
        a, b = ("ours" + end, most), ("traced" + end, scenes)
        row = [f"{scenes * VIEWS}{end}", f"{spent:.0f}", with_interval(made.mean(*b))]
        row += [
            str(most * VIEWS),
            f"{most * VIEWS * costs['ours']:.0f}",
            with_interval(made.mean(*a)),
        ]
        rows.append([*row, signed(made.difference(a, b))])
    heads = ["Cycles' images", "CPU s", "score", "our images", "CPU s", "score", "difference"]
    return Table("The same rendering time, %", heads, rows)


def elements_worth(made: Trainings) -> Table:
    """Return a table of the score lost when one element is missing from our training images."""
    size = made.work.study.train
    rows = []
    for name in made.work.study.elements:
        lacking = f"no {name}", size
        lost = made.difference(("ours", size), lacking)
        rows.append([name, with_interval(made.mean(*lacking)), signed(lost)])
    title = f"Without an element, {size * VIEWS} of our images, %"
    return Table(title, ["without", "score", "points it is worth"], rows)


def with_interval(mean: Mean) -> str:
    """Format a mean and its interval."""
    return f"{mean.mean:.1f} ({mean.low:.1f} to {mean.high:.1f})"


def signed(mean: Mean) -> str:
    """Format a difference and its interval."""
    return f"{mean.mean:+.1f} ({mean.low:+.1f} to {mean.high:+.1f})"


def main(argv: Sequence[str] | None = None) -> None:
    """Render, train, and write the results."""
    work = parsed(argv)
    study = work.study
    torch.set_num_threads(1)
    with Generator(CONFIG, SCENE_SEED, SIZE) as generator:
        sets = rendered(work, generator)
    made = trained(work, sets)
    costs = {"traced": sets["traced train"].core_s, "ours": sets["ours more"].core_s}

    listed = [equal_number(made), equal_time(made, costs), elements_worth(made)]
    curves = {
        name: [(scenes * VIEWS * costs[source], *made.mean(source, scenes)) for scenes in numbers]
        for name, source, numbers in (
            ("trained on Cycles' images", "traced", study.numbers),
            ("trained on ours", "ours", (*study.numbers, *study.more)),
        )
    }
    charts.score_by_cost(curves, "CPU seconds of rendering", work.folder / "fast_or_true.png")
    losses = {
        name: made.difference(("ours", study.train), (f"no {name}", study.train))
        for name in study.elements
    }
    charts.worth(losses, "points lost without it", work.folder / "fast_or_true_elements.png")
    charts.pairs(
        sets["traced test"].pixels, sets["ours test"].pixels, work.folder / "fast_or_true_crops.png"
    )
    text = "\n\n".join(table.markdown() for table in listed)
    found = {
        "example": "fast_or_true",
        "mode": work.mode,
        "study": asdict(study),
        "samples": SAMPLES,
        "size": SIZE,
        "test_crops": len(sets["traced test"].classes),
        "crops_per_image": len(sets["ours more"].classes) / (VIEWS * max(study.more)),
        "core_s_per_image": costs,
        "scores": {
            f"{name}, {scenes * VIEWS} images": {
                "on_traced": made.mean(name, scenes),
                "on_ours": made.mean(name, scenes, "on_ours"),
                "seeds": len(outcomes),
            }
            for (name, scenes), outcomes in made.done.items()
        },
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, no GPU",
        "torch": str(torch.__version__),
    }
    (work.folder / "fast_or_true.json").write_text(json.dumps(found, indent=1) + "\n")
    (work.folder / "fast_or_true.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()

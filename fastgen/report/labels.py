"""Labels of a dataset as one table, and the counts that the report shows.

The labels come from the records in the shards' manifests, so this works for every layout. Every
value is checked, because a person who edits a manifest can also update its hash.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from fastgen.dataset.job import scene_and_camera
from fastgen.dataset.stats import NOT_MEASURED, RARE
from fastgen.formats.format import Record
from fastgen.formats.registry import known_formats
from fastgen.sampling.scene import SPLITS

TASKS = ("damage", "imdg")
"""Tasks whose labels have classes and boxes."""

GRID = 24
"""Cells along each side of an occurrence map."""

SIZE_EDGES_PX = (1, *(round(2 ** (step / 2)) for step in range(1, 25)))
"""Limits of the bins of box sizes in pixels; each is about 1.4 times the one before."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class LabelClass:
    """A class of one task; both tasks have a class called container."""

    task: str
    name: str

    @property
    def is_target(self) -> bool:
        """True for damages and dangerous-goods markers, whose size matters for training."""
        return self.name not in NOT_MEASURED


@dataclass(frozen=True, eq=False)
class LabelTable:
    """The labels of some images of a dataset.

    Attributes:
        classes: All classes of the dataset's tasks.
        cameras: Names of the cameras that occur.
        tasks: The dataset's tasks out of TASKS.
        split: int [I], index of each image's split in SPLITS.
        camera: int [I], index of each image's camera.
        size: float [I, 2], width and height of each image in pixels.
        image: int [L], index of each label's image.
        label: int [L], index of each label's class.
        box: float [L, 4], x, y, width and height of each label's visible box in pixels.
    """

    classes: Sequence[LabelClass]
    cameras: Sequence[str]
    tasks: Sequence[str]
    split: Ints
    camera: Ints
    size: Floats
    image: Ints
    label: Ints
    box: Floats

    @property
    def shares(self) -> Floats:
        """Boxes [L, 4] as shares of the image's width and height."""
        width, height = self.size[self.image].T
        return np.asarray(self.box / np.stack([width, height, width, height], axis=-1))

    def places(self, wanted: Iterable[bool]) -> list[int]:
        """Return the indices of the classes for which `wanted` is true."""
        return [index for index, chosen in enumerate(wanted) if chosen]

    def with_labels(self, classes: Sequence[int]) -> NDArray[np.bool_]:
        """Return for each image [I] whether it has a label of one of the classes."""
        found = np.zeros(len(self.split), bool)
        found[self.image[np.isin(self.label, classes)]] = True
        return found

    def by_split(self, chosen: NDArray[np.bool_] | None = None) -> list[int]:
        """Return the number of images in each split, of all or of the chosen ones [I]."""
        split = self.split if chosen is None else self.split[chosen]
        return list(map(int, np.bincount(split, minlength=len(SPLITS))))

    def counts(self) -> Ints:
        """Return the number of labels [C, S] of each class in each split."""
        found = np.zeros((len(self.classes), len(SPLITS)), np.int64)
        np.add.at(found, (self.label, self.split[self.image]), 1)
        return found

    def size_bins(self) -> dict[int, Ints]:
        """Return a histogram [B, B] over width and height for each class that occurs."""
        bins = np.searchsorted(SIZE_EDGES_PX, self.box[:, 2:], side="right") - 1
        bins = np.clip(bins, 0, len(SIZE_EDGES_PX) - 1)
        found = {}
        for index in np.unique(self.label).tolist():
            grid = np.zeros((len(SIZE_EDGES_PX),) * 2, np.int64)
            np.add.at(grid, tuple(bins[self.label == index].T), 1)
            found[index] = grid
        return found

    def maps(self) -> dict[tuple[int, int], Ints]:
        """Return occurrence maps [GRID, GRID] by class and camera.

        A cell, in rows from the top, has the number of boxes that reach into it.
        """
        x, y, width, height = self.shares.T * GRID
        # rounding must not make a box reach into the next cell
        first = np.floor(np.stack([y, x]) + 1e-9).astype(int).clip(0, GRID)
        last = np.ceil(np.stack([y + height, x + width]) - 1e-9).astype(int).clip(0, GRID)
        camera = self.camera[self.image]
        found = {}
        for key in sorted(set(zip(self.label.tolist(), camera.tolist(), strict=True))):
            chosen = (self.label == key[0]) & (camera == key[1])
            corners = np.zeros((GRID + 1, GRID + 1), np.int64)
            for rows, columns, sign in (
                *((first[0], first[1], 1), (last[0], last[1], 1)),
                *((first[0], last[1], -1), (last[0], first[1], -1)),
            ):
                np.add.at(corners, (rows[chosen], columns[chosen]), sign)
            found[key] = corners.cumsum(axis=0).cumsum(axis=1)[:GRID, :GRID]
        return found

    def together(self) -> Ints:
        """Return the number of images [C, C] that show both of two classes."""
        present = np.zeros((len(self.split), len(self.classes)))
        present[self.image, self.label] = 1
        return np.rint(present.T @ present).astype(np.int64)

    def smallest_sides(self, index: int) -> Floats:
        """Return the shorter side in pixels of each box of a class."""
        return np.asarray(self.box[self.label == index, 2:].min(axis=1))

    @property
    def listed(self) -> list[int]:
        """Indices of the classes to show: all, except unusual ones without labels."""
        occurs = np.bincount(self.label, minlength=len(self.classes)) > 0
        return self.places(
            bool(any_) or each.name not in RARE
            for each, any_ in zip(self.classes, occurs, strict=True)
        )


def class_names(manifest: Mapping[str, Any], task: str) -> Sequence[str]:
    """Return the classes of a task in the order of its categories.

    Args:
        manifest: Content of dataset.json.
        task: One of TASKS.
    """
    # dataset.json lists the classes if a configuration can change them
    names: Sequence[str] = manifest.get("classes", {}).get(task, known_formats()[task].classes)
    return names


def label_table(manifest: Mapping[str, Any], records: Iterable[Record]) -> LabelTable:
    """Return the labels in records, except ignored ones.

    Args:
        manifest: Content of dataset.json.
        records: Records of images.

    Raises:
        ValueError: A record does not have the facts of its formats.
    """
    tasks = [task for task in TASKS if task in manifest["formats"]]
    names = {task: class_names(manifest, task) for task in tasks}
    classes = [LabelClass(task, name) for task in tasks for name in names[task]]
    start = {task: [each.task for each in classes].index(task) for task in tasks}
    cameras: dict[str, int] = {}
    images: list[tuple[int, int]] = []
    sizes: list[Sequence[int]] = []
    rows: list[tuple[int, int]] = []
    boxes: list[Sequence[float]] = []
    for number, record in enumerate(records):
        camera = scene_and_camera(record["stem"])[1]
        images.append((SPLITS.index(record["split"]), cameras.setdefault(camera, len(cameras))))
        sizes.append(record["size"])
        for task in tasks:
            for category, box in _checked(record, task, len(names[task])):
                rows.append((number, start[task] + category - 1))
                boxes.append(box)
    image_rows = np.array(images, np.int64).reshape(-1, 2)
    label_rows = np.array(rows, np.int64).reshape(-1, 2)
    return LabelTable(
        classes=classes,
        cameras=list(cameras),
        tasks=tasks,
        split=image_rows[:, 0],
        camera=image_rows[:, 1],
        size=np.array(sizes, np.float64).reshape(-1, 2),
        image=label_rows[:, 0],
        label=label_rows[:, 1],
        box=np.array(boxes, np.float64).reshape(-1, 4),
    )


def _checked(record: Record, task: str, limit: int) -> Iterable[tuple[int, Sequence[float]]]:
    """Yield category and box of each annotation that is not ignored."""
    width, height = record["size"]
    facts = record["facts"].get(task)
    if not isinstance(facts, list):
        raise ValueError(f"{record['stem']}: has no list of {task} labels")
    for item in facts:
        if not isinstance(item, dict):
            raise ValueError(f"{record['stem']}: a {task} label is no object")
        if item.get("iscrowd") == 1:
            continue
        category, box = item.get("category_id"), item.get("bbox")
        if not (isinstance(category, int) and 1 <= category <= limit):
            raise ValueError(f"{record['stem']}: a {task} label has an unknown category")
        if not is_box(box) or (box[0] + box[2] > width or box[1] + box[3] > height):
            raise ValueError(f"{record['stem']}: a {task} label has a box outside of the image")
        yield category, box


def is_box(value: Any) -> TypeGuard[list[float]]:
    """Return whether a JSON value is four finite numbers of 0 or more."""
    return (
        isinstance(value, list)
        and len(value) == 4
        and all(isinstance(v, int | float) and math.isfinite(v) and v >= 0 for v in value)
    )

"""Everything that the report of a dataset shows, as JSON values for its page.

Large datasets are sampled: labels are counted in at most MOST_RECORDS images, and fewer are opened
to measure them.
"""

import base64
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import PurePath
from typing import Any

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fastgen.dataset.finished import FinishedDataset, open_finished
from fastgen.dataset.job import ARCHIVE_ENDINGS
from fastgen.dataset.stats import QUANTILES
from fastgen.errors import OutputError
from fastgen.formats.format import Record
from fastgen.overlay import class_hex
from fastgen.report.advice import SMALL_PX, advice_on
from fastgen.report.labels import (
    GRID,
    SIZE_EDGES_PX,
    LabelTable,
    label_table,
)
from fastgen.report.looks import Look, look_at, ranges
from fastgen.report.origin import origins
from fastgen.report.views import (
    LoadedView,
    Place,
    chosen_places,
    load_views,
    place_of_record,
    spread,
)
from fastgen.sampling.scene import SPLITS

MOST_RECORDS = 5_000
"""Images whose labels are counted."""

MOST_VIEWS = 400
"""Images that are opened."""

_SHEET, _SHEET_PX, _SHEET_BYTES = 32, 720, 5_000_000
"""Images on the contact sheet at most, their longer side, and the size of all their files."""

_CROPS, _CROP_PX, _CROP_BYTES = 48, 240, 500_000
_QUALITY = 80
_VISIBLE_BINS = 10
_MOST_CAMERAS, _MOST_ENVIRONMENTS = 12, 60
_MOST_CLASSES, _MOST_BOXES = 200, 500
_LONGEST_TEXT = 80


def report_content(out: str) -> dict[str, Any]:
    """Return what the report of the dataset at `out` shows.

    Raises:
        OutputError: `out` is not a finished dataset, or is damaged.
    """
    dataset = open_finished(out)
    manifest, places = dataset.manifest, list[Place]()
    try:
        records = islice(_records(dataset), 2 * MOST_RECORDS)  # a manifest may give false numbers
        table = label_table(manifest, _noted(records, places))
    except ValueError as error:
        raise OutputError(f"{out}: {error}; run fastgen verify {out}") from None
    views = _Views()
    archived = manifest["format"] in ARCHIVE_ENDINGS
    chosen = chosen_places(places, MOST_VIEWS, archived) if places else []
    pictured = set(chosen_places(chosen, _SHEET, False)) if chosen else set()
    for view in load_views(dataset, chosen):
        views.add(view, view.place in pictured)
    scale = dataset.images / max(len(places), 1)
    return {
        # the name of a folder may contain bytes that are not text
        "title": (PurePath(out).name or out).encode("utf-8", "replace").decode(),
        "splits": SPLITS,
        "scope": {"images": dataset.images, "counted": len(places), "opened": len(views.looks)},
        "origins": origins(manifest),
        "advice": [each._asdict() for each in advice_on(manifest, table, views.looks, scale)],
        "images": [manifest["counts"].get(split, {}).get("images", 0) for split in SPLITS],
        "damaged": _damaged(table),
        "sheet": views.sheet,
        "crops": views.crops,
        "visible": {
            name: [counts[at] for at in range(_VISIBLE_BINS)]
            for name, counts in sorted(views.visible.items())
        },
        "exposure": {
            "quantiles": QUANTILES,
            "cameras": ranges(views.looks, lambda look: look.place.camera),
            "environments": ranges(views.looks, lambda look: look.environment)[:_MOST_ENVIRONMENTS],
        },
        "colors": {
            name: class_hex(name)
            for name in sorted(
                {each.name for each in table.classes}
                | {box["name"] for image in views.sheet for box in image["boxes"]}
            )
        },
        **_label_parts(table),
    }


def _records(dataset: FinishedDataset) -> Iterator[tuple[int, Record]]:
    """Yield shard and record of images of shards that are evenly spread."""
    each = max(dataset.images // max(len(dataset.shards), 1), 1)
    for shard in spread(dataset.shards, max(MOST_RECORDS // each, 1)):
        for record in dataset.records(shard):
            yield shard, record


def _noted(records: Iterator[tuple[int, Record]], places: list[Place]) -> Iterator[Record]:
    """Yield records, and add the place of each to `places`."""
    for shard, record in records:
        places.append(place_of_record(record, shard))
        yield record


def _damaged(table: LabelTable) -> dict[str, list[int]] | None:
    """Return the number of images without and with visible damage in each split."""
    if "damage" not in table.tasks:
        return None
    targets = table.places(each.task == "damage" and each.is_target for each in table.classes)
    damaged = table.with_labels(targets)
    return {"without": table.by_split(~damaged), "with": table.by_split(damaged)}


def _label_parts(table: LabelTable) -> dict[str, Any]:
    counts, maps, bins = table.counts(), table.maps(), table.size_bins()
    frequent = [camera for camera, _ in Counter(table.camera.tolist()).most_common(_MOST_CAMERAS)]
    whole: dict[int, NDArray[np.int64]] = {}
    for (index, _), cells in maps.items():
        whole[index] = whole.get(index, 0) + cells
    return {
        "tasks": table.tasks,
        "classes": [
            {"name": each.name, "task": each.task, "target": each.is_target}
            for each in table.classes
        ],
        "listed": table.listed,
        "counts": counts.tolist(),
        "sizes": {
            "edges": SIZE_EDGES_PX,
            "quantiles": QUANTILES,
            "small_px": SMALL_PX,
            "bins": {index: _sparse(grid) for index, grid in bins.items()},
            "rows": {index: _size_row(table, index) for index in bins},
        },
        "maps": {
            "grid": GRID,
            "cameras": {camera: table.cameras[camera] for camera in sorted(frequent)},
            "all": {index: cells.ravel().tolist() for index, cells in whole.items()},
            "cells": [
                [index, camera, cells.ravel().tolist()]
                for (index, camera), cells in maps.items()
                if camera in frequent
            ],
        },
        "together": table.together().tolist(),
    }


def _sparse(grid: NDArray[np.int64]) -> list[list[int]]:
    """Return [row, column, value] of each cell that is not 0."""
    rows, columns = np.nonzero(grid)
    return [[int(v) for v in cell] for cell in zip(rows, columns, grid[rows, columns], strict=True)]


def _size_row(table: LabelTable, index: int) -> dict[str, Any]:
    """Return quantiles of width and height as shares of the image, and the share of small boxes."""
    shares = table.shares[table.label == index, 2:]
    width, height = np.quantile(shares, QUANTILES, axis=0).T.tolist()
    small = float((table.smallest_sides(index) < SMALL_PX).mean())
    return {"width": width, "height": height, "small": small}


class _Views:
    """Collects what the report shows of opened images, without keeping the images.

    Attributes:
        looks: Measurements of each image.
        sheet: Images of the contact sheet with their boxes.
        crops: Text crops with their texts.
        visible: Histogram of the visible fraction of each class, in ten bins.
    """

    def __init__(self) -> None:
        self.looks: list[Look] = []
        self.sheet: list[dict[str, Any]] = []
        self.crops: list[dict[str, Any]] = []
        self.visible: dict[str, Counter[int]] = {}
        self._sheet_bytes = self._crop_bytes = 0

    def add(self, view: LoadedView, pictured: bool) -> None:
        """Measure an image, and put it on the contact sheet if it is `pictured`."""
        self.looks.append(look_at(view))
        for thing in view.objects:
            if thing.bbox is not None and not thing.background:
                at = min(int(thing.visible_fraction * _VISIBLE_BINS), _VISIBLE_BINS - 1)
                name = thing.class_name[:_LONGEST_TEXT]
                if name in self.visible or len(self.visible) < _MOST_CLASSES:
                    self.visible.setdefault(name, Counter())[at] += 1
        if pictured:
            source = _encoded(view.image, _SHEET_PX)
            self._sheet_bytes += len(source)
            if self._sheet_bytes <= _SHEET_BYTES:
                self.sheet.append({"source": source, **_picture(view)})
        # few of each image, so that the crops come from many
        for text, (x0, y0, x1, y1) in spread(view.place.crops, 2):
            pixels = view.image[y0:y1, x0:x1]
            if pixels.size and len(self.crops) < _CROPS:
                source = _encoded(pixels, _CROP_PX)
                self._crop_bytes += len(source)
                if self._crop_bytes <= _CROP_BYTES:
                    stem = view.place.stem
                    self.crops.append(
                        {"source": source, "text": text[:_LONGEST_TEXT], "stem": stem}
                    )


def _picture(view: LoadedView) -> dict[str, Any]:
    place = view.place
    return {
        "stem": place.stem,
        "split": place.split,
        "camera": place.camera,
        "environment": view.environment,
        "size": place.size,
        "boxes": [
            {
                "name": thing.class_name[:_LONGEST_TEXT],
                "box": thing.bbox,
                "visible": round(thing.visible_fraction, 3),
                "text": thing.text[:_LONGEST_TEXT],
                "ignored": thing.ignored,
            }
            for thing in view.objects[:_MOST_BOXES]
            if thing.bbox is not None and not thing.background
        ],
    }


def _encoded(image: NDArray[np.uint8], longest: int) -> str:
    """Return an image as the data URI of a JPEG with sides of at most `longest` pixels."""
    scale = longest / max(image.shape[:2])
    if scale < 1:
        height, width = (max(round(side * scale), 1) for side in image.shape[:2])
        image = np.asarray(
            cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8
        )
    data = simplejpeg.encode_jpeg(np.ascontiguousarray(image), quality=_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(data).decode()

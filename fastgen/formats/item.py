"""One image with its labels, as formats get it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import is_detection
from fastgen.config.config import LabelConfig
from fastgen.files.images import jpeg
from fastgen.formats import coco
from fastgen.labels.background import background_masks
from fastgen.labels.visibility import window
from fastgen.sample import Box, Object, Sample


@dataclass(frozen=True, eq=False)
class Item:
    """A sample and its place in a dataset.

    Values that several formats need are computed on first use and kept.

    Attributes:
        sample: The image with its labels.
        split: train, val or test.
        stem: Name of its files without the suffix: seed, scene and camera, as in s7_000017_A.
        number: Position of the image in the whole dataset.
        rules: Limits below which labels are ignored or left out.
        polygons: Write COCO masks that are not crowds as polygons instead of run lengths.
    """

    sample: Sample
    split: str
    stem: str
    number: int
    rules: LabelConfig
    polygons: bool = True

    @property
    def image_path(self) -> str:
        """Path of the image relative to the dataset."""
        return f"images/{self.split}/{self.stem}.jpg"

    @property
    def container(self) -> Object | None:
        """The first container, visible or not; None if the scene has none."""
        return next(iter(self.containers), None)

    @property
    def containers(self) -> list[Object]:
        """The containers of the scene, visible or not, without those of the background."""
        return [
            thing
            for thing in self.sample.objects
            if thing.class_name == "container" and not thing.background
        ]

    @property
    def detections(self) -> Iterator[tuple[Object, Box]]:
        """Containers, texts and markers that have visible pixels.

        Each comes with the box (x0, y0, x1, y1) of these pixels; x1 and y1 are exclusive.
        """
        return detections(self.sample.objects)

    @cached_property
    def container_annotations(self) -> dict[int, dict[str, Any]]:
        """COCO annotation of each visible container by its id, category 1 of each task."""
        found = {}
        for thing in self.containers:
            if thing.bbox is not None:
                part = window(self.sample.container_mask(thing.container), thing.bbox)
                found[thing.id] = self.annotation(1, thing.bbox, part, thing.ignored)
        return found

    @cached_property
    def background_annotations(self) -> list[dict[str, Any]]:
        """COCO annotations of the visible containers of the panorama, category 1 of each task.

        Each has the additional key `background`, which is true.
        """
        return [
            {**self.annotation(1, box, part, thing.ignored), "background": True}
            for thing, box, part in background_masks(self.sample)
        ]

    def annotation(
        self, category_id: int, box: Box, part: NDArray[np.bool_], ignored: bool
    ) -> dict[str, Any]:
        """Return `coco.annotation` of an instance in this image."""
        size = self.sample.view.size
        return coco.annotation(category_id, box, part, size, ignored, self.polygons)

    @cached_property
    def jpeg(self) -> bytes:
        """The image as JPEG."""
        return jpeg(self.sample.image)


def detections(objects: Iterable[Object]) -> Iterator[tuple[Object, Box]]:
    """Yield containers, texts and markers that have visible pixels.

    Each comes with the box (x0, y0, x1, y1) of these pixels; x1 and y1 are exclusive. Ignored
    objects are included.
    """
    for thing in objects:
        if is_detection(thing.class_name) and thing.bbox is not None:
            yield thing, thing.bbox

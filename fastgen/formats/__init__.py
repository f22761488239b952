"""Formats: what a sample becomes in the files that trainers read.

A format is one small class in a module of this package with an instance called FORMAT; adding one
adds one file. Formats are pure: pixels and labels in, bytes out. Where the bytes go, and that they
arrive whole, is the business of dataset/.
"""

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.classes import CONTAINER_ID, DETECTION_CLASSES
from fastgen.config.config import LabelConfig
from fastgen.files.images import jpeg
from fastgen.formats import coco
from fastgen.labels.visibility import window
from fastgen.sample import Box, Object, Sample
from fastgen.scene import Scene
from fastgen.validation import check_known

SEAFRONT = ("damage", "imdg", "container", "text", "door")
"""The formats that `--format seafront` always writes: the paper's tasks, and the container."""


@dataclass(frozen=True)
class Same:
    """A file that holds the bytes of another of the same sample."""

    path: str


Files = dict[str, bytes | Same]
"""Content by path relative to the dataset, with forward slashes."""

Record = dict[str, Any]
"""One image for those who come after: stem, split, size [width, height], and facts by format."""

Records = Callable[[], Iterable[Record]]
"""The records of one split in order; each call goes through them from the start."""

Read = Callable[[str], bytes]
"""Returns the content of a file of a dataset by its path relative to the dataset."""

Label = tuple[str, Sequence[float]]
"""Class name, and box as x, y, width and height in pixels."""

DatasetFiles = Iterator[tuple[str, Iterable[str] | bytes]]
"""Files over a whole split: path, and text piece by piece or bytes."""


@dataclass(frozen=True, eq=False)
class Item:
    """A sample on its way into files. stem: 000017_A. number: of the image in the whole dataset."""

    sample: Sample
    split: str
    stem: str
    number: int
    rules: LabelConfig

    @property
    def image_path(self) -> str:
        """Where the image itself lies."""
        return f"images/{self.split}/{self.stem}.jpg"

    @property
    def container(self) -> Object:
        """The container, seen or not."""
        return next(thing for thing in self.sample.objects if thing.id == CONTAINER_ID)

    @property
    def detections(self) -> Iterator[tuple[Object, Box]]:
        """As `detections`, of the sample's objects."""
        return detections(self.sample.objects)

    @cached_property
    def container_annotation(self) -> dict[str, Any] | None:
        """The container as COCO has it, category 1 of every task; None where it is not seen."""
        thing, sample = self.container, self.sample
        if thing.bbox is None:
            return None
        part = window(sample.damage, thing.bbox) > 0
        return coco.annotation(1, thing.bbox, part, sample.view.size, thing.ignored)

    @cached_property
    def jpeg(self) -> bytes:
        """The image as JPEG."""
        return jpeg(self.sample.image)


def detections(objects: Iterable[Object]) -> Iterator[tuple[Object, Box]]:
    """What the marker task labels, ignored or not, each with its visible box."""
    for thing in objects:
        if thing.class_name in DETECTION_CLASSES and thing.bbox is not None:
            yield thing, thing.bbox


class Format(ABC):
    """One label format: the files of each sample, and what dataset code needs to know of them.

    A subclass has one instance, which its module calls FORMAT.

    Attributes:
        name: Name on the command line and key of `Record["facts"]`.
        classes: Class names of its labels in order; empty where labels have no classes.
        needs_normals: `sample_files` reads `Sample.normals`, which cost another draw.
        fits_archives: The webdataset layout can hold this format, because `sample_files` alone
            gives everything a reader needs.
    """

    name: str
    classes: tuple[str, ...] = ()
    needs_normals: bool = False
    fits_archives: bool = True

    @abstractmethod
    def sample_files(self, item: Item) -> tuple[Files, Any]:
        """Return the files of one sample, and facts about it as JSON values.

        The shard's manifest keeps the facts; the other methods work on them.
        """

    def dataset_files(self, split: str, records: Records) -> DatasetFiles:
        """Yield the path and content of each file that covers a whole split."""
        return iter(())

    def folders(self, split: str) -> Sequence[str]:
        """Return folders that readers expect even when they are empty."""
        return ()

    def labels(self, facts: Any) -> Iterable[Label]:
        """Return the labels to train on in one image with these facts, ignored ones left out."""
        return ()

    def counts(self, facts: Iterable[Any]) -> dict[str, int]:
        """Count labels over the images with these facts, under the names used in dataset.json.

        Without images, return every name with 0.
        """
        return {}

    def draw(self, picture: NDArray[np.uint8], read: Read, name: str) -> None:  # noqa: B027
        """Draw the labels of one image, as its label file has them, into `picture` in place.

        Args:
            picture: uint8 RGB [H, W, 3], the image at any scale.
            read: Returns the content of a file of the dataset by its path.
            name: SPLIT/STEM of the image.

        Raises:
            ValueError, IndexError: The label file cannot be read.
        """

    def check(self, record: Record, read: Read) -> Iterable[str]:
        """Return a line "PATH: FAULT" for each label file of one image that contradicts others."""
        return ()

    def check_split(self, split: str, facts: list[Any], read: Read) -> Iterable[str]:
        """Return a line "PATH: FAULT" for each file of a split that contradicts the facts.

        Args:
            split: train, val or test.
            facts: Facts of the split's images in order.
            read: Returns the content of a file of the dataset by its path.
        """
        return ()


@cache
def known_formats() -> dict[str, Format]:
    """All formats of this package by name."""
    found: dict[str, Format] = {}
    for module in pkgutil.iter_modules(__path__):
        made = getattr(importlib.import_module(f"{__name__}.{module.name}"), "FORMAT", None)
        if made is not None:
            found[made.name] = made
    return found


def formats_of(names: Sequence[str]) -> list[Format]:
    """Formats by name. Raises ConfigError for an unknown one."""
    known = known_formats()
    for name in names:
        if name not in known:
            check_known("also", name, set(known) - set(SEAFRONT))
    return [known[name] for name in names]


def assemble(item: Item, formats: Sequence[Format]) -> tuple[Files, Record]:
    """All files of one sample, its image first and its scene last, and its record."""
    files: Files = {item.image_path: item.jpeg}
    facts = {}
    for each in formats:
        more, facts[each.name] = each.sample_files(item)
        files.update(more)
    record = {
        "stem": item.stem,
        "split": item.split,
        "size": list(item.sample.view.size),
        "facts": facts,
    }
    files[f"scenes/{item.split}/{item.stem}.json"] = _scene_file(item)
    return files, record


def _scene_file(item: Item) -> bytes:
    """The Scene, the camera in numbers that other tools take, and all Objects."""
    sample = item.sample
    head = {
        "stem": item.stem,
        "split": item.split,
        "camera": sample.camera.name,
        "size": list(sample.view.size),
        "view": view_values(sample.view),
        "objects": [vars(thing) for thing in sample.objects],
    }
    return orjson.dumps(head)[:-1] + b',"scene":' + _scene_json(sample.scene) + b"}"


def view_values(view: View) -> dict[str, Any]:
    """Camera in OpenCV's convention (x right, y down, z forward), but for pixel coordinates: here
    the first pixel's centre is (0.5, 0.5). rotation and translation_mm take world to camera.
    distortion: OpenCV's coefficients, of cv2.fisheye where distortion_model is fisheye, none for a
    pinhole."""
    lens = view.distortion.lens if view.distortion else None
    return {
        "intrinsics": view.intrinsics.tolist(),
        "distortion_model": lens.model if lens else "pinhole",
        "distortion": list(lens.coefficients) if lens else [],
        "rotation": view.rotation.tolist(),
        "translation_mm": view.translation_mm.tolist(),
    }


@lru_cache(maxsize=2)
def _scene_json(scene: Scene) -> bytes:
    """The scene as JSON text; all cameras of a scene share it."""
    return orjson.dumps(scene)

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

import orjson

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
    """What every format does, in a subclass with one instance."""

    name: str

    @abstractmethod
    def sample_files(self, item: Item) -> tuple[Files, Any]:
        """Files of one sample, and JSON facts that `dataset_files` will need of it."""

    def dataset_files(self, split: str, records: Records) -> DatasetFiles:
        """Files over all samples of a split: path, and text piece by piece or bytes."""
        return iter(())

    def folders(self, split: str) -> Sequence[str]:
        """Folders that readers expect even where nothing is in them."""
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

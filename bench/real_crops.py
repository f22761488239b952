"""Labelled real pictures in a folder, for measuring only.

docs/benchmarks.md describes the layout of the folder. Every part may be missing, and further
columns of its tables and keys of its COCO file are ignored.
"""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from fastgen.classes import MARKER_CLASSES
from fastgen.decals.iso6346 import check_digit
from fastgen.errors import ConfigError
from fastgen.validation import check_known

LAYOUTS = ("rows", "block", "column")
"""Layouts of an identifier: one line, several lines, letters below one another."""

DAMAGE_KINDS = ("dent", "hole")

Pixels = NDArray[np.uint8]
"""RGB picture [H, W, 3]."""

_CODE = re.compile("[A-Z]{4}[0-9]{7}")
_PLACARD_KINDS = ("exact", "near")
_PICTURES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True, eq=False)
class Placard:
    """Picture of a marker, and its class."""

    pixels: Pixels
    class_name: str


@dataclass(frozen=True, eq=False)
class RealIdentifier:
    """Picture of an identifier.

    Attributes:
        pixels: The picture.
        code: Owner code, serial number and check digit, 11 characters.
        layout: One of LAYOUTS.
        on_end: True on an end of the container, False on a long side.
    """

    pixels: Pixels
    code: str
    layout: str
    on_end: bool


@dataclass(frozen=True, eq=False)
class PanelPair:
    """A damaged and an undamaged panel of one photograph, or of one view of a rendered scene.

    `kind` is one of DAMAGE_KINDS, or the damage class in a render.
    """

    damaged: Pixels
    undamaged: Pixels
    kind: str


@dataclass(frozen=True, eq=False)
class BoxedImage:
    """Photograph or render with the visible boxes of its containers.

    Attributes:
        pixels: The picture.
        boxes: Boxes x0, y0, x1, y1 in pixels [N, 4], float64.
        ignored: Boxes that need not be found and whose detection is not wrong, bool [N].
        preset: Preset of a render, '' for a photograph.
    """

    pixels: Pixels
    boxes: NDArray[np.float64]
    ignored: NDArray[np.bool_]
    preset: str = ""


@dataclass(frozen=True, eq=False)
class RealCrops:
    """Everything that a folder holds. Parts that it does not have are empty."""

    placards: tuple[Placard, ...]
    identifiers: tuple[RealIdentifier, ...]
    panels: tuple[PanelPair, ...]
    photos: tuple[Pixels, ...]
    boxed: tuple[BoxedImage, ...]


def load_real(folder: Path) -> RealCrops:
    """Read a folder of real pictures.

    Raises:
        ConfigError: The folder is missing or has none of the parts, a picture is missing, or a row
            or an annotation has an invalid value. The message names the file and the place in it.
    """
    if not folder.is_dir():
        raise ConfigError(f"{folder}: there is no such folder")
    found = RealCrops(
        tuple(_placards(folder)),
        tuple(_identifiers(folder)),
        tuple(_panels(folder)),
        tuple(_photos(folder / "look")),
        tuple(_boxed(folder)),
    )
    if not any(vars(found).values()):
        raise ConfigError(
            f"{folder}: has no placards.csv, identifiers.csv, damage.csv, containers.json or look/ "
            "with pictures; see docs/benchmarks.md for the layout"
        )
    return found


def read_picture(path: Path) -> Pixels:
    """Return the RGB pixels [H, W, 3] of a picture.

    Raises:
        ConfigError: The file is missing or is not a picture.
    """
    if not path.is_file():
        raise ConfigError(f"{path}: the picture is missing")
    pixels = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        raise ConfigError(f"{path}: is not a JPEG or PNG picture")
    return np.ascontiguousarray(pixels[:, :, ::-1]).astype(np.uint8)


def _placards(folder: Path) -> Iterator[Placard]:
    for place, row in _rows(folder / "placards.csv", ("file", "class", "kind")):
        check_known(f"{place}: kind", row["kind"], _PLACARD_KINDS)
        if row["kind"] == "exact":
            check_known(f"{place}: class", row["class"], MARKER_CLASSES)
            yield Placard(_picture(folder, row["file"], place), row["class"])


def _identifiers(folder: Path) -> Iterator[RealIdentifier]:
    for place, row in _rows(folder / "identifiers.csv", ("file", "code", "layout", "view")):
        code = row["code"]
        if not _CODE.fullmatch(code):
            raise ConfigError(
                f"{place}: code: {code!r} is not four capital letters, six digits and a check digit"
            )
        if check_digit(code[:10]) != int(code[10]):
            raise ConfigError(
                f"{place}: code: the check digit of {code[:10]} is {check_digit(code[:10])}, not "
                f"{code[10]}"
            )
        check_known(f"{place}: layout", row["layout"], LAYOUTS)
        check_known(f"{place}: view, first letter", row["view"][:1], ("A", "L", "R"))
        pixels = _picture(folder, row["file"], place)
        yield RealIdentifier(pixels, code, row["layout"], row["view"].startswith("A"))


def _panels(folder: Path) -> Iterator[PanelPair]:
    for place, row in _rows(folder / "damage.csv", ("pair", "kind")):
        check_known(f"{place}: kind", row["kind"], DAMAGE_KINDS)
        damaged, undamaged = (
            _picture(folder, f"damage/{row['pair']}_{end}.jpg", place) for end in ("pos", "neg")
        )
        yield PanelPair(damaged, undamaged, row["kind"])


def _photos(folder: Path) -> Iterator[Pixels]:
    for path in sorted(folder.glob("*")):
        if path.suffix.lower() in _PICTURES:
            yield read_picture(path)


class _CocoImage(BaseModel):
    id: int
    file_name: str


class _CocoBox(BaseModel):
    image_id: int
    category_id: int
    bbox: tuple[float, float, float, float]
    iscrowd: int = 0


class _CocoCategory(BaseModel):
    id: int
    name: str


class _Coco(BaseModel):
    images: list[_CocoImage]
    annotations: list[_CocoBox]
    categories: list[_CocoCategory]


def _boxed(folder: Path) -> Iterator[BoxedImage]:
    """Yield the images of containers.json with their annotations of the category container."""
    path = folder / "containers.json"
    if not path.exists():
        return
    try:
        coco = _Coco.model_validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(key) for key in first["loc"])
        raise ConfigError(f"{path}{place and ': '}{place}: {first['msg']}") from None
    if not coco.images:
        raise ConfigError(f"{path}: images: is empty; add your photographs, or remove the file")
    known = {each.id for each in coco.images}
    for k, each in enumerate(coco.annotations):
        if each.image_id not in known:
            raise ConfigError(
                f"{path}: annotations.{k}.image_id: no image has the id {each.image_id}; add "
                "the image or remove the annotation"
            )
    chosen = [each.id for each in coco.categories if each.name == "container"]
    if not chosen:
        raise ConfigError(f"{path}: categories: has no category named 'container'; rename yours")
    for image in coco.images:
        pixels = _picture(folder, image.file_name, f"{path}, image {image.id}")
        height, width = pixels.shape[:2]
        own = [
            each
            for each in coco.annotations
            if each.image_id == image.id and each.category_id in chosen
        ]
        boxes = np.array([each.bbox for each in own], float).reshape(-1, 4)
        boxes[:, 2:] += boxes[:, :2]
        boxes = boxes.clip(0, [width, height, width, height])
        empty = np.flatnonzero((boxes[:, 2:] <= boxes[:, :2]).any(axis=1))
        if len(empty):
            raise ConfigError(
                f"{path}, image {image.id}: bbox {list(own[empty[0]].bbox)} has no area inside "
                f"{image.file_name} of {width}x{height} pixels; give x, y, width and height"
            )
        yield BoxedImage(pixels, boxes, np.array([each.iscrowd > 0 for each in own], bool))


def _picture(folder: Path, name: str, place: str) -> Pixels:
    try:
        return read_picture(folder / name)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None


def _rows(path: Path, columns: Sequence[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield 'FILE, row N' and the values of each row. A missing file has no rows."""
    if not path.exists():
        return
    with path.open(encoding="utf-8-sig", newline="") as file:
        table = csv.DictReader(file)
        missing = [name for name in columns if name not in (table.fieldnames or ())]
        if missing:
            raise ConfigError(f"{path}: has no column {missing[0]!r}; it needs {','.join(columns)}")
        for row in table:
            values = {name: (row[name] or "").strip() for name in columns}
            yield f"{path}, row {table.line_num}", values

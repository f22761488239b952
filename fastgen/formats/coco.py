"""COCO annotations, run-length masks and files, shared by the formats that write them.

Sources: cocodataset.org, "Data format", and the notes of its mask API.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.formats import outlines
from fastgen.sample import Box

_LICENSE = {
    "id": 1,
    "name": "CC0 1.0",
    "url": "https://creativecommons.org/publicdomain/zero/1.0/",
}


_GROUP_SHIFTS = 5 * np.arange(12)


def rle(part: NDArray[np.bool_], corner: tuple[int, int], size: tuple[int, int]) -> dict[str, Any]:
    """Encode a mask as COCO's compressed run lengths, which go down the columns from zeros.

    pycocotools gives the same bytes, but it encodes whole masks, which takes several times as long.

    Args:
        part: bool [h, w], a window of the mask that contains all its pixels.
        corner: (x, y) of the window's first pixel.
        size: (width, height) of the mask.

    Returns:
        {"size": [height, width], "counts": text}.
    """
    (x, y), (width, height) = corner, size
    padded = np.zeros((part.shape[0] + 2, part.shape[1]), bool)
    padded[1:-1] = part
    # positions in the whole mask, column by column, where a run of ones starts or has ended
    row, column = np.divmod(np.flatnonzero(padded[1:] != padded[:-1]), part.shape[1])
    edges = np.sort((x + column) * height + y + row)
    # a run that continues in the next column ends and starts at the same position
    again = edges[1:] == edges[:-1]
    once = np.ones(len(edges), bool)
    once[1:][again] = once[:-1][again] = False
    edges = np.concatenate([[0], edges[once], [width * height]])
    counts = edges[1:] - edges[:-1]
    if len(edges) > 2 and edges[-1] == edges[-2]:
        counts = counts[:-1]
    return {"size": [height, width], "counts": _packed(counts)}


def _packed(counts: NDArray[np.int64]) -> str:
    """Return run lengths as COCO's text.

    From the fourth on, a run length is stored as its difference to the one two places before. Each
    number becomes groups of 5 bits, lowest first. Bit 0x20 says that more groups follow; the top
    bit of the last group is the sign. A character is a group plus 48.
    """
    rest = counts.astype(np.int64)
    rest[3:] -= counts[1:-2]
    # column g: the number without its lowest g groups
    most = int(np.abs(rest).max()).bit_length() // 5 + 1
    left = rest[:, None] >> _GROUP_SHIFTS[: most + 1]
    group = left[:, :-1] & 0x1F
    # a group is the last if the rest only repeats its sign bit
    more = left[:, 1:] != -(group >> 4)
    used = np.ones(group.shape, bool)
    np.logical_and.accumulate(more[:, :-1], axis=1, out=used[:, 1:])
    text: str = (group + 0x20 * more + 48)[used].astype(np.uint8).tobytes().decode("ascii")
    return text


def polygons_text(part: NDArray[np.bool_], corner: tuple[int, int]) -> str:
    """Return the polygons of a mask, from which pycocotools makes the same mask, as JSON.

    Args:
        part: bool [h, w], a window of the mask that contains all its pixels.
        corner: (x, y) of the window's first pixel.

    Returns:
        Text [[x0,y0,x1,y1,...],...].
    """
    return _json([(loop + corner).astype(int).ravel().tolist() for loop in outlines.polygons(part)])


def annotation(
    category_id: int,
    box: Box,
    part: NDArray[np.bool_],
    size: tuple[int, int],
    ignored: bool,
    polygons: bool,
) -> dict[str, Any]:
    """Return the annotation of one instance as records hold it, without its ids.

    `file_text` writes both kinds of mask as `segmentation`. Records keep polygons as text under
    `polygons`, because lists of numbers take ten times the memory.

    Args:
        category_id: Category, from 1.
        box: Visible box in pixels.
        part: bool [h, w], the instance's pixels within the box.
        size: (width, height) of the image.
        ignored: Mark the instance as a crowd. Scorers neither expect nor punish its detection.
        polygons: Write the mask as polygons. Those of crowds are always run lengths, as in COCO.
    """
    x0, y0, x1, y1 = box
    in_polygons = polygons and not ignored
    return {
        "category_id": category_id,
        "bbox": [x0, y0, x1 - x0, y1 - y0],
        "area": int(np.count_nonzero(part)),
        **(
            {"polygons": polygons_text(part, (x0, y0))}
            if in_polygons
            else {"segmentation": rle(part, (x0, y0), size)}
        ),
        "iscrowd": int(ignored),
    }


def trained_on(annotations: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the annotations that are not ignored."""
    return [item for item in annotations if not item["iscrowd"]]


def labels(
    annotations: Iterable[dict[str, Any]], classes: Sequence[str]
) -> Iterator[tuple[str, Sequence[float]]]:
    """Yield class name and box (x, y, width, height) of each annotation that is not ignored."""
    for item in trained_on(annotations):
        yield classes[item["category_id"] - 1], item["bbox"]


def has_annotations(text: bytes, annotations: list[dict[str, Any]]) -> bool:
    """Return whether a COCO file holds exactly these annotations, apart from their ids."""
    found = json.loads(text)["annotations"]
    for item in found:
        item.pop("id", None)
        item.pop("image_id", None)
        if isinstance(item.get("segmentation"), list):
            item["polygons"] = _json(item.pop("segmentation"))
    return bool(annotations == found)


@dataclass(frozen=True)
class Task:
    """A task whose labels are COCO annotations.

    Attributes:
        name: Name of its format, whose facts are the annotations, and of its folder.
        description: Description of the dataset.
        categories: Categories in the order of their ids.
        usual: Number of categories that a file lists, from the first. If an annotation has a
            later category, the file lists all: scenes made by hand may contain objects that the
            configuration does not draw.
        more: Keys that its annotations have beside those of `annotation`, each with the value that
            stands for a missing key: "" for text, () for a list of numbers.
    """

    name: str
    description: str
    categories: Sequence[dict[str, Any]]
    usual: int
    more: tuple[tuple[str, str | tuple[()]], ...] = ()

    def split_file(
        self, split: str, records: Callable[[], Iterable[dict[str, Any]]]
    ) -> tuple[str, Iterator[str]]:
        """Return path and text of a split's file, whose image names start at the dataset."""
        return f"{self.name}/coco_{split}.json", file_text(self, records, f"images/{split}/")


def file_text(
    task: Task, records: Callable[[], Iterable[dict[str, Any]]], folder: str
) -> Iterator[str]:
    """Yield a COCO file in pieces, so that memory does not depend on its size.

    Args:
        task: The task.
        records: Returns the images' records; each call starts from the beginning.
        folder: Start of each image's `file_name`.
    """
    from fastgen import __version__

    usual = task.usual
    info = {
        "description": task.description,
        "version": __version__,
        "contributor": "fastgen",
        "year": 2026,
        "url": "",
        "date_created": "",
    }
    yield f'{{"info":{_json(info)},"licenses":[{_json(_LICENSE)}],"images":['
    for number, record in enumerate(records(), start=1):
        width, height = record["size"]
        image = {
            "id": number,
            "file_name": f"{folder}{record['stem']}.jpg",
            "width": width,
            "height": height,
            "license": 1,
        }
        yield ("," if number > 1 else "") + _json(image)
    yield '],"annotations":['
    count = 0
    for number, record in enumerate(records(), start=1):
        for item in record["facts"][task.name]:
            count += 1
            if item["category_id"] > usual:
                usual = len(task.categories)
            values = {"id": count, "image_id": number, **item}
            polygons = values.pop("polygons", None)
            mask = "" if polygons is None else f',"segmentation":{polygons}'
            yield f"{',' if count > 1 else ''}{_json(values)[:-1]}{mask}}}"
    # after the annotations, which determine how many categories are listed
    yield f'],"categories":{_json(task.categories[:usual])}}}'


def columns(annotations: Sequence[dict[str, Any]], task: Task) -> dict[str, list[Any]]:
    """Return the annotations of one image as lists, one for each kind of value.

    Categories count from 0.
    """
    return {
        "bbox": [each["bbox"] for each in annotations],
        "category": [each["category_id"] - 1 for each in annotations],
        "area": [each["area"] for each in annotations],
        "iscrowd": [bool(each["iscrowd"]) for each in annotations],
        **{key: [each.get(key, empty) for each in annotations] for key, empty in task.more},
    }


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))

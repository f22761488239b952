"""COCO masks and files. Format: cocodataset.org, 'Data format', and its mask API's notes."""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastgen.sample import Box

_LICENSE = {
    "id": 1,
    "name": "CC0 1.0",
    "url": "https://creativecommons.org/publicdomain/zero/1.0/",
}


_GROUP_SHIFTS = 5 * np.arange(12)


def rle(part: NDArray[np.bool_], corner: tuple[int, int], size: tuple[int, int]) -> dict[str, Any]:
    """Compressed run-length encoding of a mask: {'size': [H, W], 'counts': text}.

    part: bool [h, w], what is not all zeros of the mask; corner: (x, y) of its first pixel in the
    mask of `size` (width, height). Runs go down the columns and begin with zeros.
    """
    (x, y), (width, height) = corner, size
    padded = np.zeros((part.shape[0] + 2, part.shape[1]), bool)
    padded[1:-1] = part
    # where columns begin and end to be set, in the order of the whole mask
    row, column = np.divmod(np.flatnonzero(padded[1:] != padded[:-1]), part.shape[1])
    edges = np.sort((x + column) * height + y + row)
    # a run that goes on in the next column ends and begins at one place
    again = edges[1:] == edges[:-1]
    once = np.ones(len(edges), bool)
    once[1:][again] = once[:-1][again] = False
    edges = np.concatenate([[0], edges[once], [width * height]])
    counts = edges[1:] - edges[:-1]
    if len(edges) > 2 and edges[-1] == edges[-2]:
        counts = counts[:-1]
    return {"size": [height, width], "counts": _packed(counts)}


def _packed(counts: NDArray[np.int64]) -> str:
    """Run lengths as text: from the fourth on as differences to the one two before, then signed
    groups of 5 bits, lowest first, 0x20 marking that more follow, offset by 48."""
    rest = counts.astype(np.int64)
    rest[3:] -= counts[1:-2]
    # what is left at each group, the number itself first; none is longer than the longest's
    most = int(np.abs(rest).max()).bit_length() // 5 + 1
    left = rest[:, None] >> _GROUP_SHIFTS[: most + 1]
    group = left[:, :-1] & 0x1F
    # the sign bit of a last group is that of all that is left
    more = left[:, 1:] != -(group >> 4)
    used = np.ones(group.shape, bool)
    np.logical_and.accumulate(more[:, :-1], axis=1, out=used[:, 1:])
    return (group + 0x20 * more + 48)[used].astype(np.uint8).tobytes().decode("ascii")


def annotation(
    category_id: int,
    box: Box,
    part: NDArray[np.bool_],
    size: tuple[int, int],
    ignored: bool,
) -> dict[str, Any]:
    """One instance: category, box (x, y, width, height), area and mask.

    part: bool [h, w], its pixels within the box. size: (width, height) of the image. An ignored one
    is a crowd, which scorers neither ask for nor punish.
    """
    x0, y0, x1, y1 = box
    return {
        "category_id": category_id,
        "bbox": [x0, y0, x1 - x0, y1 - y0],
        "area": int(np.count_nonzero(part)),
        "segmentation": rle(part, (x0, y0), size),
        "iscrowd": int(ignored),
    }


def trained_on(annotations: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those that are not ignored."""
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
    return annotations == [
        {key: value for key, value in item.items() if key not in ("id", "image_id")}
        for item in found
    ]


def file_text(
    description: str,
    categories: Sequence[dict[str, Any]],
    records: Callable[[], Iterable[dict[str, Any]]],
    facts: str,
) -> Iterator[str]:
    """A COCO file piece by piece, so that its size does not matter.

    records: each call goes through the images' records again. facts: whose annotations.
    """
    from fastgen import __version__

    info = {
        "description": description,
        "version": __version__,
        "contributor": "fastgen",
        "year": 2026,
        "url": "",
        "date_created": "",
    }
    yield f'{{"info":{_json(info)},"licenses":[{_json(_LICENSE)}],'
    yield f'"categories":{_json(categories)},"images":['
    for number, record in enumerate(records(), start=1):
        width, height = record["size"]
        image = {
            "id": number,
            "file_name": f"images/{record['split']}/{record['stem']}.jpg",
            "width": width,
            "height": height,
            "license": 1,
        }
        yield ("," if number > 1 else "") + _json(image)
    yield '],"annotations":['
    count = 0
    for number, record in enumerate(records(), start=1):
        for item in record["facts"][facts]:
            count += 1
            yield ("," if count > 1 else "") + _json({"id": count, "image_id": number, **item})
    yield "]}"


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))

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
    again = np.flatnonzero(edges[1:] == edges[:-1])
    edges = np.delete(edges, np.concatenate([again, again + 1]))
    edges = np.concatenate([[0], edges, [width * height]])
    counts = np.diff(edges)
    if len(edges) > 2 and edges[-1] == edges[-2]:
        counts = counts[:-1]
    return {"size": [height, width], "counts": _packed(counts)}


def _packed(counts: NDArray[np.int64]) -> str:
    """Run lengths as text: from the fourth on as differences to the one two before, then signed
    groups of 5 bits, lowest first, 0x20 marking that more follow, offset by 48."""
    rest = counts.astype(np.int64)
    rest[3:] -= counts[1:-2]
    columns, used = [], []
    open_ = np.ones(len(rest), bool)
    while open_.any():
        group = rest & 0x1F
        rest = rest >> 5
        more = np.where(group & 0x10, rest != -1, rest != 0)
        columns.append(group + np.where(more, 0x20, 0) + 48)
        used.append(open_)
        open_ = open_ & more
    text = np.stack(columns, axis=1)[np.stack(used, axis=1)]
    return text.astype(np.uint8).tobytes().decode("ascii")


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

"""Boxes of containers beside photographs, and the camera distances that they imply."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fastgen.config.config import Config
from fastgen.errors import AssetError
from fastgen.files.plain_file import read_plain
from fastgen.fit.photographs import LARGEST_FILE, Photograph
from fastgen.scene.container_kinds import KINDS

BoxHeights = Sequence[float]
"""Height of the largest box of each photograph, as a share of the photograph's height."""

_TOUCHES = 0.005
"""Boxes closer than this share to the upper or lower border may be cut off."""

_OUTSIDE = 0.05
"""Share of the image's height by which boxes may reach beyond it."""

_LEAST_HEIGHT = 0.02
"""Height of the smallest boxes that say something about the distance of a camera."""

_QUANTILES = (10, 90)
_SIDES = ("front", "back", "door", "no_door")


def read_box_heights(folder: Path, photographs: Sequence[Photograph]) -> list[float]:
    """Return the height of the largest box of each photograph that has one.

    Boxes come from COCO files (*.json in the folder, with `images` and `annotations`) or from YOLO
    files (NAME.txt beside NAME.jpg, lines of class, centre x, centre y, width, height). All boxes
    count as containers, except COCO categories whose name does not contain "container" in a file
    that has such a category.

    Raises:
        AssetError: A file of boxes cannot be read; the message names it.
    """
    found: dict[str, list[tuple[float, float]]] = {}
    for path in sorted(folder.glob("*.json")):
        for name, ends in _coco(path, photographs):
            found.setdefault(name, []).append(ends)
    for photograph in photographs:
        path = photograph.path.with_suffix(".txt")
        if path.exists():
            found.setdefault(photograph.path.name, []).extend(_yolo(path))
    largest = (max(boxes, key=lambda ends: ends[1] - ends[0]) for boxes in found.values() if boxes)
    return [
        low - top
        for top, low in largest
        if top > _TOUCHES and low < 1 - _TOUCHES and low - top > _LEAST_HEIGHT
    ]


def camera_distances(preset: Config, heights: BoxHeights) -> tuple[dict[str, Any], str]:
    """Return the rig with distances at which containers are as high as in photographs.

    A wall of height h at distance d has an image of f h / d on a sensor, so d follows from the
    share of the image's height. Images are taken as 4:3. Cameras of roofs and undersides stay.

    Args:
        preset: Configuration with the rig and the kinds of containers.
        heights: Heights of boxes.

    Returns:
        Values of `cameras` and what was measured.
    """
    weights = preset.container.kinds
    tall = sum(KINDS[kind].size_mm[2] * share for kind, share in weights.items())
    tall /= sum(weights.values())
    high, low = np.percentile(heights, _QUANTILES[::-1])
    rig: dict[str, Any] = {}
    for name, camera in preset.cameras.items():
        rig[name] = {}
        if camera.face in _SIDES:
            one_mm = camera.focal_mm * tall / (camera.sensor_width_mm * 3 / 4)
            rig[name] = {"distance_mm": [float(round(one_mm / share, -1)) for share in (high, low)]}
    words = f"boxes of {len(heights)} photographs are {low:.0%} to {high:.0%} of the image high"
    return rig, words


def _coco(
    path: Path, photographs: Sequence[Photograph]
) -> Iterator[tuple[str, tuple[float, float]]]:
    try:
        data = json.loads(read_plain(path, LARGEST_FILE))
        if not isinstance(data, dict) or "annotations" not in data:
            return  # some other JSON file
        images = {each["id"]: each for each in data["images"]}
        names = {each["id"]: str(each["name"]) for each in data.get("categories", [])}
        wanted = {key for key, name in names.items() if "container" in name.lower()} or set(names)
        known = {photograph.path.name for photograph in photographs}
        for each in data["annotations"]:
            image = images[each["image_id"]]
            name = Path(image["file_name"]).name
            if name in known and (not names or each["category_id"] in wanted):
                _, top, _, height = (float(v) for v in each["bbox"])
                yield name, _ends(top / image["height"], (top + height) / image["height"])
    except (OSError, ValueError, KeyError, TypeError, ArithmeticError, RecursionError) as error:
        raise AssetError(f"{path}: not a COCO file of boxes ({error!r})") from None


def _yolo(path: Path) -> Iterator[tuple[float, float]]:
    try:
        lines = read_plain(path, LARGEST_FILE).decode().splitlines()
    except (OSError, ValueError) as error:
        raise AssetError(f"{path}: not a YOLO file of boxes ({error}); move it away") from None
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        try:
            if len(words) > 6:  # a polygon; a sixth number is a confidence
                raise ValueError
            _, _, middle, _, height = (float(word) for word in words[:5])
            yield _ends(middle - height / 2, middle + height / 2)
        except ValueError:
            raise AssetError(
                f"{path}: line {number} is not a YOLO box; write class, centre x, centre y, width, "
                "height, as shares of the image"
            ) from None


def _ends(top: float, low: float) -> tuple[float, float]:
    """Return the ends of a box as shares of the image's height.

    Raises:
        ValueError: They are not those of a box in the image.
    """
    if not (top >= -_OUTSIDE and low <= 1 + _OUTSIDE and low > top):
        raise ValueError(f"a box from {top:g} to {low:g} of the image's height")
    return top, low

"""How much of an object is seen: what every kind of object's label has in common."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.classes import SPREADER_ID
from fastgen.config.config import Config
from fastgen.frame import Frame
from fastgen.geometry.mesh import Mesh
from fastgen.sample import Box
from fastgen.scene import Scene

FloatBox = tuple[float, float, float, float]

_EDGE_SHARE = 0.01
_EDGE_PX = 2
"""Up to this much of an object may be missing along its edges, where rasterizers differ by a
rounding, before something is said to hide it."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One image and all that explains it. mesh: the scene's container at rest; spreader: as of
    shapes.spreader_outline."""

    frame: Frame
    scene: Scene
    view: View
    mesh: Mesh
    spreader: Mesh | None
    config: Config

    @cached_property
    def container_box(self) -> Box | None:
        """Tight box of all that is the container's, what is printed on it and done to it."""
        # what is seen through two holes is the container's, though void
        return mask_box(self.frame.damage > 0)

    def boxes_on_container(
        self, target: NDArray[np.uint16], least: int, limit: int
    ) -> tuple[list[Box | None], NDArray[np.int64]]:
        """`value_boxes` of one of the frame's targets, for values that only the container has."""
        x0, y0, x1, y1 = self.container_box or (0, 0, 0, 0)
        found, areas = value_boxes(target[y0:y1, x0:x1], least, limit)
        return [b and (b[0] + x0, b[1] + y0, b[2] + x0, b[3] + y0) for b in found], areas

    @cached_property
    def spreader_shown(self) -> NDArray[np.bool_]:
        """Pixels [H, W] that see the spreader."""
        return self.frame.ids == SPREADER_ID

    @cached_property
    def spreader_box(self) -> Box | None:
        """Tight box of those."""
        return mask_box(self.spreader_shown) if self.spreader else None


class Visibility(TypedDict):
    """The members of Object that tell how much of a thing is seen."""

    visible_fraction: float
    truncated: bool
    occluded: bool
    ignored: bool


def visibility(config: Config, area: int, hidden: int, beyond: int) -> Visibility:
    """area: the object's visible pixels; hidden: those that it would cover alone as well; beyond:
    likewise outside the image."""
    whole = area + hidden + beyond
    fraction = area / whole if whole else 0.0
    rules = config.labels
    return {
        "visible_fraction": fraction,
        "truncated": bool(area) and beyond > 0,
        "occluded": bool(area) and hidden > max(_EDGE_PX, _EDGE_SHARE * (area + hidden)),
        "ignored": area < rules.min_visible_px or fraction < rules.min_visible_fraction,
    }


def mask_box(mask: NDArray[np.bool_]) -> Box | None:
    """Tight box of a mask [H, W], None where it is empty."""
    rows = np.flatnonzero(mask.any(axis=1))
    if not len(rows):
        return None
    y0, y1 = int(rows[0]), int(rows[-1]) + 1
    columns = np.flatnonzero(mask[y0:y1].any(axis=0))
    return int(columns[0]), y0, int(columns[-1]) + 1, y1


def value_boxes(
    target: NDArray[np.uint16], least: int, limit: int
) -> tuple[list[Box | None], NDArray[np.int64]]:
    """Tight boxes and areas of all values from `least` to below `limit` in one pass over them.

    target: uint16 [H, W]. Returns a list of limit - least boxes, None where a value is not seen,
    and int64 [limit - least] areas in pixels.
    """
    count = limit - least
    above = target - np.uint16(least)  # lower values wrap round to the greatest
    at = np.flatnonzero(above < count)
    found = above.ravel().take(at)
    # runs of one value in the target's one long line, which may go on from one row to the next
    last = np.ones(len(at), bool)
    last[:-1] = (at[1:] - at[:-1] != 1) | (found[1:] != found[:-1])
    end = np.flatnonzero(last)
    start = np.append(0, end[:-1] + 1)[: len(end)]
    found, length = found[end], end + 1 - start
    width = target.shape[1]
    (row, left), (until, right) = np.divmod(at[start], width), np.divmod(at[end], width)
    goes_on = until > row
    areas = np.bincount(found, length, count).astype(np.int64)
    x0, y0 = np.full((2, count), max(target.shape))
    x1, y1 = np.zeros((2, count), np.int64)
    # runs come row by row, and of those that write to one place the last stays
    y0[found[::-1]] = row[::-1]
    y1[found] = until + 1
    np.minimum.at(x0, found, np.where(goes_on, 0, left))
    np.maximum.at(x1, found, np.where(goes_on, width, right + 1))
    boxes: list[Box | None] = [None] * count
    for i in np.flatnonzero(areas).tolist():
        boxes[i] = int(x0[i]), int(y0[i]), int(x1[i]), int(y1[i])
    return boxes, areas


def float_boxes(bounds: NDArray[np.float64]) -> list[FloatBox | None]:
    """Bounds (x0, y0, x1, y1) [N, 4] to a thousandth of a pixel; None where they are not finite."""
    finite = np.asarray(np.isfinite(bounds).all(axis=1))
    return [
        (x0, y0, x1, y1) if known else None
        for (x0, y0, x1, y1), known in zip(np.round(bounds, 3).tolist(), finite, strict=True)
    ]


def window(target: NDArray[Any], box: Box) -> NDArray[Any]:
    """The part of `target` [H, W] within a box, as a view."""
    x0, y0, x1, y1 = box
    return target[y0:y1, x0:x1]

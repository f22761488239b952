"""Visibility of labelled objects: boxes, fractions and flags that all kinds of labels share."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypedDict

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.camera.sensor import along_rays
from fastgen.classes import DAMAGE_VALUES, SPREADER_ID
from fastgen.config.config import Config
from fastgen.frame import Frame
from fastgen.geometry.prepared_scene import Member, PreparedScene
from fastgen.geometry.solids import Body
from fastgen.sample import Box
from fastgen.scene import Scene
from fastgen.scene.limits import MM

FloatBox = tuple[float, float, float, float]

_EDGE_SHARE = 0.01
_EDGE_PX = 2
"""An object counts as occluded when more than this many of its pixels, or more than _EDGE_SHARE of
them, are hidden. Rasterizers differ by fewer pixels along edges."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One image with its camera and the geometry that it shows.

    Attributes:
        frame: The rendered image and its per-pixel labels.
        prepared: The scene.
        view: Projection of the camera.
        config: Configuration whose label rules apply.
        foreign: Pixels [H, W] that show other containers, None without any.
        blocking: Triangles around the other containers, in the frame of this one.
    """

    frame: Frame
    prepared: PreparedScene
    view: View
    config: Config
    foreign: NDArray[np.bool_] | None = None
    blocking: Body | None = None

    def of_member(self, member: Member) -> "Shot":
        """Return the image with one container of its scene alone, in the frame of the container."""
        damage = self.frame.damage
        mine = self._owner == member.number + 1
        return Shot(
            replace(self.frame, damage=np.asarray(cv2.copyTo(damage, mine.view(np.uint8)))),
            member.prepared,
            self.view.in_frame(member.pose),
            self.config,
            (self._owner > 0) & ~mine,
            self.prepared.others[member.number],
        )

    @cached_property
    def _owner(self) -> NDArray[np.uint8]:
        """Number of the container that each pixel [H, W] shows, plus 1; 0 for everything else."""
        damage = self.frame.damage
        numbers = np.zeros(max(int(damage.max()), *DAMAGE_VALUES) + 1, np.uint8)
        for each in self.prepared.members:
            carried = each.prepared.numbers
            numbers[[carried.undamaged, *carried.damages]] = each.number + 1
        return numbers.take(damage)

    @property
    def scene(self) -> Scene:
        """The scene as plain data."""
        return self.prepared.scene

    @property
    def lens(self) -> bool:
        """True if the view has lens distortion."""
        return self.view.distortion is not None

    @cached_property
    def container_box(self) -> Box | None:
        """Tight box of the container with its decals and damages."""
        # the ids have no container where two aligned holes show what is behind it
        return mask_box(self.frame.damage > 0)

    def boxes_on_container(
        self, target: NDArray[np.uint16], least: int, limit: int
    ) -> tuple[list[Box | None], NDArray[np.int64]]:
        """Return `value_boxes` of a target for values that occur only on the container."""
        x0, y0, x1, y1 = self.container_box or (0, 0, 0, 0)
        found, areas = value_boxes(target[y0:y1, x0:x1], least, limit)
        return [b and (b[0] + x0, b[1] + y0, b[2] + x0, b[3] + y0) for b in found], areas

    @cached_property
    def spreader_shown(self) -> NDArray[np.bool_]:
        """Pixels [H, W] that show the spreader."""
        shown: NDArray[np.bool_] = self.frame.ids == SPREADER_ID
        return shown

    @cached_property
    def hiding(self) -> NDArray[np.bool_] | None:
        """Pixels [H, W] that show what may hide the container; None if nothing is in the scene."""
        if self.foreign is not None:
            return self.spreader_shown | self.foreign
        return self.spreader_shown if self.prepared.spreader else None

    @cached_property
    def spreader_box(self) -> Box | None:
        """Tight box of the visible spreader."""
        return mask_box(self.spreader_shown) if self.prepared.spreader else None


def within_visibility(depth_m: NDArray[np.float32], view: View, scene: Scene) -> NDArray[np.bool_]:
    """Return the pixels [H, W] whose surface is within the visibility, along the ray, in fog.

    Args:
        depth_m: Depth [H, W] along the optical axis.
        view: Projection of the camera.
        scene: A scene with fog.
    """
    per_depth, _ = along_rays(view, scene.ground)
    near: NDArray[np.bool_] = depth_m * per_depth <= MM * scene.weather.visibility_mm
    return near


class Visibility(TypedDict):
    """The members of Object that describe how much of it is visible."""

    visible_fraction: float
    truncated: bool
    occluded: bool
    ignored: bool


def visibility(
    config: Config, size: tuple[int, int], area: int, hidden: int, beyond: int
) -> Visibility:
    """Return the visibility members of an object.

    An object with more pixels than the image counts as large as the image where its fraction
    decides whether it is ignored. Beside a camera, a container may have thousands of times as many.

    Args:
        config: Configuration with the label rules.
        size: (width, height) of the image in pixels.
        area: Visible pixels of the object.
        hidden: Other pixels of the image that the object would cover alone.
        beyond: Pixels outside the image that the object would cover alone.
    """
    whole = area + hidden + beyond
    fraction = area / whole if whole else 0.0
    return {
        "visible_fraction": fraction,
        "truncated": bool(area) and beyond > 0,
        "occluded": bool(area) and hidden > max(_EDGE_PX, _EDGE_SHARE * (area + hidden)),
        "ignored": too_little(config, size, area, whole),
    }


def too_little(config: Config, size: tuple[int, int], pixels: float, whole: float) -> bool:
    """Return whether an object is ignored because of its visible pixels.

    Args:
        config: Configuration with the label rules.
        size: (width, height) of the image in pixels.
        pixels: Visible pixels of the object.
        whole: Pixels that the object would cover alone in an image without borders.
    """
    shown = pixels / min(whole, size[0] * size[1]) if whole else 0.0
    return pixels < config.labels.min_visible_px or shown < config.labels.min_visible_fraction


def mask_box(mask: NDArray[np.bool_]) -> Box | None:
    """Return the tight box of a mask [H, W], None if it is empty."""
    rows = np.flatnonzero(mask.any(axis=1))
    if not len(rows):
        return None
    y0, y1 = int(rows[0]), int(rows[-1]) + 1
    columns = np.flatnonzero(mask[y0:y1].any(axis=0))
    return int(columns[0]), y0, int(columns[-1]) + 1, y1


def value_boxes(
    target: NDArray[np.uint16], least: int, limit: int
) -> tuple[list[Box | None], NDArray[np.int64]]:
    """Return the tight boxes and areas of a range of values, in one pass over their pixels.

    Args:
        target: uint16 [H, W].
        least: First value.
        limit: One more than the last value.

    Returns:
        A list of limit - least boxes, None for values that do not occur, and areas in pixels,
        int64 [limit - least].
    """
    count = limit - least
    above = target - np.uint16(least)  # smaller values wrap around
    at = np.flatnonzero(above < count)
    found = above.ravel().take(at)
    # runs of equal values in the flattened target; a run may continue in the next row
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
    # NumPy keeps the last value that is assigned to an index, so reversed runs keep the first row
    y0[found[::-1]] = row[::-1]
    y1[found] = until + 1
    np.minimum.at(x0, found, np.where(goes_on, 0, left))
    np.maximum.at(x1, found, np.where(goes_on, width, right + 1))
    boxes: list[Box | None] = [None] * count
    for i in np.flatnonzero(areas).tolist():
        boxes[i] = int(x0[i]), int(y0[i]), int(x1[i]), int(y1[i])
    return boxes, areas


def float_boxes(bounds: NDArray[np.float64]) -> list[FloatBox | None]:
    """Round bounds (x0, y0, x1, y1) [N, 4] to 0.001 pixels; None for bounds that are not finite."""
    finite = np.asarray(np.isfinite(bounds).all(axis=1))
    return [
        (x0, y0, x1, y1) if known else None
        for (x0, y0, x1, y1), known in zip(np.round(bounds, 3).tolist(), finite, strict=True)
    ]


def window(target: NDArray[Any], box: Box) -> NDArray[Any]:
    """Return the part of `target` [H, W] within a box, as a view."""
    x0, y0, x1, y1 = box
    return target[y0:y1, x0:x1]

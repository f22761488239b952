"""Free rectangles on the sheet of a container face while decals are placed on it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fastgen.decals.lettering import PartBox
from fastgen.geometry.door_clearance import DoorClearance
from fastgen.scene import Decal, Vec2
from fastgen.scene.limits import MOST_NEARBY, NEARBY_MM
from fastgen.validation import Range

_Box = tuple[float, float, float, float]
"""Left, lower, right and upper end, mm."""

EDGE_MM = 110.0
"""Width of the strip without decals along each sheet edge, mostly under posts and rails."""

_LEAF_EDGE_MM = 15.0
"""The same for lettering on doors."""

_TRIES = 40
"""Random positions tried per call of `Sheet.place`."""

GAP_MM = 25.0
"""Smallest distance between two decals, in x or in y."""


def tenth(value: float) -> float:
    """Round a length in mm to 0.1 mm."""
    return round(float(value), 1)


def between(rng: np.random.Generator, values: Range) -> float:
    """Draw a length from a range, in mm, rounded to 0.1 mm."""
    return tenth(values.draw(rng))


@dataclass
class Sheet:
    """Sheet of one face while decals are placed on it.

    Attributes:
        face: Name of the face.
        size: Width and height, mm.
        flats: Outer flats of the wall's corrugation as intervals (x0, x1), mm.
        clearance: Map of the gear on a door, None on walls.
        taken: Occupied rectangles (x0, y0, x1, y1), mm from the lower left corner.
    """

    face: str
    size: Vec2
    flats: Sequence[tuple[float, float]] = ()
    clearance: DoorClearance | None = None
    taken: list[tuple[float, float, float, float]] = field(default_factory=list)

    @property
    def half_wave_mm(self) -> float:
        """Half the pitch of the corrugation: the distance from an outer to an inner flat."""
        return (self.flats[1][0] - self.flats[0][0]) / 2 if len(self.flats) > 1 else 0.0

    def holds_lettering(self, x0: float, x1: float) -> bool:
        """Test whether lettering from x0 to x1 in mm keeps clear of the left and right edge."""
        edge = _LEAF_EDGE_MM if self.clearance else EDGE_MM
        return x0 >= edge and x1 <= self.size[0] - edge

    def holds(self, decal: Decal) -> bool:
        """Test whether a turned decal lies inside the strip along the edges of the sheet."""
        return all(
            reach + EDGE_MM <= at <= side - EDGE_MM - reach
            for at, reach, side in zip(decal.center_mm, half_extent(decal), self.size, strict=True)
        )

    def claim(self, center: Vec2, size: Vec2, parts: Sequence[PartBox] = ()) -> bool:
        """Reserve a rectangle if it is free and on the sheet.

        Args:
            center: Centre of the rectangle, mm from the sheet's lower left corner.
            size: Width and height, mm.
            parts: Parts of a text that no door gear may cover. They may lie nearer to the edges of
                a door, where no posts and rails hide them.

        Returns:
            True if the rectangle was reserved.
        """
        x0, y0 = center[0] - size[0] / 2, center[1] - size[1] / 2
        x1, y1 = center[0] + size[0] / 2, center[1] + size[1] / 2
        edge = _LEAF_EDGE_MM if parts and self.clearance else EDGE_MM
        if min(x0, y0) < edge or x1 > self.size[0] - edge or y1 > self.size[1] - edge:
            return False
        for a0, b0, a1, b1 in self.taken:
            if x0 < a1 + GAP_MM and a0 < x1 + GAP_MM and y0 < b1 + GAP_MM and b0 < y1 + GAP_MM:
                return False
        if self.clearance and not all(
            self.clearance.clear(x0 + part.x0, y0 + part.y0, x0 + part.x1, y0 + part.y1)
            for part in parts
        ):
            return False
        self.taken.append((x0, y0, x1, y1))
        return True

    def place(
        self,
        size: Vec2,
        rng: np.random.Generator,
        x: Range,
        y: Range,
        parts: Sequence[PartBox] = (),
    ) -> Vec2 | None:
        """Reserve a rectangle at a random free position and return its centre.

        Args:
            size: Width and height, mm.
            rng: Random generator of the decal.
            x: Allowed positions from left (0) to right (1).
            y: Allowed positions from bottom (0) to top (1).
            parts: Parts of a text that no door gear may cover.

        Returns:
            Centre in mm from the lower left corner, or None if no free position was found.
        """
        room = [
            max(side - 2 * EDGE_MM - want, 0.0) for side, want in zip(self.size, size, strict=True)
        ]
        for _ in range(_TRIES):
            center = (
                tenth(EDGE_MM + size[0] / 2 + room[0] * rng.uniform(x.lo, x.hi)),
                tenth(EDGE_MM + size[1] / 2 + room[1] * rng.uniform(y.lo, y.hi)),
            )
            if self.claim(center, size, parts):
                return center
        return None


def half_extent(decal: Decal) -> Vec2:
    """Return half the width and height of the upright box around a turned decal, mm."""
    width, height = decal.size_mm
    angle = math.radians(decal.rotation_deg)
    cos, sin = abs(math.cos(angle)), abs(math.sin(angle))
    return (cos * width + sin * height) / 2, (sin * width + cos * height) / 2


def has_slots(added: Sequence[Decal], others: Sequence[Decal]) -> bool:
    """Test whether the renderer can draw more decals on a face.

    Args:
        added: The new decals.
        others: Decals that are on this face already.

    Returns:
        False if more than MOST_NEARBY decals would be near one place.
    """
    mine = [_surroundings(decal) for decal in added]
    theirs = [box for box in map(_surroundings, others) if any(_meet(box, one) for one in mine)]
    boxes = mine + theirs
    if len(boxes) <= MOST_NEARBY:
        return True
    left, low, right, high = np.array(boxes).T
    # boxes that share a place also share the lower left corner of their intersection
    x, y = (corner.reshape(-1, 1) for corner in np.meshgrid(left, low))
    over = (left <= x) & (x < right) & (low <= y) & (y < high)
    return bool(over.sum(axis=1).max() <= MOST_NEARBY)


def _surroundings(decal: Decal) -> _Box:
    """Return the box around a decal and half of NEARBY_MM on each side."""
    (x, y), reach = decal.center_mm, half_extent(decal)
    across, up = (each + NEARBY_MM / 2 for each in reach)
    return x - across, y - up, x + across, y + up


def _meet(a: _Box, b: _Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]

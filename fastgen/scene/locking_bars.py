"""Places of the locking bars on the door end and of the handles that turn them.

Bars are numbered from left to right as seen from outside. Insets are distances in mm inward from
the castings' plane.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fastgen.scene.damage_kinds import kind_named
from fastgen.scene.data import Damage

BAR_RADIUS_MM = 17.0
BAR_Y_MM = (-545.0, -130.0, 130.0, 545.0)
"""Positions of the locking bars. Between the outer ones and the edges, a leaf has room for a serial
number."""

BAR_INSET_MM = 31.0
"""Inset of the bars' axes."""

BAR_END_MM = 50.0
"""Distance of the bars' ends from the castings' top and bottom planes."""

BAR_PIECE_MM = 300.0
"""Longest piece of a bar between two stations, where it can bend."""

CAM_MM = 76.0
"""z of the bottom cams, and distance of the top cams below the container's top."""

HANDLE_MM = 300.0
"""Length of a handle from its bar to its hasp."""

HANDLE_INSETS_MM = (22.0, 34.0)
"""Insets of a handle's front and back."""


def bar_stations_mm(height_mm: float) -> NDArray[np.float64]:
    """Return the ascending z of the stations of the bars of a container of a height."""
    length_mm = height_mm - 2 * BAR_END_MM
    pieces = int(np.ceil(length_mm / BAR_PIECE_MM))
    return np.linspace(BAR_END_MM, height_mm - BAR_END_MM, pieces + 1)


def handle_side(bar: int) -> float:
    """Return the direction of a bar's handle, 1.0 toward +y or -1.0 toward -y.

    The handles of the outer bars point to the middle of the door, those of the inner bars away.
    """
    sign = float(np.sign(BAR_Y_MM[bar]))
    return -sign if abs(BAR_Y_MM[bar]) > 300 else sign


def hasp_mm(bar: int) -> tuple[float, float]:
    """Return y and z of the hasp of a locking bar: the middle of the catch at its handle's end.

    Levers of neighbouring bars have different heights, so that they can overlap.
    """
    y = BAR_Y_MM[bar]
    return y + handle_side(bar) * HANDLE_MM, 1120.0 if abs(y) > 300 else 980.0


def damaged_bar(damage: Damage) -> int | None:
    """Return the number of the locking bar that a damage changes, None for other damages."""
    if not kind_named(damage.kind).on_gear:
        return None
    return int(np.abs(np.subtract(BAR_Y_MM, damage.origin_mm[1])).argmin())


def damaged_bars(damages: Iterable[Damage]) -> list[int]:
    """Return the numbers of the locking bars that damages change, one for each such damage."""
    return [bar for bar in map(damaged_bar, damages) if bar is not None]

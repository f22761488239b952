"""Places of door gear: locking bars, the handles that turn them, and the gasket's lip.

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

LIP_Y_MM = 0.0
"""Position of the lip: the part of the gasket between the leaves that may hang out of the door."""

LIP_INSET_MM = 94.0
"""Inset of the lip's axis. There the gasket and the edges of the leaves hide the lip."""

LIP_HALF_MM = (5.0, 9.0)
"""Half extents of the lip's section along x and y."""

LIP_END_MM = 150.0
"""Distance of the lip's ends from the castings' top and bottom planes."""

LIP_PIECE_MM = 80.0
"""Longest piece of the lip between two stations, where it can bend."""

LIP = len(BAR_Y_MM)
"""Number of the lip among door gear, after the bars."""


def bar_stations_mm(height_mm: float) -> NDArray[np.float64]:
    """Return the ascending z of the stations of the bars of a container of a height."""
    return _stations_mm(height_mm, BAR_END_MM, BAR_PIECE_MM)


def lip_stations_mm(height_mm: float) -> NDArray[np.float64]:
    """Return the ascending z of the stations of the gasket's lip of a container of a height."""
    return _stations_mm(height_mm, LIP_END_MM, LIP_PIECE_MM)


def _stations_mm(height_mm: float, end_mm: float, piece_mm: float) -> NDArray[np.float64]:
    pieces = int(np.ceil((height_mm - 2 * end_mm) / piece_mm))
    return np.linspace(end_mm, height_mm - end_mm, pieces + 1)


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


def damaged_gear(damages: Iterable[Damage]) -> list[int]:
    """Return the number of the bar that each damage of door gear changes, or LIP."""
    places = [*BAR_Y_MM, LIP_Y_MM]
    return [
        int(np.abs(np.subtract(places, damage.origin_mm[1])).argmin())
        for damage in damages
        if kind_named(damage.kind).on_gear
    ]

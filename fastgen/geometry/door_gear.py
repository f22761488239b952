"""Locking gear and hinges of the door end, and the lip of the gasket between its leaves.

At 10 m, a 45 mm lens and a 36 mm sensor of 640 pixels resolve 12.5 mm. A locking bar of 34 mm is
under 3 pixels wide, so eight sides are round enough; hinge knuckles of 28 mm get six.
"""

import numpy as np

from fastgen.geometry.container_layout import DOOR_RING_MM, Layout
from fastgen.geometry.container_parts import DOOR_FACE_MM
from fastgen.geometry.door import LEAF_MM, SWAGE, Opening, opening
from fastgen.geometry.mesh import Chart
from fastgen.geometry.unfold import Patch, Sheet, beside, box, breaks, prism, regular
from fastgen.scene.door_gear import (
    BAR_END_MM,
    BAR_INSET_MM,
    BAR_RADIUS_MM,
    BAR_Y_MM,
    CAM_MM,
    HANDLE_INSETS_MM,
    LIP_HALF_MM,
    LIP_INSET_MM,
    LIP_Y_MM,
    hasp_mm,
    lip_stations_mm,
)

_BACK_MM = LEAF_MM + SWAGE.depth_mm + 4.0
"""Inset of the back of gear on a leaf, behind the deepest swage."""

_FRONT_MM = DOOR_RING_MM + 0.5

_BEND_MM = 80.0
"""Longest piece of a block: levers bend with a dented leaf and stay in front of it."""


_ON_BARS = ("bar", "cams", "brackets", "handle")


def is_gear(chart: Chart) -> bool:
    """Return True for charts of locking bars and their attachments.

    They are in front of the leaves. Holes and scars in a leaf leave them whole, but they bend with
    it.
    """
    name = chart.name.split(".")
    return name[0] == "door" and len(name) > 1 and name[1] in _ON_BARS


def gear(layout: Layout) -> list[Sheet]:
    """Return bars, cams, keepers, brackets, handles, catches and hinges."""
    place = opening(layout)
    sheets = []
    for i, y in enumerate(BAR_Y_MM):
        parts = {
            "bar": (beside([_bar(layout, place, y)]), "galvanized"),
            "cams": (beside(_cams(layout, place, y, -np.sign(y))), "galvanized"),
            "keepers": (beside(_keepers(layout, place, y)), "paint_frame"),
            "brackets": (beside(_brackets(place, y)), "galvanized"),
            "handle": (beside(_handle(place, y, *hasp_mm(i))), "galvanized"),
        }
        for part, (patch, material) in parts.items():
            sheets.append(Sheet(f"door.{part}.{i}", "door", material, "door", patch))
    for name, sign in (("left", -1.0), ("right", 1.0)):
        patches = _hinges(place, sign)
        sheets.append(Sheet(f"door.hinges.{name}", "door", "paint_frame", "door", beside(patches)))
    return sheets


def gasket_lip(layout: Layout) -> Sheet:
    """Return the lip, out of sight behind the gasket until a damage moves it; see
    damages/door_gear.py."""
    middle = opening(layout).x - LIP_INSET_MM, LIP_Y_MM
    # unfolded from its back
    outline = middle + np.array([(-1, 1), (-1, -1), (1, -1), (1, 1)]) * LIP_HALF_MM
    lip = prism(outline, lip_stations_mm(layout.top), 2, capped=(True, False))
    return Sheet("door.lip", "door", "rubber", "door", lip, last=True)


def _block(
    place: Opening, y: tuple[float, float], z: tuple[float, float], inset: tuple[float, float]
) -> Patch:
    low, high = sorted(y)
    return box((place.x - inset[1], low, z[0]), (place.x - inset[0], high, z[1]), _BEND_MM)


def _bar(layout: Layout, place: Opening, y: float) -> Patch:
    stations = breaks(BAR_END_MM, layout.top - BAR_END_MM, 2 * layout.max_edge_mm)
    # unfolded from its back, which hides the sheet's borders: they rust like edges
    outline = np.roll(regular((place.x - BAR_INSET_MM, y), BAR_RADIUS_MM, 8), 4, axis=0)
    return prism(outline, stations, 2, capped=(True, True))


def _cams(layout: Layout, place: Opening, y: float, toward: float) -> list[Patch]:
    """Return the forging at either end: a collar with a nose toward the middle of the door."""
    x = place.x - BAR_INSET_MM
    nose = [(-16.0, -22.0), (16.0, -22.0), (18.0, 10.0), (10.0, 44.0), (-6.0, 44.0), (-18.0, 10.0)]
    outline = np.array([(x + dx, y + toward * dy) for dx, dy in nose])
    if toward < 0:
        outline = outline[::-1]
    patches = []
    for z in (CAM_MM, layout.top - CAM_MM):
        patches.append(prism(outline, (z - 18.0, z + 18.0), 2, capped=(True, True)))
    return patches


def _keepers(layout: Layout, place: Opening, y: float) -> list[Patch]:
    """Return two jaws on the sill and on the header, above and below each cam's nose."""
    toward = -np.sign(y)
    patches = []
    for z in (CAM_MM, layout.top - CAM_MM):
        for side in (-1.0, 1.0):
            middle = z + side * 27.0
            span = (y + toward * 22.0, y + toward * 58.0)
            patches.append(_block(place, span, (middle - 7, middle + 7), (15.0, DOOR_FACE_MM + 4)))
    return patches


def _brackets(place: Opening, y: float) -> list[Patch]:
    """Return the guides that fix the bar to the leaf: a plate, and a saddle over the bar."""
    patches = []
    for share in (0.12, 0.5, 0.88):
        z = place.low + share * (place.high - place.low)
        patches.append(_block(place, (y - 50, y + 50), (z - 32, z + 32), (LEAF_MM - 8, _BACK_MM)))
        patches.append(_block(place, (y - 25, y + 25), (z - 22, z + 22), (_FRONT_MM, LEAF_MM)))
    return patches


def _handle(place: Opening, y: float, end: float, z: float) -> list[Patch]:
    """Return the hub on the bar, the lever along the leaf to y = end, and the catch there."""
    return [
        _block(place, (y - 23, y + 23), (z - 34, z + 34), (_FRONT_MM + 0.5, DOOR_FACE_MM)),
        _block(place, (y, end), (z - 14, z + 14), HANDLE_INSETS_MM),
        _block(place, (end - 38, end + 38), (z - 45, z + 45), (LEAF_MM - 6, _BACK_MM)),
        _block(place, (end - 12, end + 12), (z - 30, z + 24), (16.0, LEAF_MM)),
    ]


def _hinges(place: Opening, sign: float) -> list[Patch]:
    """Return five hinges: a strap on the leaf, a knuckle over the gap, and two lugs on the post."""
    pin = sign * (place.half_width + 14.0)
    strap_end = sign * (place.half_width - 150.0)
    patches = []
    for z in np.linspace(place.low + 160, place.high - 160, 5):
        patches.append(_block(place, (strap_end, pin), (z - 42, z + 42), (40.0, LEAF_MM + 2)))
        outline = regular((place.x - 32.0, pin), 14.0, 6)
        patches.append(prism(outline, (z - 72, z + 72), 2, capped=(True, True)))
        for side in (-1.0, 1.0):
            span = (z + side * 57 - 11, z + side * 57 + 11)
            lug = (sign * (place.half_width - 4), sign * (place.half_width + 40))
            patches.append(_block(place, lug, span, (24.0, DOOR_FACE_MM + 4)))
    return patches

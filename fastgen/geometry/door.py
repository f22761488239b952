"""The door end: two leaves with swages on one sheet, their edges and gaskets.

Insets are distances in mm inward from the castings' plane of the door end. door_gear.py has the
locking gear in front of the leaves.
"""

from dataclasses import dataclass

import numpy as np

from fastgen.geometry.container_layout import OVERLAP_MM, Array, Layout
from fastgen.geometry.container_parts import DOOR_HEADER_MM, DOOR_SILL_MM
from fastgen.geometry.container_walls import Flats, wave_knots
from fastgen.geometry.unfold import Patch, Sheet, beside, breaks, flat, joined, sweep
from fastgen.scene.container_kinds import Wave
from fastgen.scene.faces import FACE_AXES

LEAF_MM = 58.0
"""Inset of the leaves' face."""

SWAGE = Wave(424.0, 34.0, 110.0, 50.0, 214.0)
"""Horizontal swages. They are so shallow that the flat stiles beside them can share their
unfolding: beside a slope, a stile is stretched by sqrt(1 + (34 / 50)^2) = 1.21."""

GASKET_MM = 20.0
"""Width of the seal around each leaf, set back to _GASKET_INSET_MM."""

_GASKET_INSET_MM = 72.0
_CENTER_GAP_MM = 12.0
_STILE_MM = 60.0
_SHADE_MM = 50.0
"""Width of cells on the leaves: the shade beside a locking bar varies over this distance."""

_UP = FACE_AXES["door"].up
_RIGHT = FACE_AXES["door"].right


@dataclass(frozen=True)
class Opening:
    """Position of the leaves.

    Attributes:
        half_width: Half the width of the door opening.
        low: z of a leaf's lower edge.
        high: z of a leaf's upper edge.
        left: Range of y of the left leaf; the right leaf mirrors it.
        x: x of the castings' plane.
    """

    half_width: float
    low: float
    high: float
    left: tuple[float, float]
    x: float


def opening(layout: Layout) -> Opening:
    """Return the door opening between the rear posts, the sill and the header."""
    half_width = layout.half[1] - layout.door_post_mm[1]
    return Opening(
        half_width,
        DOOR_SILL_MM + GASKET_MM,
        layout.top - DOOR_HEADER_MM - GASKET_MM,
        (-half_width + GASKET_MM, -_CENTER_GAP_MM),
        layout.half[0],
    )


def leaves(layout: Layout) -> tuple[list[Sheet], Flats]:
    """Return both leaves with edges and gaskets, and the outer flats along y of their sheet."""
    place = opening(layout)
    knots, depths = wave_knots(SWAGE, place.low, place.high, 90.0)
    arc_knots = np.append(0.0, np.cumsum(np.hypot(np.diff(knots), np.diff(depths))))
    arc = breaks(0.0, arc_knots[-1], 0.7 * layout.max_edge_mm, arc_knots)
    z, depth = np.interp(arc, arc_knots, knots), np.interp(arc, arc_knots, depths)
    mirrored = (-place.left[1], -place.left[0])
    patches, ends, edges = [], [], []
    for low, high in (place.left, mirrored):
        inner_low, inner_high = low + _STILE_MM, high - _STILE_MM
        for a, b, waves in (
            (low, inner_low, 0.0), (inner_low, inner_high, 1.0), (inner_high, high, 0.0),
        ):  # fmt: skip
            x = place.x - LEAF_MM - waves * depth
            profile = np.column_stack([x, np.zeros(len(z)), z])
            rows = breaks(a, b, min(_SHADE_MM, 0.7 * layout.max_edge_mm))
            patch = sweep(profile, rows, _RIGHT, upright=False, arc_mm=arc)
            # both leaves share one sheet, whose x is y plus a constant
            shift = (a - place.left[0], 0.0)
            patches.append(
                Patch(patch.positions_mm, patch.normals, patch.sheet_mm + shift, patch.triangles)
            )
        ends.extend(_swage_ends(knots, place, inner_low, inner_high))
        edges.extend(_leaf_edges(layout, place, low, high))
    sheets = [
        Sheet("door", "door", "paint_sheet", "door", joined(patches)),
        Sheet("door.swage_ends", "door", "paint_sheet", "door", beside(ends)),
        Sheet("door.edges", "door", "paint_frame", "door", beside(edges)),
        Sheet("door.gasket", "door", "rubber", "door", beside(_gaskets(layout, place))),
    ]
    bounds = np.concatenate([[0], np.arange(4, len(knots) - 1, 4)])
    flats = tuple((float(arc_knots[i]), float(arc_knots[i + 1])) for i in bounds)
    return sheets, flats


def _swage_ends(knots: Array, place: Opening, low: float, high: float) -> list[Patch]:
    """Return the trapezoids that close the swages toward the stiles."""
    top, bottom = place.x - LEAF_MM, place.x - LEAF_MM - SWAGE.depth_mm
    patches = []
    for z in knots[1:-1].reshape(-1, 4):
        for y, face in ((low, "back"), (high, "front")):
            points = np.column_stack([[top, bottom, bottom, top], np.full(4, y), z])
            axes = FACE_AXES[face]
            patches.append(flat(points, [(0, 1, 2), (0, 2, 3)], axes.right, axes.up))
    return patches


def _leaf_edges(layout: Layout, place: Opening, low: float, high: float) -> list[Patch]:
    """Return the leaf's four narrow sides, which end behind the gasket."""
    face, back = place.x - LEAF_MM, place.x - _GASKET_INSET_MM - OVERLAP_MM
    z = breaks(place.low, place.high, layout.max_edge_mm)
    y = breaks(low, high, layout.max_edge_mm)
    return [
        sweep([(back, low, 0), (face, low, 0)], z, _UP),
        sweep([(face, high, 0), (back, high, 0)], z, _UP),
        sweep([(back, 0, place.high), (face, 0, place.high)], y, _RIGHT),
        sweep([(face, 0, place.low), (back, 0, place.low)], y, _RIGHT),
    ]


def _gaskets(layout: Layout, place: Opening) -> list[Patch]:
    """Return the seals around both leaves: strips in one plane that overlap their neighbours."""
    x = place.x - _GASKET_INSET_MM
    step = layout.max_edge_mm
    out_y, out_low = place.half_width + OVERLAP_MM, place.low - GASKET_MM - OVERLAP_MM
    out_high = place.high + GASKET_MM + OVERLAP_MM
    in_low, in_high = place.low + OVERLAP_MM, place.high - OVERLAP_MM
    patches = []
    for low, high in ((-out_y, place.left[0] + OVERLAP_MM),
                      (place.left[1] - OVERLAP_MM, 0.0),
                      (0.0, -place.left[1] + OVERLAP_MM),
                      (-place.left[0] - OVERLAP_MM, out_y)):  # fmt: skip
        patches.append(sweep([(x, low, 0), (x, high, 0)], breaks(in_low, in_high, step), _UP))
    for low, high in ((out_low, in_low), (in_high, out_high)):
        for a, b in ((-out_y, 0.0), (0.0, out_y)):
            rows = breaks(a, b, step)
            patches.append(sweep([(x, 0, low), (x, 0, high)], rows, _RIGHT, upright=False))
    return patches

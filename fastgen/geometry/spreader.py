"""A ship-to-shore crane's spreader as a mesh, in the frame of the container that it holds.

It rests on the upper castings, extended to their distance, and includes the headblock and the lower
part of the hoist cables. 3,000 to 3,800 triangles: box sections and prisms only, because a pixel
at 10 m covers 12 mm or more and shows no bolts.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.spreader_parts import (
    CUT_MM,
    TIERS,
    Hang,
    cables,
    ends,
    flippers,
    frame,
    headblock,
)
from fastgen.geometry.stored_mesh import stored
from fastgen.geometry.unfold import assemble
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.limits import GAP_LIMITS_MM
from fastgen.validation import check_known

VERSION = 5  # raise when the stored arrays change

CABLE_TIER = TIERS.index("cables")

USUAL_GAP_MM = 15.0
"""Gap of spreaders for which none is given."""

Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]


def build_spreader(
    kind: str,
    flippers_down: tuple[bool, bool] = (True, True),
    gap_mm: float = USUAL_GAP_MM,
    cut_mm: float = CUT_MM,
) -> Mesh:
    """Build the mesh of a spreader, or read it from the disk cache.

    `shape_library.SHAPES` keeps the meshes that scenes use. All triangles are in the group "frame".

    Args:
        kind: Kind of the container that it holds, one of KINDS.
        flippers_down: True where the flippers of the front (-y) and of the back (+y) side hang
            beside the container; False where they are swung up.
        gap_mm: Distance from the castings' upper plane to the spreader's lower plane.
        cut_mm: Longest piece of a member between two cuts across it. Cuts add vertices, which
            carry indirect light; the surface stays the same.

    Returns:
        A new Mesh with read-only arrays.

    Raises:
        ConfigError: The kind is unknown or the gap is out of range.
    """
    check_gap(gap_mm)
    return lifted(touching_spreader(kind, flippers_down, cut_mm), gap_mm)


def touching_spreader(kind: str, flippers_down: tuple[bool, bool], cut_mm: float) -> Mesh:
    """Build a spreader without a gap below it, or read it from the disk cache.

    See build_spreader for arguments and errors.
    """
    check_known("container kind", kind, KINDS)
    inputs = kind, flippers_down, cut_mm
    return stored("spreader", VERSION, inputs, lambda: _built(*inputs))


def check_gap(gap_mm: float) -> None:
    """Raise ConfigError for a gap outside of GAP_LIMITS_MM."""
    low, high = GAP_LIMITS_MM
    if not low <= gap_mm <= high:
        raise ConfigError(f"spreader gap_mm: {gap_mm:g} is outside {low:g} to {high:g} mm")


def lifted(touching: Mesh, gap_mm: float) -> Mesh:
    """Return a spreader that rests on its container, lifted by a gap.

    All arrays except positions_mm are shared.
    """
    positions = touching.positions_mm + np.array([0.0, 0.0, gap_mm], np.float32)
    positions.flags.writeable = False
    return replace(touching, positions_mm=positions)


def tier_of_vertices(mesh: Mesh) -> NDArray[np.intp]:
    """Return the index into TIERS of each vertex [V] of a spreader."""
    return np.array([TIERS.index(chart.name.split(".")[1]) for chart in mesh.charts])[mesh.chart]


def tier_bounds_mm(mesh: Mesh) -> tuple[Bounds, ...]:
    """Return the lowest and highest coordinates [3] in mm of each of a spreader's TIERS."""
    tiers = tier_of_vertices(mesh)
    parts = [mesh.positions_mm[tiers == tier] for tier in range(len(TIERS))]
    return tuple((points.min(axis=0), points.max(axis=0)) for points in parts)


def _built(kind: str, flippers_down: tuple[bool, bool], cut_mm: float) -> Mesh:
    hang = Hang(KINDS[kind], 0.0, cut_mm)
    sheets = [
        *frame(hang),
        *ends(hang),
        *flippers(hang, flippers_down),
        *headblock(hang),
        *cables(hang),
    ]
    return assemble(sheets)

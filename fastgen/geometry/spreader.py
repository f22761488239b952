"""A ship-to-shore crane's spreader as a mesh: which container it holds in, triangles out.

It hangs in the container's frame on the upper castings, drawn out to their distance, headblock and
the beginning of the hoist cables included. 3,100 to 3,900 triangles: box sections and prisms only,
for at 10 m a pixel is 12 mm or more and no bolt is seen.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.spreader_parts import (
    CUT_MM,
    LOCKS_CHARTS,
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

CABLE_TIER = TIERS.index("cables")

Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]


def build_spreader(
    kind: str,
    flippers_down: tuple[bool, bool] = (True, True),
    gap_mm: float = 15.0,
    cut_mm: float = CUT_MM,
) -> Mesh:
    """The mesh of a spreader that holds a container, in the container's frame; see Mesh.

    kind: one of KINDS. flippers_down: whether the gather guides of the front (-y) and of the back
    (+y) side hang beside the container or are swung up. gap_mm: from the castings' upper plane to
    the spreader's lower one. cut_mm: how often members are cut across, for what light the vertices
    bear; the surface stays the same. All triangles are in the group "frame". Calls with equal
    arguments return the same object. Raises ConfigError for an unknown kind or a gap out of range.
    """
    check_known("container kind", kind, KINDS)
    low, high = GAP_LIMITS_MM
    if not low <= gap_mm <= high:
        raise ConfigError(f"spreader gap_mm: {gap_mm:g} is outside {low:g} to {high:g} mm")
    return _lifted(kind, flippers_down, gap_mm, cut_mm)


def tier_of_vertices(mesh: Mesh) -> NDArray[np.intp]:
    """Which of TIERS each vertex of a spreader belongs to, [V]."""
    return np.array([TIERS.index(chart.name.split(".")[1]) for chart in mesh.charts])[mesh.chart]


@lru_cache(maxsize=128)
def tier_bounds_mm(mesh: Mesh) -> tuple[Bounds, ...]:
    """Lowest and highest coordinates [3] in mm of each of TIERS of a spreader."""
    tiers = tier_of_vertices(mesh)
    parts = [mesh.positions_mm[tiers == tier] for tier in range(len(TIERS))]
    return tuple((points.min(axis=0), points.max(axis=0)) for points in parts)


@lru_cache(maxsize=256)  # all of the preset, cut and uncut
def _lifted(kind: str, flippers_down: tuple[bool, bool], gap_mm: float, cut_mm: float) -> Mesh:
    """The same at any gap but for where it is: only the twistlocks stay in their castings."""
    touching = _touching(kind, flippers_down, cut_mm)
    locks = [touching.chart_index(name) for name in LOCKS_CHARTS.values()]
    positions = touching.positions_mm.copy()
    positions[~np.isin(touching.chart, locks), 2] += gap_mm
    positions.flags.writeable = False
    return replace(touching, positions_mm=positions)


@lru_cache(maxsize=64)  # all there are: the lifted ones share all but their positions
def _touching(kind: str, flippers_down: tuple[bool, bool], cut_mm: float) -> Mesh:
    """A spreader without a gap below it."""
    inputs = kind, flippers_down, cut_mm
    return stored("spreader", inputs, lambda: _built(*inputs))


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

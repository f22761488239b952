"""The corrugated panels: two sides, the front end wall and the roof."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fastgen.errors import ConfigError
from fastgen.geometry.container_layout import (
    BASE_RAIL_TOP_MM,
    FRONT_SILL_TOP_MM,
    OVERLAP_MM,
    Array,
    Layout,
)
from fastgen.geometry.unfold import Sheet, breaks, sweep
from fastgen.scene.container_kinds import CASTING_MM, Wave
from fastgen.scene.faces import FACE_AXES

Flats = tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Panel:
    """A corrugated wall.

    Attributes:
        sheet: The wall's surface.
        flats: Sheet coordinates (start, end) in mm of the outermost flats.
        knots_mm: Stations across the ridges, from left to right seen from outside.
        rows_mm: Stations along the ridges.
    """

    sheet: Sheet
    flats: Flats
    knots_mm: Array
    rows_mm: Array


def wave_knots(wave: Wave, low: float, high: float, margin: float) -> tuple[Array, Array]:
    """Fit as many whole waves as possible between two stations, centred.

    Args:
        wave: One wave of the corrugation.
        low: First station in mm.
        high: Last station in mm.
        margin: Least width in mm of the flat on either side.

    Returns:
        Stations [K] in mm from low to high, and the depth [K] in mm at each.

    Raises:
        ConfigError: Not even one wave fits.
    """
    count = int((high - low + wave.outer_mm - 2 * margin) // wave.pitch_mm)
    if count < 1:
        raise ConfigError(
            f"pitch_mm: no wave of {wave.pitch_mm:g} mm, outer_mm {wave.outer_mm:g}, fits a wall "
            f"of {high - low:.0f} mm; make them smaller"
        )
    start = (low + high - (count * wave.pitch_mm - wave.outer_mm)) / 2
    steps = np.cumsum([0.0, wave.slope_mm, wave.inner_mm, wave.slope_mm])
    knots = start + np.arange(count)[:, None] * wave.pitch_mm + steps
    depths = np.tile([0.0, wave.depth_mm, wave.depth_mm, 0.0], count)
    return np.concatenate([[low], knots.ravel(), [high]]), np.concatenate([[0.0], depths, [0.0]])


class Span(NamedTuple):
    """Extent of a wall along one axis: first and last station, and where castings begin."""

    low: float
    high: float
    notches: tuple[float, ...]


def panels(layout: Layout) -> dict[str, Panel]:
    """Return the four corrugated walls by face."""
    half_length, half_width = layout.half
    long, wide, high = (size - OVERLAP_MM for size in CASTING_MM)
    post = layout.post_mm - OVERLAP_MM
    door_post = layout.door_post_mm[0] - OVERLAP_MM
    behind_header = layout.end_inner_mm - OVERLAP_MM
    under_rail = layout.rail_bottom_mm + OVERLAP_MM
    past_casting = (half_length - long, half_width - wide, layout.top - high)
    side_rows = (BASE_RAIL_TOP_MM - OVERLAP_MM, under_rail)
    end_rows = (FRONT_SILL_TOP_MM - OVERLAP_MM, under_rail)
    roof_y = half_width - layout.side_inner_mm + OVERLAP_MM
    profiles = layout.profiles
    x_notches = (-past_casting[0], past_casting[0])
    y_notches = (-past_casting[1], past_casting[1])
    z_notches = (past_casting[2],)
    side_plane = half_width - layout.side_recess_mm
    end_plane = half_length - layout.end_recess_mm
    roof_plane = layout.top - layout.roof_recess_mm
    to_front, to_door = half_length - post, half_length - door_post
    sides, ends = Span(*side_rows, z_notches), Span(*end_rows, z_notches)
    roof_across = Span(behind_header - half_length, to_door, x_notches)
    return {
        "front": _panel(
            layout, "front", profiles.side, side_plane, Span(-to_front, to_door, x_notches), sides
        ),
        "back": _panel(
            layout, "back", profiles.side, side_plane, Span(-to_door, to_front, x_notches), sides
        ),
        "no_door": _panel(
            layout,
            "no_door",
            profiles.end,
            end_plane,
            Span(post - half_width, half_width - post, y_notches),
            ends,
        ),
        "roof": _panel(
            layout, "roof", profiles.roof, roof_plane, roof_across, Span(-roof_y, roof_y, y_notches)
        ),
    }


def _panel(
    layout: Layout,
    face: str,
    wave: Wave,
    plane: float,
    across: Span,
    along: Span,
) -> Panel:
    """Return a wall with the castings cut out of its corners.

    Args:
        layout: Dimensions of the container.
        face: Face of the wall.
        wave: Its corrugation.
        plane: Distance of its outermost flats from the origin, along the face's outward axis.
        across: Stations across the ridges.
        along: Stations along the ridges.
    """
    axes = FACE_AXES[face]
    low, high, notches = across
    margin = max(notches[0] - low, high - notches[1]) + 2 * OVERLAP_MM
    knots, depths = wave_knots(wave, low, high, margin)
    stations = breaks(low, high, np.inf, (*knots, *notches))
    station_depths = np.interp(stations, knots, depths)
    lengths = np.hypot(np.diff(stations), np.diff(station_depths))
    station_arc = np.append(0.0, np.cumsum(lengths))
    # a cell's diagonal counts as an edge: columns are no wider than the wave's facets and at most
    # 0.8 max_edge_mm, and rows are limited by the diagonal that remains
    widest = max(wave.outer_mm, wave.inner_mm, float(np.hypot(wave.slope_mm, wave.depth_mm)))
    if face == "no_door":
        widest /= 2  # light varies most across the facets of deep waves
    arc = breaks(0.0, station_arc[-1], min(widest, 0.8 * layout.max_edge_mm), station_arc)
    columns, depth = (
        np.interp(arc, station_arc, stations),
        np.interp(arc, station_arc, station_depths),
    )
    step = float(np.sqrt(layout.max_edge_mm**2 - np.diff(arc).max() ** 2))
    rows = breaks(along.low, along.high, step, along.notches)
    right, out = np.array(axes.right), np.array(axes.out)
    profile = columns[:, None] * right + (plane - depth)[:, None] * out
    patch = sweep(profile, rows, axes.up, keep=layout.outside_castings)
    edges = np.interp(knots[4:-2].reshape(-1, 4)[:, [0, 1]], stations, station_arc)
    return Panel(
        Sheet(face, face, "paint_sheet", face, patch),
        tuple((float(a), float(b)) for a, b in edges),
        columns,
        rows,
    )

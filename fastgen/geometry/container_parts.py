"""Frame and base of a container: posts, rails, headers, sills, floor, fork pockets."""

from collections.abc import Sequence

import numpy as np

from fastgen.geometry.container_layout import (
    BASE_RAIL_TOP_MM,
    BESIDE_MM,
    DOOR_RING_MM,
    FLOOR_MM,
    FRONT_SILL_TOP_MM,
    OVERLAP_MM,
    RING_BOTTOM_MM,
    RING_TOP_MM,
    Array,
    Layout,
)
from fastgen.geometry.container_walls import Panel
from fastgen.geometry.unfold import Patch, Sheet, breaks, coarsened, prism, sweep
from fastgen.scene.container_kinds import CASTING_MM
from fastgen.scene.faces import FACE_AXES

FORK_CENTERS_MM = (-1025.0, 1025.0)
"""x of the fork pockets of a 20' container. ISO 1496-1 annex C: 2050 mm between centres, at least
355 wide and 115 high, at least 20 above the base plane."""

FORK_WIDTH_MM = 360.0
FORK_Z_MM = (20.0, 136.0)

DOOR_HEADER_MM = DOOR_SILL_MM = 120.0
"""Height of the door header and of the door sill, flush with the castings."""

DOOR_FACE_MM = 50.0
"""Inset d of the faces of the door header and sill; the locking bars pass in front of them."""

_FLOOR_CUT_MM, _FORK_CUT_MM = 280.0, 400.0
"""Spacing of cuts across the floor and the fork pockets below it: a lens distorts corners only."""


def frame(layout: Layout, walls: dict[str, Panel]) -> list[Sheet]:
    """Return posts, rails, headers and sills, cut at the stations of the walls beside them."""
    return [
        *_posts(layout, walls),
        *_top_rails(layout, walls),
        *_bottom_rails(layout, walls),
        *_front_beams(layout, walls["no_door"]),
        *_door_beams(layout),
    ]


def ring(outline: Sequence[tuple[float, float]]) -> Array:
    """Return an outline [N, 2] in counter-clockwise order."""
    points = np.array(outline, np.float64)
    x, y = points.T
    area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return points if area > 0 else points[::-1]


def _posts(layout: Layout, walls: dict[str, Panel]) -> list[Sheet]:
    half_length, half_width = layout.half
    low, high = CASTING_MM[2] - OVERLAP_MM, layout.top - CASTING_MM[2] + OVERLAP_MM
    stations = breaks(low, high, layout.max_edge_mm, walls["front"].rows_mm)
    outer, front = layout.frame_recess_mm, layout.post_mm
    depth, inner = layout.door_post_mm
    step = inner - 42.0  # the hinges are mounted on this step
    square = [(outer, outer), (front, outer), (front, front), (outer, front)]
    stepped = [
        (DOOR_RING_MM, outer), (depth, outer), (depth, inner),
        (DOOR_FACE_MM, inner), (DOOR_FACE_MM, step), (DOOR_RING_MM, step),
    ]  # fmt: skip
    sheets = []
    for face, x_sign, section in (("no_door", -1, square), ("door", 1, stepped)):
        for side, y_sign in (("front", -1), ("back", 1)):
            outline = [(x_sign * (half_length - d), y_sign * (half_width - e)) for d, e in section]
            patch = prism(ring(outline), stations, 2, capped=(False, False))
            sheets.append(Sheet(f"post.{face}.{side}", face, "paint_frame", "frame", patch))
    return sheets


def _top_rails(layout: Layout, walls: dict[str, Panel]) -> list[Sheet]:
    _, half_width = layout.half
    sheets = []
    for side, y_sign in (("front", -1), ("back", 1)):
        outer = y_sign * (half_width - layout.frame_recess_mm)
        inner = y_sign * (half_width - layout.side_inner_mm)
        bottom, top = layout.rail_bottom_mm, layout.top - RING_TOP_MM
        outline = ring([(outer, bottom), (inner, bottom), (inner, top), (outer, top)])
        stations = _side_stations(layout, walls[side])
        patch = prism(outline, stations, 0, capped=(False, False))
        sheets.append(Sheet(f"rail.top.{side}", side, "paint_frame", "frame", patch))
    return sheets


def _side_stations(layout: Layout, wall: Panel) -> Array:
    """Return x from casting to casting at knots of the side wall, so that both bend alike."""
    reach = layout.half[0] - CASTING_MM[0] + OVERLAP_MM
    knots = np.sort(wall.knots_mm * FACE_AXES[wall.sheet.face].right[0])
    inside = knots[(knots > -reach) & (knots < reach)]
    return coarsened(np.concatenate([[-reach], inside, [reach]]), layout.max_edge_mm)


def _bottom_rails(layout: Layout, walls: dict[str, Panel]) -> list[Sheet]:
    half_length, half_width = layout.half
    pockets = _fork_centers(layout)
    long, _, high = CASTING_MM
    edges = [x + s * FORK_WIDTH_MM / 2 for x in pockets for s in (-1, 1)]
    sheets = []

    def present(points: Array) -> np.ndarray:
        x, _, z = np.moveaxis(points, -1, 0)
        in_pocket = np.zeros(x.shape, bool)
        for center in pockets:
            in_pocket |= np.abs(x - center) < FORK_WIDTH_MM / 2
        in_pocket &= (z > FORK_Z_MM[0]) & (z < FORK_Z_MM[1])
        return ~in_pocket & layout.outside_castings(points)

    for side, y_sign in (("front", -1), ("back", 1)):
        outer = y_sign * (half_width - layout.bottom_rail_recess_mm)
        inner = y_sign * (half_width - layout.side_inner_mm)
        levels = breaks(RING_BOTTOM_MM, BASE_RAIL_TOP_MM, np.inf, (*FORK_Z_MM, high - OVERLAP_MM))
        outline = [(outer, z) for z in levels[::-1]] + [(inner, z) for z in levels]
        # outline runs down outside and up inside: counter-clockwise from +x for the front side
        points = np.array(outline if y_sign < 0 else outline[::-1])
        closed = np.vstack([points, points[:1]])
        profile = np.column_stack([np.zeros(len(closed)), closed])
        reach = (-half_length + layout.post_mm - OVERLAP_MM,
                 half_length - layout.door_post_mm[0] + OVERLAP_MM)  # fmt: skip
        castings = (-half_length + long - OVERLAP_MM, half_length - long + OVERLAP_MM)
        stations = breaks(
            *reach, layout.max_edge_mm, (*_side_stations(layout, walls[side]), *edges, *castings)
        )
        patch = sweep(profile, stations, (1, 0, 0), keep=present)
        sheets.append(Sheet(f"rail.bottom.{side}", side, "paint_frame", "frame", patch))
    return sheets


def _front_beams(layout: Layout, wall: Panel) -> list[Sheet]:
    """Return header and sill of the front end; the sill's inner side ends above the floor."""
    half_length, half_width = layout.half
    reach = half_width - CASTING_MM[1] + OVERLAP_MM
    inside = -wall.knots_mm[::-1]
    inside = inside[np.abs(inside) < reach]
    stations = coarsened(np.concatenate([[-reach], inside, [reach]]), layout.max_edge_mm)
    outer, inner = -half_length + 6.0, -half_length + layout.end_inner_mm
    top, bottom = layout.top - RING_TOP_MM, layout.rail_bottom_mm
    header = [(outer, bottom), (outer, top), (inner, top), (inner, bottom), (outer, bottom)]
    sill_inner_top = FLOOR_MM + OVERLAP_MM
    sill = [(inner, sill_inner_top), (inner, RING_BOTTOM_MM), (outer, RING_BOTTOM_MM),
            (outer, FRONT_SILL_TOP_MM), (inner, FRONT_SILL_TOP_MM)]  # fmt: skip
    return [
        _beam("header.no_door", "no_door", header, stations),
        _beam("sill.no_door", "no_door", sill, _to_posts(stations, half_width - layout.post_mm)),
    ]


def _door_beams(layout: Layout) -> list[Sheet]:
    """Return the header with its rain gutter and the sill with its lip, both at DOOR_RING_MM."""
    half_length, half_width = layout.half
    reach = half_width - CASTING_MM[1] + OVERLAP_MM
    stations = breaks(-reach, reach, layout.max_edge_mm)
    lip, face = half_length - DOOR_RING_MM, half_length - DOOR_FACE_MM
    inner = half_length - layout.door_post_mm[0]
    top, bottom = layout.top - RING_TOP_MM, layout.top - DOOR_HEADER_MM
    header = [(inner, bottom), (inner, top), (lip, top), (lip, top - 22), (face, top - 22),
              (face, bottom), (inner, bottom)]  # fmt: skip
    sill_face, sill_inner = face - BESIDE_MM, inner - BESIDE_MM
    sill = [(sill_inner, DOOR_SILL_MM), (sill_face, DOOR_SILL_MM), (sill_face, 32.0), (lip, 32.0),
            (lip, RING_BOTTOM_MM), (sill_inner, RING_BOTTOM_MM),
            (sill_inner, FLOOR_MM + OVERLAP_MM)]  # fmt: skip
    return [
        _beam("header.door", "door", header, stations),
        _beam("sill.door", "door", sill, _to_posts(stations, half_width - layout.door_post_mm[1])),
    ]


def _to_posts(stations: Array, post: float) -> Array:
    """Return a sill's stations with ends at the posts, to close the gaps above the castings."""
    reach = post + OVERLAP_MM
    return np.concatenate([[-reach], stations, [reach]]) if reach > stations[-1] else stations


def _profile(section: list[tuple[float, float]]) -> Array:
    """Return a section (x, z) as points [N, 3] for a sweep along y."""
    return np.array([(x, 0.0, z) for x, z in section])


def _beam(name: str, face: str, section: list[tuple[float, float]], stations: Array) -> Sheet:
    """Return a beam along y; its section (x, z) runs clockwise as seen from -y."""
    patch = sweep(_profile(section), stations, (0, 1, 0))
    return Sheet(name, face, "paint_frame", "frame", patch)


def _fork_centers(layout: Layout) -> tuple[float, ...]:
    return FORK_CENTERS_MM if layout.kind.length_mm < 7000 else ()


def base(layout: Layout) -> list[Sheet]:
    """Return floor and fork pockets, as seen from below.

    Cross members are not modelled: they are behind the rails for all cameras but those far below.
    """
    half_length, half_width = layout.half
    reach_y = half_width - layout.side_inner_mm + OVERLAP_MM
    start = -half_length + layout.end_inner_mm
    end = half_length - layout.door_post_mm[0]
    floor = sweep(
        [(x, 0.0, FLOOR_MM) for x in breaks(start - OVERLAP_MM, end + OVERLAP_MM, _FLOOR_CUT_MM)],
        breaks(-reach_y, reach_y, _FLOOR_CUT_MM),
        FACE_AXES["underside"].up,
    )
    sheets = [Sheet("underside", "underside", "underside", "underside", floor)]
    rows = breaks(-reach_y, reach_y, _FORK_CUT_MM)
    outer = half_width - layout.bottom_rail_recess_mm
    for i, center in enumerate(_fork_centers(layout)):
        sheets.append(
            Sheet(f"fork.{i}", "underside", "underside", "frame", _fork_lining(center, outer))
        )
        low, high = center - FORK_WIDTH_MM / 2 - 4, center + FORK_WIDTH_MM / 2 + 4
        shell = _profile([(high, FLOOR_MM + 2), (high, 13.0), (low, 13.0), (low, FLOOR_MM + 2)])
        sheets.append(
            Sheet(
                f"fork.{i}.shell",
                "underside",
                "underside",
                "underside",
                sweep(shell, rows, (0, 1, 0)),
            )
        )
    return sheets


def _fork_lining(center: float, outer: float) -> Patch:
    """Return the tunnel from side to side, facing inward."""
    low, high = center - FORK_WIDTH_MM / 2, center + FORK_WIDTH_MM / 2
    bottom, top = FORK_Z_MM
    section = [(low, bottom), (high, bottom), (high, top), (low, top), (low, bottom)]
    rows = breaks(-outer, outer, 600.0)
    return sweep(_profile(section), rows, (0, 1, 0))

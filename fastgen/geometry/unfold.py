"""Flat-faceted parts with their unfolding: swept profiles, polygons and prisms.

A Sheet is a chart without a place in the atlas; `assemble` packs sheets into a Mesh.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.geometry.atlas_packing import packed
from fastgen.geometry.mesh import GROUP_SLACK_MM, MATERIALS, MAX_ZONES, Chart, Mesh, Zone
from fastgen.geometry.seams import stitched
from fastgen.geometry.zones import zones_of
from fastgen.scene.faces import FACE_AXES, FACES

Array = NDArray[np.float64]

_CLOSEST_MM = 0.01
"""Stations closer than this count as one."""

_SPACE_MM = 4.0
"""Space between the pieces of one chart, which share a material."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Triangles with their unfolding.

    Attributes:
        positions_mm: float64 [V, 3] in the container frame.
        normals: float64 [V, 3], unit length.
        sheet_mm: float64 [V, 2], coordinates on the sheet.
        triangles: int [T, 3], counter-clockwise both from outside and on the sheet.
    """

    positions_mm: Array
    normals: Array
    sheet_mm: Array
    triangles: NDArray[np.int64]

    @cached_property
    def size_mm(self) -> Array:
        """Width and height of the sheet's bounding box."""
        return np.asarray(np.ptp(self.sheet_mm, axis=0))

    def at(self, x: float, y: float) -> "Patch":
        """Move the sheet's lower left corner to (x, y)."""
        return replace(self, sheet_mm=self.sheet_mm - self.sheet_mm.min(axis=0) + (x, y))

    def turned(self) -> "Patch":
        """Turn the sheet by 90 degrees."""
        return replace(self, sheet_mm=self.sheet_mm @ np.array([[0.0, 1.0], [-1.0, 0.0]]))


@dataclass(frozen=True, eq=False)
class Sheet:
    """A chart without a place in the atlas.

    Attributes:
        name: Name of the chart.
        face: Its face, see Chart.
        material: Its material.
        group: Face group of its triangles, or "frame". The outermost facets of "frame" go to the
            group of their face, see Mesh.groups.
        patch: Its triangles.
        last: Whether it is packed after all others, in the room that they leave in the atlas.
    """

    name: str
    face: str
    material: str
    group: str
    patch: Patch
    last: bool = False


def breaks(low: float, high: float, step: float, extra: Iterable[float] = ()) -> Array:
    """Return ascending stations from low to high, at most `step` apart, that include all `extra`
    stations in between."""
    knots = [low]
    for knot in sorted(extra):
        if knots[-1] + _CLOSEST_MM < knot < high - _CLOSEST_MM:
            knots.append(knot)
    knots.append(high)
    pieces = [
        np.linspace(a, b, max(int(np.ceil((b - a) / step - 1e-9)), 1) + 1)[:-1]
        for a, b in pairwise(knots)
    ]
    return np.append(np.concatenate(pieces), high)


def coarsened(stations: Array, step: float) -> Array:
    """Return a subset of ascending stations with both ends and, if possible, gaps up to `step`."""
    kept = [0]
    for i in range(1, len(stations) - 1):
        if stations[i + 1] - stations[kept[-1]] > step:
            kept.append(i)
    return stations[[*kept, len(stations) - 1]]


def sweep(
    profile_mm: ArrayLike,
    stations_mm: ArrayLike,
    direction: ArrayLike,
    *,
    upright: bool = True,
    keep: Callable[[Array], NDArray[np.bool_]] | None = None,
    arc_mm: ArrayLike | None = None,
) -> Patch:
    """Sweep a polyline along a direction.

    Args:
        profile_mm: Polyline [K, 3].
        stations_mm: Stations [R] along the direction.
        direction: Unit vector [3].
        upright: True if the sheet's x runs along the polyline and y along the direction, False for
            the opposite. The cross product of x's and y's directions faces outward.
        keep: Returns which cells exist, bool [K-1, R-1], from their centres [K-1, R-1, 3].
        arc_mm: Sheet coordinates [K] of the polyline's points; by default its arc length.
    """
    profile, stations = np.asarray(profile_mm, np.float64), np.asarray(stations_mm, np.float64)
    along = np.asarray(direction, np.float64)
    edges = np.diff(profile, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    arc = np.append(0.0, np.cumsum(lengths)) if arc_mm is None else np.asarray(arc_mm, np.float64)
    strips, rows = len(edges), len(stations)
    ends = np.arange(strips)[:, None] + np.arange(2)
    positions = profile[ends][:, :, None, :] + stations[:, None] * along
    normal = _crossed(edges, along) * (1.0 if upright else -1.0) / lengths[:, None]
    sheet = np.empty((strips, 2, rows, 2))
    sheet[..., 0 if upright else 1] = arc[ends][:, :, None]
    sheet[..., 1 if upright else 0] = stations - stations[0]
    index = np.arange(strips * 2 * rows).reshape(strips, 2, rows)
    a, b = index[:, 0, :-1], index[:, 1, :-1]
    c, d = index[:, 1, 1:], index[:, 0, 1:]
    order = (a, b, c, a, c, d) if upright else (a, d, c, a, c, b)
    quads = np.stack(order, axis=-1).reshape(strips, rows - 1, 2, 3)
    normals = np.broadcast_to(normal[:, None, None, :], positions.shape)
    whole = Patch(
        positions.reshape(-1, 3), normals.reshape(-1, 3), sheet.reshape(-1, 2), quads.reshape(-1, 3)
    )
    if keep is None:
        return whole
    middle = (profile[:-1] + profile[1:])[:, None] / 2
    there = keep(middle + ((stations[:-1] + stations[1:]) / 2)[:, None] * along)
    used, numbers = np.unique(quads[there].reshape(-1, 3), return_inverse=True)
    return Patch(
        whole.positions_mm[used],
        whole.normals[used],
        whole.sheet_mm[used],
        numbers.reshape(-1, 3),
    )


def _crossed(vectors: Array, axis: Array) -> Array:
    """Return vectors [..., 3] cross one axis [3], in a fifth of the time of np.cross."""
    x, y, z = axis.tolist()
    crossed: Array = vectors @ np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return crossed


def flat(points_mm: ArrayLike, triangles: ArrayLike, right: ArrayLike, up: ArrayLike) -> Patch:
    """Return triangles [T, 3] of coplanar points [N, 3], seen with unit vectors right and up."""
    points = np.asarray(points_mm, np.float64)
    x, y = np.asarray(right, np.float64), np.asarray(up, np.float64)
    sheet = np.stack([points @ x, points @ y], axis=1)
    corners = np.array(triangles, np.int64)
    a, b, c = sheet[corners].transpose(1, 0, 2)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    mirrored = ux * vy - uy * vx < 0
    corners[mirrored] = corners[mirrored][:, ::-1]
    normals = np.broadcast_to(_crossed(x, y), points.shape)
    return Patch(points, normals, sheet, corners)


def polygon(points_mm: ArrayLike, right: ArrayLike, up: ArrayLike) -> Patch:
    """Return a convex polygon [N, 3] of either winding, seen with unit vectors right and up."""
    count = len(np.asarray(points_mm))
    fan = [(0, i, i + 1) for i in range(1, count - 1)]
    return flat(points_mm, fan, right, up)


def regular(center: tuple[float, float], radius: float, sides: int) -> Array:
    """Return the corners [sides, 2] of a regular polygon for `prism`, counter-clockwise.

    All corners are at distance `radius`, so no point is farther away.
    """
    turn = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.array(center) + radius * np.column_stack([np.cos(turn), np.sin(turn)])


def beside(patches: Sequence[Patch]) -> Patch:
    """Put patches side by side on one sheet, each upright."""
    x = 0.0
    parts = []
    for patch in patches:
        placed = (patch.turned() if patch.size_mm[0] > patch.size_mm[1] else patch).at(x, 0.0)
        parts.append(placed)
        x += float(placed.size_mm[0]) + _SPACE_MM
    return joined(parts)


def joined(patches: Sequence[Patch]) -> Patch:
    """Join patches that already share the coordinates of one sheet."""
    first = np.cumsum([0, *(len(p.positions_mm) for p in patches[:-1])])
    return Patch(
        np.concatenate([p.positions_mm for p in patches]),
        np.concatenate([p.normals for p in patches]),
        np.concatenate([p.sheet_mm for p in patches]),
        np.concatenate([p.triangles + k for p, k in zip(patches, first, strict=True)]),
    )


def prism(
    outline_mm: ArrayLike, stations_mm: ArrayLike, axis: int, *, capped: tuple[bool, bool]
) -> Patch:
    """Sweep a convex outline along a coordinate axis.

    Args:
        outline_mm: Outline [N, 2] in the two following axes (y, z for x; z, x for y; x, y for z),
            counter-clockwise seen from the tip of the axis.
        stations_mm: Stations along the axis.
        axis: 0, 1 or 2.
        capped: Whether the low and the high end have a cap.
    """
    outline = np.asarray(outline_mm, np.float64)
    stations = np.asarray(stations_mm, np.float64)
    a, b, direction = np.roll(np.eye(3), -axis, axis=0)[[1, 2, 0]]
    points = outline[:, :1] * a + outline[:, 1:] * b
    patches = [sweep(np.vstack([points, points[:1]]), stations, direction)]
    if capped[0]:
        patches.append(polygon(points + stations[0] * direction, b, a))
    if capped[1]:
        patches.append(polygon(points + stations[-1] * direction, a, b))
    return beside(patches)


def box(low_mm: ArrayLike, high_mm: ArrayLike, step_mm: float = np.inf) -> Patch:
    """Return the six faces of an axis-aligned box.

    They are unfolded around the longest edge, and cut across it every step_mm.
    """
    low, high = np.asarray(low_mm, np.float64), np.asarray(high_mm, np.float64)
    axis = int(np.argmax(high - low))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    outline = [(low[i], low[j]), (high[i], low[j]), (high[i], high[j]), (low[i], high[j])]
    return prism(outline, breaks(low[axis], high[axis], step_mm), axis, capped=(True, True))


def assemble(
    sheets: Sequence[Sheet],
    outer_size_mm: tuple[float, float, float] | None = None,
    flats: Mapping[str, tuple[tuple[float, float], ...]] | None = None,
) -> Mesh:
    """Pack sheets into one atlas and join them into a Mesh.

    Args:
        sheets: The parts.
        outer_size_mm: Length, width and height of the container, whose planes Mesh.groups refer
            to. Without it, all sheets keep their group.
        flats: Mesh.flats.

    Returns:
        A mesh whose triangles are sorted by group.
    """
    assert all(s.material in MATERIALS and s.face in FACES for s in sheets)
    packing = packed(
        np.array([s.patch.size_mm for s in sheets]), np.array([s.last for s in sheets])
    )
    patches = [
        (s.patch.turned() if turned else s.patch).at(x, y)
        for s, turned, (x, y) in zip(sheets, packing.turned, packing.corners, strict=True)
    ]
    zones, zone = _zones(patches, [s.name in FACES for s in sheets])
    assert len(zones) < MAX_ZONES
    whole = joined(patches)
    values = np.column_stack([whole.normals, whole.sheet_mm, zone])
    positions, values, triangles, source = stitched(whole.positions_mm, values, whole.triangles)
    group = np.concatenate([_groups(s, outer_size_mm) for s in sheets])[source]
    order = np.argsort(group, kind="stable")
    ends = np.searchsorted(group[order], np.arange(len(FACES) + 2))
    names = (*FACES, "frame")
    return Mesh(
        positions_mm=positions.astype(np.float32),
        normals=values[:, :3].astype(np.float32),
        atlas_mm=values[:, 3:5].astype(np.float32),
        zone=np.rint(values[:, 5]).astype(np.uint16),
        triangles=triangles[order].astype(np.uint32),
        charts=tuple(
            Chart(s.name, s.face, s.material, (float(x), float(y), *p.size_mm.tolist()))
            for s, p, (x, y) in zip(sheets, patches, packing.corners, strict=True)
        ),
        zones=zones,
        atlas_size_mm=packing.size,
        groups={n: slice(int(ends[i]), int(ends[i + 1])) for i, n in enumerate(names)},
        flats=flats or {},
    )


def _zones(
    patches: Sequence[Patch], panels: Sequence[bool]
) -> tuple[tuple[Zone, ...], NDArray[np.int64]]:
    """Return the zones of placed charts, and the zone number of each vertex."""
    zones: list[Zone] = []
    of_vertices = []
    for chart, (patch, panel) in enumerate(zip(patches, panels, strict=True)):
        heights, corners = patch.positions_mm[:, 2], patch.triangles
        found, which = zones_of(chart, patch.sheet_mm, heights, patch.normals, corners, panel)
        of_vertices.append(np.zeros(len(heights), np.int64))
        of_vertices[-1][corners] = len(zones) + which[:, None]
        zones += found
    return tuple(zones), np.concatenate(of_vertices)


def _groups(sheet: Sheet, outer_size_mm: tuple[float, float, float] | None) -> NDArray[np.int64]:
    """Return the index into (*FACES, "frame") of each triangle.

    A facet of the frame is visible only from in front of its own plane. If it is parallel to a face
    and no deeper than GROUP_SLACK_MM, it belongs to the group of that face.
    """
    patch = sheet.patch
    if sheet.group != "frame":
        return np.full(len(patch.triangles), FACES.index(sheet.group))
    result = np.full(len(patch.triangles), len(FACES))
    if outer_size_mm is None:
        return result
    length, width, height = outer_size_mm
    half = np.array([length, width, height]) / 2
    depth_center = patch.positions_mm - (0.0, 0.0, height / 2)
    for i, face in enumerate(FACES):
        out = np.array(FACE_AXES[face].out)
        depth = np.abs(out) @ half - depth_center @ out
        outer = (patch.normals @ out > 1 - 1e-9) & (depth <= GROUP_SLACK_MM + 1e-6)
        result[outer[patch.triangles].all(axis=1)] = i
    return result

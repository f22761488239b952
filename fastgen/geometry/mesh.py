"""A triangle mesh with one atlas in millimetres, and the map from its sheets to the surface.

Container frame: right-handed, z up, origin at the centre of the footprint, z = 0 at the bottom of
the bottom castings, +x at the door end.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.errors import ConfigError
from fastgen.files import disk_cache
from fastgen.geometry.chart_sheet import LAYOUT as SHEET_LAYOUT
from fastgen.geometry.chart_sheet import VERSION as SHEET_VERSION
from fastgen.geometry.chart_sheet import ChartSheet
from fastgen.geometry.distinct_rows import distinct_rows
from fastgen.geometry.sheet_folds import VERSION as FOLDS_VERSION
from fastgen.geometry.sheet_folds import SheetFolds, corrugated_axis
from fastgen.scene.faces import FACES, SHEET_FACES
from fastgen.scene.limits import HASPS

VERSION = 1  # raise when the stored arrays change

MATERIALS = (
    *("paint_sheet", "paint_frame", "casting", "galvanized", "rubber", "underside"),
    *("spreader", "cable"),
    *(f"seal_{hasp}" for hasp in range(HASPS)),
    "seal_steel",
)

UNIT_CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
"""Corners of a cube from 0 to 1, int [8, 3]."""

_UNIT_CUBE_FACES = ("013 032", "467 475", "045 051", "237 276", "026 064", "157 173")
UNIT_CUBE_TRIANGLES = np.array(
    [[int(corner) for corner in three] for face in _UNIT_CUBE_FACES for three in face.split()],
    np.uint32,
)
"""Triangles of the faces of UNIT_CUBE, uint32 [12, 3], counter-clockwise from outside."""

MAX_ZONES = 500
"""Upper limit of the zones of one mesh: the zone numbers of a container and a spreader together fit
into ten bits of the visibility buffer."""

_RIM_MM = 60.0
"""Distance from two sides of the box around a mesh within which a point is at its rim. Posts and
rails are that near; walls between them do not count."""

GROUP_SLACK_MM = 12.0
"""Largest distance of a face's frame behind the plane of the castings, see Mesh.groups."""


@dataclass(frozen=True)
class Chart:
    """One part's piece of the atlas.

    Attributes:
        name: Unique name of the part, such as "door.bar.0".
        face: The side of the container that the part belongs to, one of FACES.
        material: One of MATERIALS.
        rect_mm: x0, y0, width and height in the atlas. Coordinates relative to (x0, y0) are called
            sheet coordinates.
    """

    name: str
    face: str
    material: str
    rect_mm: tuple[float, float, float, float]

    @property
    def material_index(self) -> int:
        """Position of the material in MATERIALS."""
        return MATERIALS.index(self.material)


@dataclass(frozen=True)
class Zone:
    """A part of a chart with its own edges for rust and dirt, such as one side of a beam.

    Attributes:
        chart: Index into Mesh.charts.
        rect_mm: x0, y0, width and height in the atlas.
        quarter_turns: Quarter turns clockwise from the atlas's +y to the world's up; 0 for
            horizontal parts.
        small: True for a collection of narrow pieces, packed anywhere in the chart.
        level: True for horizontal parts, where water does not run down.
    """

    chart: int
    rect_mm: tuple[float, float, float, float]
    quarter_turns: int
    small: bool
    level: bool


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with flat normals, their vertices split at creases.

    Meshes are compared by identity and their arrays must not change. Derived arrays, which are
    properties, are computed on first use and kept with the mesh.

    Attributes:
        positions_mm: float32 [V, 3] in the container frame.
        normals: float32 [V, 3], unit length.
        atlas_mm: float32 [V, 2].
        zone: uint16 [V], indices into zones. The zones of a chart are sorted by size, the largest
            first.
        triangles: uint32 [T, 3], counter-clockwise from outside.
        charts: The parts.
        zones: The zones of all charts.
        atlas_size_mm: Width and height.
        groups: Range of triangles of each face, and of "frame". A triangle of face F is never the
            first hit of a ray from outside the container's outer box unless the ray starts in
            front of F's plane of that box moved inward by GROUP_SLACK_MM. Triangles that cannot
            guarantee this are in "frame".
        flats: Sheet coordinates (start, end) in mm of the outermost flats of each corrugated face,
            ascending. They run along sheet x, on the door along sheet y.
    """

    positions_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    atlas_mm: NDArray[np.float32]
    zone: NDArray[np.uint16]
    triangles: NDArray[np.uint32]
    charts: tuple[Chart, ...]
    zones: tuple[Zone, ...]
    atlas_size_mm: tuple[float, float]
    groups: Mapping[str, slice]
    flats: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @cached_property
    def chart(self) -> NDArray[np.uint16]:
        """Index [V] into charts of each vertex."""
        return np.array([zone.chart for zone in self.zones], np.uint16)[self.zone]

    @cached_property
    def panels(self) -> Mapping[str, ChartSheet]:
        """Sheets of those SHEET_FACES that the mesh has, by face."""
        numbers = [i for i, chart in enumerate(self.charts) if chart.name in SHEET_FACES]
        return {self.charts[number].name: self._stored_sheet(number) for number in numbers}

    def sheet(self, number: int) -> ChartSheet:
        """Return the triangles of a chart on its sheet.

        Args:
            number: Index into charts.
        """
        name = self.charts[number].name
        return self.panels[name] if name in SHEET_FACES else self._sheet(number)

    @cached_property
    def folds(self) -> Mapping[str, SheetFolds]:
        """Slopes of those SHEET_FACES that the mesh has, by face."""

        def make() -> disk_cache.Arrays:
            return {face: SheetFolds.of(self, face).sums for face in self.panels}

        inputs = self.shape_digest, self.atlas_digest
        layout = {face: f"float64 {face} 2" for face in self.panels}
        stored = disk_cache.cached("folds", FOLDS_VERSION, inputs, make, layout=layout)
        return {face: SheetFolds(corrugated_axis(face), sums) for face, sums in stored.items()}

    def _sheet(self, number: int) -> ChartSheet:
        index = np.flatnonzero(self.chart[self.triangles[:, 0]] == number)
        corners = self.atlas_mm[self.triangles[index]].astype(np.float64)
        left, bottom, width, height = self.charts[number].rect_mm
        return ChartSheet.of(index, corners - (left, bottom), (width, height))

    def _stored_sheet(self, number: int) -> ChartSheet:
        def make() -> disk_cache.Arrays:
            return vars(self._sheet(number))

        inputs = self.atlas_digest, number
        stored = disk_cache.cached("sheet", SHEET_VERSION, inputs, make, layout=SHEET_LAYOUT)
        return ChartSheet(**stored)

    def chart_index(self, name: str) -> int:
        """Return the index of a chart.

        Args:
            name: Name of the chart.

        Raises:
            ConfigError: There is no such chart.
        """
        try:
            return self._chart_numbers[name]
        except KeyError:
            raise ConfigError(
                f"chart {name!r}: no such part of the container; panels are {', '.join(FACES)}"
            ) from None

    def sheet_to_surface(
        self, chart_name: str, sheet_mm: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Map sheet coordinates to the surface at rest.

        A point on the border of two facets gets the normal of one of them. A point outside the
        chart's triangles, such as beyond its border or between the door leaves, gets a place in
        the plane of the triangle that it is least far outside of.

        Args:
            chart_name: Name of the chart.
            sheet_mm: Sheet coordinates [K, 2] in mm.

        Returns:
            Positions float64 [K, 3] in mm and unit normals float64 [K, 3].

        Raises:
            ConfigError: There is no such chart.
        """
        number = self.chart_index(chart_name)
        points = np.asarray(sheet_mm, np.float64).reshape(-1, 2)
        triangle, weights = self.sheet(number).find(points)
        corners = self.triangles[triangle]
        positions = np.einsum("kc,kcd->kd", weights, self.positions_mm[corners].astype(np.float64))
        normals = self.normals[corners[:, 0]].astype(np.float64)
        return positions, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def prepare(self, damages: bool) -> None:
        """Compute the cached properties that labels and rust need.

        The first image is then as fast as later ones.

        Args:
            damages: Prepare for damaged scenes too.
        """
        _ = self.panels, self.hull, self.rim, self.zone_areas_mm2
        if damages:
            _ = self.triangle_bounds_mm

    @cached_property
    def bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [3] of all vertices."""
        return self.positions_mm.min(axis=0), self.positions_mm.max(axis=0)

    @cached_property
    def triangle_bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [T, 3] of each triangle."""

        def found() -> disk_cache.Arrays:
            a, b, c = self.positions_mm[self.triangles].transpose(1, 0, 2)
            low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            return {"low": low, "high": high}

        layout = dict.fromkeys(("low", "high"), f"float32 {len(self.triangles)} 3")
        bounds = disk_cache.cached(
            "triangle-bounds", VERSION, self.shape_digest, found, layout=layout
        )
        return bounds["low"], bounds["high"]

    @cached_property
    def zone_areas_mm2(self) -> NDArray[np.float64]:
        """Area of each zone [Z] on the sheets."""
        corners = self.atlas_mm[self.triangles].astype(float)
        area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
        of_zone = np.bincount(self.zone[self.triangles[:, 0]], area, len(self.zones))
        return of_zone.astype(np.float64, copy=False)

    @cached_property
    def points_mm(self) -> NDArray[np.float64]:
        """Distinct positions [P, 3] of the vertices."""
        first, _ = self.distinct
        return self.positions_mm[first].astype(np.float64)

    @cached_property
    def distinct(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices [P] of a vertex at each of points_mm, and the point [V] of each vertex."""
        return distinct_rows(self.positions_mm)

    @cached_property
    def hull(self) -> NDArray[np.int64]:
        """Indices into points_mm of the corners of the convex hull."""

        def found() -> dict[str, NDArray[np.int64]]:
            from scipy.spatial import ConvexHull  # takes 0.3 s, and hulls are kept on disk

            return {"hull": np.asarray(ConvexHull(self.points_mm).vertices, np.int64)}

        stored = disk_cache.cached(
            "hull", VERSION, self.shape_digest, found, layout={"hull": "int64 K"}
        )
        return stored["hull"]

    @cached_property
    def rim(self) -> NDArray[np.int64]:
        """Indices into points_mm of points near the edges of the box around the mesh."""
        low, high = self.points_mm.min(axis=0), self.points_mm.max(axis=0)
        beside = (self.points_mm < low + _RIM_MM) | (self.points_mm > high - _RIM_MM)
        return np.flatnonzero(beside.sum(axis=1) > 1)

    @cached_property
    def shape_digest(self) -> str:
        """SHA-256 of positions, normals and triangles in hexadecimal digits."""
        arrays = (self.positions_mm, self.normals, self.triangles)
        return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()

    @cached_property
    def atlas_digest(self) -> str:
        """SHA-256 of everything that places the triangles on the sheets."""
        digest = hashlib.sha256(repr((self.charts, self.zones)).encode())
        for array in (self.atlas_mm, self.zone, self.triangles):
            digest.update(array.data)
        return digest.hexdigest()

    @cached_property
    def _chart_numbers(self) -> dict[str, int]:
        return {chart.name: i for i, chart in enumerate(self.charts)}

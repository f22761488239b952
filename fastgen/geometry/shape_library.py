"""The meshes of container and spreader shapes, each loaded once per process."""

from functools import cached_property, lru_cache

import numpy as np

from fastgen.geometry.container import NOMINAL_PROFILES, build_container, container_outline
from fastgen.geometry.divided_mesh import LENS_EDGE_MM, divided
from fastgen.geometry.door_clearance import DoorClearance, door_clearance
from fastgen.geometry.facets import Facets, in_fours, mesh_facets
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.ray_triangles import RayTriangles
from fastgen.geometry.solids import Body, without_cables
from fastgen.geometry.spreader import (
    USUAL_GAP_MM,
    Bounds,
    check_gap,
    lifted,
    tier_bounds_mm,
    touching_spreader,
)
from fastgen.geometry.spreader_parts import CUT_MM
from fastgen.scene.container_kinds import WallProfiles

CONTAINER_SHAPES = 32
"""Containers that a library holds, 2 MB each; a configuration with the usual four kinds and three
corrugation depths has 12."""

SPREADER_SHAPES = 64
"""Spreaders that a library holds, 0.5 MB each and 2 MB with lens distortion; the presets have
48: four kinds of container, raised or lowered flippers on either side, and three gaps."""


class SpreaderShape:
    """The meshes of one spreader at one gap, and the geometry that labels and shadows derive.

    All derived members are computed on first use and kept with the shape.

    Attributes:
        mesh: The spreader as it is drawn without lens distortion. Its members are cut every CUT_MM
            so that vertices can carry indirect light.
        outline: The same surface with as few triangles as possible.
    """

    def __init__(self, mesh: Mesh, outline: Mesh) -> None:
        self.mesh = mesh
        self.outline = outline

    def drawn(self, lens: bool) -> Mesh:
        """Return the mesh that images show; `lens`: with lens distortion."""
        return self._lens_mesh if lens else self.mesh

    def facets(self, lens: bool) -> Facets:
        """Return the surface as polygons with up to four corners, divided like `drawn`."""
        return self._lens_facets if lens else self._facets

    @cached_property
    def solid(self) -> Body:
        """The outline without the cables, for shadow maps."""
        return without_cables(self.outline)

    @cached_property
    def tier_bounds_mm(self) -> tuple[Bounds, ...]:
        """Lowest and highest coordinates [3] of each of spreader_parts.TIERS."""
        return tier_bounds_mm(self.mesh)

    @cached_property
    def ray_triangles(self) -> RayTriangles:
        """The outline, prepared for ray tests."""
        return RayTriangles(self.outline)

    @cached_property
    def _lens_mesh(self) -> Mesh:
        return divided(self.mesh, LENS_EDGE_MM)

    @cached_property
    def _facets(self) -> Facets:
        return in_fours(mesh_facets(self.outline))

    @cached_property
    def _lens_facets(self) -> Facets:
        return in_fours(mesh_facets(self._lens_mesh))


class ShapeLibrary:
    """The most recently used meshes by shape, with everything derived from a mesh alone.

    Equal arguments give the same object while it is held, so that identity can be a key. A mesh
    that is not held is read from the disk cache, which takes about 10 ms, or built, which takes
    about a second. Threads may share a library.
    """

    def __init__(self) -> None:
        self._containers = lru_cache(CONTAINER_SHAPES)(build_container)
        self._outlines = lru_cache(CONTAINER_SHAPES)(container_outline)
        self._clearances = lru_cache(CONTAINER_SHAPES)(door_clearance)
        self._touching = lru_cache(SPREADER_SHAPES)(touching_spreader)
        self._spreaders = lru_cache(SPREADER_SHAPES)(self._spreader)

    def container(self, kind: str, profiles: WallProfiles = NOMINAL_PROFILES) -> Mesh:
        """Return the mesh of a container at rest, as it is drawn; see build_container."""
        return self._containers(kind, profiles)

    def container_outline(self, kind: str, profiles: WallProfiles = NOMINAL_PROFILES) -> Mesh:
        """Return the same surface with as few triangles as possible."""
        return self._outlines(kind, profiles)

    def door_clearance(self, kind: str, profiles: WallProfiles = NOMINAL_PROFILES) -> DoorClearance:
        """Return the map of the door's sheet that locking gear covers."""
        return self._clearances(self.container(kind, profiles))

    def spreader(
        self, kind: str, flippers_down: tuple[bool, bool], gap_mm: float = USUAL_GAP_MM
    ) -> SpreaderShape:
        """Return a spreader; see build_spreader for the arguments."""
        return self._spreaders(kind, flippers_down, gap_mm)

    def _spreader(
        self, kind: str, flippers_down: tuple[bool, bool], gap_mm: float
    ) -> SpreaderShape:
        check_gap(gap_mm)
        mesh, outline = (
            lifted(self._touching(kind, flippers_down, cut_mm), gap_mm)
            for cut_mm in (CUT_MM, np.inf)
        )
        return SpreaderShape(mesh, outline)


SHAPES = ShapeLibrary()
"""The library of this process. Sampling, rendering, labels and formats all use the shapes of the
same few containers, often without a Generator at hand, and several Generators share them too."""

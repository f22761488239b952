"""What stands in the way of light, as depth maps that light from far away in one direction sees.

Maps keep back faces (those turned away from the light) rather than front ones: a lit surface is
then no occluder of itself. Of thick bodies they keep front faces as well, sunk into them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.mesh import UNIT_CUBE, UNIT_CUBE_TRIANGLES, Mesh
from fastgen.spreader import CABLE_TIER, tier_of_vertices

_CORE_MM = 200.0
"""So far behind a container's sides its core begins."""

_SUNK_MM = 50.0
"""So far behind the front faces of a thick body light is stopped: less than a container's frame is
thick, and more than what lookups beside their place find nearer to the light on the same face. By
rays to suns all round, 30 mm let a fifth less light through, and shade a fifth more of what lies in
it at a grazing angle."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Body:
    """What stands in the way. positions_mm: float32 [V, 3]. triangles: uint32 [T, 3],
    counter-clockwise from outside."""

    positions_mm: NDArray[np.float32]
    triangles: NDArray[np.uint32]

    @cached_property
    def bounds_mm(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates [3] of all vertices."""
        columns = np.ascontiguousarray(self.positions_mm.T)  # rows take ten times as long
        return columns.min(axis=1), columns.max(axis=1)


Tile = tuple[int, int, int, int]
"""A part of a map: its first texels along and across, and how many they are."""

Solid = Body | Mesh
"""A mesh stands in the way as it is."""


@lru_cache(maxsize=256)  # as many as there are spreaders
def without_cables(spreader: Mesh) -> Body:
    """What of a spreader throws shade; its cables are too thin for the maps."""
    solid = tier_of_vertices(spreader) != CABLE_TIER
    triangles = spreader.triangles[solid[spreader.triangles[:, 0]]]
    used, numbers = np.unique(triangles, return_inverse=True)
    return Body(spreader.positions_mm[used], numbers.reshape(-1, 3).astype(np.uint32))


def core_of(container: Mesh) -> Body:
    """A box within a container.

    It stands in the way as well: maps that keep back faces lack the side that the light meets, and
    through the far one, thin as it is, light leaks along creases, within a texel and the bias.
    """
    low, high = container.bounds_mm
    inset = np.minimum(_CORE_MM, (high - low) / 3)
    corners = low + inset + UNIT_CUBE * (high - low - 2 * inset)
    return Body(corners.astype(np.float32), UNIT_CUBE_TRIANGLES)


def map_matrix(toward: Array, low: Array, high: Array) -> Array:
    """From mm to clip space [4, 4] of a parallel view of the box low..high from direction `toward`;
    the box's x axis lies along the view's."""
    along = np.array([1.0, 0.0, 0.0]) - toward[0] * toward
    if np.linalg.norm(along) < 1e-6:  # the view is along x itself
        along = np.array([0.0, 1.0, 0.0])
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(toward, along), -toward])
    center = (low + high) / 2
    half = np.abs(axes) @ ((high - low) / 2) * 1.001
    matrix = np.eye(4)
    matrix[:3, :3] = axes / half[:, None]
    matrix[:3, 3] = -matrix[:3, :3] @ center
    return matrix


class DrawnBody:
    """A Solid on the GPU. program: of occluder.vert."""

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program, body: Solid) -> None:
        self._vertices = ctx.buffer(np.ascontiguousarray(body.positions_mm, np.float32).tobytes())
        self._indices = ctx.buffer(np.ascontiguousarray(body.triangles, np.uint32).tobytes())
        content = [(self._vertices, "3f", "in_position_mm")]
        self.array = ctx.vertex_array(program, content, self._indices)

    def release(self) -> None:
        """Free it."""
        for item in (self.array, self._vertices, self._indices):
            item.release()


@dataclass(frozen=True, eq=False)
class MapView:
    """What a part of a map shows: bodies, as the map_matrix `to_map` sees them. thick: those of
    them whose front faces are kept as well, sunk into them; near the edge of a thick body a texel
    may hold no back face that stands in the way of what lies beside it."""

    bodies: Sequence[DrawnBody]
    to_map: Array
    tile: Tile
    thick: Sequence[DrawnBody] = ()


class DepthMap:
    """A depth texture of (along, across) = size texels. program: of occluder.vert, the owner's."""

    def __init__(
        self, ctx: moderngl.Context, program: moderngl.Program, size: tuple[int, int]
    ) -> None:
        self._ctx = ctx
        self._program = program
        self.depth = ctx.depth_texture(size)
        self._target = ctx.framebuffer([], self.depth)

    def draw(self, views: Iterable[MapView]) -> None:
        """Show views; what lies beside their tiles is left as it was."""
        ctx = self._ctx
        self._target.use()
        ctx.scissor = None
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.front_face = "ccw"
        for view in views:
            self._target.clear(depth=1.0, viewport=view.tile)
            self._target.viewport = view.tile
            ctx.cull_face = "front"
            self._show(view.bodies, view.to_map)
            if view.thick:
                self._show_sunk(view.thick, view.to_map)
        ctx.cull_face = "back"

    def _show_sunk(self, bodies: Sequence[DrawnBody], to_map: Array) -> None:
        sunk = to_map.copy()
        sunk[2, 3] += _SUNK_MM * np.linalg.norm(sunk[2, :3])
        self._ctx.cull_face = "back"
        self._ctx.polygon_offset = 1.0, 0.0  # and by what a face falls within a texel
        try:
            self._show(bodies, sunk)
        finally:
            self._ctx.polygon_offset = 0.0, 0.0

    def _show(self, bodies: Sequence[DrawnBody], to_map: Array) -> None:
        self._program["to_map"] = tuple(to_map.T.ravel())
        for body in bodies:
            body.array.render(moderngl.TRIANGLES)

    def release(self) -> None:
        """Free all but the program."""
        for item in (self._target, self.depth):
            item.release()

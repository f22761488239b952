"""Depth maps of occluders, as parallel light from one direction sees them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from fastgen.light.occluders import Array, Solid

_SUNK_MM = 50.0
"""So far behind the front faces of a thick body light is stopped: less than a container's frame is
thick, and more than what lookups beside their place find nearer to the light on the same face. By
rays to suns all round, 30 mm let a fifth less light through, and shade a fifth more of what lies in
it at a grazing angle."""

Tile = tuple[int, int, int, int]
"""A part of a map: its first texels along and across, and how many they are."""


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

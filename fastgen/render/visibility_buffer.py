"""Visibility buffer: which surface each sample of an image sees, and where on it."""

import ctypes
from collections.abc import Sequence
from typing import Any, TypeVar

import moderngl
import numpy as np

from fastgen.render.gl import GLContext
from fastgen.render.gl_enums import GL_SCISSOR_TEST
from fastgen.render.regions import Region
from fastgen.render.sample_lattice import SampleLattice
from fastgen.render.textures import DEPTHS, FLOATS, NUMBERS, texture_clearing

T = TypeVar("T")


_OUT_OF_REACH_MM = 1e6
"""Rest position, along each axis, of samples that no damage touches."""

_STEP_ROWS = 240
"""Number of rows by which textures grow. No multiple is a power of two, see textures.data_texture.
"""


class VisibilityBuffer:
    """Textures that the geometry pass writes, one texel per sample.

    They hold surface id, atlas position, depth, sky visibility and the light of each sample, and
    for damaged scenes the rest position. A holed scene has a second, mirrored view below the first
    one: what holes reveal of the interior. Images of a size share the textures, which grow when a
    scene needs more rows, because a driver may keep all of a texture in memory.

    Attributes:
        per_axis: Samples per pixel along each axis.
        inner_row: First row of the view of the interior.
        to_clip: Matrix [2, 2] from the image's clip space to the buffer's, see SampleLattice.
    """

    def __init__(
        self,
        gl: GLContext,
        size: tuple[int, int],
        samples_per_axis: int,
        starts_small: bool = False,
    ) -> None:
        """Prepare the buffer of (width, height) = size images.

        Args:
            gl: Current context.
            size: Image size in pixels.
            samples_per_axis: As many as sample_lattice.fitting allows, or fewer.
            starts_small: Begin with the rows that the first scene needs, instead of those of a
                whole image. It suits containers that rarely reach the lower edge of an image.
        """
        self._ctx = gl.ctx
        self._size = size
        self.per_axis = samples_per_axis
        self._lattice = SampleLattice(samples_per_axis)
        self._fine = self._lattice.texels(size)
        row = self._lattice.inner_row(size, gl.ctx.info["GL_MAX_TEXTURE_SIZE"])
        assert row is not None, "more samples than `fitting` allows"
        self.inner_row = row
        self.to_clip = self._lattice.to_clip(size)
        self._rows = 0
        self._least_rows = 0 if starts_small else self._fine[1]
        self._owned: list[Any] = []
        self._rest: list[moderngl.Texture] = []
        self._viewport = gl.function(
            "glViewportIndexedf", None, ctypes.c_uint, *[ctypes.c_float] * 4
        )
        self._scissor = gl.function("glScissorIndexed", None, ctypes.c_uint, *[ctypes.c_int] * 4)
        self._enable = gl.function("glEnablei", None, ctypes.c_uint, ctypes.c_uint)
        self._disable = gl.function("glDisablei", None, ctypes.c_uint, ctypes.c_uint)
        self._clear = texture_clearing(gl)

    @property
    def textures(self) -> dict[str, moderngl.Texture]:
        """The textures by sampler name; valid until a scene makes the buffer grow."""
        names = (
            "surface_ids",
            "atlas_positions",
            "surface_depths",
            "sky_visibility_cones",
            "sky_visibility_light",
        )
        usual = (
            self._surface_ids,
            self._atlas_positions,
            self._depths,
            self._visibility,
            self._light,
        )
        rest = zip(("rest_x", "rest_y", "rest_z"), self._rest, strict=False)
        return {**dict(zip(names, usual, strict=True)), **dict(rest)}

    def begin(
        self,
        damage: str,
        seen: Sequence[Region | None],
        rest: Sequence[Region | None] = (),
        holes: Sequence[Region | None] = (),
        over: bool = False,
    ) -> None:
        """Clear the parts of the buffer that will be read, and bind it for undamaged surfaces.

        Args:
            damage: One of DAMAGE_VARIANTS.
            seen: Regions of the image that will be read; None is the whole image.
            rest: Regions where rest positions will be read.
            holes: Regions that `limit_inside` will name.
            over: The surfaces are drawn over an image, which has its sky already.
        """
        boxes = [*map(self._texels, seen), *map(self._texels_inside, holes)]
        self._make_room(damage, max((top + height for _, top, _, height in boxes), default=1))
        for box in boxes:
            self._clear(self._surface_ids, box, NUMBERS, 0)
        # with single samples the depth separates sky from surfaces, see ImageTargets.begin
        outer = [None] if self.per_axis == 1 and not over else seen
        for box in (*map(self._texels, outer), *map(self._texels_inside, holes)):
            self._clear(self.depth_buffer, box, DEPTHS, 1.0)
        for box in map(self._texels, rest) if damage != "undamaged" else ():
            for texture in self._rest:
                self._clear(texture, box, FLOATS, _OUT_OF_REACH_MM)
        self._use(self._undamaged)

    def limit(self, region: Region) -> None:
        """Restrict drawing to what pixels of a region read, until `end`."""
        self._undamaged.scissor = self._texels(region)

    def begin_damaged(self) -> None:
        """Bind the buffer for surfaces that damages touch, which also store rest positions."""
        self._use(self._damaged)

    def _use(self, target: moderngl.Framebuffer) -> None:
        target.use()
        target.viewport = (0, 0, *self._fine)

    def _make_room(self, damage: str, rows: int) -> None:
        most = self._fine[1] + (self.inner_row if damage == "holed" else 0)
        rows = max(min(-(-rows // _STEP_ROWS) * _STEP_ROWS, most), self._least_rows)
        if rows > self._rows:
            self.release()
            self._rows = rows
            self._surface_ids = self._texture(1, "u4")
            # llvmpipe takes three times as long for four numbers a texel as for four textures of
            # one, and twice as long for bytes as for a number that holds four of them
            self._atlas_positions = self._texture(2, "f4")
            self._depths = self._texture(1, "f4")
            self._visibility = self._texture(1, "u4")
            self._light = self._texture(1, "u4")
            self.depth_buffer = self._own(self._ctx.depth_texture((self._fine[0], rows)))
            self._undamaged = self._framebuffer()
        if damage != "undamaged" and not self._rest:
            self._rest = [self._texture(1, "f4") for _ in range(3)]
            self._damaged = self._framebuffer()

    def _framebuffer(self) -> moderngl.Framebuffer:
        usual = [
            self._surface_ids,
            self._atlas_positions,
            self._depths,
            self._visibility,
            self._light,
        ]
        made: moderngl.Framebuffer = self._ctx.framebuffer([*usual, *self._rest], self.depth_buffer)
        return self._own(made)

    def _texture(self, components: int, dtype: str) -> moderngl.Texture:
        made = self._ctx.texture((self._fine[0], self._rows), components, dtype=dtype)
        made.filter = (moderngl.NEAREST, moderngl.NEAREST)
        made.repeat_x = made.repeat_y = False  # faster than repeating
        return self._own(made)

    def _own(self, made: T) -> T:
        self._owned.append(made)
        return made

    def limit_inside(self, region: Region | None) -> None:
        """Restrict drawing of the interior to what holes in a region of the image reveal."""
        width, height = self._fine
        self._viewport(1, 0.0, self.inner_row, width, height)
        self._scissor(1, *self._texels_inside(region))
        self._enable(GL_SCISSOR_TEST, 1)

    def end(self) -> None:
        """Lift the restrictions of `limit` and `limit_inside`."""
        self._undamaged.scissor = (0, 0, *self._fine)
        self._disable(GL_SCISSOR_TEST, 1)

    def _texels(self, region: Region | None) -> Region:
        """Return the texels that pixels of a region read."""
        region = region or (0, 0, *self._size)
        left, right = np.clip(self._lattice.columns(region), 0, self._fine[0]).tolist()
        top, bottom = np.clip(self._lattice.rows(region), 0, self._fine[1]).tolist()
        return left, top, right - left, bottom - top

    def _texels_inside(self, region: Region | None) -> Region:
        """Return the texels of the mirrored view of the interior that pixels of a region read."""
        left, top, width, height = self._texels(region)
        return self._fine[0] - left - width, self.inner_row + top, width, height

    def release(self) -> None:
        """Free all GL objects."""
        while self._owned:
            self._owned.pop().release()
        self._rest = []

"""The framebuffers of the geometry draw: what each sample of an image sees."""

import ctypes
from collections.abc import Sequence
from typing import Any, TypeVar

import moderngl
import numpy as np

from fastgen.render.gl import GLContext
from fastgen.render.programs import OUT_OF_REACH_MM
from fastgen.render.regions import Region
from fastgen.render.sample_lattice import SampleLattice
from fastgen.render.textures import DEPTHS, FLOATS, NUMBERS, texture_clearing

T = TypeVar("T")

_GL_SCISSOR_TEST = 0x0C11


class SampleTargets:
    """Those of (width, height) images with `samples_per_axis` squared samples a pixel.

    They lie where sample_lattice.py has them, and fit in the driver's textures as its `fitting`
    tells. Damaged scenes keep rest positions too, and holed ones an inner view that shows through
    holes: it is mirrored, and begins at `inner_row`. Scenes share the textures, which are made
    larger when one needs more: a driver may keep all of a texture in memory.
    """

    def __init__(self, gl: GLContext, size: tuple[int, int], samples_per_axis: int) -> None:
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
        self._owned: list[Any] = []
        self.rest: list[moderngl.Texture] = []
        """Positions at rest, x, y and z; none before the first damaged scene."""
        self._viewport = gl.function(
            "glViewportIndexedf", None, ctypes.c_uint, *[ctypes.c_float] * 4
        )
        self._scissor = gl.function("glScissorIndexed", None, ctypes.c_uint, *[ctypes.c_int] * 4)
        self._enable = gl.function("glEnablei", None, ctypes.c_uint, ctypes.c_uint)
        self._disable = gl.function("glDisablei", None, ctypes.c_uint, ctypes.c_uint)
        self._clear = texture_clearing(gl)

    def begin(
        self,
        damage: str,
        seen: Sequence[Region | None],
        touched: Sequence[Region | None] = (),
        inside: Sequence[Region | None] = (),
    ) -> None:
        """Bind the framebuffer for what no damage touches, emptied where it will be asked; key 0 is
        the void.

        damage: one of programs.DAMAGE_VARIANTS. seen: regions of the image, None for all of it.
        touched: where rest positions will be asked for. inside: regions that `limit_inside` will
        name.
        """
        self._make_room(damage)
        for box in (*map(self._texels, seen), *map(self._texels_inside, inside)):
            self._clear(self.keys, box, NUMBERS, 0)
        # of single samples it tells the sky from all else, see Targets.begin
        outer = [None] if self.per_axis == 1 else seen
        for box in (*map(self._texels, outer), *map(self._texels_inside, inside)):
            self._clear(self.depth_buffer, box, DEPTHS, 1.0)
        for box in map(self._texels, touched) if damage != "sound" else ():
            for rest in self.rest:
                self._clear(rest, box, FLOATS, OUT_OF_REACH_MM)
        self._use(self._sound)

    def begin_damaged(self) -> None:
        """Bind the framebuffer for what damages touch, which keeps rest positions."""
        self._use(self._damaged)

    def _use(self, target: moderngl.Framebuffer) -> None:
        target.use()
        target.viewport = (0, 0, *self._fine)

    def _make_room(self, damage: str) -> None:
        rows = self._fine[1] + (self.inner_row if damage == "holed" else 0)
        if rows > self._rows:
            self.release()
            self._rows = rows
            self.keys = self._texture(1, "u4")
            # llvmpipe takes three times as long for four numbers a texel as for four textures of
            # one, and twice as long for bytes as for a number that holds four of them
            self.points = self._texture(2, "f4")
            self.depths = self._texture(1, "f4")
            self.openness = self._texture(1, "u4")
            self.light = self._texture(1, "u4")
            self.depth_buffer = self._kept(self._ctx.depth_texture((self._fine[0], rows)))
            self._sound = self._framebuffer()
        if damage != "sound" and not self.rest:
            self.rest = [self._texture(1, "f4") for _ in range(3)]
            self._damaged = self._framebuffer()

    def _framebuffer(self) -> moderngl.Framebuffer:
        usual = [self.keys, self.points, self.depths, self.openness, self.light]
        made: moderngl.Framebuffer = self._ctx.framebuffer([*usual, *self.rest], self.depth_buffer)
        return self._kept(made)

    def _texture(self, components: int, dtype: str) -> moderngl.Texture:
        made = self._ctx.texture((self._fine[0], self._rows), components, dtype=dtype)
        made.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return self._kept(made)

    def _kept(self, made: T) -> T:
        self._owned.append(made)
        return made

    def limit_inside(self, region: Region | None) -> None:
        """Restrict the inner view to what holes in `region` of the image show, None for all."""
        width, height = self._fine
        self._viewport(1, 0.0, self.inner_row, width, height)
        self._scissor(1, *self._texels_inside(region))
        self._enable(_GL_SCISSOR_TEST, 1)

    def end(self) -> None:
        """Lift the restriction of the inner view."""
        self._disable(_GL_SCISSOR_TEST, 1)

    def _texels(self, region: Region | None) -> Region:
        """The texels that pixels of `region` of the image, None for all, ask for."""
        region = region or (0, 0, *self._size)
        left, right = np.clip(self._lattice.columns(region), 0, self._fine[0]).tolist()
        top, bottom = np.clip(self._lattice.rows(region), 0, self._fine[1]).tolist()
        return left, top, right - left, bottom - top

    def _texels_inside(self, region: Region | None) -> Region:
        """As `_texels`, of the inner view: it is mirrored, and begins below the outer one."""
        left, top, width, height = self._texels(region)
        return self._fine[0] - left - width, self.inner_row + top, width, height

    def release(self) -> None:
        """Free all GL objects."""
        while self._owned:
            self._owned.pop().release()
        self.rest = []

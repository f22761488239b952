"""Points of what an image shows, and the light that rays find there, on the GPU."""

import ctypes
import math
from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.light.traced_light import Points
from fastgen.render.gl import GLContext
from fastgen.render.programs import link
from fastgen.render.regions import Region
from fastgen.render.shading import UNITS
from fastgen.scene.limits import MM

_GL_COLOR = 0x1800
_NO_KEY = (ctypes.c_uint * 4)(0)

_POINTS_PER_AXIS = 400
"""Of a square image, at most: rays cost no more for large images."""


def point_step(size: tuple[int, int]) -> int:
    """Pixels of a (width, height) = size image between points, along either axis."""
    return math.ceil(math.sqrt(size[0] * size[1]) / _POINTS_PER_AXIS)


class LightPoints:
    """The points of images of (width, height) = size, and what they are lit by.

    Textures hold a row of cells after the other, first the point in the middle of each, then
    another one, if a cell sees more than one surface.

    Owned by the renderer, which releases it.
    """

    def __init__(self, gl: GLContext, size: tuple[int, int], samples_per_axis: int) -> None:
        self._ctx = ctx = gl.ctx
        self._size = size
        self._samples_per_axis = samples_per_axis
        self._step = step = point_step(size)
        # none of the points lies beyond the image
        width, height = (-(-(side - step // 2) // step) for side in size)
        self._rows = height
        self._cells = cells = (width, 2 * height)
        self._keys = ctx.texture(cells, 1, dtype="u4")
        self._places, self._normals = (ctx.texture(cells, 4, dtype="f4") for _ in range(2))
        self._target = ctx.framebuffer([self._keys, self._places, self._normals])
        self._light = ctx.texture_array((*cells, 4), 4, dtype="f4")
        for texture in (self._keys, self._places, self._normals, self._light):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._programs: dict[str, tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self._clear_uint = gl.function(
            "glClearBufferuiv", None, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
        )

    def read(
        self, damage: str, regions: Sequence[Region | None], eye_m: NDArray[np.float64]
    ) -> Points:
        """The points of what the sample targets hold, in the world.

        The samples and what their material is read from are bound already. damage: one of
        programs.DAMAGE_VARIANTS. regions: of the image, outside them there is only sky; None for
        all of it. eye_m: where the camera is.
        """
        self._draw(damage, regions)
        width, height = self._cells
        keys = np.frombuffer(self._keys.read(alignment=1), np.uint32).reshape(height, width)
        row, column = np.nonzero(keys)
        places, normals = (
            np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[row, column]
            for texture in (self._places, self._normals)
        )
        from_eye, roughness = places[:, :3], places[:, 3]
        away = np.linalg.norm(from_eye, axis=1, keepdims=True)
        place_mm = (np.float32(1 / MM) * from_eye + eye_m / MM).astype(np.float32)
        return Points(column, row, place_mm, normals[:, :3], -from_eye / away, roughness)

    def light(self, points: Points, traced: NDArray[np.float32]) -> None:
        """Bind the light of the points that were read last for the shaders; traced: as of
        traced_light, float32 [K, 4, 3]."""
        width, height = self._cells
        held = np.zeros((4, height, width, 4), np.float32)
        held[:, points.row, points.column, :3] = traced.transpose(1, 0, 2)
        self._light.write(held.tobytes())
        textures: dict[str, Any] = {
            "point_keys": self._keys,
            "point_places": self._places,
            "point_light": self._light,
        }
        for name, texture in textures.items():
            texture.use(UNITS[name])

    def _draw(self, damage: str, regions: Sequence[Region | None]) -> None:
        program, array = self._program(damage)
        program["point_rows"] = self._rows
        program["last_pixel"] = tuple(side - 1 for side in self._size)
        self._target.use()
        self._ctx.scissor = None
        self._clear_uint(_GL_COLOR, 0, _NO_KEY)
        self._ctx.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for region in regions:
            x, y, width, height = self._cells_of(region or (0, 0, *self._size))
            for half in (0, self._rows):
                self._ctx.scissor = x, y + half, width, height
                array.render(moderngl.TRIANGLES, vertices=3)
        self._ctx.scissor = None

    def _cells_of(self, region: Region) -> Region:
        """The cells whose points lie in a region of the image."""
        (x, width), (y, height) = (
            (first, max(end - first, 0))
            for first, end in (
                (-(-(low - self._step // 2) // self._step) for low in (low, low + length))
                for low, length in zip(region[:2], region[2:], strict=True)
            )
        )
        return x, y, width, height

    def _program(self, damage: str) -> tuple[moderngl.Program, moderngl.VertexArray]:
        if damage not in self._programs:
            program = link(
                self._ctx,
                "fullscreen.vert",
                "light_points.frag",
                UNITS,
                samples_per_axis=self._samples_per_axis,
                pixel_class="decal" if damage == "sound" else "damaged",
                damage=damage,
            )
            self._programs[damage] = program, self._ctx.vertex_array(program, [])
        return self._programs[damage]

    def release(self) -> None:
        """Free all GL objects."""
        made = [item for pair in self._programs.values() for item in reversed(pair)]
        textures: list[Any] = [self._keys, self._places, self._normals, self._light]
        for item in (*made, self._target, *textures):
            item.release()

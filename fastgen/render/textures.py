"""Textures of a GL context made from arrays."""

import ctypes
from collections.abc import Callable, Iterable

import moderngl
import numpy as np

from fastgen.decals.artwork import mip_levels
from fastgen.render.gl import GLContext
from fastgen.render.noise import noise_tiles

_TEXTURE_2D_ARRAY, _RGBA, _RGBA8, _UNSIGNED_BYTE = 0x8C1A, 0x1908, 0x8058, 0x1401
_INT, _ENUM = ctypes.c_int, ctypes.c_uint


def art_texture(gl: GLContext, images: np.ndarray) -> moderngl.TextureArray:
    """Artwork uint8 [K, N, N, 4] as a mip-mapped texture array, clamped at the borders. The driver
    would average sRGB as if it were light, so the levels are `mip_levels`'s."""
    levels = zip(*map(mip_levels, images), strict=True)
    return _clamped(_levelled(gl, [images, *map(np.stack, levels)]))


def _levelled(gl: GLContext, levels: Iterable[np.ndarray]) -> moderngl.TextureArray:
    """A texture array of `levels` uint8 [K, N, N, 4], each half as wide as the one before."""
    first, *others = map(np.ascontiguousarray, levels)
    count, side = first.shape[:2]
    texture = gl.ctx.texture_array((side, side, count), 4, first.tobytes(), alignment=1)
    texture.use()
    define = gl.function("glTexImage3D", None, _ENUM, *(_INT,) * 6, _ENUM, _ENUM, ctypes.c_void_p)
    for level, texels in enumerate(others, start=1):
        size = (texels.shape[2], texels.shape[1], count)
        address = texels.ctypes.data
        define(_TEXTURE_2D_ARRAY, level, _RGBA8, *size, 0, _RGBA, _UNSIGNED_BYTE, address)
    return texture


def mipmapped_array(ctx: moderngl.Context, images: np.ndarray) -> moderngl.TextureArray:
    """uint8 [K, H, W, C] as a mip-mapped texture array, clamped at the borders."""
    count, height, width, channels = images.shape
    data = np.ascontiguousarray(images).tobytes()
    texture = ctx.texture_array((width, height, count), channels, data, alignment=1)
    texture.build_mipmaps()
    return _clamped(texture)


def data_texture(ctx: moderngl.Context, values: np.ndarray) -> moderngl.Texture:
    """Numbers [H, W, C], float32, uint32 or uint8, for shaders to fetch by row and column.

    Filled up with zeros to powers of two: llvmpipe compiles its shaders anew, which takes seconds,
    where a texture's sides stop or start being such.
    """
    height, width, channels = values.shape
    rows, columns = (1 << (side - 1).bit_length() for side in (height, width))
    filled = np.zeros((rows, columns, channels), values.dtype)
    filled[:height, :width] = values
    dtype = f"{values.dtype.kind}{values.dtype.itemsize}"
    texture = ctx.texture((columns, rows), channels, filled.tobytes(), dtype=dtype)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


NUMBERS, FLOATS, DEPTHS = (0x8D94, 0x1405), (0x1903, 0x1406), (0x1902, 0x1406)
"""How a texel's value is told: GL_RED_INTEGER of GL_UNSIGNED_INT, and of GL_FLOAT GL_RED and
GL_DEPTH_COMPONENT."""


def texture_clearing(
    gl: GLContext,
) -> Callable[[moderngl.Texture, tuple[int, int, int, int], tuple[int, int], float], None]:
    """What fills texels of a texture with one value: takes it, a box (x, y, width, height), one of
    the formats above and the value. Clearing framebuffers, llvmpipe takes four times as long, and
    longer for a part."""
    box = (_INT,) * 7  # mip level, x, y, z, width, height, depth
    clear = gl.function("glClearTexSubImage", None, _ENUM, *box, _ENUM, _ENUM, ctypes.c_void_p)

    def fill(
        texture: moderngl.Texture,
        box: tuple[int, int, int, int],
        stored_as: tuple[int, int],
        value: float,
    ) -> None:
        x, y, width, height = box
        held = (_ENUM * 1)(int(value)) if stored_as == NUMBERS else (ctypes.c_float * 1)(value)
        clear(texture.glo, 0, x, y, 0, width, height, 1, *stored_as, held)

    return fill


def _clamped(texture: moderngl.TextureArray) -> moderngl.TextureArray:
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture


def noise_texture(gl: GLContext) -> moderngl.TextureArray:
    """The noise tiles, repeating. A driver may round up at every level of a chain of its own, which
    adds up to three steps of 255."""
    texture = _levelled(gl, noise_tiles().levels)
    texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    return texture

"""Textures of a GL context made from arrays."""

import ctypes
from collections.abc import Callable, Sequence

import moderngl
import numpy as np

from fastgen.files import disk_cache
from fastgen.render.gl import GLContext
from fastgen.render.gl_enums import (
    GL_DEPTH_COMPONENT,
    GL_FLOAT,
    GL_RED,
    GL_RED_INTEGER,
    GL_RGBA,
    GL_RGBA8,
    GL_SRGB8_ALPHA8,
    GL_TEXTURE_2D_ARRAY,
    GL_UNSIGNED_BYTE,
    GL_UNSIGNED_INT,
)
from fastgen.render.noise import noise_tiles

_INT, _ENUM = ctypes.c_int, ctypes.c_uint


def levelled_texture(
    gl: GLContext, levels: Sequence[np.ndarray], srgb: bool = False
) -> moderngl.TextureArray:
    """Return a texture array with given mip levels, clamped at the borders.

    Args:
        gl: Current context.
        levels: uint8 [K, N, N, 4], each half as wide as the one before.
        srgb: Colours are sRGB. Shaders then read linear light, filtered as such.
    """
    count, side = levels[0].shape[:2]
    texture = levelled_storage(gl, (side, count), len(levels), srgb)
    fill_layers(gl, texture, 0, levels)
    return texture


def levelled_storage(
    gl: GLContext, size: tuple[int, int], levels: int, srgb: bool
) -> moderngl.TextureArray:
    """Return an unfilled texture array, clamped at the borders.

    Args:
        gl: Current context.
        size: Side in texels, and number of layers.
        levels: Number of mip levels.
        srgb: Colours are sRGB. Shaders then read linear light, filtered as such.
    """
    side, count = size
    stored = GL_SRGB8_ALPHA8 if srgb else GL_RGBA8
    texture = gl.ctx.texture_array((1, 1, 1), 4)
    texture.use()
    # allocates all levels once; drivers copy a texture that grows level by level
    allocate = gl.function("glTexStorage3D", None, _ENUM, _INT, _ENUM, *(_INT,) * 3)
    allocate(GL_TEXTURE_2D_ARRAY, levels, stored, side, side, count)
    return _clamped(texture)


def fill_layers(
    gl: GLContext, texture: moderngl.TextureArray, first: int, levels: Sequence[np.ndarray]
) -> None:
    """Fill layers of a texture array.

    Args:
        gl: Current context.
        texture: The texture.
        first: Its first layer to fill.
        levels: All mip levels of the layers, uint8 [K, N, N, 4], each half as wide as the one
            before.
    """
    texture.use()
    fill = gl.function("glTexSubImage3D", None, _ENUM, *(_INT,) * 7, _ENUM, _ENUM, ctypes.c_void_p)
    for level, texels in enumerate(map(np.ascontiguousarray, levels)):
        size = (texels.shape[2], texels.shape[1], len(texels))
        address = texels.ctypes.data
        fill(GL_TEXTURE_2D_ARRAY, level, 0, 0, first, *size, GL_RGBA, GL_UNSIGNED_BYTE, address)


def clamped_array(ctx: moderngl.Context, images: np.ndarray) -> moderngl.TextureArray:
    """Return uint8 or uint16 images [K, H, W] as a texture array of values from 0 to 1.

    It is interpolated, clamped at the borders, and has no mip levels.
    """
    count, height, width = images.shape
    data = np.ascontiguousarray(images).tobytes()
    dtype = f"nu{images.itemsize}" if images.itemsize > 1 else "f1"
    texture = ctx.texture_array((width, height, count), 1, data, alignment=1, dtype=dtype)
    texture = _clamped(texture)
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture


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


NUMBERS = GL_RED_INTEGER, GL_UNSIGNED_INT
FLOATS = GL_RED, GL_FLOAT
DEPTHS = GL_DEPTH_COMPONENT, GL_FLOAT
"""Pixel format and type of the value that fills a texture."""


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
    """Return the noise tiles as a repeating texture array.

    A driver may round up at each mip level that it computes, which adds up to three steps of 255.
    """
    levels = noise_tiles().levels
    texture = levelled_texture(gl, levels)
    disk_cache.unload(levels[0])
    texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = True
    return texture

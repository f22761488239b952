"""Textures of a GL context made from arrays."""

import moderngl
import numpy as np

from fastgen.noise import noise_tiles


def mipmapped_array(ctx: moderngl.Context, images: np.ndarray) -> moderngl.TextureArray:
    """uint8 [K, H, W, C] as a mip-mapped texture array, clamped at the borders."""
    count, height, width, channels = images.shape
    data = np.ascontiguousarray(images).tobytes()
    texture = ctx.texture_array((width, height, count), channels, data, alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture


def noise_texture(ctx: moderngl.Context) -> moderngl.TextureArray:
    """The noise tiles, repeating; GL's box-filtered mip chain is the one they were measured on."""
    base = noise_tiles().levels[0]
    size = base.shape[1]
    texture = ctx.texture_array((size, size, len(base)), 4, base.tobytes())
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    return texture

"""Textures that the material layers of all scenes read: noise, artwork, glyphs, reflectance."""

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import art_levels, mip_levels, premultiplied
from fastgen.files import disk_cache
from fastgen.light.reflectance import dfg_table
from fastgen.render.gl import GLContext
from fastgen.render.glyph_runs import GlyphTable
from fastgen.render.textures import clamped_array, levelled_texture, noise_texture

Textures = dict[str, moderngl.Texture | moderngl.TextureArray]
"""Textures by sampler name."""


def material_tables(
    gl: GLContext, glyphs: GlyphTable, own_art: Sequence[NDArray[np.uint8]] = ()
) -> Textures:
    """Return the textures, which the caller releases.

    Args:
        gl: Current context.
        glyphs: Glyphs of all fonts.
        own_art: Further artwork, uint8 [ART_SIZE, ART_SIZE, 4], in layers after the bundled.
    """
    table = dfg_table()
    dfg = gl.ctx.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f4")
    dfg.repeat_x = dfg.repeat_y = False
    levels = art_levels()
    art = levelled_texture(gl, _with_own(levels, own_art), srgb=True)
    for level in levels:  # 20 MB that only the next context needs
        disk_cache.unload(level)
    return {
        "noise_tiles": noise_texture(gl),
        "art": art,
        "glyph_tiles": clamped_array(gl.ctx, glyphs.tiles),
        "glyph_sums": clamped_array(gl.ctx, glyphs.sums),
        "dfg_table": dfg,
    }


def _with_own(
    levels: Sequence[NDArray[np.uint8]], own_art: Sequence[NDArray[np.uint8]]
) -> Sequence[NDArray[np.uint8]]:
    """Return mip levels [K, N, N, 4] as of `art_levels` with those of further images after them."""
    if not own_art:
        return levels
    own = zip(*([image, *mip_levels(image)] for image in own_art), strict=True)
    return [
        np.concatenate([level, premultiplied(np.stack(more))])
        for level, more in zip(levels, own, strict=True)
    ]

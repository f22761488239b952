"""What the shaders read of a scene's decals, as textures."""

from collections.abc import Mapping

import moderngl

from fastgen.decals.artwork import Font
from fastgen.geometry.mesh import Mesh
from fastgen.render.decal_tables import pack_decals
from fastgen.render.decals_near import decals_near
from fastgen.render.textures import data_texture
from fastgen.scene import Scene


class SceneDecals:
    """Tables of the decals of one scene on its container's mesh, by the names of their samplers.
    Owned by the renderer, which releases them.

    art_layers, fonts: as for decal_tables.pack_decals.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: Scene,
        mesh: Mesh,
        art_layers: Mapping[str, int],
        fonts: Mapping[str, Font],
    ) -> None:
        tables = pack_decals(scene, mesh, art_layers, fonts)
        near = decals_near(tables.table[: len(scene.decals)], mesh.atlas_size_mm)
        self.textures = {
            "decal_grid": data_texture(ctx, tables.grid),
            "decal_table": data_texture(ctx, tables.table),
            "glyph_table": data_texture(ctx, tables.glyphs),
            "decal_cells": data_texture(ctx, near[..., None]),
        }

    def release(self) -> None:
        """Free all GL objects."""
        for texture in self.textures.values():
            texture.release()

"""Everything that the renderer keeps for one scene."""

from collections.abc import Mapping

import moderngl

from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.decal_tables import pack_decals
from fastgen.render.decals_near import decals_near
from fastgen.render.surface_values import SceneMaterials
from fastgen.render.textures import data_texture


class SceneResources:
    """Decal textures and material colours of one scene. Owned by the renderer, which releases them.

    Attributes:
        textures: Tables of the decals by the names of their samplers.
        materials: Mean colours of the materials.

    Args:
        ctx: The context that draws.
        prepared: The scene.
        art_layers: Texture layer of each artwork, see decal_tables.pack_decals.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        prepared: PreparedScene,
        art_layers: Mapping[str, int],
    ) -> None:
        scene, mesh = prepared.scene, prepared.container
        tables = pack_decals(scene.decals, prepared.numbers.decals, mesh, art_layers)
        near = decals_near(tables.table[: len(scene.decals)], mesh.atlas_size_mm)
        self.materials = SceneMaterials(prepared)
        self.textures = {
            "decal_grid": data_texture(ctx, tables.grid),
            "decal_table": data_texture(ctx, tables.table),
            "glyph_table": data_texture(ctx, tables.glyphs),
            "decal_proximity": data_texture(ctx, near[..., None]),
        }

    def release(self) -> None:
        """Free all GL objects."""
        for texture in self.textures.values():
            texture.release()

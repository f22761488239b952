"""Everything that the renderer keeps for one scene."""

from collections.abc import Mapping
from typing import NamedTuple

import moderngl
from numpy.typing import ArrayLike

from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.art_textures import ArtTextures
from fastgen.render.constants import DECAL_CELL_MM
from fastgen.render.decal_tables import MARGIN_MM, pack_decals
from fastgen.render.decals_near import decals_near
from fastgen.render.glyph_runs import GlyphTable
from fastgen.render.surface_values import SceneMaterials
from fastgen.render.textures import data_texture


class Prints(NamedTuple):
    """Artwork and glyphs that decals can use.

    Attributes:
        art: Layers of artwork.
        glyphs: Glyphs of all fonts.
    """

    art: ArtTextures
    glyphs: GlyphTable


class DecalTextures:
    """Decals of one scene as shaders read them, for views of one scale.

    Attributes:
        textures: Tables of the decals by the names of their samplers.
        values: Members of SCENE_BLOCK that describe the tables.

    Args:
        ctx: The context that draws.
        prepared: The scene.
        layers: Texture layer of each artwork by name.
        glyphs: Glyphs of all fonts.
        scale: See decal_tables.scale_for.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        prepared: PreparedScene,
        layers: Mapping[str, int],
        glyphs: GlyphTable,
        scale: float,
    ) -> None:
        scene, mesh = prepared.scene, prepared.container
        ids = prepared.numbers.decals
        tables = pack_decals(scene.decals, ids, mesh, layers, scale, glyphs)
        margin_mm = scale * MARGIN_MM
        near = decals_near(tables.table[: len(scene.decals)], mesh.atlas_size_mm, margin_mm)
        self.textures = {
            "decal_grid": data_texture(ctx, tables.grid),
            "decal_table": data_texture(ctx, tables.table),
            "glyph_table": data_texture(ctx, tables.glyphs),
            "decal_proximity": data_texture(ctx, near[..., None]),
        }
        self.values: Mapping[str, ArrayLike] = {
            "decal_layers": tables.layers,
            "decal_cell_mm": scale * DECAL_CELL_MM,
            "decal_margin_mm": margin_mm,
        }

    def release(self) -> None:
        """Free all GL objects."""
        for texture in self.textures.values():
            texture.release()


class SceneResources:
    """Decal textures and material colours of one scene. Owned by the renderer, which releases them.

    Attributes:
        materials: Mean colours of the materials.

    Args:
        ctx: The context that draws.
        prepared: The scene.
        prints: Artwork and glyphs that decals can use.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        prepared: PreparedScene,
        prints: Prints,
    ) -> None:
        self._ctx, self._prepared, self._prints = ctx, prepared, prints
        self.materials = SceneMaterials(prepared)
        self._layers = prints.art.take({decal.art for decal in prepared.scene.decals})
        self._decals: dict[float, DecalTextures] = {}
        try:
            self.decals()
        except BaseException:
            self.release()
            raise

    def decals(self, scale: float = 1.0) -> DecalTextures:
        """Return the decals for views of one scale, see decal_tables.scale_for."""
        if scale not in self._decals:
            self._decals[scale] = DecalTextures(
                self._ctx, self._prepared, self._layers, self._prints.glyphs, scale
            )
        return self._decals[scale]

    def release(self) -> None:
        """Free all GL objects."""
        for decals in self._decals.values():
            decals.release()
        self._prints.art.give_back(self._layers)

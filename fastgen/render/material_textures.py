"""Textures that the material layers read: those of all scenes, and those of recent scenes."""

import moderngl

from fastgen.decals.own_fonts import OwnPrints
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.art_textures import ArtTextures
from fastgen.render.gl import GLContext
from fastgen.render.glyph_runs import all_glyphs
from fastgen.render.material_tables import Textures, material_tables
from fastgen.render.recent_cache import ReleasingCache
from fastgen.render.scene_resources import DecalTextures, Prints, SceneResources
from fastgen.scene.limits import MAX_NEIGHBOURS


class MaterialTextures:
    """Owned by the renderer, which releases it.

    Args:
        gl: Current context.
        own: Artwork and fonts of a configuration.

    Attributes:
        shared: The textures that all scenes share.
    """

    def __init__(self, gl: GLContext, own: OwnPrints) -> None:
        self._ctx = gl.ctx
        self._prints = Prints(ArtTextures(gl, own.art), all_glyphs(own.fonts))
        most = 2 * (1 + MAX_NEIGHBOURS)  # see release_old
        self._scenes: ReleasingCache[SceneResources] = ReleasingCache(most)
        self.shared = material_tables(gl, self._prints.glyphs)

    def release_old(self, containers: int) -> None:
        """Release the tables of past scenes, about 3 MB per container.

        Args:
            containers: Number of containers of the current scene. The tables of twice as many are
                kept, those used last, because a scene and its variation may take turns.
        """
        self._scenes.shrink(2 * containers)

    def resources(self, prepared: PreparedScene) -> SceneResources:
        """Return what is kept for a scene."""
        return self._scenes.get(prepared, lambda: SceneResources(self._ctx, prepared, self._prints))

    def of(self, decals: DecalTextures, zones: moderngl.Texture) -> Textures:
        """Return the textures of a draw with these decals and this table of zones."""
        art = self._prints.art.texture
        return {**self.shared, "art": art, "zone_table": zones, **decals.textures}

    def release(self) -> None:
        """Free all GL objects."""
        for item in (self._scenes, self._prints.art, *self.shared.values()):
            item.release()

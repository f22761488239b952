"""Textures that the material layers read: those of all scenes, and those of recent scenes."""

from collections.abc import Mapping

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.decals.artwork import art_layers
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.gl import GLContext
from fastgen.render.material_tables import Textures, material_tables
from fastgen.render.recent_cache import CACHED_CONTAINERS, ReleasingCache
from fastgen.render.scene_resources import DecalTextures, SceneResources


class MaterialTextures:
    """Owned by the renderer, which releases it.

    Args:
        gl: Current context.
        own_art: Artwork of a configuration by name, see own_art.art_of.

    Attributes:
        shared: The textures that all scenes share.
    """

    def __init__(self, gl: GLContext, own_art: Mapping[str, NDArray[np.uint8]]) -> None:
        self._ctx = gl.ctx
        bundled = art_layers()
        self._art_layers = {**bundled, **{name: len(bundled) + i for i, name in enumerate(own_art)}}
        self._scenes: ReleasingCache[SceneResources] = ReleasingCache(CACHED_CONTAINERS)
        self.shared = material_tables(gl, list(own_art.values()))

    def resources(self, prepared: PreparedScene) -> SceneResources:
        """Return what is kept for a scene."""
        return self._scenes.get(
            prepared, lambda: SceneResources(self._ctx, prepared, self._art_layers)
        )

    def of(self, decals: DecalTextures, zones: moderngl.Texture) -> Textures:
        """Return the textures of a draw with these decals and this table of zones."""
        return {**self.shared, "zone_table": zones, **decals.textures}

    def release(self) -> None:
        """Free all GL objects."""
        for item in (self._scenes, *self.shared.values()):
            item.release()

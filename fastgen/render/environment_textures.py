"""Textures of an EnvironmentLight: four octahedral maps."""

import ctypes

import moderngl
import numpy as np

from fastgen.files import disk_cache
from fastgen.light.environment import Ambient, EnvironmentLight
from fastgen.light.hdri import HALF_MAX
from fastgen.light.octahedral import BORDER
from fastgen.light.sky_rays import SkyRays
from fastgen.light.traced_light import DIRECTIONS
from fastgen.render.gl import GLContext
from fastgen.render.gl_enums import (
    GL_RGB,
    GL_RGB9_E5,
    GL_TEXTURE_2D,
    GL_UNSIGNED_INT_5_9_9_9_REV,
)
from fastgen.render.recent_cache import ReleasingCache

_INT, _ENUM = ctypes.c_int, ctypes.c_uint


class GpuLight:
    """Light of one environment on the GPU. Owned by the renderer, which releases it.

    Args:
        gl: Current context.
        light: The environment.
        traced: Whether to prepare importance samples for ray casting.

    Attributes:
        ambient: Light without the large maps.
        background: uint32 [B, B], texels of the background map, see BackgroundTextures.
        sky_rays: Importance samples, None unless `traced`.
    """

    def __init__(self, gl: GLContext, light: EnvironmentLight, traced: bool = False) -> None:
        ctx = gl.ctx
        self.ambient = Ambient.of(light)
        self.background = light.background
        self.sky_rays: SkyRays | None = None
        if traced:
            inner = slice(BORDER, -BORDER)
            radiance = np.ascontiguousarray(light.specular[0, inner, inner])
            self.sky_rays = SkyRays(radiance, DIRECTIONS)
        layers, size = light.specular.shape[:2]
        self.specular = ctx.texture_array(
            (size, size, layers), 4, _half(light.specular), dtype="f2"
        )
        size = light.irradiance.shape[0]
        self.irradiance = ctx.texture((size, size), 4, _half(light.irradiance), dtype="f2")
        obstacles = np.zeros((1, 1), np.uint8) if light.obstacles is None else light.obstacles
        self.obstacles = ctx.texture(obstacles.shape, 1, np.ascontiguousarray(obstacles))
        for texture in (self.specular, self.irradiance, self.obstacles):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        disk_cache.unload(light.background)

    def release(self) -> None:
        """Free all GL objects."""
        for texture in (self.specular, self.irradiance, self.obstacles):
            texture.release()


class BackgroundTextures:
    """Background maps on the GPU. Owned by the renderer, which releases them.

    A software renderer has one texture per size and fills it again when the environment changes,
    which takes a few milliseconds: its textures take private memory of each process, while
    processes share the mapped texels.
    """

    def __init__(self, gl: GLContext) -> None:
        self._gl = gl
        self._textures: ReleasingCache[_BackgroundTexture] = ReleasingCache(24)

    def get(self, light: GpuLight) -> moderngl.Texture:
        """Return the background map of an environment; valid until the next call."""
        size = len(light.background)
        key = size if self._gl.software else light
        kept = self._textures.get(key, lambda: _BackgroundTexture(self._gl, size))
        kept.show(light.background)
        return kept.texture

    def release(self) -> None:
        """Free all GL objects."""
        self._textures.release()


class _BackgroundTexture:
    """Texture of RGB9_E5 texels [size, size]."""

    def __init__(self, gl: GLContext, size: int) -> None:
        self._gl = gl
        self._shown: np.ndarray | None = None
        self.texture = gl.ctx.texture((size, size), 3, dtype="f2", internal_format=GL_RGB9_E5)
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.texture.repeat_x = self.texture.repeat_y = False

    def show(self, texels: np.ndarray) -> None:
        """Fill the texture with texels, uint32 [size, size].

        moderngl does not know the pixel type, and the conversion from another type takes 60 ms.
        """
        if texels is self._shown:
            return
        self.texture.use()
        upload = self._gl.function(
            "glTexSubImage2D", None, _ENUM, _INT, *(_INT,) * 4, _ENUM, _ENUM, ctypes.c_void_p
        )
        address = np.ascontiguousarray(texels, np.uint32).ctypes.data
        size = self.texture.size
        upload(GL_TEXTURE_2D, 0, 0, 0, *size, GL_RGB, GL_UNSIGNED_INT_5_9_9_9_REV, address)
        disk_cache.unload(texels)
        self._shown = texels

    def release(self) -> None:
        self.texture.release()


def _half(radiance: np.ndarray) -> bytes:
    """Return radiance [..., 3] as bytes of RGBA half floats, clamped to their range."""
    rgba = np.ones((*radiance.shape[:-1], 4), np.float16)
    rgba[..., :3] = np.clip(radiance, 0, HALF_MAX)
    return rgba.tobytes()

"""Textures of an EnvironmentLight: three octahedral maps."""

import ctypes

import moderngl
import numpy as np

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

_INT, _ENUM = ctypes.c_int, ctypes.c_uint


class GpuLight:
    """Light of one environment on the GPU. Owned by the renderer, which releases it.

    Args:
        gl: current context.
        light: the environment.
        traced: whether to prepare importance samples for ray casting.

    Attributes:
        ambient: light without the large maps.
        background_size: texels along a side of the background map.
        sky_rays: importance samples, None unless `traced`.
    """

    def __init__(self, gl: GLContext, light: EnvironmentLight, traced: bool = False) -> None:
        ctx = gl.ctx
        self.ambient = Ambient.of(light)
        self.background_size = light.background.shape[0]
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
        self.background = _packed_texture(gl, light.background)
        for texture in (self.specular, self.irradiance, self.background):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False

    def release(self) -> None:
        """Free all GL objects."""
        for texture in (self.specular, self.irradiance, self.background):
            texture.release()


def _packed_texture(gl: GLContext, texels: np.ndarray) -> moderngl.Texture:
    """Return a texture of RGB9_E5 texels, uint32 [N, N].

    moderngl does not know the pixel type, and the conversion from another type takes 60 ms.
    """
    size = texels.shape[0]
    texture = gl.ctx.texture((size, size), 3, dtype="f2", internal_format=GL_RGB9_E5)
    texture.use()
    upload = gl.function(
        "glTexSubImage2D", None, _ENUM, _INT, *(_INT,) * 4, _ENUM, _ENUM, ctypes.c_void_p
    )
    address = np.ascontiguousarray(texels, np.uint32).ctypes.data
    upload(GL_TEXTURE_2D, 0, 0, 0, size, size, GL_RGB, GL_UNSIGNED_INT_5_9_9_9_REV, address)
    return texture


def _half(radiance: np.ndarray) -> bytes:
    """Return radiance [..., 3] as bytes of RGBA half floats, clamped to their range."""
    rgba = np.ones((*radiance.shape[:-1], 4), np.float16)
    rgba[..., :3] = np.clip(radiance, 0, HALF_MAX)
    return rgba.tobytes()

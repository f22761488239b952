"""An EnvironmentLight on the GPU: three octahedral maps."""

import moderngl
import numpy as np

from fastgen.environment import EnvironmentLight

_RGB9_E5 = 0x8C3D
"""OpenGL 4.5 core specification, section 8.5.2: holds up to 65,408."""


class GpuLight:
    """Textures of one environment. Owned by the renderer, which releases it."""

    def __init__(self, ctx: moderngl.Context, light: EnvironmentLight) -> None:
        self.background_size = light.background.shape[0]
        layers, size = light.specular.shape[:2]
        self.specular = ctx.texture_array(
            (size, size, layers), 4, _half(light.specular), dtype="f2"
        )
        size = light.irradiance.shape[0]
        self.irradiance = ctx.texture((size, size), 4, _half(light.irradiance), dtype="f2")
        size = self.background_size
        # the largest by far: nine bits a channel and a common exponent take half of half floats
        self.background = ctx.texture(
            (size, size), 3, light.background.tobytes(), dtype="f2", internal_format=_RGB9_E5
        )
        for texture in (self.specular, self.irradiance, self.background):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False

    def release(self) -> None:
        """Free all GL objects."""
        for texture in (self.specular, self.irradiance, self.background):
            texture.release()


def _half(radiance: np.ndarray) -> bytes:
    """Radiance [..., 3] as RGBA half floats, clamped to what they hold."""
    rgba = np.ones((*radiance.shape[:-1], 4), np.float16)
    rgba[..., :3] = np.clip(radiance, 0, 65504)
    return rgba.tobytes()

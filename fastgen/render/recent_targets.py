"""Targets of recent images, and the choice of how many samples a container gets."""

from fastgen.camera.projection import View
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.draw_inputs import pixel_mm, wave_mm
from fastgen.render.gl import GLContext
from fastgen.render.image_targets import ImageTargets
from fastgen.render.recent_cache import ReleasingCache
from fastgen.render.sample_lattice import fitting
from fastgen.render.settings import Quality
from fastgen.render.visibility_buffer import VisibilityBuffer


class RecentTargets:
    """Image targets and visibility buffers of the most recent image sizes.

    Args:
        gl: Current context.
        quality: Samples per pixel. Images whose samples do not fit the driver's textures get fewer.
    """

    def __init__(self, gl: GLContext, quality: Quality) -> None:
        self._gl = gl
        self._quality = quality
        self._images: ReleasingCache[ImageTargets] = ReleasingCache(2)
        # near and distant containers of one image may have different numbers of samples
        self._samples: ReleasingCache[VisibilityBuffer] = ReleasingCache(3)

    def samples_per_axis(self, prepared: PreparedScene, view: View) -> tuple[int, int]:
        """Return the samples per pixel along each axis of a container and of cables above it."""
        limit = self._gl.ctx.info["GL_MAX_TEXTURE_SIZE"]
        mesh = prepared.container
        near, thin = self._quality.samples_for(pixel_mm(mesh, view), wave_mm(mesh, view))
        return fitting(near, view.size, limit), fitting(thin, view.size, limit)

    def image(self, size: tuple[int, int], radiance: bool) -> ImageTargets:
        """Return the targets of images of a size."""
        return self._images.get((size, radiance), lambda: ImageTargets(self._gl, size, radiance))

    def samples(self, size: tuple[int, int], per_axis: int) -> VisibilityBuffer:
        """Return the visibility buffer of images of a size with so many samples per axis."""
        starts_small = per_axis > self._quality.samples_per_axis
        return self._samples.get(
            (size, per_axis), lambda: VisibilityBuffer(self._gl, size, per_axis, starts_small)
        )

    def release(self) -> None:
        """Free all GL objects."""
        self._images.release()
        self._samples.release()

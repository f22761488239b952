"""RenderSettings: how images are rendered, whatever the scenes are."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from fastgen.errors import ConfigError
from fastgen.light.ray_bodies import check_rays
from fastgen.render.gl import BACKENDS, check_device
from fastgen.validation import check_known, whole

MIN_SIZE, MAX_SIZE = 64, 4096
"""Limits of an image's width and height in pixels."""

CABLE_PIXEL_MM = 40.0
"""Width of a pixel beyond which one sample misses cables, which are 42 mm thick."""

FAR_PIXEL_MM = 70.0
"""Width of a pixel beyond which one sample misses facets of walls and roofs, which are about 70 mm
wide, and corrugation turns into moire."""

HALF_WAVE_MM = 105.0
"""Half a wave of a roof: where a pixel is wider across the corrugation, one sample shows moire."""

SLANTED_PIXEL_MM = 25.0
"""Width of a pixel on the nearest part of a container up to which moire of its slanted faces is
accepted, because it would take long to draw so many pixels with more samples."""


class Quality(NamedTuple):
    """Renderer settings of one quality preset.

    Attributes:
        samples_per_axis: Samples per pixel along each axis: 1 (no antialiasing), 2, 3 or 5.
        lookups: Lookups of the material layers per pixel: 1, 2 or 25.
        traced: Compute light with rays at points of the image instead of at mesh vertices alone.
        shadow_detail: Shadow map resolution along each axis, as a fraction of the full resolution.
        coarse_ground: Shade the ground plane, which has no labels, at half the resolution.
        thin_samples_per_axis: Least samples per pixel along each axis where parts are about as thin
            as pixels: on distant containers, where a pixel is wider than FAR_PIXEL_MM, and on
            cables, where it is wider than CABLE_PIXEL_MM.
    """

    samples_per_axis: int
    lookups: int
    traced: bool = False
    shadow_detail: float = 1.0
    coarse_ground: bool = False
    thin_samples_per_axis: int = 1

    def samples_for(self, pixel_mm: float, wave_mm: float) -> tuple[int, int]:
        """Return the samples per pixel along each axis on a container and on cables above it.

        Args:
            pixel_mm: Width of a pixel on the nearest part of the container.
            wave_mm: Width of a pixel across the corrugation of a face in view.
        """
        usual, thin = self.samples_per_axis, max(self.samples_per_axis, self.thin_samples_per_axis)
        minified = pixel_mm > SLANTED_PIXEL_MM and wave_mm > HALF_WAVE_MM
        return (
            thin if pixel_mm > FAR_PIXEL_MM or minified else usual,
            thin if pixel_mm > CABLE_PIXEL_MM else usual,
        )


QUALITY = {
    "draft": Quality(1, 1, shadow_detail=0.4, coarse_ground=True, thin_samples_per_axis=3),
    "balanced": Quality(3, 2),
    "fine": Quality(5, 25),
    "high": Quality(5, 25, traced=True),
}


@dataclass(frozen=True)
class RenderSettings:
    """How images are rendered, apart from the scenes in them.

    Attributes:
        size: (width, height) in pixels, 64 to 4096 each.
        quality: A key of QUALITY. `draft` takes one sample per pixel, 9 on cables and distant
            containers, a coarser shadow map, and the ground at half the resolution; `balanced`
            takes 9 samples per pixel; `fine` takes 25 and evaluates the material at each; `high`
            also computes light with rays, which Embree casts on the CPU on every backend. `fine`
            and `high` take 9 samples in images above about one megapixel or 1638 rows. All except
            `draft` take 4 in images above 2730 rows on drivers whose textures end at 16384 texels,
            such as Mesa's.
        backend: "auto", "egl" or "osmesa".
        device_index: EGL device to draw with, numbered as by `fastgen doctor`. None takes the
            first device that works.
        hdri_dir: Folder of .hdr and .exr files that replaces the bundled HDRIs, or None.

    Raises:
        ConfigError: A value is not valid, or `high` is chosen and Embree is not available.
    """

    size: tuple[int, int] = (640, 640)
    quality: str = "balanced"
    backend: str = "auto"
    device_index: int | None = None
    hdri_dir: str | Path | None = None

    def __post_init__(self) -> None:
        """Check every value, and turn numbers of other types into plain Python ones."""
        object.__setattr__(self, "size", _checked_size(self.size))
        check_known("quality", self.quality, tuple(QUALITY))
        if QUALITY[self.quality].traced:
            check_rays()
        check_known("backend", self.backend, BACKENDS)
        if self.device_index is not None:
            object.__setattr__(self, "device_index", whole("device_index", self.device_index))
        check_device(self.backend, self.device_index)
        if not isinstance(self.hdri_dir, str | Path | None):
            raise ConfigError(f"hdri_dir: {self.hdri_dir!r} is not a path; give a folder's path")


def _checked_size(size: Any) -> tuple[int, int]:
    pair = list(size) if isinstance(size, Iterable) and not isinstance(size, str) else []
    if len(pair) != 2:
        raise ConfigError(f"size: {size!r} is not a pair; give (width, height), as in (640, 640)")
    try:
        width, height = (whole("size", side, MIN_SIZE, MAX_SIZE) for side in pair)
    except ConfigError:
        raise ConfigError(
            f"size: {pair[0]}x{pair[1]} is out of range; "
            f"each side takes {MIN_SIZE} to {MAX_SIZE} whole pixels"
        ) from None
    return width, height

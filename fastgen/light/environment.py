"""HDRI -> prefiltered light, cached on disk. Plain arrays: no GL here.

World z is up; map projections and their borders are described in prefilter.py. Radiance is linear
with Rec. 709 primaries. A yaw in degrees turns the environment about +z, counter-clockwise seen
from above: radiance(direction) = map(Rz(-yaw) direction).
"""

import contextlib
import functools
import hashlib
from dataclasses import dataclass, fields
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.errors import AssetError
from fastgen.files import disk_cache
from fastgen.light import prefilter, rgb9e5
from fastgen.light.directional_lights import Sun, split_suns
from fastgen.light.hdri import HALF_MAX, load_radiance
from fastgen.scene import REC_709

PREFILTER_VERSION = 12
"""Part of the cache key: count up whenever the prefiltered arrays change."""

ROUGHNESS_LEVELS = (0.05, 0.1, 0.18, 0.28, 0.4, 0.55, 0.75, 1.0)
"""Perceptual roughness of the layers of `EnvironmentLight.specular`; interpolate linearly."""

SPECULAR_SIZE = 128
IRRADIANCE_SIZE = 34
"""Texels along a side, border included, as for SPECULAR_SIZE."""

_LUMINANCE_WIDTH = 32
_LUMINANCE_FLOOR = 1e-6  # so that one black texel does not turn a log average to 0
_DARKEST = 1e-5  # below this the steps of half floats show, and then the meter's floor
_BRIGHTEST = 1e4  # leaves what is six times the mean within half floats
_SKY_CELLS = 42  # along a side of `Ambient.sky`: 5 degrees
_MAPS = ("specular", "irradiance", "background", "luminance", "suns")
_SUN_WIDTH = 2048  # a texel is a third of the real sun
_MAX_WORK_WIDTH = 8192  # a background texel covers about two texels of this


@dataclass(frozen=True, eq=False)
class Ambient:
    """What of an environment's light the CPU asks for, apart from the large maps.

    Maps are finite, float32 and within [0, HALF_MAX]. `irradiance` lacks what `suns` have.
    """

    name: str
    irradiance: NDArray[np.float32]
    """[M, M, 3] irradiance / pi by surface normal: what a white Lambert surface reflects."""
    luminance: NDArray[np.float32]
    """[16, 32] equirectangular, mean Rec. 709 luminance of each cell, for exposure metering."""
    mean_luminance: float
    """Mean of the luminance over the whole sphere."""
    suns: tuple[Sun, ...]
    """Strong compact lights, brightest first; none under an even sky."""
    sky: NDArray[np.float32]
    """[42, 42, 3] octahedral without a border, mean radiance of each cell, without suns."""

    @staticmethod
    def of(light: "Ambient") -> "Ambient":
        """Only this of a whole light."""
        return Ambient(**{field.name: getattr(light, field.name) for field in fields(Ambient)})


@dataclass(frozen=True, eq=False)
class EnvironmentLight(Ambient):
    """Light of one HDRI, ready for a GPU.

    The octahedral maps have a border of one texel (prefilter.py says how uv meets it). The values
    of `specular` and `irradiance` are exactly representable as half floats.
    """

    specular: NDArray[np.float32]
    """[L, N, N, 3] radiance convolved with the GGX lobe, a layer for each of ROUGHNESS_LEVELS;
    without the suns, as `irradiance`."""
    background: NDArray[np.uint32]
    """[B, B] radiance as it is, as rgb9e5.py packs it, by prefilter.levelled directions. B is a
    power of two from 512 to 2048 near twice the width, for as much as that is needed to look as
    sharp as the HDRI itself, and 4096 where that is wider than 4096: a finer one shows in no
    picture of a usual size, but takes 67 MB."""


def prefilter_environment(name: str, radiance: NDArray[np.float32]) -> EnvironmentLight:
    """Prefilter equirectangular radiance, float32 [H, W, 3], finite and 0 or more, H close to W/2.

    Sums stay in float32 or wider; only the results are clamped to half range, so a sun of 1e6 keeps
    its energy wherever it is spread over more than a few texels.
    """
    width = radiance.shape[1]
    background_size = int(np.clip(2 ** round(np.log2(2 * width)), 512, 2048))
    if width > 4096:
        background_size = 4096
    source = prefilter.shrink(radiance, min(2 * background_size, _MAX_WORK_WIDTH))
    # a texel has sqrt(4 pi) / B radians a side, one of the source at most 2 pi / W
    samples = 1 if source.shape[1] <= 1.5 * background_size else 2
    poles = prefilter.smooth_poles(source)
    background = prefilter.resample_octahedral(poles, background_size, samples, level=True)

    # about a texel and a half of the layers; wider lobes do with half of it
    narrow = prefilter.shrink(source, _SUN_WIDTH)
    suns, sunless = split_suns(narrow)
    fine = prefilter.shrink(sunless, 4 * SPECULAR_SIZE)
    coarse = prefilter.shrink(fine, 2 * SPECULAR_SIZE)
    layers = []
    for roughness in ROUGHNESS_LEVELS:
        if roughness < 0.08:  # the lobe is narrower than a texel, whose mean is the better answer
            lobes = prefilter.smooth_poles(fine)
        else:
            grid = fine if roughness < 0.25 else coarse
            lobes = prefilter.convolve(grid, prefilter.ggx_lobe(roughness))
        layers.append(prefilter.resample_octahedral(lobes, SPECULAR_SIZE, 4))
    diffuse = prefilter.convolve(coarse, prefilter.cosine_lobe)
    irradiance = prefilter.resample_octahedral(diffuse, IRRADIANCE_SIZE, 1)

    cells = prefilter.shrink(narrow, _LUMINANCE_WIDTH) @ REC_709.astype(np.float32)
    packed = rgb9e5.packed(background)
    return _light(name, _half(np.stack(layers)), _half(irradiance), packed, cells, suns)


def _half(radiance: NDArray[np.float32]) -> NDArray[np.float16]:
    return np.minimum(radiance, HALF_MAX).astype(np.float16)


def _light(
    name: str,
    specular: NDArray[np.float16],
    irradiance: NDArray[np.float16],
    background: NDArray[np.uint32],
    luminance: NDArray[np.float32],
    suns: tuple[Sun, ...],
) -> EnvironmentLight:
    weight = prefilter.row_solid_angle(luminance.shape[0]) / (4 * np.pi)
    return EnvironmentLight(
        name=name,
        specular=specular.astype(np.float32),
        irradiance=irradiance.astype(np.float32),
        background=background,
        luminance=luminance,
        mean_luminance=float(weight @ luminance.sum(axis=1, dtype=np.float64)),
        suns=suns,
        sky=_sky_cells(specular[0].astype(np.float32)),
    )


def _sky_cells(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means over cells of an octahedral map [N, N, 3] with a border."""
    inner = radiance[prefilter.BORDER : -prefilter.BORDER, prefilter.BORDER : -prefilter.BORDER]
    cells = cv2.resize(inner, (_SKY_CELLS, _SKY_CELLS), interpolation=cv2.INTER_AREA)
    return np.asarray(cells, np.float32)


def load_environment(path: str | Path, cache_dir: str | Path | None = None) -> EnvironmentLight:
    """Read and prefilter an HDRI, or take the result of an earlier time from the disk cache.

    cache_dir: by default $XDG_CACHE_HOME/fastgen or ~/.cache/fastgen. The key is the content of the
    file, so a renamed file hits and a changed one misses. Cached or not, the result is the same to
    the bit. A broken entry is built again, and without a writable folder nothing is cached.
    Raises AssetError, as `load_radiance` does, and where it is too dark or too bright.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            key = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise AssetError(f"{path}: cannot read this HDRI: {error.strerror}") from None
    folder = Path(cache_dir) if cache_dir is not None else disk_cache.default_folder()
    entry = folder / f"{key[:32]}-{PREFILTER_VERSION}.npz"

    def make() -> EnvironmentLight:
        made = prefilter_environment(path.stem, load_radiance(path))
        _write_cache(made, entry)
        _remove_earlier(entry)
        return made

    cached = disk_cache.once(entry, lambda: _read_cache(path.stem, entry), make)
    if cached.mean_luminance > _BRIGHTEST:
        raise AssetError(
            f"{path}: is too bright, with a mean luminance of {cached.mean_luminance:.2g}; scale "
            f"it to {_BRIGHTEST:g} or less"
        )
    if cached.mean_luminance < _DARKEST:
        raise AssetError(
            f"{path}: is dark, with a mean luminance of {cached.mean_luminance:.2g}; an HDRI must "
            f"have {_DARKEST:g} or more to be exposed"
        )
    return cached


def _read_cache(name: str, entry: Path) -> EnvironmentLight | None:
    stored = disk_cache.read(entry)
    try:
        specular, irradiance, background, luminance, suns = (stored[field] for field in _MAPS)
    except KeyError:
        return None
    if specular.shape != (len(ROUGHNESS_LEVELS), SPECULAR_SIZE, SPECULAR_SIZE, 3):
        return None
    return _light(
        name,
        specular.astype(np.float16),
        irradiance.astype(np.float16),
        background.astype(np.uint32),
        luminance.astype(np.float32),
        _unpacked_suns(suns.astype(np.float64)),
    )


def _unpacked_suns(stored: NDArray[np.float64]) -> tuple[Sun, ...]:
    rows = stored.reshape(-1, 7).tolist()
    return tuple(Sun((x, y, z), (r, g, b), radius) for x, y, z, r, g, b, radius in rows)


def _write_cache(light: EnvironmentLight, entry: Path) -> None:
    specular, irradiance = light.specular.astype(np.float16), light.irradiance.astype(np.float16)
    suns = np.array([[*sun.direction, *sun.light, sun.radius] for sun in light.suns])
    maps = (specular, irradiance, light.background, light.luminance, suns)
    disk_cache.write(entry, dict(zip(_MAPS, maps, strict=True)))


def _remove_earlier(entry: Path) -> None:
    """Remove what earlier versions of this module made of the same HDRI: 17 MB a light add up."""
    key = entry.stem.rpartition("-")[0]
    for other in entry.parent.glob(f"{key}-*.npz"):
        version = other.stem.rpartition("-")[2]
        if version.isdecimal() and int(version) < PREFILTER_VERSION:
            with contextlib.suppress(OSError):
                other.unlink()


def to_map_frame(direction: ArrayLike, yaw_deg: float) -> NDArray[np.float64]:
    """World directions [..., 3] as the directions of the map's own frame: Rz(-yaw) direction."""
    d = np.asarray(direction, np.float64)
    c, s = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
    return d @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T


def irradiance_at(env: Ambient, normals: ArrayLike, yaw_deg: float = 0.0) -> NDArray[np.float32]:
    """Irradiance / pi, float32 [K, 3], on surfaces with world normals [K, 3], suns included."""
    normals = to_map_frame(normals, yaw_deg)
    found = prefilter.sample_octahedral(env.irradiance, normals)
    for sun in env.suns:
        cosine = np.maximum(normals @ np.array(sun.direction), 0.0)
        found += (cosine[:, None] * sun.light).astype(np.float32)
    return found


@functools.cache
def _meter_cells() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    height = _LUMINANCE_WIDTH // 2
    weight = np.repeat(prefilter.row_solid_angle(height), _LUMINANCE_WIDTH)
    return prefilter.equirect_directions(height).reshape(-1, 3), weight


def sky_irradiance(env: Ambient, normals: ArrayLike, yaw_deg: float) -> NDArray[np.float32]:
    """`irradiance_at` without suns, [K, 3]: what ibl.glsl's diffuse_radiance is."""
    return prefilter.sample_octahedral(env.irradiance, to_map_frame(normals, yaw_deg))


def sky_radiance(env: Ambient, directions: ArrayLike, yaw_deg: float) -> NDArray[np.float32]:
    """Mean radiance [K, 3], without suns, of what lies nearest to each of world directions.

    The directions [K, 3] are spread over the whole sphere; each holds several cells of `env.sky`.
    """
    cells, solid_angle = _sky_geometry(env.sky.shape[0])
    toward = to_map_frame(directions, yaw_deg).astype(np.float32)
    # by column: threads of a matrix library cost more than they save
    nearness = np.zeros((len(cells), len(toward)), np.float32)
    for along, to in zip(cells.T, toward.T, strict=True):
        nearness += np.outer(along, to)
    nearest = nearness.argmax(axis=1)
    count = len(toward)
    weighted = solid_angle * env.sky.reshape(-1, 3).T
    total = np.stack([np.bincount(nearest, channel, count) for channel in weighted], axis=1)
    return (total / np.bincount(nearest, solid_angle, count)[:, None]).astype(np.float32)


@functools.cache
def _sky_geometry(size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """As prefilter.octahedral_texels."""
    cells, solid_angle = prefilter.octahedral_texels(size)
    return cells.astype(np.float32), solid_angle.astype(np.float32)


def metered_luminance(
    env: Ambient, direction: ArrayLike, half_angle_deg: float, yaw_deg: float = 0.0
) -> float:
    """Log average of the luminance within a cone around a world direction [3].

    Cells of the luminance map, 11.25 degrees wide, fade out over their width at the rim, so that
    the result moves smoothly with the direction; narrower cones are widened to one cell.
    Luminance below 1e-6 counts as 1e-6.
    """
    cells, solid_angle = _meter_cells()
    cell = 2 * np.pi / _LUMINANCE_WIDTH
    axis = to_map_frame(direction, yaw_deg)
    angle = np.arccos(np.clip(cells @ (axis / np.linalg.norm(axis)), -1.0, 1.0))
    half_angle = max(np.deg2rad(half_angle_deg), cell)
    weight = solid_angle * np.clip((half_angle - angle) / cell + 0.5, 0.0, 1.0)
    weight /= weight.sum()
    luminance = env.luminance.ravel()
    return float(np.exp(weight @ np.log(np.maximum(luminance, _LUMINANCE_FLOOR))))

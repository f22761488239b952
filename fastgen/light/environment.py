"""Prefiltered light of an HDRI, cached on disk.

World z is up. prefilter.py and octahedral.py describe the map projections. Radiance is linear with
Rec. 709 primaries. The yaw, in degrees, turns the environment about +z, counter-clockwise seen from
above: radiance(direction) = map(Rz(-yaw) direction).
"""

import functools
from dataclasses import dataclass, fields
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.errors import AssetError
from fastgen.files import disk_cache
from fastgen.light import octahedral, prefilter, rgb9e5
from fastgen.light.directional_lights import DirectionalLight, extract_lights
from fastgen.light.hdri import HALF_MAX, content_hash, load_radiance
from fastgen.scene import REC_709

VERSION = 1  # raise when the stored arrays change

ROUGHNESS_LEVELS = (0.05, 0.1, 0.18, 0.28, 0.4, 0.55, 0.75, 1.0)
"""Perceptual roughness of each layer of `EnvironmentLight.specular`; interpolate linearly."""

SPECULAR_SIZE = 128
IRRADIANCE_SIZE = 34
"""Texels along a side of the map, including the border; likewise SPECULAR_SIZE."""

_LUMINANCE_WIDTH = 32
_LUMINANCE_FLOOR = 1e-6  # keeps one black texel from turning a log average to 0
_DARKEST = 1e-5  # darker maps show the steps of half floats
_BRIGHTEST = 1e4  # radiance up to six times the mean still fits half floats
_SKY_CELLS = 42  # along a side of `Ambient.sky`; 5 degrees each
_MEANS_SIZE = 16  # texels along a side of the map of hidden_sky
_LIGHTS_WIDTH = 2048  # a texel is a third of the diameter of the sun
_MAX_WORK_WIDTH = 8192  # a background texel covers about two of its texels


@dataclass(frozen=True, eq=False)
class Ambient:
    """Light of an environment without the large maps of the GPU.

    Maps are finite, float32 and within [0, HALF_MAX]. `irradiance` excludes `lights`.
    """

    name: str
    irradiance: NDArray[np.float32]
    """[M, M, 3] irradiance / pi by surface normal: the radiance of a white Lambert surface."""
    luminance: NDArray[np.float32]
    """[16, 32] equirectangular, mean Rec. 709 luminance of each cell, for exposure metering."""
    mean_luminance: float
    """Mean of the luminance over the whole sphere."""
    lights: tuple[DirectionalLight, ...]
    """Directional lights, brightest first; none under an even sky."""
    sky: NDArray[np.float32]
    """[42, 42, 3] octahedral without a border, mean radiance of each cell without `lights`."""

    @staticmethod
    def of(light: "Ambient") -> "Ambient":
        """Return a copy of `light` without its large maps."""
        return Ambient(**{field.name: getattr(light, field.name) for field in fields(Ambient)})


@dataclass(frozen=True, eq=False)
class EnvironmentLight(Ambient):
    """Prefiltered light of one HDRI, ready for a GPU.

    The octahedral maps have a border of one texel, see octahedral.py. The values of `specular` and
    `irradiance` are exactly representable as half floats.
    """

    specular: NDArray[np.float32]
    """[L, N, N, 3] radiance without `lights`, convolved with the GGX lobe of each roughness in
    ROUGHNESS_LEVELS."""
    background: NDArray[np.uint32]
    """[B, B] unfiltered radiance, packed by rgb9e5.py and indexed by octahedral.levelled.
    B is the power of two nearest twice the width of the HDRI, from 512 to 2048, which looks as
    sharp as the HDRI. It is 4096 for an HDRI wider than 4096; a finer map would take 67 MB and is
    not visible in images of usual size."""
    obstacles: NDArray[np.uint8] | None = None
    """[S, S] as `ContainerMap.obstacles`; None if it is unknown."""


def prefilter_environment(name: str, radiance: NDArray[np.float32]) -> EnvironmentLight:
    """Prefilter the radiance of an HDRI.

    Sums are in float32 or wider. Only the results are clamped to the range of half floats, so a sun
    of 1e6 keeps its energy wherever it is spread over more than a few texels.

    Args:
        name: Name of the environment.
        radiance: float32 [H, W, 3], equirectangular, finite and 0 or more, H close to W / 2.
    """
    width = radiance.shape[1]
    background_size = int(np.clip(2 ** round(np.log2(2 * width)), 512, 2048))
    if width > 4096:
        background_size = 4096
    source = prefilter.shrink(radiance, min(2 * background_size, _MAX_WORK_WIDTH))
    # a texel is sqrt(4 pi) / B radians wide, a source texel at most 2 pi / W
    samples = 1 if source.shape[1] <= 1.5 * background_size else 2
    poles = prefilter.smooth_poles(source)
    background = octahedral.resample_octahedral(poles, background_size, samples, level=True)

    # about 1.5 texels per texel of the layers; half as many suffice for wider lobes
    narrow = prefilter.shrink(source, _LIGHTS_WIDTH)
    lights, rest = extract_lights(narrow)
    fine = prefilter.shrink(rest, 4 * SPECULAR_SIZE)
    coarse = prefilter.shrink(fine, 2 * SPECULAR_SIZE)
    layers = []
    for roughness in ROUGHNESS_LEVELS:
        if roughness < 0.08:  # narrower than a texel, whose mean is more accurate
            lobes = prefilter.smooth_poles(fine)
        else:
            grid = fine if roughness < 0.25 else coarse
            lobes = prefilter.convolve(grid, prefilter.ggx_lobe(roughness))
        layers.append(octahedral.resample_octahedral(lobes, SPECULAR_SIZE, 4))
    diffuse = prefilter.convolve(coarse, prefilter.cosine_lobe)
    irradiance = octahedral.resample_octahedral(diffuse, IRRADIANCE_SIZE, 1)

    cells = prefilter.shrink(narrow, _LUMINANCE_WIDTH) @ REC_709.astype(np.float32)
    packed = rgb9e5.packed(background)
    layers_half, irradiance_half = half_floats(np.stack(layers)), half_floats(irradiance)
    return _light(name, layers_half, irradiance_half, packed, cells, lights)


def half_floats(radiance: NDArray[np.float32]) -> NDArray[np.float16]:
    """Return radiance as half floats, the format of the maps on a GPU."""
    return np.minimum(radiance, HALF_MAX).astype(np.float16)


def _light(
    name: str,
    specular: NDArray[np.float16],
    irradiance: NDArray[np.float16],
    background: NDArray[np.uint32],
    luminance: NDArray[np.float32],
    lights: tuple[DirectionalLight, ...],
) -> EnvironmentLight:
    weight = prefilter.row_solid_angle(luminance.shape[0]) / (4 * np.pi)
    return EnvironmentLight(
        name=name,
        specular=specular.astype(np.float32),
        irradiance=irradiance.astype(np.float32),
        background=background,
        luminance=np.array(luminance),  # a view would keep the whole mapped entry
        mean_luminance=float(weight @ luminance.sum(axis=1, dtype=np.float64)),
        lights=lights,
        sky=_sky_cells(specular[0].astype(np.float32)),
    )


def _sky_cells(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean of each cell of an octahedral map [N, N, 3] with a border."""
    inner = radiance[octahedral.BORDER : -octahedral.BORDER, octahedral.BORDER : -octahedral.BORDER]
    cells = cv2.resize(inner, (_SKY_CELLS, _SKY_CELLS), interpolation=cv2.INTER_AREA)
    return np.asarray(cells, np.float32)


def load_environment(path: str | Path, cache_dir: str | Path | None = None) -> EnvironmentLight:
    """Return the prefiltered light of an HDRI, from the disk cache if possible.

    The cache key is the content of the file: a renamed file hits, a changed file misses. Cached and
    new results are bit-identical. A broken entry is rebuilt. Without a writable folder nothing is
    cached.

    Args:
        path: .hdr or .exr file.
        cache_dir: By default $XDG_CACHE_HOME/fastgen or ~/.cache/fastgen.

    Raises:
        AssetError: The file cannot be used, see `load_radiance`, or is too dark or too bright.
    """
    path = Path(path)
    key = content_hash(path)
    folder = None if cache_dir is None else Path(cache_dir)
    light = _unpacked(
        path.stem,
        disk_cache.cached(
            "environment",
            VERSION,
            key,
            lambda: _packed(prefilter_environment(path.stem, load_radiance(path))),
            folder,
            _LAYOUT,
            f"light {path.stem}",
        ),
    )
    if light.mean_luminance > _BRIGHTEST:
        raise AssetError(
            f"{path}: is too bright, with a mean luminance of {light.mean_luminance:.2g}; scale "
            f"it to {_BRIGHTEST:g} or less"
        )
    if light.mean_luminance < _DARKEST:
        raise AssetError(
            f"{path}: is dark, with a mean luminance of {light.mean_luminance:.2g}; an HDRI must "
            f"have {_DARKEST:g} or more to be exposed"
        )
    return light


_LAYOUT = {
    "specular": f"float16 {len(ROUGHNESS_LEVELS)} {SPECULAR_SIZE} {SPECULAR_SIZE} 3",
    "irradiance": f"float16 {IRRADIANCE_SIZE} {IRRADIANCE_SIZE} 3",
    "background": "uint32 B B",
    "luminance": f"float32 {_LUMINANCE_WIDTH // 2} {_LUMINANCE_WIDTH}",
    "lights": "float64 L 7",
}
"""Layout of an environment in the disk cache; see `_packed`."""


def _packed(light: EnvironmentLight) -> disk_cache.Arrays:
    return {
        "specular": light.specular.astype(np.float16),
        "irradiance": light.irradiance.astype(np.float16),
        "background": light.background,
        "luminance": light.luminance,
        "lights": np.array(
            [[*each.direction, *each.light, each.radius] for each in light.lights]
        ).reshape(-1, 7),
    }


def _unpacked(name: str, arrays: disk_cache.Arrays) -> EnvironmentLight:
    rows = arrays["lights"].tolist()
    lights = tuple(
        DirectionalLight((x, y, z), (r, g, b), radius) for x, y, z, r, g, b, radius in rows
    )
    specular, irradiance = arrays["specular"], arrays["irradiance"]
    background, luminance = arrays["background"], arrays["luminance"]
    return _light(name, specular, irradiance, background, luminance, lights)


def to_map_frame(direction: ArrayLike, yaw_deg: float) -> NDArray[np.float64]:
    """Return world directions [..., 3] in the frame of the environment map: Rz(-yaw) direction."""
    d = np.asarray(direction, np.float64)
    c, s = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
    turned: NDArray[np.float64] = d @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T
    return turned


def irradiance_at(env: Ambient, normals: ArrayLike, yaw_deg: float = 0.0) -> NDArray[np.float32]:
    """Return irradiance / pi, float32 [K, 3], by world normals [K, 3], including `env.lights`."""
    normals = to_map_frame(normals, yaw_deg)
    found = octahedral.sample_octahedral(env.irradiance, normals)
    for each in env.lights:
        cosine = np.maximum(normals @ np.array(each.direction), 0.0)
        found += (cosine[:, None] * each.light).astype(np.float32)
    return found


@functools.cache
def _meter_cells() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    height = _LUMINANCE_WIDTH // 2
    weight = np.repeat(prefilter.row_solid_angle(height), _LUMINANCE_WIDTH)
    return prefilter.equirect_directions(height).reshape(-1, 3), weight


def sky_irradiance(env: Ambient, normals: ArrayLike, yaw_deg: float) -> NDArray[np.float32]:
    """Return irradiance / pi, float32 [K, 3], by world normals [K, 3], without `env.lights`.

    The numpy twin of diffuse_radiance() in shaders/environment_map.glsl.
    """
    return octahedral.sample_octahedral(env.irradiance, to_map_frame(normals, yaw_deg))


def sky_radiance(env: Ambient, directions: ArrayLike, yaw_deg: float) -> NDArray[np.float32]:
    """Return the mean radiance around each world direction, without `env.lights`.

    Args:
        env: The light.
        directions: [K, 3], spread over the whole sphere. Each cell of `env.sky` counts for the
            nearest direction; each direction gets several cells.
        yaw_deg: Rotation of the environment.

    Returns:
        float32 [K, 3].
    """
    cells, solid_angle = _sky_geometry(env.sky.shape[0])
    toward = to_map_frame(directions, yaw_deg).astype(np.float32)
    # column by column, because the threads of a matrix library cost more than they save
    nearness = np.zeros((len(cells), len(toward)), np.float32)
    for along, to in zip(cells.T, toward.T, strict=True):
        nearness += np.outer(along, to)
    nearest = nearness.argmax(axis=1)
    count = len(toward)
    weighted = solid_angle * env.sky.reshape(-1, 3).T
    total = np.stack([np.bincount(nearest, channel, count) for channel in weighted], axis=1)
    return (total / np.bincount(nearest, solid_angle, count)[:, None]).astype(np.float32)


def lower_irradiance(env: Ambient, normals: ArrayLike, yaw_deg: float) -> NDArray[np.float32]:
    """Return the part of `sky_irradiance` that comes from below the horizon, float32 [K, 3]."""
    cells, solid_angle = _sky_geometry(env.sky.shape[0])
    facing = np.maximum(to_map_frame(normals, yaw_deg) @ cells.T, 0.0) * solid_angle
    radiance = env.sky.reshape(-1, 3)
    part = (facing * (cells[:, 2] < 0)) @ radiance / np.maximum(facing @ radiance, 1e-9)
    return np.asarray(sky_irradiance(env, normals, yaw_deg) * part, np.float32)


def hidden_sky(env: Ambient, directions: ArrayLike, yaw_deg: float) -> NDArray[np.float32]:
    """Return the radiance of the sky that something in each world direction [K, 3] hides.

    It is the mean above the horizon in a lobe that falls to half at 33 degrees, about the extent of
    a container near by, without `env.lights`.

    Returns:
        float32 [K, 3].
    """
    return octahedral.sample_octahedral(_means_above(env), to_map_frame(directions, yaw_deg))


@functools.lru_cache(maxsize=8)
def _means_above(env: Ambient) -> NDArray[np.float32]:
    """Return `hidden_sky` as an octahedral map with a border, in the frame of the environment."""
    cells, solid_angle = _sky_geometry(env.sky.shape[0])
    toward, _ = octahedral.octahedral_texels(_MEANS_SIZE)
    weight = np.maximum(toward.astype(np.float32) @ cells.T, 0.0) ** 4
    weight *= solid_angle * (cells[:, 2] > 0)
    means = weight @ env.sky.reshape(-1, 3) / np.maximum(weight.sum(axis=1), 1e-9)[:, None]
    side = _MEANS_SIZE + 2 * octahedral.BORDER
    found = np.zeros((side, side, 3), np.float32)
    inside = slice(octahedral.BORDER, -octahedral.BORDER)
    found[inside, inside] = means.reshape(_MEANS_SIZE, _MEANS_SIZE, 3)
    octahedral.fill_border(found)
    return found


@functools.cache
def _sky_geometry(size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return octahedral_texels as float32."""
    cells, solid_angle = octahedral.octahedral_texels(size)
    return cells.astype(np.float32), solid_angle.astype(np.float32)


def metered_luminance(
    env: Ambient, direction: ArrayLike, half_angle_deg: float, yaw_deg: float = 0.0
) -> float:
    """Return the log average of the luminance within a cone.

    Cells of the luminance map, 11.25 degrees wide, fade out over their width at the rim of the
    cone, which makes the result continuous in the direction. Narrower cones are widened to one
    cell. Luminance below 1e-6 counts as 1e-6.

    Args:
        env: The light.
        direction: Axis of the cone in the world, [3].
        half_angle_deg: Half of its opening angle.
        yaw_deg: Rotation of the environment.
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

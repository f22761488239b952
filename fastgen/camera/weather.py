"""Fog and falling rain between the camera and what it sees, in linear light."""

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.camera.tone_curve import Light
from fastgen.scene.optics import Rain

_CONTRAST = 3.912
"""-ln 0.02: visibility is where 2 % of a contrast is left (Koschmieder 1924)."""

_BACKDROP_M = 300.0
"""How far away the surroundings are taken to be, of which an HDRI does not say it."""

_BESIDE = 2
"""Pixels around one in which its surroundings are looked for."""

_NEAREST_M, _FARTHEST_M = 0.12, 4.0
"""Drops nearer are blurs before the lens, drops farther are too fine to tell apart."""

_SMALLEST_MM, _LARGEST_MM = 1.0, 4.5
_MOST_DROPS = 12_000
"""Of more, as wide lenses see in heavy rain, so many are drawn, each for as many as it takes."""

_DROP_LIGHT = 0.94
"""Of the mean light around, that a drop sends on (Garg and Nayar 2007, "Vision and Rain", 3)."""


def foggy(
    light: Light,
    ray_m: NDArray[np.float32],
    cover: NDArray[np.uint8],
    visibility_mm: float,
    airlight: Light,
) -> Light:
    """Koschmieder's law: light L t + A (1 - t), t = exp(-3.912 d / V).

    ray_m: float32 [H, W], distance along the ray through each pixel's centre, inf for the
    surroundings. cover: uint8 [H, W], see Frame. airlight: [3].
    """
    decay = np.float32(-_CONTRAST * 1e3 / visibility_mm)
    far, near = np.exp(decay * np.float32(_BACKDROP_M)), np.exp(decay * _objects_m(ray_m))
    left = np.where(cover == 0, far, near)
    seen = _mixed(light, airlight, 1 - left)
    mixed = np.nonzero((cover > 0) & (cover < 255))
    share = cover[mixed][:, None] * np.float32(1 / 255)
    own = light[mixed]
    behind = _behind(light, cover, mixed, share)
    near_them = near[mixed][:, None]
    left_of_them = near_them * share + far * (1 - share)
    seen[mixed] = (own - behind) * near_them + behind * far + airlight * (1 - left_of_them)
    return seen


def _behind(
    light: Light,
    cover: NDArray[np.uint8],
    mixed: tuple[NDArray[np.intp], ...],
    share: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Of the light of pixels that objects cover a share [N, 1] of, the surroundings', [N, 3].

    It is that of pixels beside them that show nothing else, where there are some. But objects are
    no brighter than pixels beside them that they cover whole, or where there are none, as beside
    cables, than the mean of all such: what detail of the surroundings adds to that is theirs.
    """
    step = np.arange(-_BESIDE, _BESIDE + 1)
    down, right = (offset.ravel() for offset in np.meshgrid(step, step, indexing="ij"))
    height, width = cover.shape
    rows = np.clip(mixed[0][:, None] + down, 0, height - 1)
    columns = np.clip(mixed[1][:, None] + right, 0, width - 1)
    beside, covered = light[rows, columns], cover[rows, columns][..., None]
    own, bare, whole = light[mixed], covered == 0, covered == 255
    count = bare.sum(axis=1)
    beyond = np.where(count > 0, (beside * bare).sum(axis=1) / np.maximum(count, 1), own)
    everywhere = cover == 255
    usual = light[everywhere].mean(axis=0) if everywhere.any() else beyond
    most = np.where(whole.any(axis=1), np.where(whole, beside, 0).max(axis=1), usual)
    return np.clip((1 - share) * beyond, own - share * most, own)


def _objects_m(ray_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far away is what covers a pixel [H, W], also where its centre shows the surroundings:
    as far as beside it, or, of a cable that no centre meets, as the nearest thing."""
    beside = cv2.erode(ray_m, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    nearest = np.minimum(ray_m.min(), np.float32(_BACKDROP_M))
    away = np.where(np.isfinite(beside), beside, nearest)
    return np.where(np.isfinite(ray_m), ray_m, away)


def rained(light: Light, depth_m: NDArray[np.float32], view: View, rain: Rain, sky: Light) -> Light:
    """Streaks of drops that fall while the shutter is open, before what is farther than they.

    A drop of diameter a at speed v covers a pixel on its way for a / v, so that it mixes that share
    of the exposure with its own light: Garg and Nayar 2007, section 5. Sizes: Marshall and Palmer
    1948; speed: Atlas, Srivastava and Sekhon 1973. sky: [3], mean light around.
    """
    rng = np.random.Generator(np.random.PCG64(rain.seed))
    height, width = depth_m.shape
    slope = 4.1 * rain.rate_mm_h**-0.21  # 1/mm
    per_m3 = 8000 / slope * (np.exp(-slope * _SMALLEST_MM) - np.exp(-slope * _LARGEST_MM))
    reach = np.array([width, height]) / view.focal_px
    volume = reach.prod() * (_FARTHEST_M**3 - _NEAREST_M**3) / 3
    fallen = int(rng.poisson(per_m3 * volume))
    count = min(fallen, _MOST_DROPS)
    # uniform in the pyramid that is seen
    near, far = _NEAREST_M**3, _FARTHEST_M**3
    z = np.cbrt(near + rng.random(count) * (far - near))
    start = rng.random((count, 2)) * (width, height)
    least, most = np.exp(-slope * _LARGEST_MM), np.exp(-slope * _SMALLEST_MM)
    size_mm = -np.log(least + rng.random(count) * (most - least)) / slope
    speed = 9.65 - 10.3 * np.exp(-0.6 * size_mm)  # m/s
    down = view.rotation @ (0.0, 0.0, -1.0)
    aside = np.array([down[1], -down[0], 0.0])
    fall_m = (speed * rain.shutter_s)[:, None] * (down + rain.wind * aside)
    # the derivative of a pinhole's projection
    from_center = (start - view.center_px) / view.focal_px
    way_px = (fall_m[:, :2] - from_center * fall_m[:, 2:]) / z[:, None] * view.focal_px
    wide_px = size_mm * 1e-3 / z * view.focal_px
    cover = _streaks(start, way_px, wide_px, z, depth_m, fallen / max(count, 1))
    return _mixed(light, _DROP_LIGHT * sky, cover)


def _mixed(light: Light, other: Light, share: NDArray[np.float32]) -> Light:
    """Light [H, W, 3] and `other` [3], of which each pixel gets its `share` [H, W]."""
    planes = zip(cv2.split(light), other, strict=True)
    return np.asarray(cv2.merge([plane + share * (one - plane) for plane, one in planes]))


def _streaks(
    middle: NDArray[np.float64],
    way_px: NDArray[np.float64],
    wide_px: NDArray[np.float64],
    z: NDArray[np.float64],
    depth_m: NDArray[np.float32],
    times: float = 1.0,
) -> NDArray[np.float32]:
    """Share of the exposure that drops cover each pixel for, float32 [H, W] in 0..1.

    middle, way_px: [N, 2] in pixels, of each streak. A drop's area, over its way and width in
    whole pixels, adds up to wide_px squared. times: how many drops each stands for.
    """
    height, width = depth_m.shape
    way = np.abs(way_px).max(axis=1)
    length = way + wide_px  # from the first to the last that it covers
    steps = np.ceil(length).astype(np.int64) + 1
    drop = np.repeat(np.arange(len(z)), steps)
    along = np.arange(len(drop)) - np.repeat(np.cumsum(steps) - steps, steps)
    step = way_px / np.maximum(way, 1e-6)[:, None]
    # what is wider than a pixel is so across its way
    across = (np.abs(way_px[:, :1]) > np.abs(way_px[:, 1:])) == [False, True]
    cover = np.zeros(height * width)
    thick = np.maximum(np.rint(wide_px), 1).astype(int)
    share = np.minimum(times * wide_px**2 / (steps * thick), 1.0)
    for side in range(int(thick.max(initial=1))):
        wide = thick[drop] > side
        which = drop[wide]
        at_px = middle[which] + step[which] * (along[wide] - length[which] / 2)[:, None]
        at_px += across[which] * (side - thick[which] / 2)[:, None]
        column, row = np.floor(at_px).astype(np.int64).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        at, which = row[inside] * width + column[inside], which[inside]
        before = z[which] < depth_m.ravel()[at]
        at, which = at[before], which[before]
        cover += np.bincount(at, weights=share[which], minlength=height * width)
    return np.minimum(cover, 1.0).reshape(height, width).astype(np.float32)

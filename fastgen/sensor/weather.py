"""Fog and falling rain between the camera and what it sees, in linear light."""

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera import View
from fastgen.sensor.light import Light
from fastgen.sensor.parts import Rain

_CONTRAST = 3.912
"""-ln 0.02: visibility is where 2 % of a contrast is left (Koschmieder 1924)."""

_BACKDROP_M = 300.0
"""How far away the surroundings are taken to be, of which an HDRI does not say it."""

_BESIDE = (5, 5)
"""Pixels around one in which its surroundings are looked for."""

_NEAREST_M, _FARTHEST_M = 0.12, 4.0
"""Drops nearer are blurs before the lens, drops farther are too fine to tell apart."""

_SMALLEST_MM, _LARGEST_MM = 1.0, 4.5
_MOST_DROPS = 6000
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
    open_share = 1 - cover * np.float32(1 / 255)
    left = near + (far - near) * open_share
    planes = []
    for plane, beyond, air in zip(
        cv2.split(light), cv2.split(_beyond(light, cover)), airlight, strict=True
    ):
        behind = np.minimum(open_share * beyond, plane)
        planes.append((plane - behind) * near + behind * far + air * (1 - left))
    return np.asarray(cv2.merge(planes))


def _beyond(light: Light, cover: NDArray[np.uint8]) -> Light:
    """Light [H, W, 3] of the surroundings in each pixel: where objects cover a part of one, that of
    pixels beside it that show nothing else; its own where there are none."""
    bare = (cover == 0).astype(np.float32)
    count = cv2.boxFilter(bare, -1, _BESIDE, normalize=False)
    total = cv2.boxFilter(light * bare[..., None], -1, _BESIDE, normalize=False)
    mixed = (cover > 0) & (count > 0.5)
    found = light.copy()
    found[mixed] = total[mixed] / count[mixed][:, None]
    return found


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
    count = min(int(rng.poisson(per_m3 * volume)), _MOST_DROPS)
    # uniform in the pyramid that is seen
    near, far = _NEAREST_M**3, _FARTHEST_M**3
    z = np.cbrt(near + rng.random(count) * (far - near))
    start = rng.random((count, 2)) * (width, height)
    least, most = np.exp(-slope * _LARGEST_MM), np.exp(-slope * _SMALLEST_MM)
    size_mm = -np.log(least + rng.random(count) * (most - least)) / slope
    speed = 9.65 - 10.3 * np.exp(-0.6 * size_mm)  # m/s
    fall_px = speed * rain.shutter_s / z * view.focal_px
    wide_px = size_mm * 1e-3 / z * view.focal_px
    share = np.minimum(size_mm * 1e-3 / (speed * rain.shutter_s), 1.0)
    cover = _streaks(start, fall_px, rain.wind, wide_px, share, z, depth_m)
    return _mixed(light, _DROP_LIGHT * sky, cover)


def _mixed(light: Light, other: Light, share: NDArray[np.float32]) -> Light:
    """Light [H, W, 3] and `other` [3], of which each pixel gets its `share` [H, W]."""
    planes = zip(cv2.split(light), other, strict=True)
    return np.asarray(cv2.merge([plane + share * (one - plane) for plane, one in planes]))


def _streaks(
    start: NDArray[np.float64],
    fall_px: NDArray[np.float64],
    wind: float,
    wide_px: NDArray[np.float64],
    share: NDArray[np.float64],
    z: NDArray[np.float64],
    depth_m: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Share of the exposure that drops cover each pixel for, float32 [H, W] in 0..1.

    A streak adds to each pixel of its line, and of its width where it is wider than one.
    """
    height, width = depth_m.shape
    steps = np.ceil(fall_px).astype(np.int64) + 1
    drop = np.repeat(np.arange(len(z)), steps)
    along = np.arange(len(drop)) - np.repeat(np.cumsum(steps) - steps, steps)
    cover = np.zeros(height * width)
    thick = np.maximum(np.ceil(wide_px), 1).astype(int)
    for side in range(int(thick.max(initial=1))):
        wide = thick[drop] > side
        which = drop[wide]
        x = start[which, 0] + wind * along[wide] + side - thick[which] / 2
        y = start[which, 1] + along[wide] - fall_px[which] / 2
        column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        at, which = row[inside] * width + column[inside], which[inside]
        before = z[which] < depth_m.ravel()[at]
        at, which = at[before], which[before]
        # a drop narrower than a pixel covers a part of it
        weight = share[which] * np.minimum(wide_px[which], 1.0)
        cover += np.bincount(at, weights=weight, minlength=height * width)
    return np.minimum(cover, 1.0).reshape(height, width).astype(np.float32)

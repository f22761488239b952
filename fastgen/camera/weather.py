"""Fog and falling rain between the camera and the scene, in linear light."""

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.camera.tone_curve import Light
from fastgen.scene.optics import Rain

CONTRAST = 3.912
"""-ln 0.02: at the visibility distance 2 % of a contrast remains (Koschmieder 1924)."""

BACKDROP_M = 300.0
"""Assumed distance of the panorama, because an HDRI has no distances."""

_BESIDE = 2
"""Radius in pixels of the search for uncovered neighbours."""

_NEAREST_M, _FARTHEST_M = 0.12, 4.0
"""Nearer drops are only blurs in front of the lens; farther drops are too fine to resolve."""

_SMALLEST_MM, _LARGEST_MM = 1.0, 4.5
_MOST_DROPS = 12_000
"""Limit on drawn drops. If a wide lens sees more, each drawn drop represents several."""

_DROP_LIGHT = 0.94
"""Share of the mean ambient light that a drop refracts to the camera (Garg and Nayar 2007, "Vision
and Rain", section 3)."""


def add_fog(
    light: Light,
    ray_m: NDArray[np.float32],
    cover: NDArray[np.uint8],
    visibility_mm: float,
    airlight: Light,
    backdrop_m: float | NDArray[np.float32] = BACKDROP_M,
) -> Light:
    """Return light seen through fog, by Koschmieder's law: L t + A (1 - t), t = exp(-3.912 d / V).

    In partly covered pixels the object and the panorama are attenuated separately.

    Args:
        light: float32 [H, W, 3], linear.
        ray_m: float32 [H, W], distance along the ray of each pixel centre in metres, inf for the
            panorama.
        cover: uint8 [H, W], see Frame.
        visibility_mm: Meteorological visibility V.
        airlight: float32 [3], A.
        backdrop_m: Distance of the panorama along the ray in metres, one or float32 [H, W].
    """
    decay = np.float32(-CONTRAST * 1e3 / visibility_mm)
    far = np.broadcast_to(np.exp(decay * np.float32(backdrop_m)), ray_m.shape)
    near = np.exp(decay * _objects_m(ray_m))
    left = np.where(cover == 0, far, near)
    seen = _mixed(light, airlight, 1 - left)
    mixed = np.nonzero((cover > 0) & (cover < 255))
    if not len(mixed[0]):
        return seen
    share = cover[mixed][:, None] * np.float32(1 / 255)
    own = light[mixed]
    behind = _behind(light, cover, mixed, share)
    near_them, beyond = near[mixed][:, None], far[mixed][:, None]
    left_of_them = near_them * share + beyond * (1 - share)
    seen[mixed] = (own - behind) * near_them + behind * beyond + airlight * (1 - left_of_them)
    return seen


def _behind(
    light: Light,
    cover: NDArray[np.uint8],
    mixed: tuple[NDArray[np.intp], ...],
    share: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return the panorama's part of the light of partly covered pixels, [N, 3].

    The uncovered neighbours give the estimate. It is raised so that the object in the pixel is not
    brighter than the fully covered neighbours, or than the mean fully covered pixel if there are
    none, as beside cables. This keeps bright detail of the panorama out of the object.

    Args:
        light: float32 [H, W, 3].
        cover: uint8 [H, W].
        mixed: Rows and columns [N] of the partly covered pixels.
        share: float32 [N, 1], coverage of these pixels, 0..1.
    """
    own, sides = light[mixed], (2 * _BESIDE + 1,) * 2
    bare, whole = (cover == value for value in (0, 255))
    edge = cv2.BORDER_REPLICATE
    count, total = (
        cv2.boxFilter(part, -1, sides, normalize=False, borderType=edge)[mixed]
        for part in (bare.astype(np.float32), cv2.copyTo(light, bare.view(np.uint8)))
    )
    beyond = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], own)
    usual = light[whole].mean(axis=0) if whole.any() else beyond
    square = np.ones(sides, np.uint8)
    near = cv2.dilate(whole.view(np.uint8), square, borderType=edge)[mixed] > 0
    brightest = cv2.dilate(cv2.copyTo(light, whole.view(np.uint8)), square, borderType=edge)[mixed]
    most = np.where(near[:, None], brightest, usual)
    return np.asarray(np.clip((1 - share) * beyond, own - share * most, own), np.float32)


def _objects_m(ray_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the distance of the object that covers a pixel, [H, W].

    If the pixel centre shows the panorama, the nearest neighbour's distance is used. A cable
    may miss all pixel centres; it gets the smallest distance in the image.
    """
    beside = cv2.erode(ray_m, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    nearest = np.minimum(ray_m.min(), np.float32(BACKDROP_M))
    away = np.where(np.isfinite(beside), beside, nearest)
    return np.where(np.isfinite(ray_m), ray_m, away)


def add_rain(
    light: Light, depth_m: NDArray[np.float32], view: View, rain: Rain, sky: Light
) -> Light:
    """Return light with streaks of drops that fall while the shutter is open.

    A drop of diameter a and speed v covers a pixel in its path for the time a / v and adds its own
    light for that share of the exposure (Garg and Nayar 2007, section 5). Sizes follow Marshall and
    Palmer 1948, speeds Atlas, Srivastava and Sekhon 1973. Nearer surfaces hide drops.

    Args:
        light: float32 [H, W, 3], linear.
        depth_m: float32 [H, W], metres along the optical axis.
        view: Projection of the camera.
        rain: Rate, shutter time, wind and random seed.
        sky: float32 [3], mean ambient light.
    """
    rng = np.random.Generator(np.random.PCG64(rain.seed))
    height, width = depth_m.shape
    slope = 4.1 * rain.rate_mm_h**-0.21  # 1/mm
    per_m3 = 8000 / slope * (np.exp(-slope * _SMALLEST_MM) - np.exp(-slope * _LARGEST_MM))
    reach = np.array([width, height]) / view.focals_px
    volume = reach.prod() * (_FARTHEST_M**3 - _NEAREST_M**3) / 3
    fallen = int(rng.poisson(per_m3 * volume))
    count = min(fallen, _MOST_DROPS)
    # uniform in the view pyramid
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
    from_center = (start - view.center_px) / view.focals_px
    way_px = (fall_m[:, :2] - from_center * fall_m[:, 2:]) / z[:, None] * view.focals_px
    wide_px = size_mm * 1e-3 / z * view.focal_px
    cover = _streaks(start, way_px, wide_px, z, depth_m, fallen / max(count, 1))
    return _mixed(light, _DROP_LIGHT * sky, cover)


def _mixed(light: Light, other: Light, share: NDArray[np.float32]) -> Light:
    """Return light [H, W, 3] mixed with `other` [3] by the `share` [H, W] of each pixel."""
    planes = cv2.split(light)
    change = np.empty(light.shape[:2], np.float32)
    for plane, one in zip(planes, other, strict=True):
        np.subtract(one, plane, out=change)
        change *= share
        np.add(plane, change, out=plane)
    return np.asarray(cv2.merge(planes))


def _streaks(
    middle: NDArray[np.float64],
    way_px: NDArray[np.float64],
    wide_px: NDArray[np.float64],
    z: NDArray[np.float64],
    depth_m: NDArray[np.float32],
    times: float = 1.0,
) -> NDArray[np.float32]:
    """Return the share of the exposure for which drops cover each pixel, float32 [H, W], 0..1.

    The coverage of one drop sums to wide_px squared over its streak.

    Args:
        middle: [N, 2], centre of each streak in pixels.
        way_px: [N, 2], movement during the exposure in pixels.
        wide_px: [N], diameter in pixels.
        z: [N], depth in metres.
        depth_m: float32 [H, W], depth of the scene.
        times: Number of drops that each streak represents.
    """
    height, width = depth_m.shape
    way = np.abs(way_px).max(axis=1)
    length = way + wide_px  # from the first covered pixel to the last
    steps = np.ceil(length).astype(np.int64) + 1
    drop = np.repeat(np.arange(len(z)), steps)
    along = np.arange(len(drop)) - np.repeat(np.cumsum(steps) - steps, steps)
    step = way_px / np.maximum(way, 1e-6)[:, None]
    # streaks wider than a pixel are widened along the minor axis of their movement
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

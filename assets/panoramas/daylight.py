"""Sky and sun of a panorama: maps of their radiance, and the lights of the Blender scene."""

import sys

import bpy
import numpy as np
from numpy.typing import NDArray

from panoramas import sky
from panoramas.port import Variant
from panoramas.tracing import Image, render

REC_709 = np.array((0.2126, 0.7152, 0.0722), np.float32)
FAINT = 0.03
"""Irradiance below which the sun is not visible through the clouds."""

_TWILIGHT = np.array((0.67, 1.01, 1.91), np.float32)
"""Blue sky without the sun, of luminance 1: daylight of 25,000 K, the highest temperature for which
CIE 15:2004 (section 3.1) gives a chromaticity."""


def toward(elevation_deg: float, azimuth_deg: float) -> NDArray[np.float64]:
    """Return the unit vector of angles in degrees."""
    e, a = np.radians((elevation_deg, azimuth_deg))
    return np.array((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)))


def bake_sky(v: Variant) -> tuple[Image, NDArray[np.float64]]:
    """Return the clear sky [512, 1024, 3], black below the horizon, and the sun's irradiance
    [3]."""
    tree = bpy.context.scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexSky")
    node.sky_type = "NISHITA"
    node.sun_elevation, node.sun_rotation = np.radians(max(v.sun_deg[0], -8.0)), 0.0
    node.sun_size, node.air_density, node.dust_density = np.radians(2.0), v.air, v.dust
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs[0])
    maps = []
    for disc in (False, True):
        node.sun_disc = disc
        planes = render((1024, 512), 24 if disc else 2, mist=False)
        maps.append(np.stack([planes[f"Combined.{c}"] for c in "RGB"], -1))
    tree.nodes.remove(node)
    clear, with_sun = maps
    # rotate Blender's sun, which is at +y for rotation 0, to the variant's azimuth
    shift = round((90.0 - v.sun_deg[1]) / 360 * 1024)
    clear = np.roll(clear, shift, axis=1)
    clear[256:] = 0
    angle = np.pi / 512
    solid = angle**2 * np.sin((np.arange(512) + 0.5) * angle)[:, None, None]
    sun = ((with_sun - maps[0]) * solid)[:256].sum((0, 1))
    return clear, np.maximum(sun, 0.0) * (v.sun_deg[0] > 0)


def compose_sky(
    v: Variant, clear: Image, sun: NDArray[np.float64], width: int
) -> tuple[Image, NDArray[np.float64]]:
    """Return the cloudy sky [width / 2, width, 3] without the disc, and the sun's light through
    it."""
    half = min(width, 1536) // 4
    down = sky.directions(2 * half)[:half]
    base = enlarge(clear[:256], (half, 4 * half))
    if v.sun_deg[0] <= 0:  # single scattering leaves the sky opposite the sun black
        # chosen by eye; multiple scattering matters more the lower the sun is
        more = 0.3 - 0.12 * v.sun_deg[0]
        base = base + more * float((base @ REC_709).mean()) * _TWILIGHT
    mean_sky = (base * down[..., 2:]).mean((0, 1)) / down[..., 2].mean()
    sun_way = toward(*v.sun_deg)
    through = np.ones((half, 4 * half), np.float32)
    if v.clouds.cover:
        through, lit, ambient = sky.cloud_layer(v.clouds, 2 * half, sun_way)
        light = sun
        if v.sun_deg[0] <= 0:  # the afterglow reaches clouds above the earth's shadow
            shadow_km = sky.EARTH_KM * (1 / np.cos(np.radians(v.sun_deg[0])) - 1)
            glow = base[-12:, :].max((0, 1))
            light = 0.9 * glow * (v.clouds.base_km > shadow_km)
        distance = v.clouds.base_km / np.maximum(down[..., 2], 0.01)
        clear_air = np.exp(-distance / 45.0)[..., None]
        clouded = (
            base * through[..., None]
            + lit[..., None] * light
            + ambient[..., None] * (1.15 * mean_sky + 0.04 * sun * max(sun_way[2], 0.0))
        )
        base = base + clear_air * (clouded - base)
        near_sun = down @ sun_way > np.cos(np.radians(0.6))
        if near_sun.any():
            sun = sun * float(through[near_sun].mean())
    if v.sun_deg[0] < -12:  # night: airglow, and town light scattered by haze
        rise = down[..., 2:]
        base = np.array((0.10, 0.14, 0.22)) + np.exp(-rise / 0.12) * np.array((1.0, 0.72, 0.45))
    full = np.zeros((2 * half, 4 * half, 3), np.float32)
    full[:half] = base
    gain = v.sky_level / float((base @ REC_709 * down[..., 2]).mean() / down[..., 2].mean())
    return enlarge(gain * full, (width // 2, width)), gain * sun


def enlarge(image: Image, size: tuple[int, int]) -> Image:
    """Resize bilinearly, seamless in azimuth."""
    (h, w), (high, wide) = image.shape[:2], size
    y = np.clip((np.arange(high) + 0.5) * h / high - 0.5, 0, h - 1)
    x = (np.arange(wide) + 0.5) * w / wide - 0.5
    y0, x0 = np.minimum(y.astype(int), h - 2), np.floor(x).astype(int)
    fy, fx = (y - y0)[:, None, None], (x - x0)[None, :, None]
    rows = image[y0] * (1 - fy) + image[y0 + 1] * fy
    return (rows[:, x0 % w] * (1 - fx) + rows[:, (x0 + 1) % w] * fx).astype(np.float32)


def light_scene(v: Variant, around: Image, sun: NDArray[np.float64]) -> None:
    """Light the scene with the sky map, and with the sun as a lamp so that it makes no noise."""
    small = enlarge(around, (512, 1024)) if around.shape[1] > 1024 else around
    high, wide = small.shape[:2]
    small[high // 2 :] = 0.5 * small[high // 2 - 2]  # invisible behind the ground
    image = bpy.data.images.new("sky", wide, high, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(np.dstack([small, np.ones((high, wide))])[::-1].ravel().astype("f4"))
    image.update()
    tree = bpy.context.scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs[0])
    if sun.max() > FAINT:
        lamp = bpy.data.lights.new("sun", "SUN")
        lamp.energy, lamp.color = float(sun.max()), tuple(sun / sun.max())
        lamp.angle = 2 * sky.SUN_RADIUS
        thing = bpy.data.objects.new("sun", lamp)
        elevation, azimuth = np.radians(v.sun_deg)
        thing.rotation_euler = (0.0, np.pi / 2 - elevation, azimuth)
        bpy.context.scene.collection.objects.link(thing)


def sun_disc(width: int, sun: NDArray[np.float64], way: NDArray[np.float64]) -> Image:
    """Return the radiance [width / 2, width, 3] of a uniform disc with the irradiance `sun`."""
    disc = np.zeros((width // 2, width, 3), np.float32)
    row = int(np.arccos(way[2]) / np.pi * (width // 2))
    fine = 8 * (width // 2)
    near = slice(max(row - width // 256, 0), row + width // 256)
    theta = np.pi * (np.arange(8 * near.start, 8 * near.stop) + 0.5)[:, None] / fine
    phi = np.pi - np.pi * (np.arange(8 * width) + 0.5)[None] / fine
    cosine = np.sin(theta) * (np.cos(phi) * way[0] + np.sin(phi) * way[1]) + np.cos(theta) * way[2]
    inside = (cosine > np.cos(sky.SUN_RADIUS)).astype(np.float32)
    cover = inside.reshape(-1, 8, width, 8).mean((1, 3))
    solid = (np.pi / (width // 2)) ** 2 * np.sin(
        np.pi * (np.arange(near.start, near.stop) + 0.5) / (width // 2)
    )[:, None]
    disc[near] = cover[..., None] * (sun / (cover * solid).sum())
    return disc


def check_sun(v: Variant) -> None:
    """Exit if an object hides the sun from the camera, because the variant's layout must change."""
    graph = bpy.context.evaluated_depsgraph_get()
    hit = bpy.context.scene.ray_cast(graph, v.eye, toward(*v.sun_deg))
    if hit[0]:
        sys.exit(f"{v.name}: {hit[4].name} hides the sun; move the eye or the sun")

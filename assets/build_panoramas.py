"""Render the port panoramas hdri/port_*.exr from our own Blender model of a port.

    python assets/build_panoramas.py                  # all that are missing, in hdri/
    python assets/build_panoramas.py --width 512 --out /tmp/look port_noon

Run by hand. Needs Python 3.11, `bpy` 4.5 and `OpenEXR`. The package panoramas/ contains the port:
shapes, materials, models, layout and sky. Cycles traces the objects on the ground. Haze, sky and
the sun's disc are added from exact maps afterwards, so that the disc keeps its energy and the sky
has no noise.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from numpy.typing import NDArray
from panoramas import sky
from panoramas.materials import build_materials
from panoramas.port import Builder, Variant
from panoramas.sky import Clouds

HDRI = Path(__file__).parent / "hdri"
Image = NDArray[np.float32]

REC_709 = np.array((0.2126, 0.7152, 0.0722), np.float32)
MEAN, PEAK = 0.7, 40000.0  # mean luminance by day; limit at which compression cannot overflow
_MIST_M = 20000.0
_DOWN_REACH = 1.52  # tangent of the view down: 45 degrees, 11.25 for blending, and a margin
_FAINT = 0.03  # irradiance below which the sun is not visible through the clouds
_TWILIGHT = np.array((0.67, 1.01, 1.91), np.float32)
"""Blue sky without the sun, of luminance 1: daylight of 25,000 K, the highest temperature for which
CIE 15:2004 (section 3.1) gives a chromaticity."""
_DWA_LEVELS = (60.0, 100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 800.0)
_MAX_BYTES = 1_100_000
_MAX_CHANGE = 0.005  # relative, for the light of the whole map and of its brightest parts

VARIANTS = (
    Variant("port_noon", ("day", "port", "waterside"), 1, (-6, 20, 7.5), (56, 200),
            Clouds(0.36, 1.3, 0.9, 9.0, 6.0, 3), haze_km=14.0),
    Variant("port_morning", ("day", "port"), 2, (-10, 82, 8.0), (17, 35),
            Clouds(0.22, 2.2, 0.4, 6.0, 8.0, 5), dust=2.0, haze_km=6.0),
    Variant("port_overcast", ("overcast", "port", "waterside"), 3, (-14, 9, 8.5), (40, 120),
            Clouds(0.97, 0.9, 0.8, 6.0, 9.0, 7), wet=0.5, haze_km=3.5, ship_m=0.0,
            cranes=((-52.0, False), (46.0, False), (140.0, False), (-190.0, True))),
    Variant("port_pier", ("day", "port", "waterside"), 4, (38, 12, 7.0), (33, -40),
            Clouds(0.28, 3.0, 0.3, 4.0, 9.0, 9), air=1.2, dust=3.0, haze_km=2.2, ship_m=None,
            cranes=((-40.0, True), (-120.0, False)), end_m=60.0, swell=1.3),
    Variant("port_golden", ("sunset", "port", "waterside"), 5, (14, 24, 8.0), (6.5, 170),
            Clouds(0.33, 2.0, 0.5, 7.0, 7.0, 11), dust=2.0, haze_km=7.0, ship_m=-150.0,
            cranes=((-60.0, False), (84.0, False), (180.0, False))),
    Variant("port_dusk", ("dusk", "port"), 16, (20, 45, 9.0), (-1.0, -150),
            Clouds(0.40, 2.6, 0.5, 6.0, 8.0, 13), sky_level=0.28, haze_km=8.0, lamps=0.35,
            lamp="sodium", cranes=((-60.0, True), (90.0, False))),
    Variant("port_night", ("night", "port"), 7, (30, 50, 8.0), (-30, 0), sky_level=0.006,
            haze_km=8.0, lamps=1.6, wet=0.25, ship_m=60.0,
            cranes=((-30.0, False), (100.0, False), (180.0, True))),
    Variant("port_blue_hour", ("dusk", "night", "port", "waterside"), 8, (-20, 16, 7.0),
            (-6.0, 60), Clouds(0.25, 3.0, 0.3, 5.0, 9.0, 15), sky_level=0.045, haze_km=10.0,
            lamps=0.7, cranes=((40.0, False), (-80.0, False)), ship_m=90.0),
    Variant("port_afternoon", ("day", "port", "waterside"), 10, (4, 30, 6.5), (38, -75),
            Clouds(0.46, 1.2, 1.1, 9.0, 5.0, 21), haze_km=11.0, ship_m=175.0,
            cranes=((-46.0, False), (56.0, True), (120.0, False))),
)  # fmt: skip


def read_exr(path: Path) -> dict[str, Image]:
    """Return the channels by name, without the prefix of Blender's render layer."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    layer = "ViewLayer."
    return {name.removeprefix(layer): c.pixels.astype(np.float32) for name, c in channels.items()}


def render(
    size: tuple[int, int], samples: int, mist: bool, rows: tuple[float, float] = (0.0, 1.0)
) -> dict[str, Image]:
    """Trace the view of the current camera.

    size is (width, height). Only `rows` are rendered, as shares of the height from the bottom.
    `mist` adds the mist pass, a transparent background and denoising.
    """
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 1.0
    scene.render.border_min_y, scene.render.border_max_y = rows
    scene.render.film_transparent = mist
    scene.view_layers[0].use_pass_mist = mist
    c = scene.cycles
    c.device, c.samples = "CPU", samples
    c.use_adaptive_sampling, c.adaptive_threshold, c.adaptive_min_samples = mist, 0.04, 6
    c.use_denoising, c.denoiser = mist, "OPENIMAGEDENOISE"
    c.denoising_input_passes, c.denoising_prefilter = "RGB_ALBEDO_NORMAL", "FAST"
    c.use_auto_tile = False
    c.max_bounces, c.diffuse_bounces, c.glossy_bounces = 2, 1, 2
    c.caustics_reflective = c.caustics_refractive = False
    c.blur_glossy, c.sample_clamp_indirect = 1.0, 4.0
    c.denoising_quality = "BALANCED"
    c.use_light_tree = True
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/view.exr"
        bpy.ops.render.render(write_still=True)
        return read_exr(Path(folder) / "view.exr")


def trace(width: int, samples: int, eye: tuple[float, float, float]) -> dict[str, Image]:
    """Trace the whole panorama from the current camera.

    The part more than 45 degrees below the horizon comes from a view straight down, because
    denoising the rows around a pole leaves spokes.
    """
    above = render((width, width // 2), samples, True, (0.25, 1.0))
    add_camera(eye, down=True)
    below = render((width // 4, width // 4), samples, True)
    joined, lap = {}, width // 32
    blend = np.linspace(1, 0, lap, dtype=np.float32)[:, None]
    around = sky.directions(width // 2)[-(width // 8 + lap) :]
    for name, high in above.items():
        low = seen_below(below[name], around)
        high[-lap:] = blend * high[-lap:] + (1 - blend) * low[:lap]
        joined[name] = np.concatenate([high, low[lap:]])
    return joined


def seen_below(view: Image, toward: NDArray[np.float64]) -> Image:
    """Sample a view straight down [N, N] with the tangent _DOWN_REACH in directions [..., 3]."""
    side = view.shape[0]
    x, y = (toward[..., :2] / (_DOWN_REACH * -toward[..., 2:])).transpose(2, 0, 1)
    column, row = (x + 1) * side / 2 - 0.5, (1 - y) * side / 2 - 0.5
    left, top = (np.clip(np.floor(at), 0, side - 2).astype(int) for at in (column, row))
    right, low = (column - left).astype(np.float32), (row - top).astype(np.float32)
    upper = view[top, left] * (1 - right) + view[top, left + 1] * right
    lower = view[top + 1, left] * (1 - right) + view[top + 1, left + 1] * right
    return upper * (1 - low) + lower * low


def add_camera(eye: tuple[float, float, float], down: bool = False) -> None:
    """Add a panoramic camera with its middle column along +x.

    With `down`, it looks straight down instead, +x to the right and +y up.
    """
    camera = bpy.data.cameras.new("eye")
    camera.clip_start, camera.clip_end = 0.05, 1e5
    thing = bpy.data.objects.new("eye", camera)
    thing.location = eye
    if down:
        camera.angle = 2 * np.arctan(_DOWN_REACH)
    else:
        camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
        thing.rotation_euler = (np.pi / 2, 0.0, -np.pi / 2)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.camera = thing


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
    if sun.max() > _FAINT:
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


def bake(v: Variant, width: int, samples: int) -> Image:
    """Return the finished panorama of a variant as linear radiance [width / 2, width, 3]."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.world = world = bpy.data.worlds.new("world")
    world.use_nodes = True
    add_camera(v.eye)
    around, sun = compose_sky(v, *bake_sky(v), width)
    world.mist_settings.start, world.mist_settings.depth = 0.0, _MIST_M
    world.mist_settings.falloff = "LINEAR"
    build_materials(400.0 * v.lamps, v.wet, v.swell)
    Builder(v).build()
    light_scene(v, around, sun)
    if sun.max() > _FAINT:
        check_sun(v)
    planes = trace(width, samples, v.eye)
    seen = np.stack([planes[f"Combined.{c}"] for c in "RGB"], -1)
    alpha = np.clip(planes["Combined.A"], 0, 1)[..., None]
    depth = (planes.get("Mist.Z", planes.get("Mist.X")) - (1 - alpha[..., 0])) * _MIST_M
    depth = np.clip(depth / np.maximum(alpha[..., 0], 1e-3), 0, _MIST_M)[..., None]
    clear = np.exp(-depth / (1000 * v.haze_km))
    degree = width / 360
    air = around[int(width / 4 - 7 * degree) : int(width / 4 - degree)].mean(0)[None]
    seen = seen * clear + air * alpha * (1 - clear)
    sky_part = around + (sun_disc(width, sun, toward(*v.sun_deg)) if sun.max() > _FAINT else 0)
    # the denoised image has smooth edges, but the coverage is noisy
    bare = 1 - sky.smooth(alpha[..., 0])[..., None]
    radiance = np.maximum(seen + bare * sky_part, 0.0)
    solid = np.sin(np.pi * (np.arange(width // 2) + 0.5) / (width // 2))[:, None]
    mean = float((radiance @ REC_709 * solid).sum() / solid.sum() / width)
    wanted = MEAN if not v.lamps else MEAN * min(1.0, 2 * v.sky_level + 0.12)
    scale = min(wanted / mean, PEAK / float(radiance.max()))
    print(f"{v.name}: sun through cloud {sun}, mean {mean:.3f}, scaled by {scale:.3f}", flush=True)
    return (scale * radiance).astype(np.float32)


def write(radiance: Image, path: Path) -> None:
    """Write an EXR of half floats with the weakest compression that fits its size limit.

    Exits if compression noticeably changes the light of the whole map, or of the sun and lamps.
    """
    height, width = radiance.shape[:2]
    solid = np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None]
    luminance = radiance @ REC_709 * solid
    bright = luminance > 200 * luminance.mean()
    whole = path.with_suffix(".part")
    for level in _DWA_LEVELS:
        header = {
            "compression": OpenEXR.DWAB_COMPRESSION,
            "dwaCompressionLevel": level,
            "type": OpenEXR.scanlineimage,
        }
        channels = {"RGB": np.ascontiguousarray(radiance.astype(np.float16))}
        OpenEXR.File(header, channels).write(str(whole))
        if whole.stat().st_size <= _MAX_BYTES * width / 4096:
            break
    stored = read_exr(whole)
    after = np.stack([stored[c] for c in "RGB"], -1) @ REC_709 * solid
    for part in (np.ones_like(bright), bright):
        change = abs(after[part].sum() / max(luminance[part].sum(), 1e-9) - 1) if part.any() else 0
        if not change < _MAX_CHANGE:
            sys.exit(f"{path}: level {level} changes its light by {change:.2%}; raise _MAX_BYTES")
    print(f"{path.name}: level {level:.0f}, {whole.stat().st_size} bytes", flush=True)
    whole.replace(path)


def write_index(folder: Path) -> None:
    """Add the panoramas in the folder to its index.json and SOURCES.md."""
    listed, sources = folder / "index.json", folder / "SOURCES.md"
    index = json.loads(listed.read_text(encoding="utf-8"))
    text = sources.read_text(encoding="utf-8")
    for v in VARIANTS:
        file = f"{v.name}.exr"
        if not (folder / file).exists():
            continue
        index[v.name] = {
            "file": file,
            "kind": list(v.kind),
            "licence": "Apache-2.0",
            "source": "assets/build_panoramas.py",
        }
        if f"| {file} |" not in text:
            row = ("our own", "build_panoramas.py", "fastgen", "Apache-2.0", ", ".join(v.kind))
            text += f"| {file} | {' | '.join(row)} |\n"
    listed.write_text(json.dumps(index, indent=2) + "\n", encoding="utf-8")
    sources.write_text(text, encoding="utf-8")


def main() -> None:
    """Render the requested or missing panoramas, and update the folder's index."""
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument(
        "names", nargs="*", help="panoramas to render; default: all that are missing in --out"
    )
    options.add_argument("--out", type=Path, default=HDRI)
    options.add_argument("--width", type=int, default=4096)
    options.add_argument("--samples", type=int, default=6)
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    for v in VARIANTS:
        path = chosen.out / f"{v.name}.exr"
        if v.name in chosen.names or (not chosen.names and not path.exists()):
            write(bake(v, chosen.width, chosen.samples), path)
    if (chosen.out / "index.json").exists():
        write_index(chosen.out)


if __name__ == "__main__":
    main()

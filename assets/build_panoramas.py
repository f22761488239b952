"""Render the port panoramas hdri/port_*.exr from our own Blender model of a port.

    python assets/build_panoramas.py                  # all that are missing, in hdri/
    python assets/build_panoramas.py --width 512 --out /tmp/look port_noon
    python assets/build_panoramas.py --maps-only      # the container maps of those that exist

Run by hand. Needs Python 3.11, `bpy` 4.5, `OpenEXR` and OpenCV. The package panoramas/ contains the
port: shapes, materials, models, layout and sky. Cycles traces the objects on the ground. Haze, sky
and the sun's disc are added from exact maps afterwards, so that the disc keeps its energy and the
sky has no noise. Beside each panorama, NAME.containers.png numbers the containers that it shows,
and marks other obstacles.

The night of the aisle and the dusk at the rails were rendered with --samples 16, the low
sun at the gate with 8.
"""

import argparse
import json
import sys
from pathlib import Path

import bpy
import cv2
import numpy as np
import OpenEXR
from panoramas import sky
from panoramas.daylight import (
    FAINT,
    REC_709,
    bake_sky,
    check_sun,
    compose_sky,
    light_scene,
    sun_disc,
    toward,
)
from panoramas.materials import build_materials
from panoramas.port import Builder, Variant
from panoramas.tracing import OTHER, Image, add_camera, container_map, read_exr, trace
from panoramas.variants import VARIANTS

HDRI = Path(__file__).parent / "hdri"

MEAN, PEAK = 0.7, 40000.0  # mean luminance by day; limit at which compression cannot overflow
_MIST_M = 20000.0
_DWA_LEVELS = (60.0, 100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 800.0)
_MAX_BYTES = 1_100_000
_MAX_CHANGE = 0.005  # relative, for the light of the whole map and of its brightest parts


def start_scene(v: Variant) -> bpy.types.World:
    """Make an empty Blender scene with a camera at the variant's eye, and return its world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.world = world = bpy.data.worlds.new("world")
    world.use_nodes = True
    add_camera(v.eye)
    return world


def build_port(v: Variant) -> None:
    """Add the variant's port to the current scene."""
    build_materials(400.0 * v.lamps, v.wet, v.swell)
    Builder(v).build()


def bake(v: Variant, width: int, samples: int) -> Image:
    """Return the finished panorama of a variant as linear radiance [width / 2, width, 3]."""
    world = start_scene(v)
    around, sun = compose_sky(v, *bake_sky(v), width)
    world.mist_settings.start, world.mist_settings.depth = 0.0, _MIST_M
    world.mist_settings.falloff = "LINEAR"
    build_port(v)
    light_scene(v, around, sun)
    if sun.max() > FAINT:
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
    sky_part = around + (sun_disc(width, sun, toward(*v.sun_deg)) if sun.max() > FAINT else 0)
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


def write_map(v: Variant, width: int, path: Path) -> None:
    """Render the variant's container map and write it as 16-bit PNG."""
    start_scene(v)
    build_port(v)
    numbers = container_map(width)
    done, data = cv2.imencode(".png", numbers, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done
    path.write_bytes(data.tobytes())
    count = numbers.max(where=numbers < OTHER, initial=0)
    print(f"{path.name}: {count} containers, {len(data)} bytes", flush=True)


def write_index(folder: Path) -> None:
    """Add the panoramas in the folder to its index.json and SOURCES.md."""
    listed, sources = folder / "index.json", folder / "SOURCES.md"
    index = json.loads(listed.read_text(encoding="utf-8"))
    text = sources.read_text(encoding="utf-8")
    for v in VARIANTS:
        file = f"{v.name}.exr"
        if not (folder / file).exists():
            continue
        kinds = [*v.kind, v.place] if v.place else list(v.kind)
        lux = {key: value for key, value in index.get(v.name, {}).items() if key == "lux"}
        index[v.name] = {
            "file": file,
            "kind": kinds,
            "licence": "Apache-2.0",
            "source": "assets/build_panoramas.py",
            **lux,
        }
        if f"| {file} |" not in text:
            row = ("our own", "build_panoramas.py", "fastgen", "Apache-2.0", ", ".join(kinds))
            end = text.rindex("|\n") + 2  # of the table
            text = f"{text[:end]}| {file} | {' | '.join(row)} |\n{text[end:]}"
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
    options.add_argument("--map-width", type=int, default=4096, help="width of container maps")
    options.add_argument(
        "--maps-only", action="store_true", help="render container maps and no panoramas"
    )
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    for v in VARIANTS:
        path = chosen.out / f"{v.name}.exr"
        by_default = path.exists() == chosen.maps_only
        if v.name not in chosen.names and (chosen.names or not by_default):
            continue
        if not chosen.maps_only:
            write(bake(v, chosen.width, chosen.samples), path)
        write_map(v, chosen.map_width, path.with_suffix(".containers.png"))
    if (chosen.out / "index.json").exists():
        write_index(chosen.out)


if __name__ == "__main__":
    main()

"""Measure common methods, and fastgen, in two conditions of docs/stability.md.

    python bench/peers.py --install          # once, for pyrender
    python bench/stability.py [--scenes 3] [--only light,motion]

light: Radiance in lobes of roughness 0.4 in each bundled HDRI, relative to sums over every texel.
The common method takes 1,024 samples of a lobe from a map of half floats (Karis 2013, Real Shading
in Unreal Engine 4), without extracting suns. fastgen uses its filtered map and its directional
lights.

motion: Change of the image of a camera that turns by half a pixel, relative to the change of images
of four times the size that are averaged down. Pixels that show the container count.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from numpy.typing import NDArray
from peer_jobs import write_jobs
from peers import ENVIRONMENTS
from reporting import RESULTS, origin, save

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light import prefilter
from fastgen.light.environment import ROUGHNESS_LEVELS, EnvironmentLight, prefilter_environment
from fastgen.light.hdri import bundled_hdris, load_radiance
from fastgen.light.octahedral import sample_octahedral
from fastgen.scene import Spreader
from fastgen.srgb import DECODED, encoded
from tests.panned_camera import panned
from tests.sky_samples import even_directions

Array = NDArray[np.float64]

LEVEL = 4
MAP_WIDTH = 256
DIRECTIONS, SAMPLES = 400, 1024
SIZE = (320, 320)
TIMES = 4
"""Size of the larger images of `motion_with_pyrender.py`, too, relative to SIZE."""
HALF_MAX = 65504.0
PEER = Path(__file__).with_name("peer_renderers") / "motion_with_pyrender.py"


def exact(radiance: Array, normals: Array, masked: bool) -> Array:
    """Return radiance [N] averaged over the GGX lobe around each normal, as a sum over all texels.

    Args:
        radiance: [H, 2H].
        normals: [N, 3].
        masked: Smith's masking of the light, as in fastgen's map, instead of its cosine.
    """
    roughness = ROUGHNESS_LEVELS[LEVEL]
    height = len(radiance)
    grid = prefilter.equirect_directions(height).reshape(-1, 3)
    solid_angle = np.repeat(prefilter.row_solid_angle(height), 2 * height)
    lobe = prefilter.ggx_lobe(roughness)
    means = []
    for normal in normals:
        cosine = grid @ normal
        if masked:
            weight = lobe(cosine) * solid_angle
        else:
            a2 = roughness**4
            spread = (1 + a2) - (1 - a2) * cosine
            weight = np.maximum(cosine, 0) / spread**2 * solid_angle
        means.append((weight @ radiance.ravel()) / weight.sum())
    return np.array(means)


def sampled(radiance: Array, normals: Array) -> Array:
    """Return the common estimate of `exact` [N] from SAMPLES directions in a map of half floats."""
    a2 = ROUGHNESS_LEVELS[LEVEL] ** 4
    k = np.arange(SAMPLES)
    radical = np.array([int(f"{i:010b}"[::-1], 2) for i in k]) / 1024
    u = (k + 0.5) / SAMPLES
    z = np.sqrt((1 - radical) / (1 + (a2 - 1) * radical))
    r, turn = np.sqrt(1 - z**2), 2 * np.pi * u
    half = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)
    light = 2 * half[:, 2:] * half - (0, 0, 1)
    stored = np.minimum(radiance, HALF_MAX).astype(np.float16).astype(np.float64)
    height, width = stored.shape
    means = []
    for normal in normals:
        side = np.cross(normal, (0, 0, 1) if abs(normal[2]) < 0.9 else (1, 0, 0))
        side /= np.linalg.norm(side)
        world = light @ np.stack([side, np.cross(normal, side), normal])
        v = np.arccos(np.clip(world[:, 2], -1, 1)) / np.pi * height - 0.5
        u = (0.5 - np.arctan2(world[:, 1], world[:, 0]) / (2 * np.pi)) % 1 * width - 0.5
        weight = np.maximum(light[:, 2], 0)
        means.append(weight @ bilinear(stored, v, u) / weight.sum())
    return np.array(means)


def bilinear(image: Array, row: Array, column: Array) -> Array:
    """Look up an equirectangular image [H, W] between texel centres."""
    height, width = image.shape
    top, left = np.floor(row).astype(int), np.floor(column).astype(int)
    y, x = row - top, column - left
    rows = np.clip([top, top + 1], 0, height - 1)
    columns = np.array([left, left + 1]) % width
    upper, lower = ((1 - x) * image[r, columns[0]] + x * image[r, columns[1]] for r in rows)
    result: Array = (1 - y) * upper + y * lower
    return result


def filtered(light: EnvironmentLight, normals: Array) -> Array:
    """Return fastgen's value of `exact` [N] for a light without colour."""
    means = sample_octahedral(light.specular[LEVEL], normals)[:, 0].astype(np.float64)
    lobe = prefilter.ggx_lobe(ROUGHNESS_LEVELS[LEVEL])
    steps = (np.arange(200_000) + 0.5) / 100_000 - 1
    whole = 2 * np.pi * lobe(steps).mean() * 2
    for source in light.lights:
        cosine = normals @ np.array(source.direction)
        means += np.pi * source.light[0] * lobe(cosine) / whole
    return means


def light_errors() -> dict[str, dict[str, float]]:
    """Return the RMS errors relative to the mean, and the worst factors, by HDRI."""
    normals = even_directions(DIRECTIONS)
    table = {}
    for name, path in bundled_hdris().items():
        color = prefilter.shrink(load_radiance(path), MAP_WIDTH)
        gray = np.repeat(color.mean(axis=2, keepdims=True), 3, axis=2)
        plain = gray[..., 0].astype(np.float64)
        row = {}
        for method, found, true in (
            ("common", sampled(plain, normals), exact(plain, normals, masked=False)),
            (
                "fastgen",
                filtered(prefilter_environment(name, gray), normals),
                exact(plain, normals, masked=True),
            ),
        ):
            row[f"{method}_rms"] = float(np.sqrt(np.mean((found - true) ** 2)) / true.mean())
            row[f"{method}_worst"] = float(np.abs(np.log2(found / true)).max())
        row["brightest"] = float(plain.max())
        table[name] = row
        print(f"{name:16}" + "".join(f"{key:>16} {value:9.3f}" for key, value in row.items()))
    return table


def ratio(pairs: Iterator[tuple[Array, Array, NDArray[np.bool_]]]) -> float:
    """Return the change of small images relative to that of large ones.

    Args:
        pairs: Linear images [2, H, W, 3], larger ones [2, T H, T W, 3], and pixels [H, W] to count.
    """
    found = expected = 0.0
    for small, large, counted in pairs:
        height, width = small.shape[1:3]
        means = large.reshape(2, height, TIMES, width, TIMES, 3).mean(axis=(2, 4))
        changes = [np.abs(np.diff(encoded(each), axis=0)[0])[counted] for each in (small, means)]
        found, expected = found + changes[0].sum(), expected + changes[1].sum()
    return float(found / expected)


def motion_ratios(scenes: int) -> dict[str, float]:
    """Return the ratio of each renderer."""
    ratios = {}
    cameras = ["A", "B", "Cl", "Cr"]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        with Generator(Config.preset(), seed=5, size=SIZE) as generator:
            truths = write_jobs(generator, list(range(scenes)), cameras, 1, folder)
        python = ENVIRONMENTS / "pyrender" / "bin" / "python"
        subprocess.run([str(python), str(PEER), str(folder), str(folder / "out")], check=True)

        def of_peer() -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
            for index, camera, ids in truths:
                stem = folder / "out" / f"{index:06d}_{camera}"
                small, large = (DECODED[np.load(f"{stem}_{n}.npy")] for n in (1, TIMES))
                yield small, large, ids > 0

        ratios["pyrender"] = ratio(of_peer())
    for quality in ("draft", "balanced"):
        with Generator(Config.preset(), seed=5, size=SIZE, quality=quality) as generator:
            ratios[quality] = ratio(of_fastgen(generator, scenes, cameras))
    for name, value in ratios.items():
        print(f"{name:12}{value:6.2f}")
    return ratios


def of_fastgen(
    generator: Generator, scenes: int, cameras: list[str]
) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
    """Yield fastgen's images for `ratio`."""
    large = (TIMES * SIZE[0], TIMES * SIZE[1])
    for index in range(scenes):
        scene = replace(generator.scene(index), damages=(), spreader=Spreader())
        for name in cameras:
            camera = scene.camera(name)
            ids = generator.render(scene=scene, camera=name).ids
            images = []
            for size in (SIZE, large):
                frames = []
                for view in (camera, panned(camera, SIZE[0])):
                    frame = generator.gpu.renderer().render(
                        PreparedScene(scene), view, size, radiance=True
                    )
                    assert frame.radiance is not None
                    frames.append(np.clip(frame.radiance, 0, 1))
                images.append(np.stack(frames).astype(np.float64))
            yield images[0], images[1], ids > 0


def main() -> None:
    """Print and save the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", type=int, default=3)
    parser.add_argument("--only", default="light,motion")
    options = parser.parse_args()
    parts = options.only.split(",")
    path = RESULTS / "stability.json"
    figures: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if "light" in parts:
        figures["light"] = {**origin(), "hdris": light_errors()}
    if "motion" in parts:
        figures["motion"] = {**origin(), "scenes": options.scenes, **motion_ratios(options.scenes)}
    save("stability", figures)


if __name__ == "__main__":
    main()

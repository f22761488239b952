"""How far are the images from a path tracer's?

    python bench/accuracy.py --blender-python PYTHON [--scenes 8] [--size 320x320] [--samples 256]

Exports each scene (`fastgen export`), renders the file with Cycles (bench/path_traced.py; PYTHON is
a Python 3.11 with bpy==4.5.15), applies the same exposure and tone curve to its linear radiance and
compares with the rasterizer's image: FLIP, SSIM and PSNR over the whole image and over the pixels
of the container and its spreader. Cycles' own noise is the same measure between two of its renders
of different seeds. Before that, silhouettes and depths through the pixel centres must coincide.
References are kept in bench/references and made again only where scene, size, samples or seed
differ.

Also needs what `pip install '.[accuracy]'` brings.
"""

import argparse
import hashlib
import os
import subprocess
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")

import cv2
import flip_evaluator
import numpy as np
import OpenEXR
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from fastgen import Config, Generator
from fastgen.environment import bundled_hdris, find_hdris
from fastgen.export import export_glb
from fastgen.programs import SPREADER_ID
from fastgen.sample import Sample

CAMERAS = ("A", "B", "Cl", "Cr")
MIN_COINCIDENCE = 0.999
STEP_M = 0.15
OCCLUDED = 0.8  # ambient occlusion below this is a corner or the valley of a wave

Array = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Reference:
    """A Cycles render, [H, W, ...]. radiance: linear, no exposure. openness: ambient occlusion,
    1 in the open. inside: what the rays through pixel centres hit; depth_m: how far along the
    axis."""

    radiance: Array
    openness: Array
    inside: NDArray[np.bool_]
    depth_m: Array


def neutral_tone(color: Array) -> Array:
    """Khronos PBR Neutral tone curve, twin of shaders/tone.glsl; linear [..., 3] in and out."""
    start, desaturation = 0.8 - 0.04, 0.15
    low = color.min(axis=-1, keepdims=True)
    color = color - np.where(low < 0.08, low - 6.25 * low * low, 0.04)
    peak = color.max(axis=-1, keepdims=True)
    d = 1.0 - start
    new_peak = 1.0 - d * d / (np.maximum(peak, start) + d - start)
    bright = color * new_peak / np.maximum(peak, start)
    share = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    return np.where(peak < start, color, bright + share * (new_peak - bright))


def srgb_encode(color: Array) -> Array:
    """Linear [..., 3] in 0..1 to sRGB in 0..1 (IEC 61966-2-1)."""
    color = np.clip(color, 0.0, 1.0)
    curve = 1.055 * np.maximum(color, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(color <= 0.0031308, 12.92 * color, curve)


def srgb_decode(color: Array) -> Array:
    """sRGB [..., 3] in 0..1 to linear in 0..1."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


class References:
    """Cycles renders of exported scenes, kept in a folder."""

    def __init__(self, folder: Path, python: Path | None, samples: int) -> None:
        self._folder = folder
        self._python = python
        self._samples = samples
        folder.mkdir(parents=True, exist_ok=True)

    def get(self, glb: Path, camera: str, hdri: Path, seed: int) -> Reference:
        """The reference of an exported file, rendered if it is not there yet."""
        digest = hashlib.sha256(glb.read_bytes() + hdri.read_bytes())
        tracer = Path(__file__).with_name("path_traced.py")
        digest.update(tracer.read_bytes())
        digest.update(f"{camera} {self._samples} {seed}".encode())
        kept = self._folder / f"{digest.hexdigest()[:24]}.npz"
        if not kept.exists():
            image = self._run(glb, camera, hdri, seed, [])
            center = self._run(glb, camera, hdri, seed, ["--centers"])
            radiance = np.stack([image[f"Combined.{c}"] for c in "RGB"], axis=-1)
            aside = kept.with_suffix(".part.npz")
            np.savez_compressed(
                aside,
                radiance=radiance,
                openness=image["AO.R"],
                inside=center["IndexOB.X"] > 0.5,
                depth_m=center["Depth.Z"],
            )
            aside.replace(kept)
        with np.load(kept) as stored:
            return Reference(**stored)

    def _run(
        self, glb: Path, camera: str, hdri: Path, seed: int, more: list[str]
    ) -> dict[str, Array]:
        if self._python is None:
            raise SystemExit("a reference is missing: give --blender-python, see --help")
        out = self._folder / "new.exr"
        tracer = Path(__file__).with_name("path_traced.py")
        command = [self._python, tracer, glb, "--camera", camera, "--hdri", hdri, "-o", out, *more]
        command += ["--samples", str(self._samples), "--seed", str(seed)]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
        channels = OpenEXR.File(str(out), separate_channels=True).channels()
        out.unlink()
        return {name.removeprefix("ViewLayer."): c.pixels for name, c in channels.items()}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two sRGB images in 0..1, [H, W, 3], and their difference by pixel."""

    flip_map: Array
    similarity_map: Array
    squared: Array

    @staticmethod
    def of(reference: Array, test: Array) -> "Comparison":
        """Compare `test` with `reference`. Andersson et al. 2020, FLIP; at its default viewing
        distance, 67 pixels a degree."""
        a, b = reference.astype(np.float32), test.astype(np.float32)
        flip_map, _, _ = flip_evaluator.evaluate(a, b, "LDR", applyMagma=False)
        _, similarity = structural_similarity(a, b, channel_axis=2, data_range=1.0, full=True)
        return Comparison(flip_map[..., 0], similarity.mean(axis=2), ((a - b) ** 2).mean(axis=2))

    def measures(self, where: NDArray[np.bool_]) -> tuple[float, float, float]:
        """Mean FLIP, SSIM, and PSNR in dB over a mask [H, W]."""
        psnr = -10 * np.log10(max(float(self.squared[where].mean()), 1e-12))
        return float(self.flip_map[where].mean()), float(self.similarity_map[where].mean()), psnr


def borders(ids: NDArray[np.integer], depth_m: Array) -> NDArray[np.bool_]:
    """Pixels beside a change of object, or a step in depth larger than a wall's waves."""
    near = np.where(np.isfinite(depth_m), depth_m, 1e3)
    found = np.zeros(ids.shape, bool)
    for axis in (0, 1):
        step = (np.abs(np.diff(near, axis=axis)) > STEP_M) | (
            np.diff(ids.astype(int), axis=axis) != 0
        )
        for side in ((1, 0), (0, 1)):
            pad = [(0, 0), (0, 0)]
            pad[axis] = side
            found |= np.pad(step, pad)
    return found


def stops_over(test: Array, reference: Array) -> float:
    """Median stops by which displayed linear light of pixels [N, 3] exceeds the reference's."""
    if not len(test):
        return float("nan")
    light, expected = (srgb_decode(image).mean(axis=-1) + 1e-4 for image in (test, reference))
    return float(np.median(np.log2(light / expected)))


def picture(test: Array, reference: Array, error: Array) -> NDArray[np.uint8]:
    """Ours, Cycles', FLIP from black to white at 0.5, and who is brighter (red: we are)."""
    signed = (test - reference).mean(axis=2)
    lean = np.stack([np.maximum(signed, 0), np.zeros_like(signed), np.maximum(-signed, 0)], axis=2)
    flat = np.repeat(np.clip(error * 2, 0, 1)[..., None], 3, axis=2)
    row = np.hstack([test, reference, flat, np.clip(lean * 4, 0, 1)])
    return np.asarray(row * 255 + 0.5, np.uint8)[..., ::-1]


def divided(sample: Sample, openness: Array) -> dict[str, NDArray[np.bool_]]:
    """Masks [H, W] of the parts of an image in which errors have causes of their own."""
    inside = sample.ids > 0
    edges = borders(sample.ids, sample.depth)
    plain = inside & ~edges & (sample.ids == 1)
    return {
        "sky": ~inside & ~edges,
        "edges": edges,
        "markers and text": ~edges & (sample.ids > 1) & (sample.ids < SPREADER_ID),
        "spreader": ~edges & (sample.ids == SPREADER_ID),
        "open sheet": plain & (openness >= OCCLUDED),
        "occluded sheet": plain & (openness < OCCLUDED),
    }


def table(title: str, rows: list[tuple[float, ...]]) -> None:
    """Print the mean and the worst of (FLIP, SSIM, PSNR) whole and object, a row a scene."""
    values = np.array(rows)
    worst = [values[:, i].max() if i % 3 == 0 else values[:, i].min() for i in range(6)]
    lines = (
        [("mean", values.mean(axis=0)), ("worst", worst)] if len(rows) > 1 else [("", values[0])]
    )
    for name, six in lines:
        words = [f"{v:7.2f}" if i % 3 == 2 else f"{v:7.4f}" for i, v in enumerate(six)]
        print(f"{title:8s} {name:5s}  whole {' '.join(words[:3])}   object {' '.join(words[3:])}")


def main() -> None:
    """Print the measures of each scene and over all, and write a picture a scene."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--size", default="320x320")
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--noise-scenes", type=int, default=2, help="how many to render twice")
    parser.add_argument("--quality", default="balanced")
    parser.add_argument("--blender-python", type=Path)
    parser.add_argument("--hdri", help="folder of .hdr and .exr files to light with")
    parser.add_argument("--references", type=Path, default=Path(__file__).parent / "references")
    parser.add_argument("--out", type=Path, default=Path("accuracy"), help="folder of pictures")
    options = parser.parse_args()
    width, height = (int(side) for side in options.size.split("x"))
    references = References(options.references, options.blender_python, options.samples)
    options.out.mkdir(parents=True, exist_ok=True)
    hdris = bundled_hdris()
    if options.hdri:
        hdris = {path.stem: path for path in find_hdris(options.hdri)}
    glb = options.references / "scene.glb"
    rows, floors = [], []
    shares: dict[str, list[tuple[float, ...]]] = defaultdict(list)
    with Generator(
        Config.preset(),
        options.seed,
        (width, height),
        hdri_dir=options.hdri,
        quality=options.quality,
    ) as generator:
        for index in range(options.scenes):
            scene = generator.scene(index)
            name = CAMERAS[index % len(CAMERAS)]
            camera = scene.camera(name)
            sample = generator.render(scene=scene, camera=name)
            export_glb(generator, scene, glb, [camera])
            hdri = hdris[scene.environment.name]
            reference = references.get(glb, name, hdri, 1)
            exposure = generator.exposure(scene, camera)
            expected = srgb_encode(neutral_tone(exposure * reference.radiance))
            ours = sample.image / 255.0

            inside = sample.ids > 0
            same = float((inside == reference.inside).mean())
            both = inside & reference.inside
            apart_m = np.abs(sample.depth - reference.depth_m)[both]
            print(
                f"{index} {name:2s} {scene.environment.name:11s} silhouettes coincide in "
                f"{same:.3%}, 99 % of depths to {np.quantile(apart_m, 0.99) * 1e3:.3f} mm"
            )
            if same < MIN_COINCIDENCE:
                raise SystemExit("the two do not see the same geometry: not comparable")

            compared = Comparison.of(expected, ours)
            rows.append((*compared.measures(inside | True), *compared.measures(inside)))
            table("", rows[-1:])
            total = float(compared.flip_map.sum())
            for part, mask in divided(sample, reference.openness).items():
                error = float(compared.flip_map[mask].sum())
                stops = stops_over(ours[mask], expected[mask])
                shares[part].append((float(mask.sum()), error, error / total, stops))
            cv2.imwrite(
                str(options.out / f"{index}_{name}.png"),
                picture(ours, expected, compared.flip_map),
            )
            if index < options.noise_scenes:
                second = references.get(glb, name, hdri, 2)
                again = srgb_encode(neutral_tone(exposure * second.radiance))
                floor = Comparison.of(expected, again)
                floors.append((*floor.measures(inside | True), *floor.measures(inside)))
    glb.unlink()
    print(f"\n{len(rows)} scenes, {width}x{height}, {options.samples} samples: FLIP, SSIM, PSNR dB")
    table("ours", rows)
    if floors:
        table("noise", floors)
    for part, listed in shares.items():
        pixels, error, share, stops = np.array(listed).T
        mean = error.sum() / max(pixels.sum(), 1)
        print(
            f"{part:17s} {pixels.sum() / (len(rows) * width * height):5.1%} of pixels, "
            f"{np.mean(share):5.1%} of error, FLIP {mean:.4f}, brighter than Cycles by "
            f"{np.nanmean(stops):+.2f} stops ({np.nanmin(stops):+.2f} to {np.nanmax(stops):+.2f})"
        )


if __name__ == "__main__":
    main()

"""Measure what accuracy costs: images per second against the error to the path tracer.

    python bench/pareto.py [--cases 8] [--repeats 3]
    python bench/pareto.py --redraw     # docs/pareto.png from the stored results

Renders the same cases of bench/references at 320x320 with several variants of fastgen, each with
one feature removed, simplified or refined. The error is FLIP over the pixels of objects against
Cycles at 1,024 samples. The rate is labelled images per second of one core, from CPU time.

The chart also shows Cycles at 1 to 256 samples with and without denoising, from
bench/references/cycles.json (colour only, without the time to open the scene). It includes pyrender
if `python bench/peers.py --install --only pyrender` was run. pyrender has no image-based light, so
its image is scaled to the mean light of the reference's object pixels.

The speed of a machine changes during a run. Each variant therefore alternates with `balanced`. Its
rate is that of `balanced` over the whole run times the ratio of the two.

Writes the table in docs/accuracy.md, bench/results/pareto.json and docs/pareto.png.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import charts
import numpy as np
import peers
import trimesh
from ablation_elements import ELEMENTS, Element, gpu_session
from cycles_figures import Figures
from image_error import displayed, flip, srgb_decode, srgb_encode
from pareto_chart import Point, draw, front
from peer_jobs import shot
from reference_set import FILTERS, SEED, SIZE, Case, Reference, load, traced
from reporting import heading, origin, save, write_section

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.export import export_glb
from fastgen.geometry.shape_library import ShapeLibrary
from fastgen.light import environment
from fastgen.light.hdri import load_radiance
from fastgen.scene import Camera, Scene

PYRENDER_TEXEL_MM = 6.0

Patches = list[tuple[Any, str, Any]]


@dataclass(frozen=True)
class Variant:
    """One way to render.

    Attributes:
        name: Name in the table and the chart.
        quality: Quality preset.
        absent: Names in ablation_elements.ELEMENTS to render without.
        patches: Function that returns further attributes to replace. It runs only when the variant
            is used, because building replacements can be slow.
    """

    name: str
    quality: str = "balanced"
    absent: tuple[str, ...] = ()
    patches: Callable[[], Patches] = list

    @property
    def elements(self) -> list[Element]:
        """The elements to render without."""
        return [element for element in ELEMENTS if element.name in self.absent]

    def generator(self) -> Generator:
        """Return a generator of the benchmark's scenes that renders this way inside `entered`."""
        made = Generator(Config.preset(), SEED, SIZE, quality=self.quality)
        if self.absent:
            made.gpu = gpu_session(self.elements, self.quality)
        return made

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Make the generator render this way in this context."""
        with ExitStack() as stack:
            for element in self.elements:
                stack.enter_context(element.light_removed())
            for owner, attribute, value in self.patches():
                stack.enter_context(mock.patch.object(owner, attribute, value))
            yield


def _coarse_mesh() -> Patches:
    return [(ShapeLibrary, "container", ShapeLibrary.container_outline)]


def _light_maps(scale: float) -> Callable[[], Patches]:
    """Scale the side of the prefiltered maps, and rebuild them instead of reading the cache."""

    def load_anew(path: Path) -> environment.EnvironmentLight:
        return environment.prefilter_environment(path.stem, load_radiance(path))

    def patches() -> Patches:
        sizes = [
            (environment, name, 2 * int(getattr(environment, name) * scale / 2))  # even
            for name in ("SPECULAR_SIZE", "IRRADIANCE_SIZE")
        ]
        return [*sizes, (sys.modules["fastgen.generator"], "load_environment", load_anew)]

    return patches


LAYERS = tuple(e.name for e in ELEMENTS if e.group == "surface")
OCCLUSION = "occlusion of the sky"

VARIANTS = (
    Variant("draft", "draft"),
    Variant("balanced"),
    Variant("fine", "fine"),
    Variant("high", "high"),
    Variant("draft, no occlusion", "draft", (OCCLUSION,)),
    Variant("balanced, no occlusion", absent=(OCCLUSION,)),
    Variant("balanced, no shadow of the sun", absent=("shadow of the sun",)),
    Variant("balanced, no noise layers", absent=LAYERS),
    Variant("balanced, no reflections", absent=("reflections altogether",)),
    Variant("balanced, coarse mesh", patches=_coarse_mesh),
    Variant("balanced, half light maps", patches=_light_maps(0.5)),
    Variant("balanced, double light maps", patches=_light_maps(2.0)),
)


@dataclass(frozen=True)
class Measured:
    """Results of a variant.

    Attributes:
        name: Name of the variant.
        error: Mean FLIP over the objects.
        seconds: Mean CPU seconds per image.
        balanced: Mean CPU seconds per image of `balanced`, measured in alternation.
    """

    name: str
    error: float
    seconds: float
    balanced: float


def spent(generator: Generator, scene: Scene, camera: Camera) -> float:
    """Return the CPU seconds of a labelled image."""
    began = time.process_time()
    generator.render(scene=scene, camera=camera)
    return time.process_time() - began


def measured(variant: Variant, balanced: Generator, chosen: list[Case], repeats: int) -> Measured:
    """Measure a variant over all cases, alternating with a generator of the default settings."""
    errors, seconds = [], []
    with variant.generator() as generator:
        for case in chosen:
            reference = load(case.number)
            scene, camera = reference.scene, reference.scene.camera(case.camera)
            with variant.entered():
                image = generator.render(scene=scene, camera=camera).image / 255.0
                exposure = generator.exposure(scene, camera)
            expected = displayed(reference.radiance[FILTERS[variant.quality]], exposure)
            errors.append(float(flip(expected, image)[reference.inside].mean()))
            spent(balanced, scene, camera)  # not counted: fills the caches
            turns = []
            for _ in range(repeats):
                beside = spent(balanced, scene, camera)
                with variant.entered():
                    turns.append((spent(generator, scene, camera), beside))
            seconds.append([statistics.median(each) for each in zip(*turns, strict=True)])
    means = [statistics.fmean(each) for each in zip(*seconds, strict=True)]
    return Measured(variant.name, statistics.fmean(errors), *means)


def ours(variants: list[Variant], chosen: list[Case], repeats: int) -> list[Point]:
    """Return a point for each variant."""
    with Generator(Config.preset(), SEED, SIZE) as balanced:
        found = [measured(variant, balanced, chosen, repeats) for variant in variants]
    pace = statistics.fmean(each.balanced for each in found)
    return [
        Point("fastgen", each.name, each.balanced / each.seconds / pace, each.error)
        for each in found
    ]


def cycles(chosen: list[Case], figures: Figures) -> list[Point]:
    """Return Cycles' points, over the chosen cases that have a series."""
    numbers = [case.number for case in chosen if case.number in figures.series]
    names = {"spp": "Cycles", "denoised": "Cycles, denoised"}
    return [
        Point(names[way], str(samples), 1 / seconds, error)
        for way in names
        for samples, error, seconds in figures.curve(numbers, way, 3)
    ]


def write_pyrender_job(chosen: list[Case], repeats: int, folder: Path) -> None:
    """Write the cases as a job for peer_renderers/measure.py.

    The spreader counts as a marker, everything else as the container.
    """
    folder.mkdir()
    scenes = []
    with Generator(Config.preset(), SEED, SIZE) as generator:
        for case in chosen:
            scene = load(case.number).scene
            camera = scene.camera(case.camera)
            file = folder / f"{case.number}.glb"
            export_glb(generator, scene, file, [camera], PYRENDER_TEXEL_MM)
            whole = trimesh.Scene()
            for name, part in trimesh.load_scene(file, process=False).geometry.items():
                node = "marker_2" if name.startswith("spreader") else f"container {name}"
                whole.add_geometry(part, node_name=node, geom_name=node)
            file.write_bytes(whole.export(file_type="glb"))
            exposure = generator.exposure(scene, camera)
            shots = [shot(case.camera, view_of(camera, SIZE), exposure, [])]
            scenes.append(
                {"index": case.number, "glb": file.name, "hdri": "", "yaw_deg": 0.0, "shots": shots}
            )
    job = {"seed": SEED, "size": SIZE, "repeats": repeats, "samples": 0, "scenes": scenes}
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")


def as_bright(image: np.ndarray, reference: Reference, expected: np.ndarray) -> np.ndarray:
    """Scale the sRGB `image` to the mean linear light of `expected` over the object pixels."""
    inside = reference.inside
    light = srgb_decode(image)
    gain = srgb_decode(expected)[inside].mean() / max(float(light[inside].mean()), 1e-6)
    return np.asarray(srgb_encode(gain * light))


def pyrender(chosen: list[Case], repeats: int) -> list[Point]:
    """Return pyrender's point, or nothing if it is not installed."""
    (peer,) = (p for p in peers.PEERS if p.script == "with_pyrender.py")
    if not peer.interpreter.exists():
        print("pyrender: not installed: python bench/peers.py --install --only pyrender")
        return []
    with tempfile.TemporaryDirectory() as place:
        job, out = Path(place) / "job", Path(place) / "out"
        write_pyrender_job(chosen, repeats, job)
        result = peers.run(peer, job, out)
        if "failed" in result:
            print(f"pyrender: {result['failed']}")
            return []
        errors = []
        with Generator(Config.preset(), SEED, SIZE) as generator:
            for case in chosen:
                reference = load(case.number)
                exposure = generator.exposure(reference.scene, reference.scene.camera(case.camera))
                expected = displayed(reference.radiance["box"], exposure)
                with np.load(out / f"{case.number:06d}_{case.camera}.npz") as stored:
                    image = as_bright(stored["image"] / 255.0, reference, expected)
                errors.append(float(flip(expected, image)[reference.inside].mean()))
    stages = ("colour", "labels")
    cores = sum(statistics.median(lap[1] for lap in result["laps"][s]) for s in stages) / 1e3
    return [Point("pyrender", "colour and ids", 1 / cores, statistics.fmean(errors))]


def main() -> None:
    """Print the points and draw the chart."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="measure only variants whose name contains this")
    charts.add_options(parser, "pareto")
    options = parser.parse_args()
    if charts.redrawn(options, "pareto", draw):
        return
    chosen = traced(options.cases)
    variants = [variant for variant in VARIANTS if options.only in variant.name]
    points = ours(variants, chosen, options.repeats)
    points += cycles(chosen, Figures.load()) + pyrender(chosen, options.repeats)
    best = front(points)
    figures = {**origin(), "cases": len(chosen), "size": f"{SIZE[0]}x{SIZE[1]}"}
    lines = [
        f"{figures['cases']} cases, {figures['size']}, {heading()}.",
        "",
        "| renderer | setting | images/s per core | FLIP of objects | on the Pareto front |",
        "| --- | --- | --- | --- | --- |",
    ]
    for point in points:
        cells = f"{point.rate:.3g} | {point.error:.3f} | {'yes' if point in best else ''}"
        lines.append(f"| {point.renderer} | {point.setting} | {cells} |")
    write_section("pareto", lines)
    figures["points"] = [vars(point) for point in points]
    save("pareto", figures)
    charts.write(draw(figures), options.chart)


if __name__ == "__main__":
    main()

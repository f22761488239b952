"""Compare the images with those of a path tracer.

    python bench/accuracy.py [--cases 8] [--only 32,33] [--qualities draft,balanced,fine,high]

Renders the cases of bench/references at every quality. The references are Cycles renders of the
same exported scenes at 1,024 samples, with the same light, exposure, tone curve and pixel filter.
Reports FLIP, SSIM and PSNR over the whole image and over the pixels of the containers and the
spreader. First checks that silhouettes and depths through the pixel centres agree.

The first 32 cases, 8 of which are stored, show one container without surroundings. The cases of
surrounded_cases.py have a ground and neighbours; they get a table of their own, also with FLIP over
the pixels of the ground and the props on it.

Two figures put the errors in perspective. Cycles' own noise is the same measure between two of its
renders with different seeds. For each quality, the table also shows at how many samples Cycles has
the same error. pareto.py measures times.

Works without Blender; `--blender-python PYTHON` traces missing references (see
trace_references.py). Writes tables to docs/accuracy.md, bench/results/accuracy.json,
docs/accuracy.jpg, and a picture per case into --out. Needs the packages of `pip install
'.[accuracy]'`.
"""

import argparse
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from cycles_figures import Figures, equal_samples
from error_pictures import contact_picture, picture, write_picture
from image_error import Comparison, displayed, divided, stops_over
from numpy.typing import NDArray
from reference_set import DEPTH_STEP, FILTERS, FOLDER, SEED, SIZE, Case, Reference, cases, load
from reporting import ROOT, heading, origin, save, write_section
from surrounded_cases import SurroundedCase, every_case, surrounded_cases

from fastgen import Config, Generator
from fastgen.sample import Sample

MIN_COINCIDENCE = 0.999
CONTACT_CASES = 8

Array = NDArray[np.floating]

GROUPS: dict[str, Callable[[Case], str]] = {
    "camera": lambda case: case.camera,
    "light": lambda case: case.light,
    "damage": lambda case: "damaged" if case.damaged else "undamaged",
    "rust": lambda case: "rusty" if case.rusty else "clean",
}


@dataclass(frozen=True, eq=False)
class Result:
    """A case at one quality.

    Attributes:
        measures: Measures from Comparison.both.
        rounding: The same measures of the reference rounded to 8 bits per channel, like our images.
        ground: Mean FLIP over the pixels of ground and props; nan if there are none.
        parts: By part of the image: number of pixels, sum of their FLIP, and median stops by which
            our image is brighter.
        panels: Our image, the reference, and the FLIP map.
    """

    case: Case
    measures: tuple[float, ...]
    rounding: tuple[float, ...]
    ground: float
    parts: dict[str, tuple[int, float, float]]
    panels: tuple[Array, Array, Array]


def check_geometry(case: Case, reference: Reference, sample: Sample) -> tuple[float, float]:
    """Check that an image shows the same geometry as its reference.

    Returns:
        Share of pixels with the same silhouette, and the 99 % quantile of the depth error in mm.

    Raises:
        SystemExit: The silhouettes differ in more than 1 - MIN_COINCIDENCE of the pixels.
    """
    inside = sample.ids > 0
    solid = np.isfinite(sample.depth)
    same = float((inside == reference.inside).mean())
    if same < MIN_COINCIDENCE:
        raise SystemExit(
            f"case {case.number}: the silhouette differs from the reference in {1 - same:.2%} of "
            "pixels, so the geometry has changed; delete the case's files in bench/references "
            "and trace it again with --blender-python"
        )
    step = (slice(None, None, DEPTH_STEP),) * 2
    both = solid[step] & np.isfinite(reference.depth_m)
    apart_m = np.abs(sample.depth[step][both] - reference.depth_m[both])
    return same, float(np.quantile(apart_m, 0.99)) * 1e3


def compared(
    generator: Generator, case: Case, reference: Reference, filter_name: str, sample: Sample
) -> Result:
    """Measure `sample` against the reference."""
    scene, camera = reference.scene, reference.scene.camera(case.camera)
    exposure = generator.exposure(scene, camera)
    expected = displayed(reference.radiance[filter_name], exposure)
    ours = sample.image / 255.0
    error = Comparison.of(expected, ours)
    rounded = Comparison.of(expected, np.rint(np.clip(expected, 0, 1) * 255) / 255)
    parts = {
        part: (
            int(mask.sum()),
            float(error.flip_map[mask].sum()),
            stops_over(ours[mask], expected[mask]),
        )
        for part, mask in divided(sample, reference.openness).items()
    }
    measures, rounding = (c.both(reference.inside) for c in (error, rounded))
    panels = (ours, expected, error.flip_map)
    plane = (sample.ids == 0) & np.isfinite(sample.depth)
    ground = float(error.flip_map[plane].mean()) if plane.any() else float("nan")
    return Result(case, measures, rounding, ground, parts, panels)


def all_results(quality: str, chosen: Iterable[Case]) -> tuple[list[Result], str]:
    """Return the results of all cases at a quality, and a line on how well the geometry agrees."""
    found, same, apart = [], [], []
    with Generator(Config.preset(), SEED, SIZE, quality=quality) as generator:
        for case in chosen:
            reference = load(case.number)
            sample = generator.render(scene=reference.scene, camera=case.camera)
            coincide, apart_mm = check_geometry(case, reference, sample)
            same.append(coincide)
            apart.append(apart_mm)
            found.append(compared(generator, case, reference, FILTERS[quality], sample))
    coincidence = (
        f"{quality}, {len(same)} cases, those with a ground included: silhouettes agree in "
        f"{np.mean(same):.4%} of pixels (worst case "
        f"{min(same):.3%}), 99 % of depths within {np.median(apart):.2f} mm "
        f"(worst case {max(apart):.2f})"
    )
    return found, coincidence


def row(title: str, rows: list[tuple[float, ...]]) -> str:
    """Return a table row of mean (worst) FLIP, SSIM and PSNR, first whole image, then objects."""
    values = np.array(rows)
    worst = [values[:, i].max() if i % 3 == 0 else values[:, i].min() for i in range(6)]
    digits = (3, 3, 1, 3, 3, 1)
    cells = [
        f"{mean:.{n}f} ({bad:.{n}f})"
        for mean, bad, n in zip(values.mean(axis=0), worst, digits, strict=True)
    ]
    return f"| {title} | " + " | ".join(cells) + " |"


def overall(results: dict[str, list[Result]], figures: Figures) -> list[str]:
    """Return a table with a row per quality, then one for 8-bit rounding and one for Cycles'
    noise."""
    columns = [f"{m}, {where}" for where in ("whole", "objects") for m in ("FLIP", "SSIM", "PSNR")]
    lines = ["| mean (worst) | " + " | ".join(columns) + " |", "| --- |" + " --- |" * 6]
    lines += [row(name, [result.measures for result in r]) for name, r in results.items()]
    by_filter = {FILTERS[quality]: r for quality, r in results.items()}
    for name, r in sorted(by_filter.items()):
        lines.append(row(f"8-bit reference, {name}", [result.rounding for result in r]))
    for name in sorted(set(FILTERS.values())):
        rows = figures.floor_rows(name)
        if rows:
            lines.append(row(f"Cycles against itself, {name} ({len(rows)} cases)", rows))
    return lines


def by_group(results: dict[str, list[Result]]) -> list[str]:
    """Return a table of mean (worst) object FLIP by group of cases, with a column per quality."""
    lines = ["| object FLIP, mean (worst) | cases | " + " | ".join(results) + " |"]
    lines.append("| --- |" + " --- |" * (len(results) + 1))
    for group in GROUPS.values():
        first = next(iter(results.values()))
        for name in dict.fromkeys(group(result.case) for result in first):
            cells = []
            for listed in results.values():
                flips = [r.measures[3] for r in listed if group(r.case) == name]
                cells.append(f"{np.mean(flips):.3f} ({max(flips):.3f})")
            lines.append(f"| {name} | {len(flips)} | " + " | ".join(cells) + " |")
    return lines


def by_part(quality: str, listed: list[Result]) -> list[str]:
    """Return a table of the error in each part of the images."""
    shares: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for result in listed:
        for part, values in result.parts.items():
            shares[part].append(values)
    totals = np.array([[p[:2] for p in values] for values in shares.values()]).sum(axis=(0, 1))
    lines = [
        f"| part of the image, {quality} | share of pixels | share of error | FLIP "
        "| too bright by, stops |"
    ]
    lines.append("| --- | --- | --- | --- | --- |")
    for part, of_images in shares.items():
        pixels, error, stops = np.array(of_images).T
        if not pixels.any():
            continue
        lines.append(
            f"| {part} | {pixels.sum() / totals[0]:.1%} | {error.sum() / totals[1]:.1%} | "
            f"{error.sum() / max(pixels.sum(), 1):.3f} | {np.nanmean(stops):+.2f} "
            f"({np.nanmin(stops):+.2f} to {np.nanmax(stops):+.2f}) |"
        )
    return lines


def by_surroundings(results: dict[str, list[Result]]) -> list[str]:
    """Return a table of the FLIP of each surrounded case, with two columns per quality."""
    columns = [f"{where}, {quality}" for quality in results for where in ("objects", "ground")]
    lines = ["| case | " + " | ".join(columns) + " |", "| --- |" + " --- |" * len(columns)]
    rows = []
    for same in zip(*results.values(), strict=True):
        case = same[0].case
        assert isinstance(case, SurroundedCase)
        rows.append([value for r in same for value in (r.measures[3], r.ground)])
        lines.append(f"| {case.number}: {case.name}, {case.light} | {_cells(rows[-1])} |")
    return [*lines, f"| mean | {_cells(np.nanmean(rows, axis=0))} |"]


def _cells(values: Iterable[float]) -> str:
    """Return cells of a table; an image without ground has no value there."""
    return " | ".join("-" if np.isnan(value) else f"{value:.3f}" for value in values)


def as_samples(results: dict[str, list[Result]], figures: Figures) -> list[str]:
    """Return a table of the Cycles samples with the same error as each quality.

    Covers the cases that have a Cycles series.
    """
    columns = ["quality", "pixels", "FLIP", "Cycles with the same FLIP", "denoised Cycles"]
    lines = ["| " + " | ".join(columns) + " |", "| --- |" + " --- |" * 4]
    for quality, listed in results.items():
        traced = [r for r in listed if r.case.number in figures.series]
        numbers = [r.case.number for r in traced]
        for where, column in (("whole image", 0), ("objects", 3)):
            error = float(np.mean([r.measures[column] for r in traced]))
            cells = [quality, where, f"{error:.3f}"]
            for way in ("spp", "denoised"):
                equal = equal_samples(figures.curve(numbers, way, column), error)
                cells.append(f"{equal.words} samples")
            lines.append("| " + " | ".join(cells) + " |")
    return lines


def main_section(results: dict[str, list[Result]], coincidence: list[str]) -> list[str]:
    """Return the tables about the cases without surroundings."""
    figures = Figures.load()
    count = len(next(iter(results.values())))
    lines = [
        f"{count} cases, {SIZE[0]}x{SIZE[1]}, {heading()}.",
        "",
        *overall(results, figures),
        "",
    ]
    lines += [*(f"- {line}" for line in coincidence), ""]
    if any(r.case.number in figures.series for r in next(iter(results.values()))):
        lines += [f"Over the {len(figures.series)} cases with a Cycles series:", ""]
        lines += [*as_samples(results, figures), ""]
    lines += [*by_group(results), ""]
    for quality, listed in results.items():
        if quality != "draft":
            lines += [*by_part(quality, listed), ""]
    return lines[:-1]


def surroundings_section(results: dict[str, list[Result]]) -> list[str]:
    """Return the tables about the cases with ground and neighbours."""
    count = len(next(iter(results.values())))
    lines = [f"{count} cases, {SIZE[0]}x{SIZE[1]}, {heading()}.", "", *by_surroundings(results), ""]
    quality = "balanced" if "balanced" in results else next(iter(results))
    return [*lines, *by_part(quality, results[quality])]


def trace(python: Path, chosen_by: list[str]) -> None:
    """Path-trace and pack missing references.

    Args:
        python: A Python with bpy.
        chosen_by: Arguments of trace_references.py that choose the cases.
    """
    command = [sys.executable, str(Path(__file__).with_name("trace_references.py"))]
    command += ["--blender-python", str(python), *chosen_by]
    subprocess.run(command, check=True)
    packer = str(Path(__file__).with_name("pack_references.py"))
    subprocess.run([sys.executable, packer], check=True)


def write_pictures(folder: Path, results: dict[str, list[Result]]) -> None:
    """Write a picture per case and quality."""
    for quality, listed in results.items():
        for r in listed:
            name = f"{quality}_{r.case.number:02d}_{r.case.camera}_{r.case.light}.png"
            write_picture(folder / name, picture(*r.panels))


def main() -> None:
    """Print the tables and write the pictures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--only", help="numbers of cases, such as 3,32; results are only printed")
    parser.add_argument("--qualities", default="draft,balanced,fine,high")
    parser.add_argument("--blender-python", type=Path)
    parser.add_argument("--picture", type=Path, default=ROOT / "docs" / "accuracy.jpg")
    parser.add_argument("--out", type=Path, help="folder for a picture per case and quality")
    options = parser.parse_args()
    wanted = [*cases()[: options.cases], *surrounded_cases()]
    if options.only:
        wanted = [every_case()[int(number)] for number in options.only.split(",")]
    if options.blender_python:
        chosen_by = ["--only", options.only] if options.only else ["--cases", str(options.cases)]
        trace(options.blender_python, chosen_by)
    chosen = [case for case in wanted if (FOLDER / f"{case.number:02d}.npz").exists()]
    if len(chosen) < len(wanted):
        missing = len(wanted) - len(chosen)
        print(f"{missing} references are missing: give --blender-python PYTHON")
    if not chosen:
        raise SystemExit(2)
    results, coincidence = {}, {}
    for quality in options.qualities.split(","):
        results[quality], coincidence[quality] = all_results(quality, chosen)
    alone = {q: [r for r in rows if r.case.number < len(cases())] for q, rows in results.items()}
    among = {q: [r for r in rows if r.case.number >= len(cases())] for q, rows in results.items()}
    sections = {}
    if any(alone.values()):
        sections["accuracy"] = main_section(alone, list(coincidence.values()))
    if any(among.values()):
        sections["surroundings"] = surroundings_section(among)
    if options.out:
        write_pictures(options.out, results)
    if options.only:
        print("\n\n".join("\n".join(lines) for lines in sections.values()))
        return
    for name, lines in sections.items():
        write_section(name, lines)
    measures = {
        quality: {f"{r.case.number:02d}": [*r.measures, r.ground] for r in listed}
        for quality, listed in results.items()
    }
    save("accuracy", {**origin(), "measures": measures})
    shown = results.get("balanced") or next(iter(results.values()))
    first = [(r.case, r.panels) for r in shown[:CONTACT_CASES]]
    write_picture(options.picture, contact_picture(first))


if __name__ == "__main__":
    main()

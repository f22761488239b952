"""Measure how far models that learn from our renders are from real pictures.

    python bench/real_gap.py --install                   # once: rapidocr, for the section ocr
    python bench/real_gap.py REAL_DIR [--only markers,identifiers] [--seeds 3]

REAL_DIR holds labelled real pictures, in the layout of docs/benchmarks.md. They are only
measured, never trained on. Each part may be missing; its section is then skipped.

Sections:

    markers      top-1 of a small classifier trained on fresh renders, all and by class
    identifiers  exact reads and character errors of a small reader, by layout
    ocr          reads of rapidocr, which learned from real text, on ours and on theirs
    false        markers found in photographs without any
    damage       AUC of damaged against undamaged panels
    containers   AP50 of a small detector of containers trained on renders of gates and yards
    statistics   AUC of telling our pictures from theirs by named statistics

Every figure is the median of all seeds with its range. The seeds share their renders; each leaves
out another quarter of the training scenes. The interval in brackets covers the choice of test
pictures: Wilson's for shares, a bootstrap for AUCs and AP50. Needs fastgen[examples] and
fastgen[bench]. Stores the measured sections in bench/results/real_gap.json.
"""

import argparse
import os
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("LP_NUM_THREADS", "0")  # one process per core renders
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples"))

import torch
from crop_statistics import Interval, wilson
from gap_renders import Effort, Renders
from gap_sections import SECTIONS, Measure, Measures, Share, Trial
from peers import install
from real_crops import RealCrops, load_real
from rendered_crops import Text
from reporting import RESULTS, origin, save, stored
from text_peer import RAPIDOCR, contains_code, read_texts

from fastgen.errors import ConfigError

NAMES = ("markers", "identifiers", "ocr", "false", "damage", "containers", "statistics")

_NEEDS = {
    "markers": ("placards",),
    "identifiers": ("identifiers",),
    "ocr": ("identifiers",),
    "false": ("photos",),
    "damage": ("panels",),
    "containers": ("boxed",),
    "statistics": ("photos", "panels", "identifiers"),
}
"""Parts of RealCrops for each section. A section needs at least one of its parts."""

_CROPS = {
    "markers": ("markers",),
    "identifiers": ("texts",),
    "false": ("markers",),
    "damage": ("panels",),
    "statistics": ("panels",),
}
"""Kinds of crops that a section renders."""

_FILES = {
    "placards": "placards.csv",
    "identifiers": "identifiers.csv",
    "panels": "damage.csv",
    "photos": "look/*.jpg",
    "boxed": "containers.json",
}

_SMOKE = Effort(2, 2, 4, 1, 4, 4, 4, 4)
_SHOWN_CUES = 6


def ocr(texts: Sequence[Text], real: RealCrops, workers: int) -> Measures:
    """Return the identifiers that rapidocr reads on ours and on theirs, by view and layout."""
    read = read_texts([text.framed() for text in texts], workers)
    right = [
        contains_code(found, text.code, text.layout == "column")
        for found, text in zip(read, texts, strict=True)
    ]
    groups = [_group(text.layout, text.on_end) for text in texts]
    ours = {f"ours, {group}": _share(right, groups, group) for group in sorted(set(groups))}
    return {**ours, **real_ocr(real, workers)}


def real_ocr(real: RealCrops, threads: int) -> dict[str, Share]:
    """Return the real identifiers that rapidocr reads, by view and layout."""
    read = read_texts([one.pixels for one in real.identifiers], threads)
    right = [
        contains_code(found, one.code, one.layout == "column")
        for found, one in zip(read, real.identifiers, strict=True)
    ]
    groups = [_group(one.layout, one.on_end) for one in real.identifiers]
    return {f"theirs, {group}": _share(right, groups, group) for group in sorted(set(groups))}


def _group(layout: str, on_end: bool) -> str:
    return f"{'ends' if on_end else 'sides'}, {'column' if layout == 'column' else 'rows+block'}"


def _share(right: Sequence[bool], groups: Sequence[str], group: str) -> Share:
    chosen = [r for r, g in zip(right, groups, strict=True) if g == group]
    return Share(sum(chosen), len(chosen))


def summary(measures: Sequence[Measure]) -> dict[str, Any]:
    """Return median, range and interval of one figure over the seeds.

    Shares of a count are returned as shares in 0..1, with the median count.
    """
    values = [m.right / m.total if isinstance(m, Share) and m.total else m[0] for m in measures]
    middle = statistics.median(values)
    found: dict[str, Any] = {"median": middle, "range": [min(values), max(values)]}
    first = measures[0]
    if isinstance(first, Share):
        counts = [m.total for m in measures if isinstance(m, Share)]
        count = round(statistics.median(counts))
        _, low, high = wilson(middle * count, count)
        found |= {"count": count, "interval": [low, high]}
    if isinstance(first, Interval):
        ends = [(m.low, m.high) for m in measures if isinstance(m, Interval)]
        found["interval"] = [statistics.median(e[k] for e in ends) for k in (0, 1)]
    return found


def line(name: str, figure: dict[str, Any]) -> str:
    """Return one line of the table."""
    share = "count" in figure
    scale, form, unit = (100, ".0f", " %") if share else (1, ".3f", "")
    text = f"  {name:44}{scale * figure['median']:7{form}}{unit}"
    low, high = (scale * value for value in figure["range"])
    text += f"  {low:{form}} to {high:{form}}"
    if "interval" in figure:
        low, high = (scale * value for value in figure["interval"])
        text += f"  [{low:{form}}, {high:{form}}]"
    return text + (f"  of {figure['count']}" if share else "")


def show(section: str, figures: dict[str, dict[str, Any]]) -> None:
    """Print the table of a section; of the statistics only the best cues."""
    print(f"\n{section}")
    if section != "statistics":
        print("\n".join(line(name, figure) for name, figure in figures.items()), flush=True)
        return
    cues: dict[str, list[tuple[float, str]]] = {}
    for name, figure in figures.items():
        group, _, cue = name.rpartition(", ")
        if cue == "all together":
            print(line(name, figure))
        else:
            cues.setdefault(group, []).append((figure["median"], cue))
    for group, found in cues.items():
        most = sorted(found, reverse=True)[:_SHOWN_CUES]
        print(f"  {group}: " + ", ".join(f"{cue} {value:.2f}" for value, cue in most))
    sys.stdout.flush()


def sections_for(real: RealCrops, wanted: Sequence[str]) -> list[str]:
    """Return the sections that can be measured, and print why the others cannot."""
    found = []
    for name in wanted:
        if not any(getattr(real, part) for part in _NEEDS[name]):
            files = " or ".join(_FILES[part] for part in _NEEDS[name])
            print(f"{name}: skipped, because the folder has no {files}")
        elif name == "ocr" and not RAPIDOCR.interpreter.exists():
            print("ocr: skipped; install the reader with python bench/real_gap.py --install")
        else:
            found.append(name)
    return found


def measure(
    real: RealCrops, wanted: Sequence[str], seeds: Sequence[int], effort: Effort, workers: int
) -> tuple[dict[str, dict[str, dict[str, Any]]], dict[str, int]]:
    """Return the figures of each section, and the confused classes "true as guess" with counts."""
    kinds = list(dict.fromkeys(kind for name in wanted for kind in _CROPS.get(name, ())))
    results: dict[str, list[Measures]] = {name: [] for name in wanted}
    confused: dict[str, int] = {}
    renders = Renders(seeds[0], effort, workers, kinds)
    # all seeds share these renders, and rapidocr learns nothing from them
    read = ocr(renders.texts, real, workers) if "ocr" in wanted else {}
    for seed in seeds:
        trial = Trial(real, renders, seed, effort)
        for name in wanted:
            began = time.perf_counter()
            results[name].append(read if name == "ocr" else SECTIONS[name](trial))
            spent = time.perf_counter() - began
            print(f"seed {seed}, {name}: {spent:.0f} s", file=sys.stderr, flush=True)
        for (truth, guess), times in trial.confused.items():
            confused[f"{truth} as {guess}"] = confused.get(f"{truth} as {guess}", 0) + times
    figures = {
        name: {
            key: summary([one[key] for one in each if key in one])
            for key in dict.fromkeys(key for one in each for key in one)
        }
        for name, each in results.items()
    }
    return figures, dict(sorted(confused.items(), key=lambda item: -item[1]))


def merged(
    before: dict[str, Any],
    figures: dict[str, dict[str, Any]],
    confused: dict[str, int],
    about: dict[str, Any],
) -> dict[str, Any]:
    """Return stored results in which the sections of a run replace those of earlier runs.

    Args:
        before: The stored results; empty if there are none.
        figures: Figures of the measured sections.
        confused: Confused classes of the markers.
        about: Machine, version, seeds and duration of the run, stored for each of its sections.
    """
    return {
        "origin": {**before.get("origin", {}), **dict.fromkeys(figures, about)},
        "sections": {**before.get("sections", {}), **figures},
        "confused": confused if "markers" in figures else before.get("confused", {}),
    }


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write the results."""
    first, _, rest = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(
        description=first, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, metavar="REAL_DIR")
    parser.add_argument("--install", action="store_true", help="install rapidocr and exit")
    parser.add_argument("--only", default=",".join(NAMES), help="sections, separated by commas")
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first seed")
    cores = len(os.sched_getaffinity(0))
    parser.add_argument("--workers", type=int, default=cores, help="processes and threads")
    parser.add_argument("--smoke", action="store_true", help="train only a few steps, as a test")
    options = parser.parse_args(argv)
    if options.install:
        print(install(RAPIDOCR) or "installed")
        return
    wanted = options.only.split(",")
    unknown = [name for name in wanted if name not in NAMES]
    if unknown:
        raise SystemExit(f"--only: {unknown[0]!r} is not a section; use {', '.join(NAMES)}")
    if options.folder is None:
        raise SystemExit("give the folder of real pictures; see --help for its layout")
    try:
        real = load_real(options.folder)
    except ConfigError as error:
        raise SystemExit(str(error)) from None
    torch.set_num_threads(options.workers)
    began = time.perf_counter()
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    effort = _SMOKE if options.smoke else Effort()
    wanted = sections_for(real, wanted)
    figures, confused = measure(real, wanted, seeds, effort, options.workers)
    about = {**origin(), "seeds": list(seeds), "seconds": round(time.perf_counter() - began)}
    print(f"\n{about['machine']}, fastgen {about['fastgen']}, {about['seconds']} s")
    print(f"median of {len(seeds)} seeds, range, [95 % interval]")
    for name in wanted:
        show(name, figures[name])
        if name == "markers" and confused:
            print("  confused: " + ", ".join(f"{k} {v}" for k, v in list(confused.items())[:8]))
    if not options.smoke:
        before = stored("real_gap") if (RESULTS / "real_gap.json").exists() else {}
        save("real_gap", merged(before, figures, confused, about))


if __name__ == "__main__":
    main()

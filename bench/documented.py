"""Write the figures of README.md and of docs/benchmarks.md that come from several benchmarks.

    python bench/documented.py

Measures nothing: it reads bench/results. Run it after throughput.py, peers.py, pareto.py or
label_accuracy.py. A test fails while the pages have other figures than bench/results.
"""

import sys
import textwrap
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from cycles_figures import Equal, equal_samples
from reporting import ROOT, stored, write_section

SECTIONS = {
    "speed accuracy labels": ROOT / "README.md",
    "labels": ROOT / "docs" / "benchmarks.md",
    "times": ROOT / "docs" / "benchmarks.md",
}
"""Page of each section."""


_EXPLAINED = (
    "The exception is at a fold of a roof, where rounding by 0.003 pixels decides whether the "
    "sheet is scraped.",
)
"""Causes of the differences in bench/results/label_accuracy.json that are not at an edge: scene 12
of `yard`, camera pole_door, pixel (211, 160) at 256x256. The floor of the corrugation is 10.0 mm
deep, and the scrape marks the sheet down to 10.1 mm."""


def usual_row(quality: str) -> dict[str, Any]:
    """Return the results of throughput.py for a quality at 640x640 on EGL."""
    return next(
        row
        for row in stored("throughput")["rows"]
        if (row["quality"], row["size"], row["backend"]) == (quality, "640x640", "egl")
    )


def cpu_ms(quality: str) -> float:
    """Return the CPU time of a labelled 640x640 image in ms, files included."""
    return float(sum(usual_row(quality)["stages_ms"].values()))


def equal_cycles(quality: str) -> tuple[Equal, float]:
    """Return the Cycles setting with the error of a quality, and their ratio of times."""
    points = stored("pareto")["points"]
    ours = next(p for p in points if (p["renderer"], p["setting"]) == ("fastgen", quality))
    curve = [
        (int(p["setting"]), p["error"], 1 / p["rate"]) for p in points if p["renderer"] == "Cycles"
    ]
    equal = equal_samples(curve, ours["error"])
    return equal, equal.seconds * ours["rate"]


def label_sentence() -> str:
    """Return a sentence on how many labels differ from cast rays."""
    found = stored("label_accuracy")
    views = found["views"].values()
    pixels, labels, depth, unexplained = (
        sum(view[key] for view in views) for key in ("pixels", "labels", "depth", "unexplained")
    )
    if unexplained > len(_EXPLAINED):
        raise SystemExit(
            f"label_accuracy: {unexplained} differences are not at an edge; explain them first"
        )
    sentences = (
        f"With version {found['fastgen']}, {labels} labels and {depth} depths of "
        f"{pixels / 1e6:.1f} million pixels differ from independently cast rays.",
        f"All{f' except {unexplained}' if unexplained else ''} are within 0.01 pixels of an edge.",
        *_EXPLAINED[:unexplained],
    )
    return " ".join(sentences)


def readme_lines() -> list[str]:
    """Return the section of README.md."""
    rates = {q: usual_row(q)["steady_images_per_s"]["2"] for q in ("draft", "balanced")}
    about, peers = stored("throughput"), stored("peers")["peers"].items()
    traced = [row["cores"] / 1e3 for name, row in peers if name.startswith("Cycles")]
    equal, ratio = equal_cycles("balanced")
    return _wrapped(
        f"""- **Speed.** {rates["draft"]:.0f} labelled 640x640 images per second with `draft` and
        {rates["balanced"]:.0f} with `balanced` ({about["machine"]}, no GPU, version
        {about["fastgen"]}). Blender Cycles takes {min(traced):.0f} to {max(traced):.0f} s of CPU
        time per image ([benchmarks](docs/benchmarks.md#results)).""",
        f"""- **Accuracy.** `balanced` is as close to a path-traced reference as Cycles with
        {equal.words} samples per pixel ([accuracy](docs/accuracy.md), version
        {stored("pareto")["fastgen"]}), at 1/{ratio:.0f} of its CPU time
        ([1/84 on another machine](docs/benchmarks.md#distance-to-the-path-tracer)).""",
        f"""- **Labels.** {label_sentence()} [docs/stability.md](docs/stability.md) lists conditions
        in which renderers and labels fail, with tests.""",
    )


def label_lines() -> list[str]:
    """Return the section of docs/benchmarks.md on labels."""
    found = stored("label_accuracy")
    wrong = found["components"]["split, the largest part's box"]
    share = wrong / sum(found["components"].values())
    theirs, ours = found["a_draw_a_marker_ms"]["32"], found["one_draw_ms"]["32"]
    return _wrapped(
        f"""- **Labels are exact.** They are compared with rays that Embree casts at the mesh
        deformed in numpy, over {found["scenes"]} random scenes with four cameras and hard views
        (`python bench/label_accuracy.py`). {label_sentence()}""",
        f"""- **Labels are cheap.** The paper's way, a mask render and connected components for each
        marker, takes {theirs:,.0f} ms for 32 markers; one draw takes {ours:.0f} ms. The paper's way
        also gives {share:.0%} of the visible markers a wrong box, because rods and corrugation
        split them (same command, 640x640).""",
    )


def time_lines() -> list[str]:
    """Return the section of docs/benchmarks.md on the times of Cycles and of each quality."""
    lines = ["| quality | Cycles with the same FLIP | CPU time relative to Cycles |"]
    lines.append("| --- | --- | --- |")
    for quality in ("draft", "balanced", "fine", "high"):
        equal, ratio = equal_cycles(quality)
        lines.append(f"| `{quality}` | {equal.words} samples | 1/{ratio:.0f} |")
    about = stored("pareto")
    lines += ["", f"Measured on {about['machine']}, version {about['fastgen']}."]
    return lines


def _wrapped(*items: str) -> list[str]:
    """Return items of a Markdown list as lines."""
    lines = []
    for item in items:
        words = " ".join(item.split())
        lines += textwrap.wrap(
            words, 118, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )
    return lines


def main() -> None:
    """Write all sections."""
    every = (readme_lines(), label_lines(), time_lines())
    for (name, page), lines in zip(SECTIONS.items(), every, strict=True):
        write_section(name, lines, page)


if __name__ == "__main__":
    main()

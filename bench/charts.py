"""Charts of the benchmarks: their size and look, and drawing them again from stored results."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from reporting import ROOT, stored

matplotlib.use("Agg")

from matplotlib import pyplot as plt

plt.rcParams.update({"font.size": 8.5, "legend.fontsize": 8, "axes.titlesize": 8.5})

WIDTH_IN = 7.2
"""Width of a chart, at which 8 pt letters are legible in the 700 px of a documentation page."""
_DPI = 200

Figures = dict[str, Any]
"""Results of a benchmark as stored in bench/results."""

Draw = Callable[[Figures], Figure]


def panels(rows: int, columns: int, height_in: float, **options: Any) -> tuple[Figure, Any]:
    """Return a figure and its axes, laid out so that no label is cut.

    Args:
        rows: Rows of axes.
        columns: Axes in a row.
        height_in: Height of the figure in inches at WIDTH_IN.
        **options: Further options of `plt.subplots`.
    """
    return plt.subplots(
        rows, columns, figsize=(WIDTH_IN, height_in), layout="constrained", **options
    )


def caption(figure: Figure, figures: Figures, words: str) -> None:
    """Write what was measured, on which machine and with which version, below the axes."""
    figure.supxlabel(
        f"{words}; {figures['machine']}; fastgen {figures['fastgen']}", fontsize=7.5, color="#444"
    )


def add_options(parser: argparse.ArgumentParser, name: str) -> None:
    """Add `--chart` and `--redraw` to the options of the benchmark that draws docs/NAME.png."""
    parser.add_argument("--chart", type=Path, default=ROOT / "docs" / f"{name}.png")
    parser.add_argument(
        "--redraw",
        action="store_true",
        help=f"measure nothing; draw the chart of bench/results/{name}.json",
    )


def redrawn(options: argparse.Namespace, name: str, draw: Draw) -> bool:
    """Draw the chart of the stored results if `--redraw` was given; return whether it was."""
    if options.redraw:
        write(draw(stored(name)), options.chart)
    return bool(options.redraw)


def write(figure: Figure, path: Path) -> None:
    """Write a chart as PNG and close it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)

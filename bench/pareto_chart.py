"""Chart of images per second against error, with the Pareto front."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import FormatStrFormatter, NullLocator

MARKS = {
    "fastgen": ("o", "#c4441f"),
    "Cycles": ("s", "#2a5d8f"),
    "Cycles, denoised": ("D", "#5f9fd0"),
    "pyrender": ("^", "#4f7f3a"),
}
"""Marker and colour of each renderer."""


@dataclass(frozen=True)
class Point:
    """One setting of a renderer.

    Attributes:
        renderer: A key of MARKS.
        setting: Name of the setting.
        rate: Images per second of one core.
        error: FLIP.
    """

    renderer: str
    setting: str
    rate: float
    error: float


def front(points: Sequence[Point]) -> list[Point]:
    """Return the Pareto front: points with the lowest error at their rate or more, fastest
    first."""
    found: list[Point] = []
    for point in sorted(points, key=lambda p: (-p.rate, p.error)):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def draw(points: Sequence[Point], caption: str, path: Path) -> None:
    """Write the chart as PNG.

    The left panel shows all points on logarithmic axes. The right panel shows fastgen's own again,
    with names. Better is down and to the right.
    """
    figure, (whole, near) = plt.subplots(1, 2, figsize=(13, 6.5), width_ratios=(3, 2))
    best = front(points)
    whole.plot(
        [p.rate for p in best],
        [p.error for p in best],
        color="#999999",
        lw=7,
        alpha=0.35,
        solid_capstyle="round",
        label="Pareto front",
        zorder=1,
    )
    for renderer, (marker, color) in MARKS.items():
        mine = [p for p in points if p.renderer == renderer]
        if not mine:
            continue
        line = "-" if renderer.startswith("Cycles") else "none"
        rates, errors = [p.rate for p in mine], [p.error for p in mine]
        whole.plot(rates, errors, ls=line, marker=marker, color=color, label=renderer, ms=6, lw=1.2)
        if renderer.startswith("Cycles"):
            for point in mine:
                _note(whole, point, point.setting, color)
    whole.set(xscale="log", yscale="log")
    whole.set_xlabel(f"images per second of one core (Cycles: colour only)\n{caption}")
    whole.set_ylabel("FLIP of objects against Cycles at 1,024 samples")
    ticks = [0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7]
    low, high = min(p.error for p in points) / 1.2, max(p.error for p in points) * 1.2
    shown = [tick for tick in ticks if low < tick < high]
    whole.set_yticks(shown, [f"{tick:g}" for tick in shown])
    whole.yaxis.set_minor_locator(NullLocator())
    whole.set_ylim(low, high)
    whole.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    whole.grid(alpha=0.3)
    whole.legend(loc="upper left", title="numbers: samples per pixel", fontsize=9)
    _name_ours([p for p in points if p.renderer == "fastgen"], near)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _note(axes: Axes, point: Point, text: str, color: str) -> None:
    axes.annotate(
        text,
        (point.rate, point.error),
        xytext=(5, 4),
        textcoords="offset points",
        fontsize=8,
        color=color,
    )


def _name_ours(points: Sequence[Point], axes: Axes) -> None:
    """Draw numbered points on linear axes, with their settings listed below."""
    marker, color = MARKS["fastgen"]
    ranked = sorted(points, key=lambda p: p.error)
    for number, point in enumerate(ranked, 1):
        axes.plot(point.rate, point.error, marker=marker, color=color, ms=6)
        _note(axes, point, str(number), "black")
    names = [f"{number}  {point.setting}" for number, point in enumerate(ranked, 1)]
    half = -(-len(names) // 2)
    columns = ["\n".join(names[:half]), "\n".join(names[half:])]
    for x, text in zip((0.0, 0.56), columns, strict=True):
        axes.text(x, -0.16, text, transform=axes.transAxes, fontsize=8, va="top")
    axes.set_title("fastgen only", fontsize=10, color=color)
    axes.set_xlabel("labelled images per second of one core")
    axes.margins(0.1)
    axes.grid(alpha=0.3)

"""Chart of images per second against error, with the Pareto front."""

from collections.abc import Sequence
from dataclasses import dataclass

import charts
from matplotlib.axes import Axes
from matplotlib.figure import Figure
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


def draw(figures: charts.Figures) -> Figure:
    """Return the chart of the stored figures of pareto.py.

    The upper panel shows all points on logarithmic axes; better is down and to the right. The lower
    panel lists fastgen's settings with error and rate.
    """
    points = [Point(**point) for point in figures["points"]]
    figure, (whole, ours) = charts.panels(2, 1, 8.2, height_ratios=(3, 2))
    _draw_all(points, whole)
    _list_ours([p for p in points if p.renderer == "fastgen"], ours)
    charts.caption(figure, figures, f"{figures['cases']} cases, {figures['size']}")
    return figure


def _draw_all(points: Sequence[Point], axes: Axes) -> None:
    best = front(points)
    axes.plot(
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
        traced = renderer.startswith("Cycles")
        line = "-" if traced else "none"
        label = "fastgen (settings below)" if renderer == "fastgen" else renderer
        rates, errors = [p.rate for p in mine], [p.error for p in mine]
        axes.plot(rates, errors, ls=line, marker=marker, color=color, label=label, ms=5, lw=1.2)
        for point in mine:
            if traced or "," not in point.setting:
                side = -1 if renderer == "Cycles, denoised" else 1  # the two curves cross
                axes.annotate(
                    point.setting,
                    (point.rate, point.error),
                    xytext=(5 * side, 4 * -side),
                    textcoords="offset points",
                    ha="right" if side < 0 else "left",
                    va="bottom" if side < 0 else "top",
                    fontsize=7,
                    color=color,
                )
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel("images per second of one core (Cycles: colour only)")
    axes.set_ylabel("FLIP of objects against Cycles\nat 1,024 samples per pixel")
    ticks = [0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7]
    low, high = min(p.error for p in points) / 1.25, max(p.error for p in points) * 1.25
    shown = [tick for tick in ticks if low < tick < high]
    axes.set_yticks(shown, [f"{tick:g}" for tick in shown])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_ylim(low, high)
    axes.margins(x=0.08)
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left", title="numbers: samples per pixel", title_fontsize=8)


def _list_ours(points: Sequence[Point], axes: Axes) -> None:
    """Draw a row for each setting: its name, error and rate."""
    marker, color = MARKS["fastgen"]
    ranked = sorted(points, key=lambda p: p.error)
    axes.hlines(range(len(ranked)), 0, [p.error for p in ranked], color="#bbbbbb", lw=1)
    axes.plot([p.error for p in ranked], range(len(ranked)), ls="none", marker=marker, color=color)
    for row, point in enumerate(ranked):
        axes.annotate(
            f"{point.rate:.3g} images/s",
            (point.error, row),
            xytext=(7, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axes.set_yticks(range(len(ranked)), [p.setting for p in ranked])
    axes.invert_yaxis()
    axes.set_xlim(0, max(p.error for p in ranked) * 1.25)
    axes.set_xlabel("FLIP of objects; settings of fastgen, images per second of one core")

"""Draws images a second against error, with the front of what nothing beats in both."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt

MARKS = {
    "fastgen": ("o", "#c4441f"),
    "Cycles": ("s", "#2a5d8f"),
    "Cycles, denoised": ("D", "#5f9fd0"),
    "pyrender": ("^", "#4f7f3a"),
}
"""Of each renderer: marker and colour."""


@dataclass(frozen=True)
class Point:
    """renderer: a key of MARKS. rate: images a second of one core. error: FLIP."""

    renderer: str
    setting: str
    rate: float
    error: float


def front(points: Sequence[Point]) -> list[Point]:
    """Points that no other beats in rate without being farther off, from fast to slow."""
    found: list[Point] = []
    for point in sorted(points, key=lambda p: (-p.rate, p.error)):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def draw(points: Sequence[Point], caption: str, path: Path) -> None:
    """Write the chart as PNG; both axes logarithmic, better is down and to the right."""
    figure, axes = plt.subplots(figsize=(10, 6))
    best = front(points)
    axes.plot(
        [p.rate for p in best],
        [p.error for p in best],
        color="#999999",
        lw=6,
        alpha=0.35,
        solid_capstyle="round",
        label="Pareto front",
        zorder=1,
    )
    for renderer, (marker, color) in MARKS.items():
        mine = [p for p in points if p.renderer == renderer]
        if not mine:
            continue
        rates, errors = [p.rate for p in mine], [p.error for p in mine]
        line = "-" if renderer.startswith("Cycles") else ""
        axes.plot(rates, errors, line, marker=marker, color=color, label=renderer, ms=6, lw=1.2)
        for point in mine:
            if renderer.startswith("Cycles"):
                axes.annotate(
                    point.setting,
                    (point.rate, point.error),
                    xytext=(4, 5),
                    textcoords="offset points",
                    fontsize=7,
                    color=color,
                )
    _name_ours([p for p in points if p.renderer == "fastgen"], axes)
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel(f"labelled images a second of one core (Cycles: colour only)\n{caption}")
    axes.set_ylabel("FLIP of container and spreader against Cycles at 1,024 samples")
    ticks = [0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7]
    low, high = min(p.error for p in points) / 1.2, max(p.error for p in points) * 1.2
    shown = [tick for tick in ticks if low < tick < high]
    axes.set_yticks(shown, [f"{tick:g}" for tick in shown])
    axes.yaxis.set_minor_locator(plt.NullLocator())
    axes.set_ylim(low, high)
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left", title="numbers: samples a pixel")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _name_ours(points: Sequence[Point], axes: plt.Axes) -> None:
    """The settings as a list in an inset that shows their cluster larger."""
    if not points:
        return
    inset = axes.inset_axes((0.44, 0.6, 0.55, 0.38))
    marker, color = MARKS["fastgen"]
    ranked = sorted(points, key=lambda p: p.error)
    for number, point in enumerate(ranked, 1):
        inset.plot(point.rate, point.error, marker=marker, color=color, ms=5)
        inset.annotate(
            str(number),
            (point.rate, point.error),
            xytext=(4, 3),
            textcoords="offset points",
            fontsize=7,
        )
    rates = [p.rate for p in points]
    inset.set_xlim(min(rates) * 0.95, max(rates) + 1.3 * (max(rates) - min(rates)))
    inset.margins(y=0.12)
    inset.tick_params(labelsize=6)
    names = "\n".join(f"{i} {p.setting}" for i, p in enumerate(ranked, 1))
    inset.text(0.99, 0.97, names, transform=inset.transAxes, fontsize=6.5, va="top", ha="right")
    inset.set_title("fastgen", fontsize=8, color=color)

"""Charts of the examples as PNG files: losses, classes, confusion, and detections."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import torch
from numpy.typing import NDArray

matplotlib.use("Agg")
from matplotlib import pyplot

_DPI = 90


def loss_curve(losses: Sequence[float], path: Path, window: int = 25) -> None:
    """Draw the loss by step, and its running mean over `window` steps."""
    figure, axes = pyplot.subplots(figsize=(6, 3.2))
    axes.plot(losses, color="0.8", linewidth=0.8, label="step")
    if len(losses) >= window:
        mean = np.convolve(losses, np.ones(window) / window, "valid")
        axes.plot(np.arange(window - 1, len(losses)), mean, label=f"mean of {window} steps")
    axes.set(xlabel="step", ylabel="loss", yscale="log")
    axes.legend()
    _save(figure, path)


def histogram(groups: Mapping[str, torch.Tensor], label: str, path: Path) -> None:
    """Draw histograms of the values 0..1 of each group, with counts on a logarithmic axis."""
    figure, axes = pyplot.subplots(figsize=(6, 3.2))
    values = [group.numpy() for group in groups.values()]
    axes.hist(values, bins=np.linspace(0, 1, 21).tolist(), label=list(groups))
    axes.set(xlabel=label, ylabel="images", yscale="log")
    axes.legend()
    _save(figure, path)


def bars(names: Sequence[str], series: Mapping[str, Sequence[float]], path: Path) -> None:
    """Draw a group of bars for each name, one bar per series, in percent."""
    figure, axes = pyplot.subplots(figsize=(max(5.0, 0.4 * len(names)), 3.2))
    width = 0.8 / len(series)
    for number, (label, values) in enumerate(series.items()):
        axes.bar(np.arange(len(names)) + number * width, values, width, label=label)
    axes.set_xticks(np.arange(len(names)) + 0.4 - width / 2, names, rotation=60, ha="right")
    axes.set(ylabel="%", ylim=(0, 100))
    # above the axes, where it covers no bar
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(series), frameon=False)
    _save(figure, path)


def confusion(counts: NDArray[np.int64], names: Sequence[str], path: Path) -> None:
    """Draw counts [true, found] as shares of each true class; the last column is missed labels."""
    columns = [*names, "missed"][: counts.shape[1]]
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure, axes = pyplot.subplots(figsize=(7.5, 7))
    shown = axes.imshow(shares, cmap="magma_r", vmin=0, vmax=1)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    axes.set_yticks(range(len(names)), list(names), fontsize=7)
    axes.set(xlabel="found as", ylabel="true class")
    figure.colorbar(shown, label="share of the class", shrink=0.7)
    _save(figure, path)


def score_by_cost(
    curves: Mapping[str, Sequence[tuple[float, float, float, float]]], cost: str, path: Path
) -> None:
    """Draw curves of points (cost, score, low, high): scores in percent, cost on a log axis."""
    figure, axes = pyplot.subplots(figsize=(6, 3.6))
    for name, points in curves.items():
        x, y, low, high = np.array(points).T
        (line,) = axes.plot(x, y, marker="o", label=name)
        axes.fill_between(x, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set(xlabel=cost, ylabel="correct on Cycles' test images, %", xscale="log", ylim=(0, 100))
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    _save(figure, path)


def worth(losses: Mapping[str, tuple[float, float, float]], label: str, path: Path) -> None:
    """Draw a point with its interval (mean, low, high) for each name, one per row."""
    figure, axes = pyplot.subplots(figsize=(6, 0.8 + 0.3 * len(losses)))
    mean, low, high = np.array(list(losses.values())).T
    rows = np.arange(len(losses))
    axes.errorbar(mean, rows, xerr=[mean - low, high - mean], fmt="o", capsize=3)
    axes.axvline(0, color="0.5", linewidth=0.8)
    axes.set_yticks(rows, list(losses))
    axes.invert_yaxis()
    axes.set(xlabel=label)
    _save(figure, path)


def pairs(above: NDArray[np.uint8], below: NDArray[np.uint8], path: Path, count: int = 16) -> None:
    """Draw `count` evenly chosen crops [N, H, W, 3] of one set above the same crops of another."""
    chosen = np.linspace(0, len(above) - 1, count).astype(int)
    figure, axes = pyplot.subplots(figsize=(0.6 * count, 1.4))
    axes.imshow(np.vstack([np.hstack(list(crops[chosen])) for crops in (above, below)]))
    axes.set_yticks([above.shape[1] * 0.5, above.shape[1] * 1.5], ["Cycles", "ours"])
    axes.set_xticks([])
    _save(figure, path)


def pictures(
    images: Sequence[torch.Tensor],
    titles: Sequence[str],
    path: Path,
    columns: int = 4,
    inches: float = 2.6,
) -> None:
    """Draw images uint8 [3, H, W] in a grid, each `inches` wide and with a title."""
    rows = -(-len(images) // columns)
    height, width = images[0].shape[1:]
    cell = (inches, inches * height / width + 0.3)
    figure, grid = pyplot.subplots(
        rows, columns, figsize=(cell[0] * columns, cell[1] * rows), squeeze=False
    )
    for axes in grid.flat:
        axes.axis("off")
    for axes, image, title in zip(grid.flat, images, titles, strict=False):
        axes.imshow(image.permute(1, 2, 0).numpy())
        axes.set_title(title, fontsize=7)
    _save(figure, path)


def _save(figure: Any, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=_DPI)
    pyplot.close(figure)

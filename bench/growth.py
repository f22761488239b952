"""Measure how the cost of an image grows with pixels, markers, damage, light, workers and count.

    python bench/growth.py [--images 400] [--parts pixels,markers,damages,hdri,workers]
    python bench/growth.py --parts length --images 20000     # a long run: rate and memory
    python bench/growth.py --redraw     # docs/growth.png from the stored results

Times are medians of `Generator.render`, labels included, in one process. bench/results/growth.json
keeps the latest results of every part, and docs/growth.png shows them all.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import charts
import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from reporting import RESULTS, ROOT, machine, origin, parse_size, save, stored
from throughput import fill_caches, generate_command, whole_run

from fastgen import Config, Generator
from fastgen.classes import MARKER_CLASSES
from fastgen.light.environment import load_environment
from fastgen.light.hdri import bundled_hdris, load_radiance
from fastgen.scene import Decal, Scene

SIZES = ("320x320", "640x640", "1024x768", "1333x800", "1920x1080", "2560x1440")
MARKERS = (1, 4, 16, 32, 64)
DAMAGES = (0, 1, 2, 4, 8, 16, 32)
HDRI_WIDTHS = (512, 1024, 2048, 4096, 8192)
SCENES = 3
LENGTH_STEP = 100
_POLL_S = 0.5
_COLUMNS, _STEP_MM, _SIZE_MM = 8, 240.0, 200.0
"""Layout of the markers on the door."""

Table = dict[str, list[float]]
"""Columns of equal length, by name."""


def frame_ms(generator: Generator, views: Sequence[tuple[Scene, str]], rounds: int) -> float:
    """Return the median milliseconds of a labelled image over `views`, after one warm-up draw
    each."""
    for scene, camera in views:
        generator.render(scene=scene, camera=camera)
    taken = []
    for _ in range(rounds):
        for scene, camera in views:
            began = time.perf_counter()
            generator.render(scene=scene, camera=camera)
            taken.append(time.perf_counter() - began)
    return statistics.median(taken) * 1e3


def pixels(rounds: int) -> Table:
    """Measure the time against the size of the image."""
    table: Table = {"pixels": [], "ms": []}
    for text in SIZES:
        width, height = parse_size(text)
        with Generator(Config.preset(), seed=1, size=(width, height)) as generator:
            scenes = [generator.scene(i) for i in range(SCENES)]
            views = [(scene, camera.name) for scene in scenes for camera in scene.cameras]
            table["ms"].append(frame_ms(generator, views, rounds))
        table["pixels"].append(width * height)
    return table


def with_markers(scene: Scene, count: int) -> Scene:
    """Return `scene` with `count` markers in rows on its door and no other decals or damage."""
    decals = []
    for i in range(count):
        row, column = divmod(i, _COLUMNS)
        name = MARKER_CLASSES[i % len(MARKER_CLASSES)]
        center = (250 + column * _STEP_MM, 250 + row * _STEP_MM)
        decals.append(Decal("marker", name, "door", center, (_SIZE_MM, _SIZE_MM), art=name))
    return replace(scene, decals=tuple(decals), damages=())


def markers(rounds: int) -> Table:
    """Measure the time against the number of markers on the door, at 640x640."""
    table: Table = {"markers": [], "ms": []}
    with Generator(Config.preset(), seed=1) as generator:
        scenes = [generator.scene(i) for i in range(SCENES)]
        for count in MARKERS:
            views = [(with_markers(scene, count), "Cr") for scene in scenes]
            table["markers"].append(count)
            table["ms"].append(frame_ms(generator, views, 3 * rounds))
    return table


def damages(rounds: int) -> Table:
    """Measure the time against the number of damages, at 640x640.

    Damages are sampled from all kinds. The rest of a scene is the same for all counts.
    """
    table: Table = {"damages": [], "ms": []}
    for count in DAMAGES:
        values = {"probability": float(count > 0), "count": [max(count, 1)] * 2}
        with Generator(Config.from_values({"damage": values}), seed=1) as generator:
            scenes = [generator.scene(i) for i in range(SCENES)]
            views = [(scene, camera.name) for scene in scenes for camera in scene.cameras]
            table["ms"].append(frame_ms(generator, views, rounds))
        table["damages"].append(count)
    return table


def hdri(rounds: int) -> Table:
    """Measure image time, first light preparation and reload from the cache against HDRI width."""
    table: Table = {"width": [], "ms": [], "prepare_s": [], "reopen_ms": []}
    radiance = load_radiance(bundled_hdris()["venice"])
    for width in HDRI_WIDTHS:
        with tempfile.TemporaryDirectory() as place:
            os.environ["XDG_CACHE_HOME"] = f"{place}/cache"  # leave the user's cache alone
            path = Path(place) / "light" / "light.hdr"
            path.parent.mkdir()
            larger = cv2.resize(radiance, (width, width // 2), interpolation=cv2.INTER_LINEAR)
            cv2.imwrite(str(path), np.ascontiguousarray(larger[..., ::-1]))
            began = time.perf_counter()
            load_environment(path)
            prepared = time.perf_counter()
            load_environment(path)
            opened = time.perf_counter()
            with Generator(Config.preset(), seed=1, hdri_dir=path.parent) as generator:
                scenes = [generator.scene(i) for i in range(SCENES)]
                views = [(scene, camera.name) for scene in scenes for camera in scene.cameras]
                table["ms"].append(frame_ms(generator, views, rounds))
        table["width"].append(width)
        table["prepare_s"].append(prepared - began)
        table["reopen_ms"].append((opened - prepared) * 1e3)
    return table


def workers(images: int) -> Table:
    """Measure the images per second of `fastgen generate` with up to twice as many workers as
    cores."""
    cores = len(os.sched_getaffinity(0))
    counts = sorted({1, 2, cores, 2 * cores})
    fill_caches("auto", images)
    rates = [whole_run("auto", "640x640", images, count).whole for count in counts]
    return {"workers": [float(c) for c in counts], "images_per_s": rates}


def length(images: int, size: str) -> Table:
    """Record rate and resident memory of one `fastgen generate` after every LENGTH_STEP images.

    resident_mb is the sum over the command and its workers. Shared pages count once per process.
    The command makes LENGTH_STEP more images, so its workers still run when the last row is
    recorded.
    """
    table: Table = {"images": [], "seconds": [], "resident_mb": []}
    cores = len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as place:
        out = Path(place) / "out"
        command = generate_command(str(out), images + LENGTH_STEP, cores, size, "auto")
        began = time.perf_counter()
        process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        while process.poll() is None and len(table["images"]) < images // LENGTH_STEP:
            done = _images_in(out)
            if done >= LENGTH_STEP * (len(table["images"]) + 1):
                table["images"].append(done)
                table["seconds"].append(time.perf_counter() - began)
                table["resident_mb"].append(_resident_mb(process.pid))
            time.sleep(_POLL_S)
        process.wait()
    if process.returncode:
        raise SystemExit(f"fastgen generate ended with exit code {process.returncode}")
    return table


def _images_in(out: Path) -> int:
    return sum(len(os.listdir(split)) for split in out.glob("images/*"))


def _resident_mb(pid: int) -> float:
    """Return the resident memory in MB of a process and all its descendants."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        children = [
            int(child)
            for task in Path(f"/proc/{pid}/task").iterdir()
            for child in (task / "children").read_text(encoding="ascii").split()
        ]
    except OSError:  # the process has ended
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6 + sum(map(_resident_mb, children))


def show(name: str, table: Table) -> None:
    """Print the table of a part in at most about twenty rows, and the drift of a long run."""
    rows = list(zip(*table.values(), strict=True))
    print(f"\n{name}\n" + "".join(f"{column:>14}" for column in table))
    for row in rows[:: max(len(rows) // 20, 1)]:
        print("".join(f"{value:14.1f}" for value in row))
    if name == "length" and len(rows) > 1:
        print(drift(table))


def drift(table: Table) -> str:
    """Describe how rate and memory changed over a long run."""
    counts, seconds, memory = (np.array(table[k]) for k in ("images", "seconds", "resident_mb"))
    rates = np.diff(counts) / np.diff(seconds)
    tenth = max(len(rates) // 10, 1)
    words = (
        f"rate: first tenth {rates[:tenth].mean():.2f}/s, last tenth {rates[-tenth:].mean():.2f}/s"
    )
    # without preloading, HDRIs and meshes are loaded on first use, so memory grows early on
    for start in (100, 1000, 5000):
        if start < counts[-1]:
            at = int(np.searchsorted(counts, start))
            change = memory[-1] / memory[at] - 1
            words += (
                f"\nresident memory from image {counts[at]:.0f} to {counts[-1]:.0f}: {change:+.2%}"
            )
    if counts[-1] > 2000:  # means, because memory fluctuates as the allocator frees it late
        first, last = (memory[part].mean() for part in (counts <= 1000, counts > counts[-1] - 1000))
        words += (
            f"\nmean memory of the last 1000 images against the first 1000: {last / first - 1:+.2%}"
        )
    return words


def draw(parts: charts.Figures) -> Figure:
    """Return a chart with a panel for each part."""
    figure, axes = charts.panels(3, 2, 8.0)
    painters: dict[str, Callable[[Axes, Table], None]] = {
        "pixels": _draw_pixels,
        "markers": lambda axes, t: _draw_ms(axes, t["markers"], t["ms"], "markers on the door"),
        "damages": lambda axes, t: _draw_ms(axes, t["damages"], t["ms"], "damages"),
        "hdri": _draw_hdri,
        "workers": _draw_workers,
        "length": _draw_length,
    }
    for panel, (name, paint) in zip(axes.flat, painters.items(), strict=True):
        if name in parts:
            paint(panel, parts[name]["table"])
            if "size" in parts[name]:
                panel.set_xlabel(f"images made, {parts[name]['size']}")
        else:
            panel.set_title(f"{name}: not measured")
    measured = {
        key: ", ".join(sorted({part[key] for part in parts.values()}))
        for key in ("machine", "fastgen")
    }
    charts.caption(figure, measured, "640x640 unless stated otherwise")
    return figure


def _from_zero(axes: Axes, *ways: str) -> None:
    """Begin axes at zero, with room between the outermost points and the frame."""
    for way in ways:
        low, high = axes.dataLim.get_points()[:, "xy".index(way)]
        room = 0.06 * (high - min(low, 0))
        axes.set(**{f"{way}lim": (-room if low <= 0 else 0, high + room)})


def _draw_ms(axes: Axes, x: list[float], ms: list[float], label: str) -> None:
    axes.plot(x, ms, "o-")
    axes.set(xlabel=label, ylabel="ms per labelled image")
    _from_zero(axes, "x", "y")


def _draw_pixels(axes: Axes, table: Table) -> None:
    _draw_ms(axes, [p / 1e6 for p in table["pixels"]], table["ms"], "million pixels")


def _draw_hdri(axes: Axes, table: Table) -> None:
    axes.plot(table["width"], table["ms"], "o-", label="image, ms")
    axes.plot(table["width"], table["reopen_ms"], "^-", label="reload from the cache, ms")
    axes.plot(table["width"], [1e3 * s for s in table["prepare_s"]], "s-", label="first use, ms")
    axes.set(xlabel="width of the HDRI in texels", ylabel="ms", xscale="log", yscale="log")
    axes.set_xticks(table["width"], [f"{w:.0f}" for w in table["width"]])
    axes.minorticks_off()
    axes.legend(loc="upper left")
    axes.set_ylim(top=1e5)  # room for the legend


def _draw_workers(axes: Axes, table: Table) -> None:
    axes.plot(table["workers"], table["images_per_s"], "o-")
    axes.set(xlabel="workers", ylabel="images per second,\nstart-up included")
    axes.set_xticks(table["workers"])
    _from_zero(axes, "x", "y")


def _draw_length(axes: Axes, table: Table) -> None:
    counts, seconds = np.array(table["images"]), np.array(table["seconds"])
    axes.plot(counts[1:], np.diff(counts) / np.diff(seconds), ".", ms=3)
    axes.set(xlabel="images made", ylabel="images per second")
    _from_zero(axes, "x", "y")
    memory = axes.twinx()
    memory.plot(counts, table["resident_mb"], "C1")
    memory.set_ylim(0, 1.3 * max(table["resident_mb"]))
    memory.set_ylabel("resident MB, all processes", color="C1")


def main() -> None:
    """Measure the requested parts, print them and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parts", default="pixels,markers,damages,hdri,workers")
    parser.add_argument("--images", type=int, default=400, help="images of the long run")
    parser.add_argument("--size", default="640x640", help="image size of the long run")
    parser.add_argument(
        "--run-images", type=int, default=200, help="images per run of the part `workers`"
    )
    parser.add_argument("--rounds", type=int, default=5, help="draws per view")
    charts.add_options(parser, "growth")
    options = parser.parse_args()
    if charts.redrawn(options, "growth", draw):
        return
    measures: dict[str, Callable[[], Table]] = {
        "pixels": lambda: pixels(options.rounds),
        "markers": lambda: markers(options.rounds),
        "damages": lambda: damages(options.rounds),
        "hdri": lambda: hdri(options.rounds),
        "workers": lambda: workers(options.run_images),
        "length": lambda: length(options.images, options.size),
    }
    wanted = options.parts.split(",")
    for name in wanted:
        if name not in measures:
            parser.error(f"--parts: {name!r} is unknown; use {', '.join(measures)}")
    parts = stored("growth") if (RESULTS / "growth.json").exists() else {}
    print(machine())
    for name in wanted:
        table = measures[name]()
        parts[name] = {**origin(), "table": table}
        if name == "length":
            parts[name]["size"] = options.size
        show(name, table)
        save("growth", parts)
    charts.write(draw(parts), options.chart)


if __name__ == "__main__":
    main()

"""Measure the time and the pixels of each render pass.

    python bench/passes.py [--scenes 6] [--repeats 3] [--size 640x640] [--damage 0.4]
        [--quality balanced] [--preset gate]

Prints CPU ms and thousands of pixels of each pass by camera, measured in one process. Each time is
the fastest of `repeats` draws, averaged over the scenes. CPU time of the process is hardly affected
by other load on the machine. The timer waits for each pass to finish, which does not happen in a
real frame.

On a GPU, times come from the GPU's own clock and pixels are not counted, because reading a list
back makes it slow from then on.
"""

import argparse
import os
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import Any

# one thread per process, like in `fastgen generate`; llvmpipe reads it at the first context
os.environ.setdefault("LP_NUM_THREADS", "0")

import moderngl
from reporting import parse_size

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.gpu_mesh import GpuMesh
from fastgen.render.passes.background import BackgroundPass
from fastgen.render.passes.ground import GroundPass
from fastgen.render.passes.shading import ShadingPass
from fastgen.render.pixel_lists import PixelLists
from fastgen.render.settings import QUALITY
from fastgen.render.visibility_buffer import VisibilityBuffer


class PassTimer:
    """Context manager that wraps the drawing methods to time them, and restores them at exit.

    Args:
        ctx: The GL context.
        on_gpu: Time with the GPU's clock instead of the CPU time of the process.
    """

    def __init__(self, ctx: moderngl.Context, on_gpu: bool) -> None:
        self._ctx = ctx
        self.on_gpu = on_gpu
        self._kept: list[tuple[type, str, Callable[..., Any]]] = []
        self.count_pixels = False
        self.seconds: dict[str, float] = {}
        self.pixels: dict[str, int] = {}

    def __enter__(self) -> "PassTimer":
        self._wrap(VisibilityBuffer, "begin", lambda *_: "clear")
        self._wrap(
            GpuMesh, "draw", lambda program, _: "inside" if program == "holed" else "geometry"
        )
        self._wrap(BackgroundPass, "run", lambda *_: "background")
        self._wrap(GroundPass, "run", lambda *_: "ground")
        self._wrap(ShadingPass, "_classify", lambda *_: "classify")
        self._wrap(PixelLists, "dispatch", lambda name, *_: name)
        return self

    def __exit__(self, *_: object) -> None:
        for owner, method, original in self._kept:
            setattr(owner, method, original)

    def _wrap(self, owner: type, method: str, named: Callable[..., str]) -> None:
        original = getattr(owner, method)
        self._kept.append((owner, method, original))

        def timed(this: Any, *args: Any, **named_args: Any) -> None:
            name = named(*args)
            if self.count_pixels:
                query = self._ctx.query(samples=True)
                with query:
                    original(this, *args, **named_args)
                # compute shaders write no samples, so their pixel lists are counted
                listed = isinstance(this, PixelLists)
                count = len(this.entries()[name]) if listed else query.samples
                self.pixels[name] = self.pixels.get(name, 0) + count
                return
            spent = self.spent(lambda: original(this, *args, **named_args))
            self.seconds[name] = self.seconds.get(name, 0.0) + spent

        setattr(owner, method, timed)

    def spent(self, work: Callable[[], Any]) -> float:
        """Return the seconds that drawing takes."""
        self._ctx.finish()
        if self.on_gpu:
            query = self._ctx.query(time=True)
            with query:
                work()
            return query.elapsed / 1e9
        began = time.process_time()
        work()
        self._ctx.finish()
        return time.process_time() - began


def measure(
    config: Config, size: tuple[int, int], quality: str, scenes: int, repeats: int
) -> tuple[dict[str, dict[str, float]], dict[str, dict[str, float]]]:
    """Return mean milliseconds and mean pixels, by camera and pass.

    The pass 'draw' is a whole draw without the timers.
    """
    spent: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    drawn: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    with Generator(config, seed=7, size=size, backend="egl", quality=quality) as generator:
        renderer = generator.gpu.renderer()
        ctx, on_gpu = renderer.ctx, not generator.gpu.context().software
        for index in range(scenes):
            scene = generator.scene(index)
            prepared = PreparedScene(scene)
            for camera in scene.cameras:
                timer = PassTimer(ctx, on_gpu)
                draw = partial(renderer.draw, prepared, camera, size)
                draw()
                spent[camera.name]["draw"].append(
                    min(timer.spent(draw) for _ in range(repeats)) * 1e3
                )
                with timer:
                    timer.count_pixels = not on_gpu
                    draw()
                    timer.count_pixels = False
                    least: dict[str, float] = {}
                    for _ in range(repeats):
                        timer.seconds = {}
                        draw()
                        for name, value in timer.seconds.items():
                            least[name] = min(least.get(name, value), value)
                for name, value in least.items():
                    spent[camera.name][name].append(value * 1e3)
                    drawn[camera.name][name].append(timer.pixels.get(name, 0))
    # a scene without a pass counts as 0, so the sum is divided by all scenes
    mean_ms = {c: {n: sum(v) / scenes for n, v in rows.items()} for c, rows in spent.items()}
    pixels = {c: {n: sum(v) / scenes for n, v in rows.items()} for c, rows in drawn.items()}
    return mean_ms, pixels


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=6)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--size", default="640x640")
    parser.add_argument("--quality", choices=tuple(QUALITY), default="balanced")
    parser.add_argument("--preset", default="seafront")
    parser.add_argument("--damage", type=float, help="share of scenes with damage")
    options = parser.parse_args()
    width, height = parse_size(options.size)
    values = {} if options.damage is None else {"damage": {"probability": options.damage}}
    times, pixels = measure(
        Config.from_values(values, Config.preset(options.preset)),
        (width, height),
        options.quality,
        options.scenes,
        options.repeats,
    )
    cameras = list(times)
    names = list(dict.fromkeys(name for rows in times.values() for name in rows))
    print("ms per pass (thousands of pixels)")
    print(f"{'pass':14}" + "".join(f"{c:>16}" for c in cameras) + f"{'mean':>9}")
    for name in names:
        cells = [times[c].get(name, 0.0) for c in cameras]
        counts = [pixels[c].get(name, 0.0) / 1e3 for c in cameras]
        row = "".join(f"{ms:8.2f} ({count:5.1f})" for ms, count in zip(cells, counts, strict=True))
        print(f"{name:14}{row}{statistics.fmean(cells):9.2f}")


if __name__ == "__main__":
    main()

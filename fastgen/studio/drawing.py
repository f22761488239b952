"""Rendering for the page, on one thread that owns every GL context."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.render.settings import RenderSettings
from fastgen.sample import Sample
from fastgen.sampling.scene import sample_scene

_OPEN = 3
"""Generators that are kept open. Each holds a GL context and its textures."""

_LONGEST_WAIT_S = 10.0
"""Time that `close` waits for the image in progress."""


@dataclass(frozen=True)
class Wanted:
    """One image to render.

    Attributes:
        config: Distribution of the scenes.
        seed, index: Seed and number of the scene.
        camera: Name of a camera of the scene; None for the first one.
        quality: A key of QUALITY.
        material: "all", or one of LAYERS to see a single material layer unlit.
        normals: Render the normals, too.
        background: Label the containers of the panorama, even if `config.labels` leaves them out.
    """

    config: Config
    seed: int = 0
    index: int = 0
    camera: str | None = None
    quality: str = "draft"
    material: str = "all"
    normals: bool = False
    background: bool = False


@dataclass(frozen=True)
class Drawn:
    """A rendered image.

    Attributes:
        wanted: What was requested.
        sample: The image with its labels.
        seconds: Time that sampling and rendering took, without waiting.
    """

    wanted: Wanted
    sample: Sample
    seconds: float


class Superseded(Exception):
    """A newer request took the place of one that had not started."""


_Task = tuple[Callable[[], Wanted], "Future[Drawn]"]


class Drawing:
    """Renders requested images one after another; a context manager.

    Opening a renderer takes seconds, so images of equal quality share one. It is given a sampled
    scene for each image, and its own configuration only decides what a renderer depends on.
    """

    def __init__(self, settings: RenderSettings) -> None:
        """Start the thread; nothing is opened before the first request.

        Args:
            settings: Size, backend, device and HDRI folder of all images.
        """
        self._settings = settings
        self._open: OrderedDict[tuple[str, float], Generator] = OrderedDict()
        self._waiting: OrderedDict[str, _Task] = OrderedDict()
        self._changed = threading.Condition()
        self._closed = False
        # a daemon, so that an image that takes minutes does not keep the process alive
        self._thread = threading.Thread(target=self._run, name="studio drawing", daemon=True)
        self._thread.start()

    def draw(self, side: str, wanted: Callable[[], Wanted]) -> "Future[Drawn]":
        """Queue an image.

        Args:
            side: Place on the page. A request replaces one for the same place that still waits.
            wanted: Called on the drawing thread, because checking a configuration takes a while.

        Returns:
            Future of the image. It raises Superseded, or what `wanted` or the renderer raises.
        """
        future: Future[Drawn] = Future()
        with self._changed:
            if side in self._waiting:
                _drop(self._waiting.pop(side)[1])
            self._waiting[side] = wanted, future
            self._changed.notify()
        return future

    def close(self) -> None:
        """Stop after the image in progress and free the GL contexts."""
        with self._changed:
            self._closed = True
            for _, future in self._waiting.values():
                _drop(future)
            self._changed.notify()
        self._thread.join(_LONGEST_WAIT_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _run(self) -> None:
        while (task := self._next()) is not None:
            wanted, future = task
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(self._drawn(wanted()))
            except Exception as error:  # of the request, not of this thread
                future.set_exception(error)
        for generator in self._open.values():
            generator.close()

    def _next(self) -> "_Task | None":
        """Wait for a request; return None when closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closed)
            return None if self._closed else self._waiting.popitem(last=False)[1]

    def _drawn(self, wanted: Wanted) -> Drawn:
        start = time.perf_counter()
        settings = replace(self._settings, quality=wanted.quality)
        # makes the checks of a Generator; without an open context this takes milliseconds
        checked = Generator.of(wanted.config, wanted.seed, settings)
        scene = sample_scene(checked.config, checked.seed, wanted.index, checked.environments)
        labels = checked.config.labels
        if wanted.background and labels.background == "none":
            labels = replace(labels, background="label")
        sample = self._generator(checked).render(
            camera=wanted.camera,
            scene=scene,
            layer=wanted.material,
            normals=wanted.normals,
            labels=labels,
        )
        return Drawn(wanted, sample, time.perf_counter() - start)

    def _generator(self, checked: Generator) -> Generator:
        """Return an open generator that renders as `checked` would."""
        key = checked.settings.quality, checked.config.damage.mask_threshold_mm
        if key not in self._open:
            if len(self._open) == _OPEN:
                self._open.popitem(last=False)[1].close()
            self._open[key] = checked
        self._open.move_to_end(key)
        return self._open[key]


def _drop(future: "Future[Drawn]") -> None:
    """Raise Superseded where the result of a future is awaited."""
    if future.set_running_or_notify_cancel():
        future.set_exception(Superseded())

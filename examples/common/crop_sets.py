"""Sets of marker crops from one renderer each, and the cost of rendering them."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.marker_walls import CAMERAS, crops, markers
from common.traced import Traced, display
from fastgen import Generator
from fastgen.classes import MARKER_CLASSES
from fastgen.scene import Scene


@dataclass(frozen=True, eq=False)
class CropSet:
    """Marker crops from one renderer.

    Attributes:
        pixels: uint8 [N, 24, 24, 3].
        classes: Positions in MARKER_CLASSES, int64 [N].
        scenes: Index of each crop's scene, int64 [N].
        core_s: Mean CPU seconds per image.
    """

    pixels: NDArray[np.uint8]
    classes: NDArray[np.int64]
    scenes: NDArray[np.int64]
    core_s: float

    def of(self, scenes: Sequence[int]) -> "CropSet":
        """Return only the crops of these scenes."""
        chosen = np.isin(self.scenes, scenes)
        return CropSet(self.pixels[chosen], self.classes[chosen], self.scenes[chosen], self.core_s)

    def save(self, path: Path) -> None:
        """Write an .npz file atomically."""
        aside = path.with_suffix(".part.npz")
        np.savez_compressed(aside, **asdict(self))
        aside.replace(path)

    @staticmethod
    def load(path: Path) -> "CropSet":
        """Read a file written by `save`."""
        with np.load(path) as stored:
            return CropSet(
                stored["pixels"], stored["classes"], stored["scenes"], float(stored["core_s"])
            )


def ours(generator: Generator, scenes: Iterable[Scene]) -> CropSet:
    """Render every scene through both cameras. The cost includes everything, labels too."""
    made, images = _Gathered(), 0
    began = time.process_time()
    for scene in scenes:
        for camera in CAMERAS:
            sample = generator.render(scene=scene, camera=camera)
            items = markers(sample)
            names = [item.class_name for item in items]
            made.add(crops(sample.image, items), names, scene.index)
            images += 1
    return made.done((time.process_time() - began) / max(images, 1))


def traced(generator: Generator, images: Iterable[Traced]) -> CropSet:
    """Cut Cycles images at the same boxes as ours. The cost is that of Cycles' render calls
    only."""
    made, spent = _Gathered(), []
    for image in images:
        camera = image.scene.camera(image.camera)
        items = markers(generator.render(scene=image.scene, camera=camera))
        shown = display(image.radiance, generator.exposure(image.scene, camera))
        names = [item.class_name for item in items]
        made.add(crops(shown, items), names, image.scene.index)
        spent.append(image.core_s)
    return made.done(float(np.mean(spent)))


def stored(path: Path, make: Callable[[], CropSet]) -> CropSet:
    """Return the set in `path`, and create it first if the file does not exist."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        make().save(path)
    return CropSet.load(path)


class _Gathered:
    """Collector of crops."""

    def __init__(self) -> None:
        self._pixels: list[NDArray[np.uint8]] = []
        self._classes: list[int] = []
        self._scenes: list[int] = []

    def add(self, pixels: NDArray[np.uint8], names: Sequence[str], scene: int) -> None:
        self._pixels.append(pixels)
        self._classes += [MARKER_CLASSES.index(name) for name in names]
        self._scenes += [scene] * len(names)

    def done(self, core_s: float) -> CropSet:
        classes, scenes = np.array(self._classes, np.int64), np.array(self._scenes, np.int64)
        return CropSet(np.concatenate(self._pixels), classes, scenes, core_s)

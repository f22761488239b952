"""Held-out renders from the cameras of a preset: whole images, and identifiers as they see them."""

from collections.abc import Iterable
from functools import partial
from typing import NamedTuple

import numpy as np
from aimed_cameras import place_mm, zoomed
from numpy.typing import NDArray
from panel_crops import Pixels
from rendered_crops import Text, in_processes, marker_objects, texts_of

from fastgen import Config, Generator
from fastgen.classes import MARKER_CLASSES

SIZE = (960, 540)
"""Size of whole images."""

TEXT_CAP_PX = 36.0
"""Height of capitals in the pictures of identifiers, as in crops of gate cameras."""

_TEXT_PX = 704


class View(NamedTuple):
    """Whole image with its markers.

    Attributes:
        image: RGB pixels [H, W, 3].
        boxes: Boxes of the markers that are inside the image and hardly occluded, [N, 4].
        classes: Position in MARKER_CLASSES of each box's marker, [N].
        seen: Boxes of all markers with a visible pixel, [M, 4].
    """

    image: Pixels
    boxes: NDArray[np.float64]
    classes: NDArray[np.int64]
    seen: NDArray[np.float64]


def default_views(preset: str, seed: int, scenes: range, workers: int) -> list[View]:
    """Render one image of each scene, by the cameras of a preset in turn."""
    task = partial(_views_of, preset, seed)
    return [v for part in in_processes(task, shares(scenes, workers), workers) for v in part]


def default_texts(seed: int, scenes: range, workers: int) -> list[Text]:
    """Return the identifiers that the cameras of the preset `seafront` see.

    The preset's cameras are zoomed to the identifiers, so that capitals are TEXT_CAP_PX high.
    """
    task = partial(_texts_of, seed)
    return [t for part in in_processes(task, shares(scenes, workers), workers) for t in part]


def shares(scenes: range, workers: int) -> list[range]:
    """Divide scenes into two parts per process."""
    return [each for i in range(2 * workers) if len(each := scenes[i :: 2 * workers])]


def _views_of(preset: str, seed: int, scenes: Iterable[int]) -> list[View]:
    found = []
    with Generator(Config.preset(preset), seed, SIZE) as generator:
        for index in scenes:
            cameras = generator.scene(index).cameras
            sample = generator.render(index, cameras[index % len(cameras)].name)
            pairs = [
                (MARKER_CLASSES.index(name), box)
                for name, box in marker_objects(sample)
                if box[0] >= 0 and box[1] >= 0 and min(np.array(SIZE) - box[2:]) >= 0
            ]
            boxes = np.array([box for _, box in pairs], float).reshape(-1, 4)
            classes = np.array([k for k, _ in pairs], np.int64)
            seen = [i.bbox for i in sample.objects if i.class_name in MARKER_CLASSES and i.bbox]
            every = np.array(seen, float).reshape(-1, 4)
            found.append(View(sample.image, boxes, classes, every))
    return found


def _texts_of(seed: int, scenes: Iterable[int]) -> list[Text]:
    config = Config.preset()
    found = []
    with Generator(config, seed, (_TEXT_PX, _TEXT_PX)) as generator:
        for index in scenes:
            scene = generator.scene(index)
            for name, rig in config.cameras.items():
                for decal in scene.decals:
                    if decal.class_name != "text" or decal.face != rig.face:
                        continue
                    scale = TEXT_CAP_PX / decal.cap_mm
                    camera = zoomed(scene.camera(name), place_mm(scene, decal), scale, _TEXT_PX)
                    sample = generator.render(scene=scene, camera=camera)
                    # beside others, the identifier that the camera is aimed at is the largest
                    texts = sorted(texts_of(sample), key=lambda t: -t.pixels.size)
                    found += texts[:1]
    return found

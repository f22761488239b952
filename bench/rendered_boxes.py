"""Renders of gates and yards with the visible boxes of their containers."""

from collections.abc import Iterable
from functools import partial

import numpy as np
from real_crops import BoxedImage
from rendered_crops import in_processes
from rendered_views import shares

from fastgen import Config, Generator
from fastgen.sample import Sample

PRESETS = ("gate", "yard")

_SIZE = (480, 360)
_VIEWS = 2
"""Images of a scene. The second one takes half the time of the first."""


def boxed_renders(seed: int, scenes: range, workers: int) -> list[BoxedImage]:
    """Render the scenes of each preset, by two of its cameras in turn.

    As in label files, containers in the background and hardly visible ones have boxes to ignore.

    Args:
        seed: Seed of the scenes.
        scenes: Indices of the scenes.
        workers: Processes that render.
    """
    task = partial(_boxed_of, seed)
    return [v for part in in_processes(task, shares(scenes, workers), workers) for v in part]


def _boxed_of(seed: int, scenes: Iterable[int]) -> list[BoxedImage]:
    found = []
    for preset in PRESETS:
        with Generator(Config.preset(preset), seed, _SIZE) as generator:
            for index in scenes:
                scene = generator.scene(index)
                for view in range(_VIEWS * index, _VIEWS * (index + 1)):
                    camera = scene.cameras[view % len(scene.cameras)]
                    found.append(_boxed(generator.render(scene=scene, camera=camera.name), preset))
    return found


def _boxed(sample: Sample, preset: str) -> BoxedImage:
    things = [each for each in sample.objects if each.class_name == "container" and each.bbox]
    boxes = np.array([each.bbox for each in things], float).reshape(-1, 4)
    ignored = np.array([each.ignored for each in things], bool)
    return BoxedImage(sample.image, boxes, ignored, preset)

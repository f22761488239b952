"""How often each class comes, counted on scenes alone, without GL; and weights that even it out."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from fastgen.camera.projection import View, view_of
from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.formats.door import door_number
from fastgen.generator import Generator
from fastgen.geometry.container import build_container
from fastgen.geometry.damage_law import may_be_seen
from fastgen.labels.objects import outlines_mm
from fastgen.scene import Camera, Scene
from fastgen.torch.plan import chosen_cameras
from fastgen.torch.targets import class_names
from fastgen.validation import whole


def class_counts(
    task: str,
    config: Config | None = None,
    seed: int = 0,
    size: tuple[int, int] = (640, 640),
    scenes: int = 200,
    cameras: Sequence[str] | None = None,
) -> torch.Tensor:
    """Labels of each class over the first `scenes` scenes, int64 in the order of class_names(task).

    Nothing is rendered: a marker or text counts where its outline faces the camera, covers at
    least labels.min_visible_px pixels and has its middle in the image, a damage where its face
    may be seen and its middle is in the image. What stands before it is not looked at, so that
    markers come out some percent high.
    Raises ConfigError for text, which has no classes.
    """
    names = class_names(task)
    if not names:
        raise ConfigError(f"task: {task} has no classes to count")
    scenes = whole("scenes", scenes, 1)
    config = Config.checked(config)
    chosen = chosen_cameras(task, config, cameras)
    generator = Generator(config, seed, size)
    counts = np.zeros(len(names), np.int64)
    for index in range(scenes):
        scene = generator.scene(index)
        for name in chosen:
            camera = scene.camera(name)
            if task == "door":
                counts[door_number(camera)] += 1
                continue
            counts[0] += 1  # the container, of both other tasks
            view = view_of(camera, size)
            if task == "damage":
                _count_damages(counts, scene, camera, view)
            else:
                _count_decals(counts, scene, view, config.labels.min_visible_px)
    return torch.from_numpy(counts)


def class_weights(
    task: str,
    config: Config | None = None,
    seed: int = 0,
    size: tuple[int, int] = (640, 640),
    scenes: int = 200,
    cameras: Sequence[str] | None = None,
) -> torch.Tensor:
    """Weights for a loss, float32 [classes]: labels / (classes * labels of the class).

    Over what was counted they average to 1 a label; arguments as for `class_counts`. A class that
    did not come weighs as if it had come once, and a warning names it. A loss that has a
    background as class 0 needs that weight put before them.
    """
    counts = class_counts(task, config, seed, size, scenes, cameras)
    absent = [name for name, count in zip(class_names(task), counts, strict=True) if not count]
    if absent:
        warnings.warn(
            f"class_weights: {', '.join(absent)} did not come in {scenes} scenes and weigh as if "
            "they had come once; count more scenes, or set these weights yourself",
            stacklevel=2,
        )
    return counts.sum() / (len(counts) * counts.clamp(min=1)).float()


def _count_damages(counts: NDArray[np.int64], scene: Scene, camera: Camera, view: View) -> None:
    for damage in scene.damages:
        # the rim of a bulge may show from behind its face, too little to count on
        flat = replace(damage, depth_mm=abs(damage.depth_mm))
        if may_be_seen(flat, camera.position_mm) and _inside(view, np.array(damage.origin_mm)):
            counts[SEGMENTATION_CLASSES.index(damage.kind)] += 1


def _count_decals(counts: NDArray[np.int64], scene: Scene, view: View, min_visible_px: int) -> None:
    labelled = [decal for decal in scene.decals if decal.class_name]
    if not labelled:
        return
    mesh = build_container(scene.container.kind, scene.container.profiles)
    outlines = outlines_mm(scene, mesh)
    pixels, depth = view.project(outlines)
    x, y = pixels[..., 0], pixels[..., 1]
    # y points down: an outline that runs counter-clockwise on its sheet has a negative area
    area = -0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
    seen = (depth > 0).all(axis=1) & (area >= min_visible_px) & _inside(view, outlines.mean(axis=1))
    for decal, visible in zip(labelled, seen, strict=True):
        counts[DETECTION_CLASSES.index(decal.class_name)] += bool(visible)


def _inside(view: View, points_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which world points [..., 3] lie before the camera and within its image."""
    pixels, depth = view.project(points_mm)
    return (depth > 0) & (pixels >= 0).all(axis=-1) & (pixels < view.size).all(axis=-1)

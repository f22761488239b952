"""Label counts by class from scenes alone, without rendering, and class weights for a loss."""

import warnings
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from fastgen.camera.projection import View, view_of
from fastgen.classes import ALL_SEGMENTATION_CLASSES
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.formats.door import door_number
from fastgen.generator import Generator
from fastgen.geometry.damage_law import amount_mm, faces, in_hole, is_marked
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Camera, Damage, Scene
from fastgen.torch.plan import chosen_cameras
from fastgen.torch.targets import class_names
from fastgen.validation import whole

_GRID = 12
"""Points per side of the grid on which the covered part of a damage is estimated."""


def class_counts(
    task: str,
    config: Config | None = None,
    seed: int = 0,
    size: tuple[int, int] = (640, 640),
    scenes: int = 200,
    cameras: Sequence[str] | None = None,
) -> torch.Tensor:
    """Count the labels of each class over the first scenes.

    A marker or text counts if its outline faces the camera, covers at least labels.min_visible_px
    pixels and has its center in the image. A damage counts if its face may be visible, it covers
    about labels.min_visible_px pixels or more, and its center is in the image. Occlusion is
    ignored, so counts of markers are a few percent too high.

    Args:
        task: damage, imdg or door; text has no classes.
        config: Distribution of the scenes; by default that of the preset seafront.
        seed: Seed of the scenes.
        size: (width, height) of the images in pixels.
        scenes: Number of scenes to count, 1 or more.
        cameras: Names of the cameras; None takes all that suit the task.

    Returns:
        int64 [classes], in the order of class_names(task, config).

    Raises:
        ConfigError: A value is not valid, or the task has no classes.
    """
    config = Config.checked(config)
    names = class_names(task, config)
    if not names:
        raise ConfigError(f"task: {task} has no classes to count")
    scenes = whole("scenes", scenes, 1)
    chosen = chosen_cameras(task, config, cameras)
    generator = Generator(config, seed, size)
    counts = np.zeros(len(names), np.int64)
    for index in range(scenes):
        scene = generator.scene(index)
        if not scene.container.present:
            continue
        prepared = PreparedScene(scene)
        for name in chosen:
            camera = scene.camera(name)
            if task == "door":
                counts[door_number(camera)] += 1
                continue
            counts[0] += 1  # the container, in both other tasks
            view = view_of(camera, size)
            if task == "damage":
                _count_damages(counts, scene, camera, view, config)
            else:
                _count_decals(counts, prepared, view, config)
    return torch.from_numpy(counts)


def class_weights(
    task: str,
    config: Config | None = None,
    seed: int = 0,
    size: tuple[int, int] = (640, 640),
    scenes: int = 200,
    cameras: Sequence[str] | None = None,
) -> torch.Tensor:
    """Return class weights for a loss: labels / (classes * labels of the class).

    Over the counted labels they average to 1. A class without labels gets the weight of a class
    with one label, and a warning names it. If the loss has a background class 0, put its weight in
    front.

    Args:
        task: As for `class_counts`, like all other arguments.

    Returns:
        float32 [classes].
    """
    counts = class_counts(task, config, seed, size, scenes, cameras)
    names = class_names(task, config)
    absent = [name for name, count in zip(names, counts, strict=True) if not count]
    if absent:
        warnings.warn(
            f"class_weights: {', '.join(absent)} have no label in {scenes} scenes and are weighted "
            "as if they had one; count more scenes, or set these weights yourself",
            stacklevel=2,
        )
    return counts.sum() / (len(counts) * counts.clamp(min=1)).float()


def _count_damages(
    counts: NDArray[np.int64], scene: Scene, camera: Camera, view: View, config: Config
) -> None:
    for damage in scene.damages:
        # only the rim of a bulge shows from behind its face: too little to count
        if not faces(damage, camera.position_mm):
            continue
        if not _inside(view, np.array(damage.origin_mm)):
            continue
        if (
            _covered_px(damage, view, config.damage.mask_threshold_mm)
            >= config.labels.min_visible_px
        ):
            counts[ALL_SEGMENTATION_CLASSES.index(damage.kind)] += 1


def _covered_px(damage: Damage, view: View, threshold_mm: float) -> float:
    """Return about how many pixels a damage covers, from a grid of points on its plane."""
    u, v = (half * np.linspace(-1, 1, _GRID) for half in np.array(damage.size_mm) / 2)
    offsets = u[:, None, None] * np.array(damage.along) + v[None, :, None] * np.array(damage.across)
    points_mm = np.array(damage.origin_mm) + offsets
    covered = np.abs(amount_mm(damage, points_mm)) > threshold_mm
    covered |= in_hole(damage, points_mm) | is_marked(damage, points_mm)
    pixels, _ = view.project(points_mm[[0, 0, -1, -1], [0, -1, -1, 0]])
    x, y = pixels.T
    area = 0.5 * abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    return float(area * covered.mean())


def _count_decals(
    counts: NDArray[np.int64], prepared: PreparedScene, view: View, config: Config
) -> None:
    labelled, outlines = prepared.decals.decals, prepared.decals.outlines_mm
    if not labelled:
        return
    pixels, depth = view.project(outlines)
    x, y = pixels[..., 0], pixels[..., 1]
    # y points down, so an outline that is counter-clockwise on its sheet has a negative area
    area = -0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
    seen = (
        (depth > 0).all(axis=1)
        & (area >= config.labels.min_visible_px)
        & _inside(view, outlines.mean(axis=1))
    )
    classes = config.markings.detection_classes
    for decal, visible in zip(labelled, seen, strict=True):
        counts[classes.index(decal.class_name)] += bool(visible)


def _inside(view: View, points_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether world points [..., 3] lie in front of the camera and inside its image."""
    pixels, depth = view.project(points_mm)
    return (depth > 0) & (pixels >= 0).all(axis=-1) & (pixels < view.size).all(axis=-1)

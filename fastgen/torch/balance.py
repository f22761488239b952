"""Label counts by class from scenes alone, without rendering, and class weights for a loss."""

import warnings
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
import torch

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.formats.door import door_number
from fastgen.formats.seal import SEAL_CLASSES
from fastgen.generator import Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.torch.estimates import ContainerEstimate, container_estimates
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
    """Count the labels of each class over the first scenes.

    All containers of a scene count, with what they carry. A container, damage, marker or text
    counts if an estimate of its visible pixels is within the limits of labels.min_visible_px and
    labels.min_visible_fraction.

    A hasp of the first container counts if its crop is estimated to be inside the image, large
    and not hidden. For door, each image counts once, by the end that its camera looks at.

    Occlusion is approximate: containers hide each other as boxes, and spreader, vehicles, door
    gear, and corrugation hide nothing. Containers of the panorama are not counted, although
    `labels.background: label` gives them targets.

    Args:
        task: damage, imdg, door or seal; text has no classes.
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
            estimates = container_estimates(prepared, camera, size, config)
            # only hasps of the first container get crops
            for estimate in islice(estimates, 1) if task == "seal" else estimates:
                for label in _labels(task, estimate):
                    counts[names.index(label)] += 1
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


def _labels(task: str, estimate: ContainerEstimate) -> Iterator[str]:
    """Yield the class name of each label of one container in one image."""
    if task == "seal":
        yield from (SEAL_CLASSES[sealed] for sealed in estimate.hasps())
        return
    if estimate.container():
        yield "container"
    if task == "damage":
        yield from (damage.kind for damage in estimate.damages())
    else:
        yield from (decal.class_name for decal in estimate.decals())

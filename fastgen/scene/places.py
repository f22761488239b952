"""Checks of the places of containers, props and the ground in a scene."""

from collections.abc import Sequence

from fastgen.errors import ConfigError
from fastgen.scene.boxes import (
    OrientedBox,
    container_box,
    overlap,
    prop_box,
    spreader_box,
)
from fastgen.scene.data import Pose, Prop, Scene

_SUNK_MM = 1.0
"""Depth below the ground that counts as standing on it."""


def container_boxes(scene: Scene) -> list[OrientedBox]:
    """Return the outer box of each container in the world, the first one's first."""
    boxes = [container_box(scene.container.kind, Pose())]
    return boxes + [container_box(each.container.kind, each.pose) for each in scene.neighbours]


def container_names(scene: Scene) -> list[str]:
    """Return what errors call each container, in the order of `container_boxes`."""
    return ["the container", *(f"neighbours[{i}]" for i in range(len(scene.neighbours)))]


def check_places(scene: Scene) -> None:
    """Check that containers and props do not overlap, and that all are above the ground.

    Raises:
        ConfigError: naming the first neighbour or prop that is misplaced.
    """
    if scene.neighbours and not scene.container.present:
        raise ConfigError(
            "scene.neighbours: the scene has no container of its own (container.present: false); "
            "remove them"
        )
    boxes, names = container_boxes(scene), container_names(scene)
    for i, neighbour in enumerate(scene.neighbours):
        path = f"scene.neighbours[{i}]"
        if not neighbour.container.present:
            raise ConfigError(f"{path}.container.present: false; remove the neighbour")
        box = boxes[i + 1]
        _check_apart(box, path, boxes[: i + 1], names[: i + 1])
        if scene.spreader.present and overlap(box, spreader_box(scene.container.kind)):
            raise ConfigError(
                f"{path}.pose: is above the container, where its spreader hangs; move it away, or "
                "set scene.spreader.present to false"
            )
        lowest = neighbour.pose.position_mm[2]
        if scene.ground is not None and lowest < scene.ground.height_mm - _SUNK_MM:
            raise ConfigError(
                f"{path}.pose.position_mm: height {lowest:g} is below the ground, whose height_mm "
                f"is {scene.ground.height_mm:g}; raise it"
            )
    for i, prop in enumerate(scene.props):
        path = f"scene.props[{i}]"
        _check_prop(prop, path, scene, boxes)
        _check_apart(prop_box(prop), path, boxes, names)


def _check_apart(
    box: OrientedBox, path: str, others: Sequence[OrientedBox], names: Sequence[str]
) -> None:
    for other, name in zip(others, names, strict=True):
        if overlap(box, other):
            raise ConfigError(f"{path}.pose: overlaps {name}; move it away")


def _check_prop(prop: Prop, path: str, scene: Scene, boxes: list[OrientedBox]) -> None:
    if scene.ground is None:
        raise ConfigError(f"{path}: a prop needs scene.ground, which is null; give a Ground")
    if prop.shape == "cylinder" and prop.size_mm[0] != prop.size_mm[2]:
        raise ConfigError(
            f"{path}.size_mm: x and z are the diameter of a cylinder, but {prop.size_mm[0]:g} and "
            f"{prop.size_mm[2]:g} differ; make them equal"
        )
    box = prop_box(prop)
    lowest, top = box.center_mm[2] - box.half_mm[2], box.center_mm[2] + box.half_mm[2]
    if lowest < scene.ground.height_mm - _SUNK_MM:
        raise ConfigError(
            f"{path}.pose.position_mm: the prop reaches down to {lowest:g}, below the ground, "
            f"whose height_mm is {scene.ground.height_mm:g}; raise it"
        )
    highest = max(each.center_mm[2] - each.half_mm[2] for each in boxes)
    if top > highest + _SUNK_MM:
        raise ConfigError(
            f"{path}.pose.position_mm: the prop reaches up to {top:g}, "
            f"above the undersides of all containers; props are below {highest:g}, lower it"
        )

"""Arguments of a batch of images: one scene and one camera for each image."""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

from fastgen.errors import ConfigError, shown
from fastgen.scene import Camera, Scene
from fastgen.validation import whole


@dataclass(frozen=True)
class BatchItem:
    """The arguments of `Generator.render` for one image of a batch.

    Attributes:
        number: Position of the image in the batch.
        index: Number of the scene; None if the scene is given.
        camera: Name of a camera, or a Camera; None for the first camera of the scene.
        scene: The scene; None if its number is given.
    """

    number: int
    index: int | None
    camera: str | Camera | None
    scene: Scene | None

    @property
    def key(self) -> Hashable:
        """Key that is equal for images of one scene."""
        return id(self.scene) if self.index is None else self.index


def items_of(indices: Any, cameras: Any, scenes: Any) -> list[BatchItem]:
    """Return the images of a batch, those of one scene one after the other.

    Scenes come in the order of their first images.

    Args:
        indices: Number of the scene of each image; None if `scenes` are given.
        cameras: Camera of each image, or one for all images, or None.
        scenes: Scene of each image; None if `indices` are given.

    Raises:
        ConfigError: An argument has the wrong type or length, or both or none of indices and scenes
            are given.
    """
    if (indices is None) == (scenes is None):
        raise ConfigError("render_batch: give either indices or scenes")
    if scenes is None:
        listed = _listed("indices", indices)
        numbers = [whole(f"indices[{k}]", each) for k, each in enumerate(listed)]
        chosen: list[tuple[int | None, Scene | None]] = [(each, None) for each in numbers]
    else:
        chosen = [(None, each) for each in _listed("scenes", scenes)]
    count = len(chosen)
    if cameras is None or isinstance(cameras, (str, Camera)):
        cameras = [cameras] * count
    else:
        cameras = _listed("cameras", cameras)
    if len(cameras) != count:
        raise ConfigError(
            f"cameras: {len(cameras)} for {count} images; give one for each image, or one for all"
        )
    items = [
        BatchItem(k, index, camera, scene)
        for k, ((index, scene), camera) in enumerate(zip(chosen, cameras, strict=True))
    ]
    first: dict[Hashable, int] = {}
    for item in items:
        first.setdefault(item.key, item.number)
    return sorted(items, key=lambda item: first[item.key])


def _listed(name: str, values: Any) -> list[Any]:
    try:
        if isinstance(values, (str, bytes)):
            raise TypeError
        return list(values)
    except TypeError:
        message = f"{name}: {shown(values)} is not a list; give one for each image"
        raise ConfigError(message) from None

"""Image and target tensors for each task of the paper, and collate functions.

The same functions as in label files decide what is labelled: formats.damage.instances,
yolo.detections, text_crops and door_class.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.config.config import Config, LabelConfig
from fastgen.errors import ConfigError
from fastgen.formats import yolo
from fastgen.formats.damage import instances
from fastgen.formats.door import DOOR_CLASSES, door_number
from fastgen.formats.seal import SEAL_CLASSES
from fastgen.labels.background import background_masks
from fastgen.labels.crops import crop_box, text_crops
from fastgen.labels.hasp_crops import hasp_crops
from fastgen.labels.visibility import window
from fastgen.sample import Box, Object, Sample
from fastgen.validation import check_known, flag

Item = tuple[Any, Any]
"""Image and target of one sample; `item_of` describes both for each task and form."""

Collate = Callable[[Sequence[Item]], Any]


_NAMES: dict[str, tuple[str, ...]] = {
    "damage": SEGMENTATION_CLASSES,
    "imdg": DETECTION_CLASSES,
    "text": (),
    "door": DOOR_CLASSES,
    "seal": SEAL_CLASSES,
}

FORMS = ("detection", "yolo")


@dataclass(frozen=True)
class ItemSettings:
    """Content of an item of a dataset.

    Attributes:
        form: Form of box targets: "detection" for torchvision's dictionaries, "yolo" for rows of
            class and normalized box.
        as_float: Images are float32 in 0..1 instead of uint8.
        transforms: Called with image and target as `item_of` makes them. Returns both, changed.
            With `pairs` it gets a tuple of two images and a tuple of their targets.
        pairs: For the damage task: an item is an image and its counterpart without damages, from
            the same camera in the same light. A scene without damages gives two equal images.

    Raises:
        ConfigError: A value is not valid.
    """

    form: str = FORMS[0]
    as_float: bool = False
    transforms: Callable[[Any, Any], Item] | None = None
    pairs: bool = False

    def __post_init__(self) -> None:
        """Check the values, and turn booleans of NumPy into Python's."""
        check_known("form", self.form, FORMS)
        for name in ("as_float", "pairs"):
            object.__setattr__(self, name, flag(name, getattr(self, name)))
        if not (self.transforms is None or callable(self.transforms)):
            raise ConfigError(
                f"transforms: {self.transforms!r} is not a function of image and target"
            )


def class_names(task: str, config: Config | None = None) -> tuple[str, ...]:
    """Return the class names of a task in label order; none for text.

    Labels of the detection form are 1 higher, because 0 is the background.

    Args:
        task: damage, imdg, text, door or seal.
        config: Configuration of the dataset. With `markings.marks` the imdg task has five more
            classes, and with kinds after `perforation` in `damage.kinds` the damage task has
            more. None stands for a configuration without either.

    Raises:
        ConfigError: The task is unknown.
    """
    check_known("task", task, _NAMES)
    if task == "imdg" and config is not None:
        return config.markings.detection_classes
    if task == "damage" and config is not None:
        return config.damage.segmentation_classes
    return _NAMES[task]


def check_items(task: str, items: ItemSettings) -> None:
    """Raise ConfigError if a task does not support the form or pairs."""
    if items.form == "yolo" and task not in ("damage", "imdg"):
        raise ConfigError(f"form: 'yolo' is for boxes, and the {task} task has none; leave it out")
    if items.pairs and task != "damage":
        raise ConfigError(f"pairs: the {task} task does not look for damages; leave it out")


def image_tensor(pixels: NDArray[np.uint8], as_float: bool = False) -> torch.Tensor:
    """Copy an sRGB image, uint8 [H, W, 3], to a tensor [3, H, W]: uint8, or float32 in 0..1."""
    image = torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))
    return image.float() / 255 if as_float else image


def item_of(
    sample: Sample, task: str, items: ItemSettings, labels: LabelConfig, image_id: int
) -> Item:
    """Make image and target of one sample.

    Args:
        sample: The sample.
        task: damage, imdg, text, door or seal.
        items: Form of the target and dtype of the image; transforms are not applied.
        labels: Decides which texts are legible.
        image_id: Number of the image, for evaluation.

    Returns:
        For damage and imdg, image [3, H, W] and a target in torchvision's detection form: a dict of
        boxes (float32 [N, 4], x0, y0, x1, y1 in pixels), labels (int64 [N] from 1; 0 is the
        background), area (float32 [N], visible pixels), iscrowd (int64 [N], zeros), image_id (int)
        and, for damage, masks (uint8 [N, H, W]). In the form "yolo" the target is float32 [N, 5]:
        class from 0, then center x, center y, width and height as fractions of the image.

        For text, a list of crops [3, h, w], and a dict of texts (list of str), boxes (float32
        [N, 4] of the visible texts), parts and image_id. `parts` has a list for each crop, with
        (role, text, quad) of each part of the identifier in reading order. The roles are 'owner',
        'serial', 'check' and 'type'. The quad is float32 [4, 2]: x and y in pixels of the crop,
        clockwise from the upper left corner of the letters.

        For door, image [3, H, W] and an int, the index in DOOR_CLASSES.

        For seal, a list of crops [3, h, w] of the door's hasps, and a dict of labels (int64 [N],
        indices in SEAL_CLASSES), hasps (int64 [N], as in Seal.hasp) and image_id.
    """
    as_float = items.as_float
    if task == "text":
        return _text_item(sample, labels, image_id, as_float)
    if task == "seal":
        return _seal_item(sample, image_id, as_float)
    image = image_tensor(sample.image, as_float)
    if task == "door":
        if not sample.scene.container.present:  # a curriculum may have set container.absent
            raise ConfigError(
                f"scene {sample.scene.index}: has no container, so it has no class for the door "
                "task; set container.absent to 0"
            )
        return image, door_number(sample.camera)
    found = _damages(sample) if task == "damage" else _markers(sample)
    if items.form == "yolo":
        size = sample.view.size
        rows = [(index, *yolo.normalised(box, size)) for index, box, _, _ in found]
        return image, torch.tensor(rows, dtype=torch.float32).reshape(-1, 5)
    target = {
        "boxes": _boxes([box for _, box, _, _ in found]),
        "labels": torch.tensor([index + 1 for index, _, _, _ in found], dtype=torch.int64),
        "area": torch.tensor([area for _, _, area, _ in found], dtype=torch.float32),
        "iscrowd": torch.zeros(len(found), dtype=torch.int64),
        "image_id": image_id,
    }
    if task == "damage":
        masks = np.array([mask for _, _, _, mask in found], np.uint8)
        target["masks"] = torch.from_numpy(masks.reshape(-1, *sample.damage.shape))
    return image, target


def collate_lists(batch: Sequence[Item]) -> tuple[list[Any], list[Any]]:
    """Collate to a list of images and a list of targets, as torchvision's detectors take them."""
    return [image for image, _ in batch], [target for _, target in batch]


def collate_yolo(batch: Sequence[Item]) -> tuple[torch.Tensor, torch.Tensor]:
    """Collate to images [B, 3, H, W] and rows float32 [M, 6] that begin with the image index."""
    rows = [
        torch.cat([torch.full((len(target), 1), float(number)), target], dim=1)
        for number, (_, target) in enumerate(batch)
    ]
    return torch.stack([image for image, _ in batch]), torch.cat(rows)


def collate_text(batch: Sequence[Item]) -> tuple[list[torch.Tensor], list[str]]:
    """Collate to all crops of the images, [3, h, w] of different sizes, and the text of each."""
    crops = [crop for image, _ in batch for crop in image]
    return crops, [text for _, target in batch for text in target["texts"]]


def collate_door(batch: Sequence[Item]) -> tuple[torch.Tensor, torch.Tensor]:
    """Collate to images [B, 3, H, W] and labels int64 [B]."""
    labels = torch.tensor([target for _, target in batch], dtype=torch.int64)
    return torch.stack([image for image, _ in batch]), labels


def collate_seal(batch: Sequence[Item]) -> tuple[list[torch.Tensor], torch.Tensor]:
    """Collate to all crops of the images, [3, h, w] of different sizes, and labels int64 [N]."""
    crops = [crop for image, _ in batch for crop in image]
    return crops, torch.cat([target["labels"] for _, target in batch])


def collate_pairs(collate: Collate, batch: Sequence[Item]) -> Any:
    """Collate pairs as if all their images were items, each damaged one before its counterpart.

    Args:
        collate: Collates single items.
        batch: Pairs of images, each with the pair of their targets.
    """
    pairs = (zip(images, targets, strict=True) for images, targets in batch)
    return collate(list(chain.from_iterable(pairs)))


def collate_of(task: str, items: ItemSettings) -> Collate:
    """Return the collate function for the items of a task."""
    own: dict[str, Collate] = {"text": collate_text, "door": collate_door, "seal": collate_seal}
    single = collate_yolo if items.form == "yolo" else own.get(task, collate_lists)
    return partial(collate_pairs, single) if items.pairs else single


_Found = tuple[int, Box, int, NDArray[np.bool_] | None]


def _damages(sample: Sample) -> list[_Found]:
    """Return class from 0, box, visible pixels and mask of each container and each damage."""
    found: list[_Found] = [
        (value // 100 - 1, box, int(np.count_nonzero(mask)), mask)
        for value, box, mask, ignored in instances(sample)
        if not ignored
    ]
    for thing, box, part in background_masks(sample):
        if not thing.ignored:
            mask = np.zeros(sample.damage.shape, bool)
            window(mask, box)[:] = part
            found.append((0, box, thing.area, mask))
    return found


def _markers(sample: Sample) -> list[_Found]:
    """Return class from 0, box and visible pixels of each label of the marker task."""
    found = yolo.detections(sample.objects, sample.marker_classes)
    return [(index, box, thing.area, None) for index, thing, box in found]


def _text_item(sample: Sample, labels: LabelConfig, image_id: int, as_float: bool) -> Item:
    found = list(text_crops(sample, labels.min_text_px))
    target = {
        "texts": [thing.text for thing, _ in found],
        "boxes": _boxes([thing.bbox for thing, _ in found if thing.bbox]),
        "parts": [_parts_in_crop(thing, sample.view.size) for thing, _ in found],
        "image_id": image_id,
    }
    return [image_tensor(pixels, as_float) for _, pixels in found], target


def _parts_in_crop(thing: Object, size: tuple[int, int]) -> list[tuple[str, str, torch.Tensor]]:
    """Return role, text and quad of each part of a text, in pixels of its crop."""
    assert thing.bbox is not None
    origin = torch.tensor(crop_box(thing.bbox, size)[:2])
    return [
        (part.role, part.text, torch.tensor(part.quad).reshape(4, 2) - origin)
        for part in thing.parts
    ]


def _seal_item(sample: Sample, image_id: int, as_float: bool) -> Item:
    found = list(hasp_crops(sample))
    target = {
        "labels": torch.tensor([int(crop.sealed) for crop in found], dtype=torch.int64),
        "hasps": torch.tensor([crop.hasp for crop in found], dtype=torch.int64),
        "image_id": image_id,
    }
    return [image_tensor(crop.pixels, as_float) for crop in found], target


def _boxes(boxes: list[Box]) -> torch.Tensor:
    return torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4)

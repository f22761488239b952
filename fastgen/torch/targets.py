"""Sample -> image and target tensors for each task of the paper, and their collate functions.

What is labelled at all is decided where the files are written: formats.damage.instances,
yolo.detections, text_crops and door_class.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.config.config import LabelConfig
from fastgen.errors import ConfigError
from fastgen.formats import yolo
from fastgen.formats.damage import instances
from fastgen.formats.door import DOOR_CLASSES, door_number
from fastgen.labels.crops import text_crops
from fastgen.sample import Box, Sample
from fastgen.validation import check_known

Item = tuple[Any, Any]
"""(image, target) of one sample; what each holds depends on task and form, see `item_of`."""

Collate = Callable[[Sequence[Item]], Any]


_NAMES: dict[str, tuple[str, ...]] = {
    "damage": SEGMENTATION_CLASSES,
    "imdg": DETECTION_CLASSES,
    "text": (),
    "door": DOOR_CLASSES,
}

FORMS = ("detection", "yolo")


def class_names(task: str) -> tuple[str, ...]:
    """Classes of a task in label order; none for text. Detection labels count them from 1.

    Raises ConfigError for an unknown task.
    """
    check_known("task", task, _NAMES)
    return _NAMES[task]


def check_form(task: str, form: str) -> None:
    """Raise ConfigError where `form` is unknown or means nothing to `task`."""
    check_known("form", form, FORMS)
    if form == "yolo" and task not in ("damage", "imdg"):
        raise ConfigError(f"form: 'yolo' holds boxes, which the {task} task has not; leave it out")


def image_tensor(pixels: NDArray[np.uint8], as_float: bool = False) -> torch.Tensor:
    """sRGB uint8 [H, W, 3] as a tensor [3, H, W] of its own: uint8, or float32 in 0..1."""
    image = torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))
    return image.float() / 255 if as_float else image


def item_of(
    sample: Sample, task: str, form: str, labels: LabelConfig, image_id: int, as_float: bool
) -> Item:
    """Image and target of one sample.

    damage, imdg: image [3, H, W]; target in torchvision's detection form, a dict of boxes
    (float32 [N, 4], x0, y0, x1, y1 in pixels), labels (int64 [N], from 1: 0 is the background),
    area (float32 [N], visible pixels), iscrowd (int64 [N], zeros), image_id (int) and, for damage,
    masks (uint8 [N, H, W]); or in form 'yolo' float32 [N, 5]: class from 0, then centre x, y,
    width and height as shares of the image.
    text: a list of crops [3, h, w]; target a dict of texts (list of str), boxes (float32 [N, 4] of
    the visible texts) and image_id.
    door: image [3, H, W]; target an int, which of DOOR_CLASSES.
    """
    if task == "text":
        return _text_item(sample, labels, image_id, as_float)
    image = image_tensor(sample.image, as_float)
    if task == "door":
        return image, door_number(sample.camera)
    found = _damages(sample) if task == "damage" else _markers(sample)
    if form == "yolo":
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
    """Images and targets as two lists, as torchvision's detectors take them."""
    return [image for image, _ in batch], [target for _, target in batch]


def collate_yolo(batch: Sequence[Item]) -> tuple[torch.Tensor, torch.Tensor]:
    """Images [B, 3, H, W], and targets float32 [M, 6]: number in the batch, then `item_of`'s."""
    rows = [
        torch.cat([torch.full((len(target), 1), float(number)), target], dim=1)
        for number, (_, target) in enumerate(batch)
    ]
    return torch.stack([image for image, _ in batch]), torch.cat(rows)


def collate_text(batch: Sequence[Item]) -> tuple[list[torch.Tensor], list[str]]:
    """All crops of the batch's images, [3, h, w] of differing sizes, and what each reads."""
    crops = [crop for image, _ in batch for crop in image]
    return crops, [text for _, target in batch for text in target["texts"]]


def collate_door(batch: Sequence[Item]) -> tuple[torch.Tensor, torch.Tensor]:
    """Images [B, 3, H, W] and labels int64 [B]."""
    labels = torch.tensor([target for _, target in batch], dtype=torch.int64)
    return torch.stack([image for image, _ in batch]), labels


def collate_of(task: str, form: str) -> Collate:
    """The collate function that fits a task's items."""
    if form == "yolo":
        return collate_yolo
    return {"text": collate_text, "door": collate_door}.get(task, collate_lists)


_Found = tuple[int, Box, int, NDArray[np.bool_] | None]


def _damages(sample: Sample) -> list[_Found]:
    """Class from 0, box, visible pixels and mask of the container and each damage."""
    return [
        (category - 1, box, int(np.count_nonzero(mask)), mask)
        for category, box, mask, ignored in instances(sample)
        if not ignored
    ]


def _markers(sample: Sample) -> list[_Found]:
    """Class from 0, box and visible pixels of what the marker task labels."""
    found = yolo.detections(sample.objects)
    return [(index, box, thing.area, None) for index, thing, box in found]


def _text_item(sample: Sample, labels: LabelConfig, image_id: int, as_float: bool) -> Item:
    found = list(text_crops(sample, labels.min_text_px))
    target = {
        "texts": [thing.text for thing, _ in found],
        "boxes": _boxes([thing.bbox for thing, _ in found if thing.bbox]),
        "image_id": image_id,
    }
    return [image_tensor(pixels, as_float) for _, pixels in found], target


def _boxes(boxes: list[Box]) -> torch.Tensor:
    return torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4)

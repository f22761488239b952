"""Training images: rendered once and cached as JPEG, or rendered anew for every pass."""

import hashlib
import json
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
import torch
from torch.utils.data import DataLoader, Dataset

import fastgen
from fastgen.files.images import jpeg
from fastgen.torch import ContainerDataset, Loader, collate_lists
from fastgen.torch.targets import collate_pairs

Batch = tuple[list[torch.Tensor], list[Any]]
"""Images, uint8 [3, H, W] each, and one target per image."""

_REPORT_S = 30.0


class Kept(Dataset[Any]):
    """Items made by `rendered`: an image uint8 [3, H, W] and the dataset's target.

    A text item is one crop with a dict of its text and parts. A seal item is one crop with a dict
    of its label, hasp and image_id. A pair is two images and two targets.
    """

    def __init__(self, items: list[Any]) -> None:
        self._items = items

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, position: int) -> tuple[Any, Any]:
        item = self._items[position]
        if isinstance(item, dict):
            return _unpacked(item)
        images, targets = zip(*map(_unpacked, item), strict=True)
        return images, targets

    @property
    def collate(self) -> Any:
        """Function that collates items to lists of images and targets."""
        paired = bool(self._items) and isinstance(self._items[0], list)
        return partial(collate_pairs, collate_lists) if paired else collate_lists

    def with_more(self, other: "Kept") -> "Kept":
        """Return these items followed by those of another."""
        return Kept(self._items + other._items)


def rendered(data: ContainerDataset, folder: Path) -> Kept:
    """Return all items of `data` in its current epoch, from a file in `folder` if there is one.

    The name of the file is a hash of everything that affects the items, so stale files are not
    used.
    """
    paired = data.items.pairs
    inputs = json.dumps([fastgen.__version__, data.epoch, data.description, paired], sort_keys=True)
    path = folder / f"{data.task}_{hashlib.sha256(inputs.encode()).hexdigest()[:12]}.pt"
    if path.exists():
        return Kept(torch.load(path, weights_only=True))
    folder.mkdir(parents=True, exist_ok=True)
    items: list[Any] = []
    start = reported = time.perf_counter()
    for position in range(len(data)):
        image, target = data[position]
        if data.task == "text":
            pairs = zip(*collate_texts([(image, target)]), strict=True)
            items += [{"jpeg": _jpeg(crop), "target": fact} for crop, fact in pairs]
        elif data.task == "seal":
            facts = zip(target["labels"].tolist(), target["hasps"].tolist(), strict=True)
            for crop, (label, hasp) in zip(image, facts, strict=True):
                fact = {"label": label, "hasp": hasp, "image_id": target["image_id"]}
                items.append({"jpeg": _jpeg(crop), "target": fact})
        elif paired:
            items.append([_packed(*each) for each in zip(image, target, strict=True)])
        else:
            items.append(_packed(image, target))
        if (now := time.perf_counter()) - reported > _REPORT_S:
            reported = now
            rate = (position + 1) / (now - start)
            print(f"{data.task}: {position + 1} of {len(data)} images, {rate:.1f}/s", flush=True)
    data.close()
    aside = path.with_suffix(".part")
    torch.save(items, aside)
    aside.rename(path)
    return Kept(items)


class Feed:
    """Batches of lists, one pass at a time, in an order that depends on the seed and the pass.

    Args:
        source: Items with a length, or a ContainerDataset that renders new scenes for every pass.
        batch: Items per batch.
        seed: Seed of the order.
        workers: Processes that render. Other items are read in this process.
        mirror: Mirror a random half of the batches. Targets must have the loader's detection form.
    """

    def __init__(
        self,
        source: Kept | ContainerDataset,
        batch: int,
        seed: int,
        workers: int = 0,
        mirror: bool = False,
    ) -> None:
        self._order = torch.Generator()
        self._seed, self._mirror = seed, mirror
        self._loader: Any
        if isinstance(source, ContainerDataset):
            options: dict[str, Any] = {"num_workers": workers}
            if workers:
                # a process that uses CUDA or OpenGL must not be forked
                options |= {"persistent_workers": True, "multiprocessing_context": "spawn"}
            collate = _COLLATES.get(source.task)
            self._loader = Loader(source, batch, shuffle=True, collate_fn=collate, **options)
        else:
            self._loader = DataLoader(
                source, batch, shuffle=True, collate_fn=source.collate, generator=self._order
            )

    def __len__(self) -> int:
        return len(self._loader)

    def passed(self, number: int) -> Iterator[Batch]:
        """Return the batches of pass `number`, counted from 0."""
        self._order.manual_seed(self._seed + number)
        if isinstance(self._loader, Loader):
            self._loader.set_epoch(number)
        for images, targets in self._loader:
            if self._mirror and torch.rand((), generator=self._order) < 0.5:
                yield mirrored(images, targets)
            else:
                yield images, targets


def mirrored(images: Sequence[torch.Tensor], targets: Sequence[dict[str, Any]]) -> Batch:
    """Mirror images, uint8 [3, H, W] each, and their boxes and masks at the vertical axis."""
    found = []
    for image, target in zip(images, targets, strict=True):
        x0, y0, x1, y1 = target["boxes"].T
        width = image.shape[2]
        one = {**target, "boxes": torch.stack([width - x1, y0, width - x0, y1], dim=1)}
        if "masks" in target:
            one["masks"] = target["masks"].flip(2)
        found.append(one)
    return [image.flip(2) for image in images], found


def collate_texts(batch: Sequence[Any]) -> Batch:
    """Collate text items to all crops of the images, and a dict of text and parts for each."""
    crops = [crop for image, _ in batch for crop in image]
    facts = [
        {"text": text, "parts": parts}
        for _, target in batch
        for text, parts in zip(target["texts"], target["parts"], strict=True)
    ]
    return crops, facts


_COLLATES: dict[str, Any] = {"text": collate_texts, "door": collate_lists}
"""Collate functions by task; others use the dataset's own."""


def in_order(source: Kept, batch: int) -> Iterator[Batch]:
    """Return batches of the items in their order, each item once."""
    return iter(DataLoader(source, batch, collate_fn=source.collate))


def _jpeg(image: torch.Tensor) -> torch.Tensor:
    data = jpeg(image.permute(1, 2, 0).numpy())
    return torch.frombuffer(bytearray(data), dtype=torch.uint8)


def _packed(image: torch.Tensor, target: Any) -> dict[str, Any]:
    """Return a JPEG file of an image, and its target with masks as bits."""
    if isinstance(target, dict) and "masks" in target:
        masks = target["masks"].numpy()
        bits = np.packbits(masks.reshape(len(masks), -1), axis=1)
        target = {**target, "masks": torch.from_numpy(bits)}
    return {"jpeg": _jpeg(image), "target": target}


def _unpacked(item: dict[str, Any]) -> tuple[torch.Tensor, Any]:
    """Return the image and the target that `_packed` stored."""
    pixels = simplejpeg.decode_jpeg(item["jpeg"].numpy().tobytes())
    target = item["target"]
    if isinstance(target, dict) and "masks" in target:
        height, width = pixels.shape[:2]
        masks = np.unpackbits(target["masks"].numpy(), axis=1, count=height * width)
        target = {**target, "masks": torch.from_numpy(masks.reshape(-1, height, width))}
    return torch.from_numpy(pixels.transpose(2, 0, 1).copy()), target

"""A small anchor-free detector: a heat map of centres, the four sides of a box, and masks.

Centres and their Gaussians follow CenterNet (Zhou et al. 2019). Boxes are trained over the Gaussian
like in TTFNet (Liu et al. 2020). The first class spans the image and contains the others, so boxes
have two groups: the first class, and all others. An instance's mask is the mask of its class inside
its box.
"""

import itertools
import math
from typing import Any

import torch
from torch import nn
from torch.nn import functional

from common.boxes import generalized_iou, iou
from common.run import Learner

STRIDE = 4
"""Image pixels per cell of the maps. The sides of an image must be multiples of 64."""

_SPREAD = 0.09  # Gaussian's sigma per side of the box; TTFNet's alpha 0.54, over 6
_LEAST_SPREAD = 0.3  # cells
_RARE = 0.01  # initial heat of the maps
_BOX_WEIGHT = 5.0
_MASK_WEIGHT = 2.0
_RARE_MASK_WEIGHT = 4.0  # weight of pixels in classes after the first, which cover little
_LONGEST_LOG = 6.5  # limit of the logarithm of a side's distance in cells
_CANDIDATES = 100
_LEAST_SCORE = 0.01
_SAME_THING = 0.6  # IoU above which two boxes of a class show the same object


def _conv(before: int, after: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(before, after, 3, stride, 1, bias=False), nn.BatchNorm2d(after), nn.ReLU()
    )


class _Residual(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.body = nn.Sequential(_conv(width, width), _conv(width, width))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        changed: torch.Tensor = x + self.body(x)
        return changed


class Detector(Learner):
    """The detector network.

    Args:
        classes: Number of classes, the container first.
        width: Channels at stride 4.
        blocks: Residual blocks at each coarser level.
        masks: Predict masks, too.
    """

    def __init__(self, classes: int, width: int = 32, blocks: int = 1, masks: bool = False) -> None:
        super().__init__()
        self.classes, self.masks = classes, masks
        # down to a stride of 64, where a cell sees 670 pixels: a container may fill the image
        widths = [width, 2 * width, 3 * width, 4 * width, 4 * width]
        self.stem = nn.Sequential(_conv(3, width // 2, 2), _conv(width // 2, width, 2))
        levels, sides = [], [nn.Conv2d(width, width, 1)]
        for before, after in itertools.pairwise(widths):
            body = [_Residual(after) for _ in range(blocks)]
            levels.append(nn.Sequential(_conv(before, after, 2), *body))
            sides.append(nn.Conv2d(after, width, 1))
        self.levels, self.sides = nn.ModuleList(levels), nn.ModuleList(sides)
        self.fuse = _conv(width, width * 3 // 2)
        self.heat = nn.Conv2d(width * 3 // 2, classes, 1)
        self.box = nn.Conv2d(width * 3 // 2, 8, 1)
        self.mask = nn.Conv2d(width * 3 // 2, classes, 1) if masks else None
        assert self.heat.bias is not None
        nn.init.constant_(self.heat.bias, -math.log(1 / _RARE - 1))
        nn.utils.convert_conv2d_weight_memory_format(self, torch.channels_last)

    def forward(self, pixels: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Run the network on images float32 [B, 3, H, W] in -1..1.

        Where the processor is fast at bfloat16, all layers except the output layers compute in
        it. On a CPU with AVX512-BF16, a training step then takes a third of the time.

        Returns:
            Float32 maps at a quarter of the image size: heat logits [B, classes, h, w], logarithms
            of the distances to the four sides in cells for both groups [B, 2, 4, h, w], and mask
            logits [B, classes, h, w] if the detector has masks.
        """
        with torch.autocast(pixels.device.type, torch.bfloat16, enabled=_fast_bfloat16(pixels)):
            x = self.stem(pixels.contiguous(memory_format=torch.channels_last))
            seen = [x]
            for level in self.levels:
                seen.append(x := level(x))
            merged = self.sides[-1](seen[-1])
            for finer, side in zip(seen[-2::-1], list(self.sides)[-2::-1], strict=True):
                merged = side(finer) + functional.interpolate(merged, scale_factor=2.0)
            features = self.fuse(functional.relu(merged))
        features = features.float()  # peaks of heat would tie in bfloat16
        maps = [self.heat(features), self.box(features).unflatten(1, (2, 4))]
        return (*maps, self.mask(features)) if self.mask is not None else tuple(maps)

    def loss(self, images: list[torch.Tensor], targets: list[dict[str, Any]]) -> torch.Tensor:
        """Return the loss: focal (heat), GIoU (boxes), cross entropy and Dice (masks).

        Args:
            images: uint8 [3, H, W] each.
            targets: Labels in the loader's detection form. Boxes with `iscrowd` are regions to
                ignore: heat inside them is not punished.
        """
        maps = self(self._pixels(images))
        heat, box = maps[0], maps[1]
        total: torch.Tensor = heat.new_zeros(())
        count = max(sum(int((t["iscrowd"] == 0).sum()) for t in targets), 1)
        for number, target in enumerate(targets):
            crowd = target["iscrowd"] > 0
            boxes = target["boxes"][~crowd].to(heat.device)
            classes = target["labels"][~crowd].to(heat.device) - 1
            ignored = target["boxes"][crowd].to(heat.device)
            bells = gaussians(boxes, heat.shape[2:])
            wanted = torch.zeros_like(heat[number])
            for k in range(len(boxes)):
                wanted[classes[k]] = torch.maximum(wanted[classes[k]], bells[k])
            free = ~_covered(ignored, heat.shape[2:])
            total = total + _focal(heat[number], wanted, free) / count
            for group, chosen in enumerate((classes == 0, classes > 0)):
                if chosen.any():
                    lost = _box_loss(box[number, group], boxes[chosen], bells[chosen])
                    total = total + _BOX_WEIGHT * lost / count
        if self.masks:
            total = total + self._mask_loss(maps[2], targets)
        return total

    @torch.no_grad()
    def predict(self, images: list[torch.Tensor]) -> list[dict[str, torch.Tensor]]:
        """Detect objects in images uint8 [3, H, W].

        Returns:
            For each image, best first and on the CPU: boxes float32 [N, 4] in pixels, labels int64
            [N] from 1, and scores float32 [N]. Also masks bool [N, H, W] if the detector has
            masks.
        """
        maps = self(self._pixels(images))
        heat = maps[0].sigmoid()
        peaks = heat * (functional.max_pool2d(heat, 3, 1, 1) == heat)
        height, width = heat.shape[2:]
        scores, places = peaks.flatten(1).topk(min(_CANDIDATES, peaks[0].numel()))
        found = []
        for number in range(len(images)):
            kept = scores[number] >= _LEAST_SCORE
            classes = places[number, kept] // (height * width)
            cells = places[number, kept] % (height * width)
            sides = maps[1][number].flatten(2)[(classes > 0).long(), :, cells]
            columns, rows = cells % width, cells // width
            boxes = _boxes(sides, columns + 0.5, rows + 0.5)
            limit = boxes.new_tensor([width, height, width, height]) * STRIDE
            boxes = boxes.clamp(min=0).minimum(limit)
            # a wide Gaussian has several peaks
            alone = distinct(boxes, classes)
            boxes, classes = boxes[alone], classes[alone]
            one = {"boxes": boxes, "labels": classes + 1, "scores": scores[number, kept][alone]}
            if self.masks:
                one["masks"] = _instance_masks(maps[2][number], boxes, classes)
            found.append({name: value.cpu() for name, value in one.items()})
        return found

    def _pixels(self, images: list[torch.Tensor]) -> torch.Tensor:
        return torch.stack(images).to(self.heat.weight.device).float() / 127.5 - 1

    def _mask_loss(self, logits: torch.Tensor, targets: list[dict[str, Any]]) -> torch.Tensor:
        wanted = torch.stack([_class_masks(t, self.classes) for t in targets]).to(logits.device)
        # cells hold the covered share instead of 0 or 1, so that thin objects do not vanish
        wanted = functional.avg_pool2d(wanted, STRIDE)
        rare = logits.new_full((self.classes, 1, 1), _RARE_MASK_WEIGHT)
        rare[0] = 1
        crossed = functional.binary_cross_entropy_with_logits(logits, wanted, pos_weight=rare)
        shares = logits.sigmoid()
        shared = (shares * wanted).sum((0, 2, 3))
        sizes = shares.sum((0, 2, 3)) + wanted.sum((0, 2, 3))
        return _MASK_WEIGHT * (crossed + (1 - (2 * shared + 1) / (sizes + 1)).mean())


def _fast_bfloat16(pixels: torch.Tensor) -> bool:
    """Return whether the device of a tensor multiplies bfloat16 numbers faster than float32."""
    if pixels.device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    return bool(torch.cpu.get_capabilities().get("avx512_bf16"))


def gaussians(boxes: torch.Tensor, shape: torch.Size) -> torch.Tensor:
    """Return a Gaussian around the cell of each box's centre, with the value 1 there.

    Args:
        boxes: [N, 4] in pixels.
        shape: (h, w) of the maps.

    Returns:
        float32 [N, h, w].
    """
    height, width = shape
    sides = (boxes[:, 2:] - boxes[:, :2]) / STRIDE
    spread = (_SPREAD * sides).clamp(min=_LEAST_SPREAD)
    centres = ((boxes[:, :2] + boxes[:, 2:]) / 2 / STRIDE).floor()
    column = centres[:, 0].clamp(0, width - 1)
    row = centres[:, 1].clamp(0, height - 1)
    x = torch.arange(width, device=boxes.device) - column[:, None]
    y = torch.arange(height, device=boxes.device) - row[:, None]
    across = torch.exp(-0.5 * (x / spread[:, :1]) ** 2)
    down = torch.exp(-0.5 * (y / spread[:, 1:]) ** 2)
    return down[:, :, None] * across[:, None, :]


def distinct(boxes: torch.Tensor, classes: torch.Tensor) -> torch.Tensor:
    """Return a mask of the boxes that overlap no better box of their class, bool [N].

    Args:
        boxes: [N, 4], best first.
        classes: [N].
    """
    same = (iou(boxes, boxes) > _SAME_THING) & (classes[:, None] == classes[None])
    rest = same.cpu().triu(1)
    kept = torch.ones(len(boxes), dtype=torch.bool)
    for i in range(len(boxes)):
        if kept[i]:
            kept &= ~rest[i]
    return kept.to(boxes.device)


def _class_masks(target: dict[str, Any], classes: int) -> torch.Tensor:
    """Return the area that each class covers, float32 [classes, H, W]."""
    masks = torch.zeros(classes, *target["masks"].shape[1:])
    for label, mask in zip(target["labels"], target["masks"], strict=True):
        masks[label - 1] = torch.maximum(masks[label - 1], mask.float())
    return masks


def _covered(boxes: torch.Tensor, shape: torch.Size) -> torch.Tensor:
    """Return the cells whose centre is in one of the boxes [N, 4] in pixels, bool [h, w]."""
    x0, y0, x1, y1 = (boxes / STRIDE).T[:, :, None]
    x = torch.arange(shape[1], device=boxes.device) + 0.5
    y = torch.arange(shape[0], device=boxes.device) + 0.5
    across, down = (x >= x0) & (x < x1), (y >= y0) & (y < y1)
    covered: torch.Tensor = (down[:, :, None] & across[:, None, :]).any(0)
    return covered


def _focal(logits: torch.Tensor, wanted: torch.Tensor, free: torch.Tensor) -> torch.Tensor:
    """Return CenterNet's focal loss, summed over the maps, with lower penalties near a centre.

    Cells outside `free` [h, w] are not penalized unless they are centres.
    """
    heat = logits.sigmoid()
    at_centre = (1 - heat) ** 2 * functional.logsigmoid(logits)
    elsewhere = free * (1 - wanted) ** 4 * heat**2 * functional.logsigmoid(-logits)
    return -torch.where(wanted == 1, at_centre, elsewhere).sum()


def _box_loss(sides: torch.Tensor, boxes: torch.Tensor, bells: torch.Tensor) -> torch.Tensor:
    """Return the sum over boxes of 1 - GIoU, averaged with each box's Gaussian; sides: [4, h, w].

    A cell where Gaussians overlap learns both boxes, each by its weight.
    """
    which, rows, columns = (bells > 0.1).nonzero(as_tuple=True)
    weights = bells[which, rows, columns]
    total = torch.zeros(len(boxes), device=boxes.device).index_add(0, which, weights)
    guessed = _boxes(sides[:, rows, columns].T, columns + 0.5, rows + 0.5)
    lost = 1 - generalized_iou(guessed, boxes[which])
    return (lost * weights / total[which]).sum()


def _boxes(sides: torch.Tensor, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """Return boxes [N, 4] in pixels.

    sides [N, 4] are logarithms of the distances (left, top, right, bottom); x and y [N] are cell
    centres. Both are in cells.
    """
    left, top, right, bottom = sides.clamp(max=_LONGEST_LOG).exp().unbind(-1)
    return torch.stack([x - left, y - top, x + right, y + bottom], dim=-1) * STRIDE


def _instance_masks(
    logits: torch.Tensor, boxes: torch.Tensor, classes: torch.Tensor
) -> torch.Tensor:
    """Return class masks at image size, each cut to its instance's box; bool [N, H, W]."""
    grown = functional.interpolate(
        logits[None], scale_factor=float(STRIDE), mode="bilinear", align_corners=False
    )[0]
    height, width = grown.shape[1:]
    x = torch.arange(width, device=boxes.device) + 0.5
    y = torch.arange(height, device=boxes.device) + 0.5
    across = (x >= boxes[:, :1]) & (x < boxes[:, 2:3])
    down = (y >= boxes[:, 1:2]) & (y < boxes[:, 3:])
    return (grown > 0)[classes] & down[:, :, None] & across[:, None, :]

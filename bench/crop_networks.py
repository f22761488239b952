"""Training of small networks for crops: a classifier, and the reader of identifiers."""

import copy
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import torch
from common.reader import CANVAS, Reader, TextBatch, convolution, varied_batch
from numpy.typing import NDArray
from panel_crops import Pixels
from rendered_crops import Text
from torch import nn
from torch.nn import functional

STRIDE = 8
"""Distance of the classifier's windows in pixels."""

_LAST = 128


class Classifier(nn.Module):
    """Convolutional network that classifies square crops.

    Args:
        classes: Number of classes.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.features = nn.Sequential(
            *convolution(3, 24, kernel=4, stride=2),
            *(*convolution(24, 48), nn.MaxPool2d(2)),
            *(*convolution(48, 96), nn.MaxPool2d(2)),
            *convolution(96, _LAST),
        )
        self.head = nn.Linear(9 * _LAST, classes)

    def forward(self, crops: torch.Tensor) -> torch.Tensor:
        """Return logits [B, classes] of crops float32 [B, 3, S, S] in 0..1."""
        pooled = functional.adaptive_avg_pool2d(self.features(crops - 0.45), 3)
        logits: torch.Tensor = self.head(functional.dropout(pooled.flatten(1), 0.2, self.training))
        return logits

    @torch.no_grad()
    def shares(self, pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return the probability of each class, float32 [N, classes], for crops [N, S, S, 3]."""
        self.eval()
        parts = [self(_input(part)).softmax(1) for part in torch.from_numpy(pixels).split(256)]
        found: NDArray[np.float32] = torch.cat(parts).numpy()
        return found

    @torch.no_grad()
    def window_shares(self, image: Pixels) -> NDArray[np.float32]:
        """Return the probability of each class in all windows of MARKER_PX of an image.

        Windows are STRIDE pixels apart. The features are computed once for the whole image, so a
        window sees its surroundings where a crop has zero padding.

        Returns:
            float32 [rows, columns, classes].
        """
        self.eval()
        cells = self.features(_input(torch.from_numpy(image)[None]) - 0.45)
        pooled = functional.avg_pool2d(cells, 2, 1)
        weights = self.head.weight.view(-1, _LAST, 3, 3)
        logits = functional.conv2d(pooled, weights, self.head.bias, dilation=2)
        found: NDArray[np.float32] = logits[0].softmax(0).permute(1, 2, 0).numpy()
        return found


def fit_classifier(
    pixels: NDArray[np.uint8],
    classes: NDArray[np.int64],
    count: int,
    steps: int,
    seed: int,
    start: Classifier | None = None,
) -> Classifier:
    """Train a classifier on varied crops; rare classes are drawn more often.

    Args:
        pixels: RGB crops [N, S, S, 3].
        classes: Their classes [N], below `count`.
        count: Number of classes.
        steps: Training steps.
        seed: Seed of weights and order.
        start: Classifier whose copy is trained further, instead of a new one.
    """
    torch.manual_seed(seed)
    model = copy.deepcopy(start) if start else Classifier(count)
    # not equally often: a class with many crops, the background, has more variety to learn
    weights = np.bincount(classes, minlength=count).clip(1)[classes] ** -0.75
    data, targets = torch.from_numpy(pixels), torch.from_numpy(classes)
    draw = torch.from_numpy(weights)

    def loss() -> torch.Tensor:
        chosen = torch.multinomial(draw, 64, replacement=True)
        crops = _varied(_input(data[chosen]))
        return functional.cross_entropy(model(crops), targets[chosen], label_smoothing=0.05)

    optimize(model, loss, steps)
    return model


def fit_pairs(
    positive: NDArray[np.uint8], negative: NDArray[np.uint8], steps: int, seed: int
) -> Classifier:
    """Train a classifier of two classes on pairs of crops.

    A batch has both crops of each pair, varied and mirrored in the same way, so the network sees no
    other difference between the classes. Half of the pairs have a lower resolution: photographs of
    damages may have been enlarged.

    Args:
        positive: RGB crops [N, S, S, 3] of class 1.
        negative: Their counterparts [N, S, S, 3] of class 0.
        steps: Training steps.
        seed: Seed of weights and order.
    """
    torch.manual_seed(seed)
    model = Classifier(2)
    count = 32
    targets = (torch.arange(2 * count) < count).long()
    sides = torch.from_numpy(positive), torch.from_numpy(negative)

    def loss() -> torch.Tensor:
        chosen = torch.randint(len(positive), (count,))
        ones, others = (_input(side[chosen]) for side in sides)
        with torch.random.fork_rng(devices=[]):
            ones = _varied(ones, _enlarged)
        crops = torch.cat([ones, _varied(others, _enlarged)])
        mirrored = torch.rand(count).repeat(2)[:, None, None, None] < 0.5
        crops = torch.where(mirrored, crops.flip(3), crops)
        return functional.cross_entropy(model(crops), targets, label_smoothing=0.05)

    optimize(model, loss, steps)
    return model


def fit_reader(texts: Sequence[Text], steps: int, seed: int) -> Reader:
    """Train a reader on identifiers with known letter places.

    Args:
        texts: Crops of all layouts.
        steps: Training steps; each sees one layout.
        seed: Seed of weights, order and variation.
    """
    torch.manual_seed(seed)
    model = Reader()
    batches = _text_batches(texts, np.random.default_rng(seed))
    optimize(model, lambda: model.text_loss(next(batches)), steps)
    return model


def _text_batches(
    texts: Sequence[Text], rng: np.random.Generator, size: int = 32
) -> Iterator[TextBatch]:
    """Yield batches of random texts of one layout, each layout in turn."""
    groups = [[t for t in texts if t.layout == name] for name in CANVAS]
    groups = [group for group in groups if group]
    while True:
        for group in groups:
            yield varied_batch([group[int(k)] for k in rng.integers(len(group), size=size)], rng)


def _softened(images: torch.Tensor) -> torch.Tensor:
    """Randomly blur half of the images [B, 3, H, W], by up to three pixels."""
    soft = functional.avg_pool2d(images, 3, 1, 1, count_include_pad=False)
    return images + _drawn_for_half(len(images)) * (soft - images)


def _enlarged(images: torch.Tensor) -> torch.Tensor:
    """Randomly lower the resolution of half of the images [B, 3, H, W], by a factor up to 4."""
    level = 2 * _drawn_for_half(len(images))
    found = images * (1 - level).clamp(min=0)
    for step in (1, 2):
        small = functional.avg_pool2d(images, 2**step, ceil_mode=True, count_include_pad=False)
        large = functional.interpolate(small, images.shape[2:], mode="bilinear")
        found = found + large * (1 - (level - step).abs()).clamp(min=0)
    return found


def _drawn_for_half(count: int) -> torch.Tensor:
    """Draw values [count, 1, 1, 1] in 0..1 for half of the images, and 0 for the others."""
    return torch.rand(count, 1, 1, 1) * (torch.rand(count, 1, 1, 1) < 0.5)


def _varied(
    crops: torch.Tensor, resolution: Callable[[torch.Tensor], torch.Tensor] = _softened
) -> torch.Tensor:
    """Randomly rotate, scale and shift crops [B, 3, S, S] in 0..1, and vary their tones.

    Args:
        crops: The crops.
        resolution: Changes their resolution.
    """
    count, _, side, _ = crops.shape

    def drawn(spread: float, *shape: int) -> torch.Tensor:
        return spread * torch.randn(count, *shape)

    angle, scale = drawn(0.06), torch.exp(drawn(0.08))
    cosine, sine = scale * angle.cos(), scale * angle.sin()
    shift = drawn(0.05, 2)
    maps = torch.stack(
        [torch.stack([cosine, -sine, shift[:, 0]], 1), torch.stack([sine, cosine, shift[:, 1]], 1)],
        1,
    )
    grid = functional.affine_grid(maps, [count, 3, side, side], align_corners=False)
    moved = functional.grid_sample(crops, grid, padding_mode="border", align_corners=False)
    return toned(moved, resolution)


def toned(
    images: torch.Tensor, resolution: Callable[[torch.Tensor], torch.Tensor] = _softened
) -> torch.Tensor:
    """Randomly change resolution and tones of images [B, 3, H, W] in 0..1, and add noise.

    Args:
        images: The images.
        resolution: Changes their resolution.
    """
    count = len(images)

    def drawn(spread: float, *shape: int) -> torch.Tensor:
        return spread * torch.randn(count, *shape)

    images = resolution(images).clamp(1e-3, 1) ** torch.exp(drawn(0.3, 1, 1, 1))
    images = images * (1 + drawn(0.06, 3, 1, 1)) + drawn(0.03, 3, 1, 1)
    return images + torch.rand(count, 1, 1, 1) * 0.03 * torch.randn_like(images)


def _input(pixels: torch.Tensor) -> torch.Tensor:
    return pixels.permute(0, 3, 1, 2).float() / 255


def optimize(model: nn.Module, loss: Any, steps: int, rate: float = 3e-3) -> None:
    """Minimize `loss()` with AdamW and one cycle of the learning rate."""
    model.train()
    # this memory format saves a fifth of the time on CPUs
    nn.utils.convert_conv2d_weight_memory_format(model, torch.channels_last)
    optimizer = torch.optim.AdamW(model.parameters(), rate, weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, max(steps, 2), pct_start=0.2)
    for _ in range(steps):
        value = loss()
        optimizer.zero_grad()
        value.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 5.0)
        optimizer.step()
        schedule.step()
    model.eval()

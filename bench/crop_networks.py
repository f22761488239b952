"""Small networks for crops: a classifier, and a reader of identifiers."""

import copy
from collections.abc import Iterator, Sequence
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from rendered_crops import CODE_LENGTH, Pixels, Text
from torch import nn
from torch.nn import functional

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
DIGITS = "0123456789"

OWNER_LENGTH = 4
"""Letters at the beginning of an identifier; digits follow."""

CANVAS = {"rows": (64, 224), "block": (104, 128), "column": (224, 88)}
"""Height and width of the reader's input, by layout."""

STRIDE = 8
"""Distance of the classifier's windows in pixels."""

_LAST = 128
_READER_STRIDE = 4
_PLACE_WEIGHT = 0.5
_PLACE_SPREAD = 1.0  # cells


class Classifier(nn.Module):
    """Convolutional network that classifies square crops.

    Args:
        classes: Number of classes.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.features = nn.Sequential(
            *_block(3, 24, kernel=4, stride=2),
            *(*_block(24, 48), nn.MaxPool2d(2)),
            *(*_block(48, 96), nn.MaxPool2d(2)),
            *_block(96, _LAST),
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

    _optimize(model, loss, steps)
    return model


class Reader(nn.Module):
    """Network that reads the 11 characters of an identifier, without finding lines first.

    For each character and layout it predicts a map of the character's place. The features at that
    place go to a classifier of letters or digits, which all characters share. Places are learned
    from the known places in renders.
    """

    def __init__(self) -> None:
        super().__init__()
        near, far = 64, 48
        self.features = nn.Sequential(
            *_block(1, 16, kernel=4, stride=2),
            *(*_block(16, 32), nn.MaxPool2d(2)),
            *_block(32, near),
            *_block(near, near),
        )
        self.around = nn.Sequential(
            *_block(near + 2, far),
            *_block(far, far, dilation=2),
            *_block(far, far, dilation=4),
            *_block(far, far, dilation=6),
        )
        self.places = nn.ModuleDict(
            {name: nn.Conv2d(near + far, CODE_LENGTH, 1) for name in CANVAS}
        )
        self.letter = nn.Sequential(nn.Linear(near, 128), nn.ReLU())
        self.letters = nn.Linear(128, len(LETTERS))
        self.digits = nn.Linear(128, len(DIGITS))

    def forward(
        self, grey: torch.Tensor, layout: str
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return letter logits [B, 4, 26], digit logits [B, 7, 10], log places [B, 11, h, w]."""
        mean, deviation = grey.mean((2, 3), keepdim=True), grey.std((2, 3), keepdim=True)
        near = self.features((grey - mean) / (deviation + 4))
        size = near.shape[2:]
        coarse = functional.max_pool2d(near, 2)
        far = self.around(torch.cat([coarse, _coordinates(coarse)], 1))
        far = functional.interpolate(far, size=size)
        maps = self.places[layout](torch.cat([near, far], 1)).flatten(2).log_softmax(2)
        seen = self.letter(maps.exp() @ near.flatten(2).transpose(1, 2))
        owner, number = seen[:, :OWNER_LENGTH], seen[:, OWNER_LENGTH:]
        return self.letters(owner), self.digits(number), maps

    @torch.no_grad()
    def read(self, pictures: Sequence[tuple[Pixels, str]]) -> list[str]:
        """Return the 11 characters of each picture, given with its layout."""
        self.eval()
        found = []
        for pixels, layout in pictures:
            height, width = pixels.shape[:2]
            grey, _ = _canvas(pixels, layout, (0, 0, width, height), np.zeros((0, 2)))
            letters, digits, _ = self(torch.from_numpy(grey)[None, None].float(), layout)
            owner = "".join(LETTERS[k] for k in letters[0].argmax(1).tolist())
            found.append(owner + "".join(DIGITS[k] for k in digits[0].argmax(1).tolist()))
        return found


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

    def loss() -> torch.Tensor:
        layout, grey, codes, places = next(batches)
        letters, digits, maps = model(grey, layout)
        read = functional.cross_entropy(
            letters.flatten(0, 1), codes[:, :OWNER_LENGTH].flatten()
        ) + 2 * functional.cross_entropy(digits.flatten(0, 1), codes[:, OWNER_LENGTH:].flatten())
        total: torch.Tensor = read - _PLACE_WEIGHT * (places * maps).sum(2).mean()
        return total

    _optimize(model, loss, steps)
    return model


def _text_batches(
    texts: Sequence[Text], rng: np.random.Generator, size: int = 32
) -> Iterator[tuple[str, torch.Tensor, torch.Tensor, torch.Tensor]]:
    """Yield layout, varied canvases, indices of the characters, and the wanted place maps."""
    groups = {name: [t for t in texts if t.layout == name] for name in CANVAS}
    groups = {name: group for name, group in groups.items() if group}
    while True:
        for name, group in groups.items():
            greys, codes, maps = [], [], []
            for k in rng.integers(len(group), size=size):
                text = group[int(k)]
                grey, letters = _varied_canvas(text, rng)
                greys.append(grey)
                codes.append(
                    [LETTERS.index(c) for c in text.code[:OWNER_LENGTH]]
                    + [DIGITS.index(c) for c in text.code[OWNER_LENGTH:]]
                )
                maps.append(_place_maps(letters, CANVAS[name]))
            grey_batch = torch.from_numpy(np.stack(greys))[:, None]
            yield name, grey_batch, torch.tensor(codes), torch.from_numpy(np.stack(maps))


def _varied_canvas(
    text: Text, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return a canvas float32 [H, W] with random margins, rotation, blur, light and noise."""
    height, width = text.pixels.shape[:2]
    x0, y0, x1, y1 = text.frame_px
    margins = rng.uniform(0.0, 1.0, 4) * (x0, y0, width - x1, height - y1)
    box = (x0 - margins[0], y0 - margins[1], x1 + margins[2], y1 + margins[3])
    turn = float(rng.normal(0, 1.5)), float(rng.uniform(-0.06, 0.06))
    grey, letters = _canvas(text.pixels, text.layout, box, text.letters_px, turn)
    image = grey.astype(float)
    if rng.random() < 0.4:
        image = cv2.GaussianBlur(image, (0, 0), float(rng.uniform(0.4, 1.3))).astype(float)
    if rng.random() < 0.5:  # light on dark and dark on light are equally likely
        image = 255 - image
    image = 255 * (image / 255).clip(0, 1) ** float(np.exp(rng.normal(0, 0.35)))
    image = image + rng.normal(0, float(rng.uniform(0, 8)), image.shape)
    return image.astype(np.float32), letters


def _canvas(
    pixels: Pixels,
    layout: str,
    box: Sequence[float],
    letters_px: NDArray[np.float64],
    turn: tuple[float, float] = (0.0, 0.0),
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return the part of a picture in a box, scaled to fit the canvas of its layout.

    Args:
        pixels: RGB picture.
        layout: Key of CANVAS.
        box: x0, y0, x1, y1 in the picture.
        letters_px: Points [N, 2] in the picture.
        turn: Rotation in degrees, and relative change of the aspect ratio.

    Returns:
        Grey canvas [H, W], and the points [N, 2] on it.
    """
    height, width = CANVAS[layout]
    x0, y0, x1, y1 = box
    scale = min(width / (x1 - x0), height / (y1 - y0))
    angle = np.deg2rad(turn[0])
    stretch = np.diag([1 + min(turn[1], 0), 1 - max(turn[1], 0)])
    linear = (
        scale
        * stretch
        @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    )
    shift = np.array([width, height]) / 2 - linear @ np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    if scale < 0.6:  # against aliasing
        grey = cv2.GaussianBlur(grey, (0, 0), 0.4 / scale)
    matrix = np.concatenate([linear, shift[:, None]], axis=1)
    canvas = cv2.warpAffine(grey, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
    return canvas.astype(np.uint8), letters_px @ linear.T + shift


def _place_maps(letters: NDArray[np.float64], canvas: tuple[int, int]) -> NDArray[np.float32]:
    """Return a Gaussian around each letter on the reader's maps, float32 [11, h * w], sum 1."""
    height, width = (side // _READER_STRIDE for side in canvas)
    x = np.arange(width) + 0.5 - letters[:, :1] / _READER_STRIDE
    y = np.arange(height) + 0.5 - letters[:, 1:] / _READER_STRIDE
    logits = -0.5 * (x[:, None, :] ** 2 + y[:, :, None] ** 2) / _PLACE_SPREAD**2
    maps = np.exp(logits - logits.max((1, 2), keepdims=True)).reshape(len(letters), -1)
    return np.asarray(maps / maps.sum(1, keepdims=True), np.float32)


def _varied(crops: torch.Tensor) -> torch.Tensor:
    """Randomly rotate, scale, shift, blur and tint crops [B, 3, S, S] in 0..1, and add noise."""
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
    crops = functional.grid_sample(crops, grid, padding_mode="border", align_corners=False)
    soft = functional.avg_pool2d(crops, 3, 1, 1, count_include_pad=False)
    softness = torch.rand(count, 1, 1, 1) * (torch.rand(count, 1, 1, 1) < 0.5)
    crops = crops + softness * (soft - crops)
    crops = crops.clamp(1e-3, 1) ** torch.exp(drawn(0.3, 1, 1, 1))
    crops = crops * (1 + drawn(0.06, 3, 1, 1)) + drawn(0.03, 3, 1, 1)
    return crops + torch.rand(count, 1, 1, 1) * 0.03 * torch.randn_like(crops)


def _coordinates(maps: torch.Tensor) -> torch.Tensor:
    """Return y and x of each cell in -1..1, float32 [B, 2, h, w]."""
    height, width = maps.shape[2:]
    y, x = torch.linspace(-1, 1, height), torch.linspace(-1, 1, width)
    both = torch.stack(torch.meshgrid(y, x, indexing="ij"))
    return both.expand(len(maps), -1, -1, -1)


def _input(pixels: torch.Tensor) -> torch.Tensor:
    return pixels.permute(0, 3, 1, 2).float() / 255


def _optimize(model: nn.Module, loss: Any, steps: int, rate: float = 3e-3) -> None:
    """Minimize `loss()` with AdamW and one cycle of the learning rate."""
    model.train()
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


def _block(
    before: int, after: int, kernel: int = 3, stride: int = 1, dilation: int = 1
) -> tuple[nn.Module, ...]:
    conv = nn.Conv2d(before, after, kernel, stride, dilation, dilation, bias=False)
    return conv, nn.BatchNorm2d(after), nn.ReLU()

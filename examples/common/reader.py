"""Network that reads identifiers from crops, and its training on letters at known places."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from fastgen.decals.iso6346 import character_value

Pixels = NDArray[np.uint8]
"""RGB picture [H, W, 3]."""

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
DIGITS = "0123456789"

OWNER_LENGTH = 4
"""Letters at the beginning of an identifier; digits follow."""

CODE_LENGTH = 11
"""Characters that are read: owner code, serial number, check digit."""

CANVAS = {"rows": (64, 224), "block": (104, 128), "column": (224, 88)}
"""Height and width of the reader's input, by layout."""

_STRIDE = 4
_PLACE_WEIGHT = 0.5
_PLACE_SPREAD = 1.0  # cells


class KnownText(Protocol):
    """Crop of an identifier whose letters have known places."""

    @property
    def pixels(self) -> Pixels:
        """RGB picture."""

    @property
    def code(self) -> str:
        """Owner code, serial number and check digit."""

    @property
    def layout(self) -> str:
        """Key of CANVAS."""

    @property
    def letters_px(self) -> NDArray[np.float64]:
        """Centres of the letters of `code`, float64 [11, 2], x right and y down."""

    @property
    def frame_px(self) -> tuple[float, float, float, float]:
        """Box of all letters x0, y0, x1, y1."""


class TextBatch(NamedTuple):
    """Training batch of one layout.

    Attributes:
        layout: Key of CANVAS.
        grey: Canvases, float32 [B, 1, H, W] in 0..255.
        codes: Indices of the characters in LETTERS and DIGITS, int64 [B, 11].
        places: Target map of each character's place, float32 [B, 11, h * w], sum 1.
    """

    layout: str
    grey: torch.Tensor
    codes: torch.Tensor
    places: torch.Tensor


class Reader(nn.Module):
    """Network that reads the 11 characters of an identifier, without finding lines first.

    For each character and layout it predicts a map of the character's place. The features at that
    place go to a classifier of letters or digits, which all characters share. Places are learned
    from the known places in renders.

    Args:
        width: Channels of the first layer.
    """

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        near, far = 4 * width, 3 * width
        self.features = nn.Sequential(
            *convolution(1, width, kernel=4, stride=2),
            *(*convolution(width, 2 * width), nn.MaxPool2d(2)),
            *convolution(2 * width, near),
            *convolution(near, near),
        )
        self.around = nn.Sequential(
            *convolution(near + 2, far),
            *convolution(far, far, dilation=2),
            *convolution(far, far, dilation=4),
            *convolution(far, far, dilation=6),
        )
        self.places = nn.ModuleDict(
            {name: nn.Conv2d(near + far, CODE_LENGTH, 1) for name in CANVAS}
        )
        self.letter = nn.Sequential(nn.Linear(near, 8 * width), nn.ReLU())
        self.letters = nn.Linear(8 * width, len(LETTERS))
        self.digits = nn.Linear(8 * width, len(DIGITS))

    def forward(
        self, grey: torch.Tensor, layout: str
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return letter logits [B, 4, 26], digit logits [B, 7, 10], log places [B, 11, h * w].

        Args:
            grey: Canvases of one layout, float32 [B, 1, H, W].
            layout: Key of CANVAS.
        """
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

    def text_loss(self, batch: TextBatch) -> torch.Tensor:
        """Return the loss of characters and places, a scalar."""
        device = self.digits.weight.device
        codes = batch.codes.to(device)
        letters, digits, maps = self(batch.grey.to(device), batch.layout)
        read = functional.cross_entropy(
            letters.flatten(0, 1), codes[:, :OWNER_LENGTH].flatten()
        ) + 2 * functional.cross_entropy(digits.flatten(0, 1), codes[:, OWNER_LENGTH:].flatten())
        places = (batch.places.to(device) * maps).sum(2).mean()
        total: torch.Tensor = read - _PLACE_WEIGHT * places
        return total

    @torch.no_grad()
    def read(self, pictures: Sequence[tuple[Pixels, str]]) -> list[str]:
        """Return the most likely valid identifier in each picture, given with its layout."""
        self.eval()
        device = self.digits.weight.device
        found = []
        for pixels, layout in pictures:
            grey = torch.from_numpy(whole_canvas(pixels, layout))[None, None].float()
            letters, digits, _ = self(grey.to(device), layout)
            found.append(
                best_identifier(
                    letters[0].log_softmax(1).cpu().numpy(), digits[0].log_softmax(1).cpu().numpy()
                )
            )
        return found


def best_identifier(letters: NDArray[np.floating], digits: NDArray[np.floating]) -> str:
    """Return the most likely identifier whose check digit is right (ISO 6346:1995, annex A).

    Characters are independent, so the search is a Viterbi search over the weighted sum modulo 11.

    Args:
        letters: Log probabilities of LETTERS at the first four places, [4, 26].
        digits: Log probabilities of DIGITS at the other seven places, [7, 10].
    """
    best = {0: (0.0, "")}  # remainder of the weighted sum: score and text of the best beginning
    tables = [(LETTERS, row) for row in letters] + [(DIGITS, row) for row in digits[:-1]]
    for place, (characters, row) in enumerate(tables):
        longer: dict[int, tuple[float, str]] = {}
        for remainder, (score, text) in best.items():
            for character, value in zip(characters, row.tolist(), strict=True):
                key = (remainder + (character_value(character) << place)) % 11
                longer[key] = max(longer.get(key, (-np.inf, "")), (score + value, text + character))
        best = longer
    last = digits[-1]
    ends = [
        (score + float(last[remainder % 10]), text + DIGITS[remainder % 10])
        for remainder, (score, text) in best.items()
    ]
    return max(ends)[1]


def whole_canvas(pixels: Pixels, layout: str) -> Pixels:
    """Return a picture in grey, scaled to fit the canvas of its layout, uint8 [H, W]."""
    height, width = pixels.shape[:2]
    return _canvas(pixels, layout, (0, 0, width, height), np.zeros((0, 2)))[0]


def varied_batch(texts: Sequence[KnownText], rng: np.random.Generator) -> TextBatch:
    """Return randomly varied canvases of texts of one layout, with their targets."""
    layout = texts[0].layout
    greys, codes, maps = [], [], []
    for text in texts:
        grey, letters = _varied_canvas(text, rng)
        greys.append(grey)
        codes.append(
            [LETTERS.index(c) for c in text.code[:OWNER_LENGTH]]
            + [DIGITS.index(c) for c in text.code[OWNER_LENGTH:]]
        )
        maps.append(_place_maps(letters, CANVAS[layout]))
    return TextBatch(
        layout,
        torch.from_numpy(np.stack(greys))[:, None],
        torch.tensor(codes),
        torch.from_numpy(np.stack(maps)),
    )


def convolution(
    before: int, after: int, kernel: int = 3, stride: int = 1, dilation: int = 1
) -> tuple[nn.Module, ...]:
    """Return a convolution with batch normalization and ReLU.

    Args:
        before: Input channels.
        after: Output channels.
        kernel: Side of the kernel; 3 keeps the size of the maps at stride 1.
        stride: Stride.
        dilation: Dilation, also used as padding.
    """
    conv = nn.Conv2d(before, after, kernel, stride, dilation, dilation, bias=False)
    return conv, nn.BatchNorm2d(after), nn.ReLU()


def _varied_canvas(
    text: KnownText, rng: np.random.Generator
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
    height, width = (side // _STRIDE for side in canvas)
    x = np.arange(width) + 0.5 - letters[:, :1] / _STRIDE
    y = np.arange(height) + 0.5 - letters[:, 1:] / _STRIDE
    logits = -0.5 * (x[:, None, :] ** 2 + y[:, :, None] ** 2) / _PLACE_SPREAD**2
    maps = np.exp(logits - logits.max((1, 2), keepdims=True)).reshape(len(letters), -1)
    return np.asarray(maps / maps.sum(1, keepdims=True), np.float32)


def _coordinates(maps: torch.Tensor) -> torch.Tensor:
    """Return y and x of each cell in -1..1, float32 [B, 2, h, w]."""
    height, width = maps.shape[2:]
    device = maps.device
    y = torch.linspace(-1, 1, height, device=device)
    x = torch.linspace(-1, 1, width, device=device)
    both = torch.stack(torch.meshgrid(y, x, indexing="ij"))
    return both.expand(len(maps), -1, -1, -1)

"""A small convolutional network that classifies the marker in a crop."""

import torch
from torch import nn

_BATCH = 64
_RATE = 4e-3
_SHIFT_PX = 2
_LIGHT, _TINT = 0.2, 0.05  # standard deviations of augmented brightness and colour


def fit(
    pixels: torch.Tensor, classes: torch.Tensor, steps: int, seed: int, count: int
) -> nn.Module:
    """Train a new network on crops.

    Crops are drawn with replacement, shifted by a pixel or two, and varied in brightness and
    colour.

    Args:
        pixels: uint8 [N, 24, 24, 3].
        classes: int64 [N], below `count`.
        steps: Training steps, independent of the number of crops.
        seed: Seed of weights and order.
        count: Number of classes.
    """
    torch.manual_seed(seed)
    net = _net(count)
    optimizer = torch.optim.AdamW(net.parameters(), _RATE, weight_decay=0.01)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _RATE, steps, pct_start=0.15)
    for _ in range(steps):
        chosen = torch.randint(len(pixels), (_BATCH,))
        loss = nn.functional.cross_entropy(net(_varied(pixels[chosen])), classes[chosen])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    return net.eval()


@torch.no_grad()
def named(net: nn.Module, pixels: torch.Tensor) -> torch.Tensor:
    """Return the class of each crop uint8 [N, 24, 24, 3], int64 [N]."""
    return torch.cat([net(_input(part)).argmax(1) for part in pixels.split(512)])


def _net(count: int) -> nn.Sequential:
    widths = (16, 32, 64)
    layers: list[nn.Module] = []
    for before, width in zip((3, *widths), widths, strict=False):
        first = before == 3
        layers += [
            nn.Conv2d(before, width, 4 if first else 3, 2 if first else 1, padding=1, bias=False),
            nn.BatchNorm2d(width),
            nn.ReLU(),
        ]
        layers += [] if first else [nn.MaxPool2d(2)]
    return nn.Sequential(*layers, nn.Flatten(), nn.Linear(widths[-1] * 9, count))


def _input(pixels: torch.Tensor) -> torch.Tensor:
    """Convert pixels [N, H, W, 3] to the network's input in 0..1, channels last in memory."""
    return pixels.permute(0, 3, 1, 2).float() / 255


def _varied(pixels: torch.Tensor) -> torch.Tensor:
    images = _input(pixels)
    across, down = torch.randint(-_SHIFT_PX, _SHIFT_PX + 1, (2,)).tolist()
    images = torch.roll(images, (down, across), (2, 3))
    light = 1 + _LIGHT * torch.randn(len(images), 1, 1, 1)
    tint = _TINT * torch.randn(len(images), 3, 1, 1)
    return (images * light + tint).contiguous(memory_format=torch.channels_last)

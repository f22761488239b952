"""Brightness and likeness of images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.dataset.stats import QUANTILES
from fastgen.report.views import LoadedView, Place
from fastgen.scene.data import REC_709
from fastgen.srgb import DECODED

CLIPPED, BLACK = 253, 3
"""Values from which a channel counts as clipped, and up to which all channels count as black."""

MID_GREY = 0.18
"""Linear luminance of a correctly exposed grey card."""

_THUMBNAIL = 16

_ALIKE = 5.0
"""Mean difference of thumbnails, in values of 0..255, below which two images are near duplicates.
Images of unrelated scenes differ by more than 30."""


@dataclass(frozen=True, eq=False)
class Look:
    """Measurements of one image.

    Attributes:
        place: The image.
        environment: Name of its HDRI.
        exposure_stops: Mean linear luminance in stops above mid grey.
        clipped: Share of pixels with a clipped channel.
        black: Share of black pixels.
        thumbnail: float32 [16 * 16 * 3], the image in small.
    """

    place: Place
    environment: str
    exposure_stops: float
    clipped: float
    black: float
    thumbnail: NDArray[np.float32]


def look_at(view: LoadedView) -> Look:
    """Measure an image."""
    luminance = DECODED[view.image].reshape(-1, 3).mean(axis=0) @ REC_709
    brightest = view.image.max(axis=-1)
    small = cv2.resize(view.image, (_THUMBNAIL, _THUMBNAIL), interpolation=cv2.INTER_AREA)
    return Look(
        place=view.place,
        environment=view.environment,
        exposure_stops=float(np.log2(max(luminance, 1e-4) / MID_GREY)),
        clipped=float((brightest >= CLIPPED).mean()),
        black=float((brightest <= BLACK).mean()),
        thumbnail=small.astype(np.float32).ravel(),
    )


def ranges(looks: Sequence[Look], key: Callable[[Look], str]) -> list[dict[str, Any]]:
    """Return the quantiles of the exposure of each group of images, and the mean shares.

    Args:
        looks: The images.
        key: Returns the name of an image's group.

    Returns:
        For each group in alphabetical order: name, images, stops (at QUANTILES), clipped, black.
    """
    groups: dict[str, list[Look]] = {}
    for look in looks:
        groups.setdefault(key(look), []).append(look)
    return [
        {
            "name": name,
            "images": len(group),
            "stops": np.quantile([look.exposure_stops for look in group], QUANTILES).tolist(),
            "clipped": float(np.mean([look.clipped for look in group])),
            "black": float(np.mean([look.black for look in group])),
        }
        for name, group in sorted(groups.items())
    ]


def near_duplicates(looks: Sequence[Look]) -> list[tuple[str, str]]:
    """Return the stems of pairs of images of one camera that look almost the same."""
    pairs = []
    for camera in sorted({look.place.camera for look in looks}):
        group = [look for look in looks if look.place.camera == camera]
        pixels = np.array([look.thumbnail for look in group])
        for at, row in enumerate(pixels[:-1]):
            apart = np.abs(pixels[at + 1 :] - row).mean(axis=1)
            alike = np.flatnonzero(apart < _ALIKE) + at + 1
            pairs += [(group[at].place.stem, group[other].place.stem) for other in alike.tolist()]
    return pairs

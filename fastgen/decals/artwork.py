"""Markers, stickers and emblems as arrays, read from the packaged assets."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.classes import MARKER_CLASSES
from fastgen.decals.asset_files import asset_image, asset_json
from fastgen.files import disk_cache
from fastgen.resources import asset_path
from fastgen.srgb import DECODED, ENCODED

VERSION = 7  # raise when the stored arrays change

ART_SIZE = 256
"""Width and height of an artwork image, texels."""


@dataclass(frozen=True)
class Sticker:
    """Plate or sticker without a label.

    Attributes:
        name: Name of its artwork.
        size_mm: Width and height.
        where: Faces that may carry it.
        always: True if every container carries it on these faces.
        weight: Relative frequency among the stickers that are drawn by number.
        share: Probability that such a face carries it in addition to that number.
        kinds: Container kinds that may carry it; empty for all.
        place: Range of x, then of y, from left and bottom (0) to right and top (1).
        ink: 'art' for the drawing's own colours, 'lettering' for the colour of the lettering, or
            'overpaint' for a darker tone of the paint.
        group: Name of a group, or ''. Of a group, a container carries only one sticker.
        art: Name of its artwork if that is not `name`.
    """

    name: str
    size_mm: tuple[float, float]
    where: tuple[str, ...]
    always: bool = False
    weight: float = 1.0
    share: float = 0.0
    kinds: tuple[str, ...] = ()
    place: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 1.0)
    ink: str = "art"
    group: str = ""
    art: str = ""


@dataclass(frozen=True)
class Mark:
    """Mark of the IMDG Code with a label.

    Attributes:
        name: Name of its artwork and of its class.
        size_mm: Smallest width and height.
        where: Faces that carry it; empty for those with markers.
    """

    name: str
    size_mm: tuple[float, float]
    where: tuple[str, ...]


@dataclass(frozen=True)
class Brand:
    """Shipping line: an invented one of fastgen, or one of a configuration.

    Attributes:
        name: Name of the line.
        emblem: Name of its artwork.
        owner_codes: Owner codes of its containers, four letters each, the last a U.
        wordmark: Text below the emblem.
        main_texts: Further large texts on its containers.
        ink: 'lettering' for an emblem in the colour of the lettering, or 'art' for the drawing's
            own colours.
    """

    name: str
    emblem: str
    owner_codes: tuple[str, ...]
    wordmark: str
    main_texts: tuple[str, ...]
    ink: str = "lettering"


@lru_cache(maxsize=1)
def marker_prints() -> Mapping[str, tuple[str, ...]]:
    """Return the names of the printed variants of each marker class, in class order.

    The first variant has the name of its class.
    """
    prints = asset_json("markers", "index.json")
    return MappingProxyType(
        {
            name: tuple(art for art, about in prints.items() if about["class"] == name)
            for name in MARKER_CLASSES
        }
    )


@lru_cache(maxsize=1)
def un_numbers() -> Mapping[str, tuple[str, tuple[str, ...]]]:
    """Return the hazard identification number and the UN numbers of each marker class.

    The hazard identification number is that of ADR 5.3.2.3; it is empty for class 1.
    """
    numbers = asset_json("markers", "un_numbers.json")
    return MappingProxyType({name: (row[0], tuple(row[1])) for name, row in numbers.items()})


@lru_cache(maxsize=1)
def art_layers() -> Mapping[str, int]:
    """Return the layer of each artwork by name: markers in class order, then the others."""
    names = (*_marker_art(), *sorted(_index()))
    return MappingProxyType({name: i for i, name in enumerate(names)})


def _marker_art() -> list[str]:
    """Return the names of the artwork in assets/markers, markers first."""
    markers = [art for prints in marker_prints().values() for art in prints]
    return markers + sorted(set(asset_json("markers", "index.json")) - set(markers))


def art_images() -> NDArray[np.uint8]:
    """Return all artwork.

    Returns:
        uint8 [K, ART_SIZE, ART_SIZE, 4], sRGB with straight alpha, row 0 at the top, in the order
        of `art_layers`.

    Raises:
        AssetError: A file is missing or broken.
    """
    images = np.stack([asset_image(path, 4, ART_SIZE) for path in _art_paths()])
    return np.ascontiguousarray(images[..., [2, 1, 0, 3]])


@lru_cache(maxsize=1)
def art_levels() -> tuple[NDArray[np.uint8], ...]:
    """Return `art_images` and its mip levels, from the disk cache if possible.

    Returns:
        Read-only uint8 [K, N, N, 4] for N = ART_SIZE, ART_SIZE / 2, ... 1: sRGB codes of linear
        light times alpha, and alpha. Filters then keep the light of small artwork.

    Raises:
        AssetError: A file is missing or broken.
    """
    digest, paths = hashlib.sha256(), _art_paths()
    for path in paths:
        digest.update(path.read_bytes() if path.exists() else b"")

    def make() -> dict[str, NDArray[np.uint8]]:
        images = art_images()
        levels = zip(*map(mip_levels, images), strict=True)
        whole = [images, *map(np.stack, levels)]
        return {f"level{i}": premultiplied(level) for i, level in enumerate(whole)}

    sizes = [ART_SIZE >> i for i in range(ART_SIZE.bit_length())]
    layout = {f"level{i}": f"uint8 {len(paths)} {size} {size} 4" for i, size in enumerate(sizes)}
    stored = disk_cache.cached("art", VERSION, digest.hexdigest(), make, layout=layout)
    return tuple(stored.values())


def premultiplied(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return sRGB codes [..., 4] of linear light times alpha, for codes with straight alpha."""
    light = DECODED[image[..., :3]] * (image[..., 3:] / np.float32(255))
    codes = ENCODED[(light * (len(ENCODED) - 1) + 0.5).astype(np.uint16)]
    return np.concatenate([codes, image[..., 3:]], axis=-1)


def _art_paths() -> list[Path]:
    markers = set(_marker_art())
    return [
        asset_path("markers" if name in markers else "stickers", f"{name}.png")
        for name in art_layers()
    ]


def mip_levels(image: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """Return the mip levels of an image, without the image.

    Each level averages linear light weighted by alpha, so that the colour of transparent texels
    has no influence.

    Args:
        image: uint8 [N, N, 4], sRGB with straight alpha; N is a power of two.

    Returns:
        Levels with N / 2, N / 4, ... 1 texels per side, encoded as the image.
    """
    rgba: np.ndarray = premultiplied_light(image)
    found = []
    while len(rgba) > 1:
        rgba = cv2.resize(rgba, (len(rgba) // 2,) * 2, interpolation=cv2.INTER_AREA)
        found.append(texels(rgba))
    return found


def premultiplied_light(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return an image [H, W, 4] as linear light times alpha, and alpha, both in 0..1."""
    rgba: np.ndarray = cv2.LUT(image, _LIGHT_AND_ALPHA)
    for channel in range(3):
        rgba[..., channel] *= rgba[..., 3]
    return rgba


def texels(rgba: np.ndarray) -> NDArray[np.uint8]:
    """Return the image of linear light times alpha: the inverse of `premultiplied_light`."""
    light = rgba[..., :3] / np.maximum(rgba[..., 3:], 1e-6)
    image = np.empty(rgba.shape, np.uint8)
    image[..., :3] = ENCODED[(light * (len(ENCODED) - 1) + 0.5).astype(np.uint16)]
    image[..., 3] = rgba[..., 3] * 255 + 0.5
    return image


_LIGHT_AND_ALPHA = np.stack([DECODED] * 3 + [np.linspace(0, 1, 256)], axis=1)[None].astype(
    np.float32
)


@lru_cache(maxsize=1)
def stickers() -> Mapping[str, Sticker]:
    """Return all plates and stickers by name; markers, marks and emblems are not included."""
    return MappingProxyType(
        {name: Sticker(name, **values) for name, values in _with_role("sticker").items()}
    )


@lru_cache(maxsize=1)
def marks() -> Mapping[str, Mark]:
    """Return the marks of the IMDG Code by name."""
    return MappingProxyType(
        {name: Mark(name, **values) for name, values in _with_role("mark").items()}
    )


@lru_cache(maxsize=1)
def brands() -> tuple[Brand, ...]:
    """Return the invented shipping lines."""
    return tuple(
        Brand(name, b["emblem"], tuple(b["owner_codes"]), b["wordmark"], tuple(b["main_texts"]))
        for name, b in asset_json("stickers", "brands.json").items()
    )


def _with_role(role: str) -> dict[str, dict[str, Any]]:
    """Return the entries of the index with a role, without it and with tuples for lists."""
    return {
        name: {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in entry.items()
            if key != "role"
        }
        for name, entry in _index().items()
        if entry["role"] == role
    }


@lru_cache(maxsize=1)
def _index() -> dict[str, Any]:
    return asset_json("stickers", "index.json")

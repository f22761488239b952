"""Images and records of a rendered sample, as the page shows them."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.camera.tone_curve import tone_map_and_encode
from fastgen.errors import ConfigError
from fastgen.files.images import jpeg
from fastgen.light.hdri import load_radiance
from fastgen.overlay import DAMAGE_GREYS, ID_GREYS, class_hex, depth_colors, label_colors
from fastgen.sample import Object, Sample
from fastgen.validation import check_known, to_plain

PICTURE_LAYERS = ("colour", "ids", "damage", "depth", "normals", "background")
"""Layers that are images. The page draws boxes itself."""

_OUTLINES = ("polygon", "quad", "parts", "keypoints")
"""Fields of objects that the page does not show."""

_THUMBNAIL = (192, 96)
_THUMBNAIL_MEAN = 0.25
"""Geometric mean of the luminance of a thumbnail before the tone curve."""

_LEAST_LIGHT = 1e-4

Image = NDArray[np.uint8]


def layer_image(sample: Sample, layer: str) -> Image:
    """Return one layer of a sample.

    Args:
        sample: The sample.
        layer: One of PICTURE_LAYERS.

    Returns:
        uint8 sRGB with alpha [H, W, 4]. Alpha is 0 at pixels without a value and 255 elsewhere.

    Raises:
        ConfigError: The layer is unknown, or the sample was rendered without it.
    """
    check_known("layer", layer, PICTURE_LAYERS)
    match layer:
        case "colour":
            return np.asarray(cv2.cvtColor(sample.image, cv2.COLOR_RGB2RGBA), np.uint8)
        case "ids":
            return _with_alpha(label_colors(sample.ids, ID_GREYS), sample.ids > 0)
        case "damage":
            return _with_alpha(label_colors(sample.damage, DAMAGE_GREYS), sample.damage > 0)
        case "depth":
            return _with_alpha(depth_colors(sample.depth), np.asarray(np.isfinite(sample.depth)))
        case "normals" if sample.normals is not None:
            codes = np.rint(127.5 * (sample.normals + 1)).astype(np.uint8)
            return _with_alpha(codes, np.asarray(sample.normals.any(axis=2)))
        case "background" if sample.background is not None:
            return _with_alpha(label_colors(sample.background, {}), sample.background > 0)
    raise ConfigError(f"layer: this image has no {layer}; choose another HDRI, or turn it off")


def pixel_values(sample: Sample) -> bytes:
    """Return the label targets of a sample, for the object under the pointer.

    Returns:
        Little-endian arrays [H, W] one after another: uint16 ids, uint16 damage, uint16 number of
        the panorama's container (0 for none), float32 depth in metres (infinite for panorama).
    """
    background = np.zeros_like(sample.ids) if sample.background is None else sample.background
    labels = (sample.ids, sample.damage, background)
    return b"".join(each.astype("<u2").tobytes() for each in labels) + (
        sample.depth.astype("<f4").tobytes()
    )


def object_records(sample: Sample) -> list[dict[str, Any]]:
    """Return what the page shows of the objects in plain JSON, with the colours of their boxes."""
    shown = [field.name for field in fields(Object) if field.name not in _OUTLINES]
    return [
        {name: to_plain(getattr(item, name)) for name in shown}
        | {"color": class_hex(item.class_name)}
        for item in sample.objects
    ]


def depth_range(sample: Sample) -> tuple[float, float] | None:
    """Return the smallest and the largest depth in metres; None if there is nothing to see."""
    known = sample.depth[np.isfinite(sample.depth)]
    return (float(known.min()), float(known.max())) if known.size else None


def thumbnail(path: Path) -> bytes:
    """Return a small JPEG of an HDRI, exposed for its mean.

    Raises:
        AssetError: The file is not a valid HDRI.
    """
    small = cv2.resize(load_radiance(path), _THUMBNAIL, interpolation=cv2.INTER_AREA)
    mean = np.exp(np.log(np.maximum(small.mean(axis=2), _LEAST_LIGHT)).mean())
    return jpeg(tone_map_and_encode(np.asarray(small * (_THUMBNAIL_MEAN / mean), np.float32)))


def _with_alpha(colors: Image, known: NDArray[np.bool_]) -> Image:
    return np.asarray(cv2.merge([colors, np.where(known, np.uint8(255), np.uint8(0))]), np.uint8)

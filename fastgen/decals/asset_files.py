"""Reading of the packaged assets that hold artwork and glyphs."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fastgen.errors import AssetError
from fastgen.resources import asset_path


def asset_json(*parts: str) -> dict[str, Any]:
    """Return the JSON of an asset, named by the parts of its path.

    Raises:
        AssetError: The file is missing or broken.
    """
    path = asset_path(*parts)
    try:
        data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise AssetError(f"{path}: cannot be read ({error}); reinstall fastgen") from None
    return data


def asset_image(path: Path, channels: int, size: int | None) -> NDArray[np.uint8]:
    """Return the pixels of a PNG.

    Args:
        path: The file.
        channels: Number of channels that it has.
        size: Width and height that it has; None for any.

    Returns:
        uint8 [H, W] or [H, W, channels], in OpenCV's order of channels, row 0 at the top.

    Raises:
        AssetError: The file is missing, broken or of another size.
    """
    # cv2.imread cannot open every path that Python can, so decode the bytes instead.
    data = np.frombuffer(path.read_bytes() if path.exists() else b"", np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    found = 0 if image is None else image.shape[2] if image.ndim == 3 else 1
    if image is None or found != channels or (size and image.shape[:2] != (size, size)):
        wanted = f"{size}x{size}, " if size else ""
        raise AssetError(f"{path}: not a PNG of {wanted}{channels} channels; reinstall fastgen")
    return np.asarray(image, np.uint8)

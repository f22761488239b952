"""Types of configuration fields that several sections share, and the colours that they hold."""

from typing import Annotated

from annotated_types import MinLen

from fastgen import srgb
from fastgen.validation import Bounds, Matching

HexColor = Annotated[str, Matching("#?[0-9a-fA-F]{6}", "is not a color; write it as '#rrggbb'")]
"""An sRGB color such as '#1f4e84'."""

HexColors = Annotated[tuple[HexColor, ...], MinLen(1)]

Weight = Annotated[float, Bounds(0.0, 1e6)]
"""Relative frequency."""


def linear_color(text: str) -> tuple[float, float, float]:
    """Return the linear Rec. 709 albedo of an sRGB hex color such as '#1f4e84'."""
    red, green, blue = (srgb.linear(code / 255) for code in bytes.fromhex(text.removeprefix("#")))
    return red, green, blue

"""Types of configuration fields that several sections share, and the colours that they hold."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from annotated_types import MinLen

from fastgen import srgb
from fastgen.decals.own_art import PREFIX, art_of, read_art
from fastgen.errors import ConfigError
from fastgen.validation import FOLDER, Bounds, Matching

if TYPE_CHECKING:
    from pydantic_core import CoreSchema

HexColor = Annotated[str, Matching("#?[0-9a-fA-F]{6}", "is not a color; write it as '#rrggbb'")]
"""An sRGB color such as '#1f4e84'."""

HexColors = Annotated[tuple[HexColor, ...], MinLen(1)]

Weight = Annotated[float, Bounds(0.0, 1e6)]
"""Relative frequency."""


class ArtFile(NamedTuple):
    """Text field for an image: the path of a PNG or SVG file, replaced by the image itself.

    Attributes:
        square: Refuse images that are not square.
    """

    square: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        return core_schema.with_info_after_validator_function(
            self._embedded, core_schema.str_schema(strict=True)
        )

    def _embedded(self, text: str, info: Any) -> str:
        from pydantic_core import PydanticCustomError

        try:
            if text.startswith(PREFIX):
                art_of(text)
            elif text:
                return read_art((info.context or {}).get(FOLDER, Path()) / text, self.square)
        except ConfigError as error:
            raise PydanticCustomError("words", "{words}", {"words": str(error)}) from None
        return text


def linear_color(text: str) -> tuple[float, float, float]:
    """Return the linear Rec. 709 albedo of an sRGB hex color such as '#1f4e84'."""
    red, green, blue = (srgb.linear(code / 255) for code in bytes.fromhex(text.removeprefix("#")))
    return red, green, blue

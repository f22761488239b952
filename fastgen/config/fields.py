"""Types of configuration fields that several sections share, and the colours that they hold."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import MinLen

from fastgen import srgb
from fastgen.decals import own_fonts
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


class EmbeddedFile(ABC):
    """Text field for a path, replaced by the content of the file."""

    @abstractmethod
    def embedded(self, text: str, folder: Path) -> str:
        """Return the content of a path relative to a folder, or a checked content as it is.

        Raises:
            ConfigError: It cannot be used.
        """

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        return core_schema.with_info_after_validator_function(
            self._checked, core_schema.str_schema(strict=True)
        )

    def _checked(self, text: str, info: Any) -> str:
        from pydantic_core import PydanticCustomError

        try:
            return self.embedded(text, (info.context or {}).get(FOLDER, Path()))
        except ConfigError as error:
            raise PydanticCustomError("words", "{words}", {"words": str(error)}) from None


@dataclass(frozen=True)
class ArtFile(EmbeddedFile):
    """Text field for an image: the path of a PNG or SVG file, replaced by the image itself.

    Attributes:
        square: Refuse images that are not square.
    """

    square: bool = False

    def embedded(self, text: str, folder: Path) -> str:
        """See EmbeddedFile. An empty text stays."""
        if text.startswith(PREFIX):
            art_of(text)
        elif text:
            return read_art(folder / text, self.square)
        return text


class FontFile(EmbeddedFile):
    """Text field for a font: the path of a TTF, OTF or WOFF file, replaced by its letters."""

    def embedded(self, text: str, folder: Path) -> str:
        """See EmbeddedFile."""
        if text.startswith(own_fonts.PREFIX):
            own_fonts.own_font("", text)
            return text
        return own_fonts.read_font(folder / text)


def linear_color(text: str) -> tuple[float, float, float]:
    """Return the linear Rec. 709 albedo of an sRGB hex color such as '#1f4e84'."""
    red, green, blue = (srgb.linear(code / 255) for code in bytes.fromhex(text.removeprefix("#")))
    return red, green, blue

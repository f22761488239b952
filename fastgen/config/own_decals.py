"""Markers, stickers and brands of users, beside those of fastgen."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

from annotated_types import MinLen

from fastgen.classes import CLASS_NAME, OTHER_CLASSES
from fastgen.config.fields import ArtFile, Weight
from fastgen.decals.glyphs import BOX, glyph_tiles
from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.faces import SHEET_FACES
from fastgen.validation import UNIT, Bounds, Flag, Matching, OneOf, Range, Share, check_distinct

Face = Annotated[str, OneOf(SHEET_FACES)]

OwnName = Annotated[
    str,
    Matching(
        CLASS_NAME,
        "is not a name; give up to 64 letters, digits, _, ., + and -, beginning with a letter or "
        "a digit",
    ),
]

OwnerCode = Annotated[
    str, Matching("[A-Z]{3}[UJZ]", "is not an owner code; give three letters and U, J or Z")
]

_Side = Annotated[float, Bounds(10.0, 5000.0, "mm")]


@dataclass(frozen=True)
class MarkerConfig:
    """A diamond-shaped marker with a label.

    Attributes:
        art: Path of a square PNG or SVG image, relative to the file that names it. The tips of the
            marker touch the middle of its sides; what is outside them is not drawn. The paint shows
            through transparent parts. A marker of fastgen needs none. The configuration keeps the
            image itself.
        weight: Relative frequency. A marker with weight 0 is neither drawn nor a class.
        hazard_number: Number in the upper row of orange panels beside it.
        un_numbers: Numbers in the lower row, all equally likely. A new marker without any has no
            panel.
    """

    art: Annotated[str, ArtFile(square=True)] = ""
    weight: Weight = 1.0
    hazard_number: Annotated[
        str,
        Matching(
            "X?[0-9]{2,3}|",
            "is not a hazard number; give two or three digits in quotes, or X before them",
        ),
    ] = ""
    un_numbers: tuple[
        Annotated[str, Matching("[0-9]{4}", "is not a UN number; give four digits in quotes")], ...
    ] = ()


@dataclass(frozen=True)
class StickerConfig:
    """A rectangular plate, sign or sticker in its own colours.

    Attributes:
        art: Path of a PNG or SVG image, relative to the file that names it. It is stretched to
            the size. The paint shows through transparent parts. The configuration keeps the image
            itself.
        size_mm: Width and height.
        faces: Faces that may carry it.
        weight: Relative frequency among the stickers_per_face.
        share: Probability that such a face carries it in addition to their number.
        always: Whether every container carries it on these faces.
        kinds: Container kinds that may carry it; an empty list for all.
        across: Place of its centre from left (0) to right (1) on the face.
        up: Place of its centre from bottom (0) to top (1) on the face.
    """

    art: Annotated[str, ArtFile()] = ""
    size_mm: tuple[_Side, _Side] = (200.0, 200.0)
    faces: Annotated[tuple[Face, ...], MinLen(1)] = ("front", "back", "door", "no_door")
    weight: Weight = 1.0
    share: Share = 0.0
    always: Flag = False
    kinds: tuple[Annotated[str, OneOf(tuple(KINDS))], ...] = ()
    across: Annotated[Range, UNIT] = Range(0.0, 1.0)
    up: Annotated[Range, UNIT] = Range(0.0, 1.0)

    def __post_init__(self) -> None:
        """Refuse a sticker without an image."""
        _check_art(self.art)
        check_distinct("faces", self.faces, "give each face once")


@dataclass(frozen=True)
class BrandConfig:
    """A shipping line, whose name, emblem and owner codes containers carry.

    Attributes:
        emblem: Path of a PNG or SVG image, relative to the file that names it. The paint shows
            through transparent parts. The configuration keeps the image itself.
        wordmark: Text below the emblem, of capitals, digits and some signs.
        main_texts: Further large texts; an empty list stands for the wordmark.
        owner_codes: Owner codes, used with the probability identifiers.brand_codes.
        weight: Relative frequency.
        ink: lettering for an emblem in the colour of the container's lettering, art for the
            image's own colours.
    """

    emblem: Annotated[str, ArtFile()] = ""
    wordmark: str = "LINE"
    main_texts: tuple[str, ...] = ()
    owner_codes: tuple[OwnerCode, ...] = ()
    weight: Weight = 1.0
    ink: Annotated[str, OneOf(("lettering", "art"))] = "lettering"

    def __post_init__(self) -> None:
        """Refuse a brand without an emblem, and texts that the fonts cannot write."""
        _check_art(self.emblem, "emblem")
        _check_text("wordmark", self.wordmark)
        for i, text in enumerate(self.main_texts):
            _check_text(f"main_texts[{i}]", text)


def check_class_names(names: Iterable[str], taken: Iterable[str]) -> None:
    """Check the names of a user's classes.

    Args:
        names: Names of the classes.
        taken: Names that have another meaning in the marker task.

    Raises:
        ConfigError: A name is taken; the message starts with the name.
    """
    reserved = {*OTHER_CLASSES, *taken}
    for name in names:
        if name in reserved:
            raise ConfigError(f"{name}: is the name of another class; rename it")


def _check_art(art: str, name: str = "art") -> None:
    if not art:
        raise ConfigError(f"{name}: is missing; give the path of a PNG or SVG image")


def _check_text(name: str, text: str) -> None:
    fonts = glyph_tiles()[1].values()
    known = {" "}.union(*(font.glyphs for font in fonts))
    wrong = [char for char in text if char not in known]
    if wrong or not text.strip():
        signs = "".join(sorted(char for char in known - {BOX} if not char.isalnum()))
        lacking = f"no font has {''.join(dict.fromkeys(wrong))!r}" if wrong else "is blank"
        raise ConfigError(f"{name}: {text!r}: {lacking}; give capitals, digits and {signs!r}")

"""Ranges and probabilities of everything printed or stuck on a container."""

from dataclasses import dataclass, field

from fastgen.artwork import glyph_tiles
from fastgen.mesh import SHEET_FACES
from fastgen.records import LENGTH, UNIT, Range, bounds, check_known, check_order


@dataclass(frozen=True)
class MarkingsConfig:
    """Markers, identifiers, brands and stickers; seafront.txt 3.3.3, Algorithms A1 and A2.

    markers_per_face: how many, drawn uniformly, on each of marker_faces. marker_side_mm: side of
    the square (IMDG Code 5.2.2.2.1.1 asks for 250 mm on containers). second_identifier:
    probability of another identifier on the same long side. brand and main_text: th_alpha and
    th_beta of Algorithm A1, by face.
    """

    marker_faces: tuple[str, ...] = ("front", "back", "door", "no_door")
    markers_per_face: tuple[int, int] = field(default=(1, 6), metadata=bounds(0, 300))
    marker_side_mm: Range = field(default=Range(250, 300), metadata=bounds(20, 5000, "mm"))
    marker_gap_mm: Range = field(default=Range(8, 40), metadata=LENGTH)
    marker_tilt_deg: Range = field(default=Range(-2.5, 2.5), metadata=bounds(-45, 45, "degrees"))
    marker_wear: Range = field(default=Range(0.0, 0.35), metadata=UNIT)
    fonts: tuple[str, ...] = ()  # empty: all that are shipped
    cap_mm: Range = field(default=Range(100, 165), metadata=bounds(100, 2000, "mm"))
    weights_cap_mm: Range = field(default=Range(50, 62), metadata=bounds(50, 1000, "mm"))
    text_wear: Range = field(default=Range(0.0, 0.4), metadata=UNIT)
    second_identifier: float = field(default=0.45, metadata=UNIT)
    vertical: float = field(default=0.3, metadata=UNIT)
    colored_lettering: float = field(default=0.12, metadata=UNIT)
    brand: dict[str, float] = field(
        default_factory=lambda: {"front": 0.6, "back": 0.6, "door": 0.35, "no_door": 0.3},
        metadata=UNIT,
    )
    main_text: dict[str, float] = field(
        default_factory=lambda: {"front": 0.2, "back": 0.2, "door": 0.3, "no_door": 0.2},
        metadata=UNIT,
    )
    brand_cap_mm: Range = field(default=Range(300, 620), metadata=bounds(20, 5000, "mm"))
    stickers_per_face: tuple[int, int] = field(default=(0, 4), metadata=bounds(0, 100))
    sticker_wear: Range = field(default=Range(0.0, 0.5), metadata=UNIT)
    height_marks: float = field(default=0.85, metadata=UNIT)

    def __post_init__(self) -> None:
        """Hold names to those that exist, and each pair of counts to its order."""
        for name in ("marker_faces", "brand", "main_text"):
            for face in getattr(self, name):
                check_known(name, face, SHEET_FACES)
        if self.fonts:
            _, shipped = glyph_tiles()
            for font in self.fonts:
                check_known("fonts", font, shipped)
        for name in ("markers_per_face", "stickers_per_face"):
            check_order(name, getattr(self, name))

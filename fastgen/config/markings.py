"""Ranges and probabilities of everything printed or stuck on a container."""

from dataclasses import dataclass, field

from fastgen.decals.artwork import glyph_tiles
from fastgen.scene.faces import SHEET_FACES
from fastgen.validation import (
    LENGTH,
    UNIT,
    Range,
    bounds,
    check_distinct,
    check_known,
    check_order,
)


@dataclass(frozen=True)
class MarkingsConfig:
    """Markers, identifiers, brands and stickers; SeaFront paper, 3.3.3, Algorithms A1 and A2.

    marker_faces: that have dangerous-goods markers: front, back, door, no_door, roof.
    markers_per_face: how many are asked for on each, every number as likely. The pattern takes as
        many as find room: on doors, beside texts and plates, often fewer.
    marker_side_mm: side of the square; IMDG Code 5.2.2.2.1.1 asks for 250 mm on containers.
    marker_gap_mm: between markers.
    marker_tilt_deg: how askew each is stuck.
    marker_wear: how faded and torn.
    fonts: of the container's lettering, by name; all that are shipped where the list is empty.
    cap_mm: height of an identifier's capitals; ISO 6346 asks for 100 mm. What runs downward on an
        end takes the lowest, and what finds no room is left out, as all other prints are.
    weights_cap_mm: height of the capitals of the weights on the door; ISO 6346 asks for 50 mm.
    text_wear: how worn identifiers and weights are.
    second_identifier: probability of another identifier on the same long side.
    vertical: probability that an identifier runs downward; on no_door 0.6 of the others do too, on
        the roof none does.
    colored_lettering: probability of lettering in a color; else it is white or black.
    brand: probability of a brand by face, th_alpha of Algorithm A1.
    main_text: probability of a further large text by face, th_beta of Algorithm A1.
    brand_cap_mm: height of a brand's capitals; under half of it on the ends.
    stickers_per_face: how many signs and stickers, beside the plates that always come.
    sticker_wear: how faded and torn they are.
    height_marks: probability of the striped marks of high cubes.
    """

    marker_faces: tuple[str, ...] = ("front", "back", "door", "no_door")
    markers_per_face: tuple[int, int] = field(default=(1, 6), metadata=bounds(0, 300))
    marker_side_mm: Range = field(default=Range(250, 300), metadata=bounds(40, 5000, "mm"))
    marker_gap_mm: Range = field(default=Range(8, 40), metadata=LENGTH)
    marker_tilt_deg: Range = field(default=Range(-2.5, 2.5), metadata=bounds(-45, 45, "degrees"))
    marker_wear: Range = field(default=Range(0.0, 0.35), metadata=UNIT)
    fonts: tuple[str, ...] = ()
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
        check_distinct("marker_faces", self.marker_faces, "give more by markers_per_face")
        for name in ("markers_per_face", "stickers_per_face"):
            check_order(name, getattr(self, name))

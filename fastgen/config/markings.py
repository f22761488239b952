"""Ranges and probabilities of everything that is printed or stuck on a container."""

from dataclasses import dataclass, field
from typing import Annotated

from fastgen.classes import ALL_DETECTION_CLASSES, DETECTION_CLASSES, MARK_CLASSES
from fastgen.config.identifiers import IdentifierConfig
from fastgen.decals.artwork import glyph_tiles
from fastgen.scene.faces import SHEET_FACES
from fastgen.validation import (
    LENGTH,
    UNIT,
    Bounds,
    OneOf,
    Range,
    Share,
    check_distinct,
    check_known,
)

_Face = Annotated[str, OneOf(SHEET_FACES)]


@dataclass(frozen=True)
class RepairsConfig:
    """Repairs without a label: patches of welded sheet or of fresh paint, and strips of tape.

    A repair that finds no room is omitted.

    Attributes:
        probability: Share of the containers with repairs.
        count: Number of repairs; all numbers are equally likely.
        side_mm: Sides of a patch. It has nearly the colour of the container, or is primer grey.
        seam: Probability of a visible weld seam around a patch.
        tape: Probability that a repair is tape, silver or brown, instead of a patch.
        tape_mm: Width of a strip of tape.
        at_damage: Probability that a repair of a damaged container is over or beside a damage.
    """

    probability: Share = 0.25
    count: Annotated[tuple[int, int], Bounds(1, 20)] = (1, 3)
    side_mm: Annotated[Range, Bounds(20, 2000, "mm")] = Range(150, 900)
    seam: Share = 0.45
    tape: Share = 0.25
    tape_mm: Annotated[Range, Bounds(10, 300, "mm")] = Range(50, 75)
    at_damage: Share = 0.4


@dataclass(frozen=True)
class ChalkConfig:
    """Surveyors' crayon marks: rings, arrows, crosses, ticks, slashes and codes, without a label.

    Attributes:
        probability: Share of the containers with such marks; it does not depend on damage.
        count: Number of marks; all numbers are equally likely. A mark without room is omitted.
        around_mm: Width and height of the places that marks are put around where no damage is.
        at_damage: Probability that a mark of a damaged container is at a damage.
    """

    probability: Share = 0.2
    count: Annotated[tuple[int, int], Bounds(1, 20)] = (1, 3)
    around_mm: Annotated[Range, Bounds(10, 2000, "mm")] = Range(100, 1500)
    at_damage: Share = 0.5


@dataclass(frozen=True)
class MarkingsConfig:
    """Markers, identifiers, brands and stickers (SeaFront paper, 3.3.3, Algorithms A1 and A2).

    Decals without room are left out.

    Attributes:
        marker_faces: Faces with dangerous-goods markers.
        marked_containers: Share of the containers that carry markers. At a gate, most carry none.
        markers_per_face: Number of markers on each of these faces; all numbers are equally likely.
            Fewer are placed if there is no room, as is frequent beside the texts and plates
            of doors.
        marker_side_mm: Side of the square. IMDG Code 5.2.2.2.1.1 requires 250 mm on containers.
        marker_gap_mm: Gap between markers.
        marker_tilt_deg: Tilt of each marker.
        marker_wear: Scratches, dirt and peeled patches of markers.
        marker_fade: Bleaching of markers.
        marker_torn: Probability that a marker has lost a corner, or two.
        marker_holder: Probability that the markers of a face are in metal holders. Markers closer
            together than 16 mm have none.
        marker_rivets: Probability that rivets hold the markers of a face.
        marker_un_panel: Probability of an orange panel with a UN number beside the markers of a
            face (IMDG Code 5.3.2.1, ADR 5.3.2.2). It has no label.
        removed_markers: Number of removed markers per face: overpainted diamonds, darker than the
            faded paint around them, and glue residue. They have no label.
        marks: Probability of each mark of the IMDG Code on a container. A mark is on all
            marker_faces, but the fumigation warning is on the door alone. Marks that are not named
            are not drawn. If any is named, the marker task has all five as its classes 28 to 32.
        fonts: Names of the fonts to draw from; an empty list stands for all bundled fonts.
        cap_mm: Height of an identifier's capitals. ISO 6346 requires 100 mm. Identifiers on
            the door have the lowest height.
        weights_cap_mm: Height of the capitals of the weights on the door. ISO 6346 requires 50 mm.
        text_wear: Wear of identifiers and weights.
        second_identifier: Probability of a second identifier on the same long side.
        identifiers: Layouts and codes of identifiers.
        colored_lettering: Probability of colored lettering; otherwise it is white or black.
        brand: Probability of a brand by face, th_alpha of Algorithm A1.
        main_text: Probability of another large text by face, th_beta of Algorithm A1.
        brand_cap_mm: Height of a brand's capitals; it is less than half of this on the ends.
        stickers_per_face: Number of signs and stickers, in addition to the plates that every
            container has.
        sticker_wear: Scratches, dirt and peeled patches of stickers.
        patches_per_face: Number of rectangles that were painted over with slightly different paint.
        runs: Probability that dirt has run down from a marker or sticker, and rust from a hole or
            dent; less on clean containers. About as many runs are below nothing.
        repairs: Patches and tape.
        chalk: Crayon marks of surveyors.
        height_marks: Probability of striped height marks on a high cube.
    """

    marker_faces: tuple[_Face, ...] = ("front", "back", "door", "no_door")
    marked_containers: Share = 1.0
    markers_per_face: Annotated[tuple[int, int], Bounds(0, 300)] = (1, 6)
    marker_side_mm: Annotated[Range, Bounds(40, 5000, "mm")] = Range(250, 300)
    marker_gap_mm: Annotated[Range, LENGTH] = Range(8, 40)
    marker_tilt_deg: Annotated[Range, Bounds(-45, 45, "degrees")] = Range(-2.5, 2.5)
    marker_wear: Annotated[Range, UNIT] = Range(0.0, 0.6)
    marker_fade: Annotated[Range, UNIT] = Range(0.0, 0.5)
    marker_torn: Share = 0.12
    marker_holder: Share = 0.12
    marker_rivets: Share = 0.12
    marker_un_panel: Share = 0.15
    removed_markers: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 1)
    marks: dict[Annotated[str, OneOf(MARK_CLASSES)], Share] = field(default_factory=dict)
    fonts: tuple[str, ...] = ()
    cap_mm: Annotated[Range, Bounds(100, 2000, "mm")] = Range(100, 165)
    weights_cap_mm: Annotated[Range, Bounds(50, 1000, "mm")] = Range(50, 62)
    text_wear: Annotated[Range, UNIT] = Range(0.0, 0.4)
    second_identifier: Share = 0.45
    identifiers: IdentifierConfig = field(default_factory=IdentifierConfig)
    colored_lettering: Share = 0.12
    brand: dict[_Face, Share] = field(
        default_factory=lambda: {"front": 0.6, "back": 0.6, "door": 0.35, "no_door": 0.3}
    )
    main_text: dict[_Face, Share] = field(
        default_factory=lambda: {"front": 0.2, "back": 0.2, "door": 0.3, "no_door": 0.2}
    )
    brand_cap_mm: Annotated[Range, Bounds(20, 5000, "mm")] = Range(300, 620)
    stickers_per_face: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 4)
    sticker_wear: Annotated[Range, UNIT] = Range(0.0, 0.5)
    patches_per_face: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 1)
    runs: Share = 0.2
    repairs: RepairsConfig = field(default_factory=RepairsConfig)
    chalk: ChalkConfig = field(default_factory=ChalkConfig)
    height_marks: Share = 0.85

    @property
    def detection_classes(self) -> tuple[str, ...]:
        """Classes of the marker task, in the order of YOLO labels."""
        return ALL_DETECTION_CLASSES if self.marks else DETECTION_CLASSES

    def __post_init__(self) -> None:
        """Refuse unknown fonts and repeated faces."""
        if self.fonts:
            _, bundled = glyph_tiles()
            for font in self.fonts:
                check_known("fonts", font, bundled)
        check_distinct("marker_faces", self.marker_faces, "increase markers_per_face instead")

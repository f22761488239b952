"""Ranges and probabilities of everything that is printed or stuck on a container."""

from dataclasses import dataclass, field
from itertools import chain
from typing import Annotated

from annotated_types import MaxLen

from fastgen.classes import DETECTION_CLASSES, MARK_CLASSES, MARKER_CLASSES
from fastgen.config.fields import FontFile, Weight
from fastgen.config.identifiers import IdentifierConfig
from fastgen.config.own_decals import (
    BrandConfig,
    Face,
    MarkerConfig,
    OwnName,
    StickerConfig,
    check_class_names,
)
from fastgen.decals.artwork import stickers as bundled_stickers
from fastgen.decals.glyphs import add_font, glyph_tiles
from fastgen.decals.own_fonts import MOST_FONTS, OwnFont, forms_of, own_font
from fastgen.errors import ConfigError, did_you_mean
from fastgen.validation import (
    LENGTH,
    UNIT,
    Bounds,
    OneOf,
    Range,
    Share,
    check_distinct,
    check_known,
    check_weights,
)


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
        markers: Changes to single markers by class name, and new markers, which become classes of
            the marker task after those of fastgen.
        other_marker_weight: Relative frequency of the markers of fastgen that `markers` does not
            name. With 0 they are neither drawn nor classes.
        marks: Probability of each mark of the IMDG Code on a container. A mark is on all
            marker_faces, but the fumigation warning is on the door alone. Marks that are not named
            are not drawn. If any is named, the marker task has all five as its classes 28 to 32.
        fonts: Names of the fonts to draw from; an empty list stands for all.
        own_fonts: New fonts by name: paths of TTF, OTF or WOFF files, relative to the file that
            names them. The configuration keeps the letters themselves.
        cap_mm: Height of an identifier's capitals. ISO 6346 requires 100 mm. Identifiers on
            the door have the lowest height.
        weights_cap_mm: Height of the capitals of the weights on the door. ISO 6346 requires 50 mm.
        text_wear: Wear of identifiers and weights.
        second_identifier: Probability of a second identifier on the same long side.
        identifiers: Layouts and codes of identifiers.
        colored_lettering: Probability of colored lettering; otherwise it is white or black.
        brand: Probability of a brand by face, th_alpha of Algorithm A1.
        brands: New brands by name.
        bundled_brand_weight: Relative frequency of each invented brand of fastgen.
        main_text: Probability of another large text by face, th_beta of Algorithm A1.
        brand_cap_mm: Height of a brand's capitals; it is less than half of this on the ends.
        stickers_per_face: Number of signs and stickers, in addition to the plates that every
            container has.
        stickers: New stickers by name.
        sticker_weights: Factor of the frequency of stickers of fastgen, by name; 0 leaves one out.
        labelled_stickers: Names of stickers that become classes of the marker task, after all
            markers.
        sticker_wear: Scratches, dirt and peeled patches of stickers.
        patches_per_face: Number of rectangles that were painted over with slightly different paint.
        runs: Probability that dirt has run down from a marker or sticker, and rust from a hole or
            dent; less on clean containers. About as many runs are below nothing.
        repairs: Patches and tape.
        chalk: Crayon marks of surveyors.
        height_marks: Probability of striped height marks on a high cube.
    """

    marker_faces: tuple[Face, ...] = ("front", "back", "door", "no_door")
    marked_containers: Share = 1.0
    markers_per_face: Annotated[tuple[int, int], Bounds(0, 300)] = (1, 6)
    marker_side_mm: Annotated[Range, Bounds(100, 5000, "mm")] = Range(250, 300)
    marker_gap_mm: Annotated[Range, LENGTH] = Range(8, 40)
    marker_tilt_deg: Annotated[Range, Bounds(-45, 45, "degrees")] = Range(-2.5, 2.5)
    marker_wear: Annotated[Range, UNIT] = Range(0.0, 0.6)
    marker_fade: Annotated[Range, UNIT] = Range(0.0, 0.5)
    marker_torn: Share = 0.12
    marker_holder: Share = 0.12
    marker_rivets: Share = 0.12
    marker_un_panel: Share = 0.15
    removed_markers: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 1)
    markers: dict[OwnName, MarkerConfig] = field(default_factory=dict)
    other_marker_weight: Weight = 1.0
    marks: dict[Annotated[str, OneOf(MARK_CLASSES)], Share] = field(default_factory=dict)
    fonts: tuple[str, ...] = ()
    own_fonts: Annotated[dict[OwnName, Annotated[str, FontFile()]], MaxLen(MOST_FONTS)] = field(
        default_factory=dict
    )
    cap_mm: Annotated[Range, Bounds(100, 2000, "mm")] = Range(100, 165)
    weights_cap_mm: Annotated[Range, Bounds(50, 1000, "mm")] = Range(50, 62)
    text_wear: Annotated[Range, UNIT] = Range(0.0, 0.4)
    second_identifier: Share = 0.45
    identifiers: IdentifierConfig = field(default_factory=IdentifierConfig)
    colored_lettering: Share = 0.12
    brand: dict[Face, Share] = field(
        default_factory=lambda: {"front": 0.6, "back": 0.6, "door": 0.35, "no_door": 0.3}
    )
    brands: dict[OwnName, BrandConfig] = field(default_factory=dict)
    bundled_brand_weight: Weight = 1.0
    main_text: dict[Face, Share] = field(
        default_factory=lambda: {"front": 0.2, "back": 0.2, "door": 0.3, "no_door": 0.2}
    )
    brand_cap_mm: Annotated[Range, Bounds(20, 5000, "mm")] = Range(300, 620)
    stickers_per_face: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 4)
    stickers: dict[OwnName, StickerConfig] = field(default_factory=dict)
    sticker_weights: dict[str, Weight] = field(default_factory=dict)
    labelled_stickers: tuple[str, ...] = ()
    sticker_wear: Annotated[Range, UNIT] = Range(0.0, 0.5)
    patches_per_face: Annotated[tuple[int, int], Bounds(0, 100)] = (0, 1)
    runs: Share = 0.2
    repairs: RepairsConfig = field(default_factory=RepairsConfig)
    chalk: ChalkConfig = field(default_factory=ChalkConfig)
    height_marks: Share = 0.85

    @property
    def marker_weights(self) -> dict[str, float]:
        """Relative frequency of each marker that is drawn, by class: those of fastgen first."""
        weights = dict.fromkeys(MARKER_CLASSES, self.other_marker_weight)
        weights |= {name: marker.weight for name, marker in self.markers.items()}
        return {name: weight for name, weight in weights.items() if weight > 0}

    @property
    def detection_classes(self) -> tuple[str, ...]:
        """Classes of the marker task, in the order of YOLO labels."""
        drawn = self.marker_weights
        bundled = (
            name for name in DETECTION_CLASSES if name not in MARKER_CLASSES or name in drawn
        )
        own = (name for name in drawn if name not in MARKER_CLASSES)
        marks = MARK_CLASSES if self.marks else ()
        return (*bundled, *marks, *own, *self.labelled_stickers)

    @property
    def own_art(self) -> dict[str, str]:
        """Images of the configuration by the names that scenes give them, see decals.own_art."""
        found = {f"marker/{name}": each.art for name, each in self.markers.items()}
        found |= {f"sticker/{name}": each.art for name, each in self.stickers.items()}
        found |= {f"emblem/{name}": each.emblem for name, each in self.brands.items()}
        return {name: text for name, text in found.items() if text}

    def read_fonts(self) -> dict[str, tuple[OwnFont, ...]]:
        """Return the forms of each own font by name: as it is, and condensed if it is wide.

        Scenes can name them from then on.
        """
        read = {name: forms_of(own_font(name, text)) for name, text in self.own_fonts.items()}
        for each in chain.from_iterable(read.values()):
            add_font(each.font)
        return read

    def drawn_fonts(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the fonts to draw from, and condensed forms for places where none of them fits.

        Both are names as scenes give them.
        """
        own = self.read_fonts()
        chosen = self.fonts or (*sorted(glyph_tiles()[1]), *own)
        forms = [[each.font.name for each in own[n]] if n in own else [n] for n in chosen]
        return tuple(first for first, *_ in forms), tuple(n for _, *rest in forms for n in rest)

    def __post_init__(self) -> None:
        """Refuse unknown fonts and stickers, repeated names, and classes that cannot be."""
        if self.fonts or self.own_fonts:
            _, bundled = glyph_tiles()
            for name in self.own_fonts:
                if name in bundled:
                    raise ConfigError(f"own_fonts.{name}: is a font of fastgen; rename yours")
            for font in self.fonts:
                check_known("fonts", font, {*bundled, *self.own_fonts})
        check_distinct("marker_faces", self.marker_faces, "increase markers_per_face instead")
        for name, marker in self.markers.items():
            if not marker.art and name not in MARKER_CLASSES:
                hint = did_you_mean(name, MARKER_CLASSES)
                raise ConfigError(
                    f"markers.{name}.art: is missing, and fastgen has no such marker{hint}; give "
                    "the path of a square PNG or SVG image"
                )
        hint = "give one above 0, or marked_containers: 0"
        check_weights("markers", self.marker_weights.values(), hint)
        lines = [self.bundled_brand_weight, *(brand.weight for brand in self.brands.values())]
        check_weights("brands", lines, "give one above 0, or bundled_brand_weight")
        for name in self.stickers:
            if name in bundled_stickers():
                raise ConfigError(f"stickers.{name}: is a sticker of fastgen; rename yours")
        for name in self.sticker_weights:
            check_known("sticker_weights", name, bundled_stickers())
        for name in self.labelled_stickers:
            check_known("labelled_stickers", name, {*bundled_stickers(), *self.stickers})
        check_distinct("labelled_stickers", self.labelled_stickers, "give each name once")
        try:
            check_class_names(self.markers, ("container", "text", *MARK_CLASSES))
        except ConfigError as error:
            raise ConfigError(f"markers.{error}") from None
        try:
            check_class_names(
                self.labelled_stickers, (*DETECTION_CLASSES, *MARK_CLASSES, *self.markers)
            )
        except ConfigError as error:
            raise ConfigError(f"labelled_stickers: {error}") from None

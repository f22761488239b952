"""Ranges of the kinds of damage; SeaFront paper, section 3.3.2, for the first four."""

from dataclasses import dataclass, field
from typing import Annotated

from fastgen.classes import (
    ALL_DAMAGE_CLASSES,
    DAMAGE_CLASSES,
    segmentation_classes,
)
from fastgen.errors import ConfigError
from fastgen.scene.faces import SHEET_FACES
from fastgen.scene.limits import LOBE_LIMIT, MAX_INSTANCES, MOST_CONTACT_MM
from fastgen.validation import UNIT, Bounds, OneOf, Range, Share, check_distinct

_Extent = Annotated[Range, Bounds(5.0, 20000.0, "mm")]
"""Extent that is cut to the size of the face. Fields are divided by it, so it must not vanish."""

_Reach = Annotated[Range, Bounds(5.0, 2400.0, "mm")]
"""Extent that is not cut to the size of the face."""

_Depth = Annotated[Range, Bounds(0.0, 2400.0, "mm")]
"""Displacement. A container is 2438 mm wide; a deeper dent would come out on the other side."""


@dataclass(frozen=True)
class AxisConfig:
    """Edge or corner post that is pushed in.

    Attributes:
        length_mm: Length along the edge.
        reach_mm: Distance from the edge up to which the faces beside it are bent.
        depth_mm: Largest displacement.
        kinked: Probability that the edge has a local kink instead: a notch of a rail or a bent
            post.
        kink_length_mm: Length of a kink along the edge.
        kink_reach_mm: Distance from the edge up to which a kink bends the faces beside it.
        kink_depth_mm: Largest displacement of a kink.
        kinked_posts: Probability that a kink is in a corner post, just above its lower casting or
            below its upper one. Other kinks may be in any edge.
    """

    length_mm: _Extent = Range(700, 1900)
    reach_mm: _Reach = Range(320, 650)
    depth_mm: _Depth = Range(110, 260)
    kinked: Share = 0.85
    kink_length_mm: _Extent = Range(200, 500)
    kink_reach_mm: _Reach = Range(120, 260)
    kink_depth_mm: _Depth = Range(40, 130)
    kinked_posts: Share = 0.5


@dataclass(frozen=True)
class ConcaveConfig:
    """Area of a face that is bowed inward or outward.

    Attributes:
        length_mm: Horizontal size; along the container on the roof.
        width_mm: Vertical size; across the container on the roof.
        depth_mm: Largest displacement.
        outward: Probability that the area bulges outward.
        at_bottom: Probability that a bulge is at the lower wall and ends at the bottom rail.
        creased: Probability that the sheet breaks into flat parts between sharp folds.
        crease_softness: Length over which a fold is rounded, as a share of the depth.
        flattened: Share by which the corrugation between the folds is flattened.
    """

    length_mm: _Extent = Range(900, 2600)
    width_mm: _Extent = Range(800, 2000)
    depth_mm: _Depth = Range(110, 250)
    outward: Share = 0.3
    at_bottom: Share = 0.7
    creased: Share = 0.85
    crease_softness: Annotated[Range, Bounds(1e-3, 1.0)] = Range(0.02, 0.2)
    flattened: Annotated[Range, UNIT] = Range(0.0, 0.3)


@dataclass(frozen=True)
class RibMarksConfig:
    """Crush marks on the outer ribs, in a row at one height.

    Attributes:
        probability: Probability that a dent is such a row.
        length_mm: Length of the row.
        height_mm: Height of its marks.
        depth_mm: Distance by which the object that was pressed against the wall reaches in.
        unevenness: Variation of the depth along the row.
        turn_deg: Angle between the row and the horizontal.
    """

    probability: Share = 0.7
    length_mm: _Extent = Range(120, 2200)
    height_mm: _Reach = Range(90, 380)
    depth_mm: _Depth = Range(20, 65)
    unevenness: Annotated[Range, UNIT] = Range(0.0, 0.7)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-6, 6)


@dataclass(frozen=True)
class DentedConfig:
    """Narrow fold along a path.

    Attributes:
        length_mm: Length of the path.
        width_mm: Width of the area that sinks along the path.
        depth_mm: Largest depth of the crease.
        crease_mm: Half width of the crease.
        sink_share: Depth of the sunken area as a share of depth_mm.
        amplitude_mm: Amplitude of the swings of the path.
        wavelength_mm: Wavelength of the swings.
        stretch_mm: Length of the stretches in which the path alternately swings and runs straight.
        turn_deg: Angle between the path and the horizontal.
        marks: Rows of crush marks on the ribs, which take the place of most folds.
    """

    length_mm: _Extent = Range(600, 1700)
    width_mm: _Reach = Range(180, 420)
    depth_mm: _Depth = Range(40, 90)
    crease_mm: Annotated[Range, Bounds(5, 1000, "mm")] = Range(35, 70)
    sink_share: Annotated[Range, UNIT] = Range(0.25, 0.5)
    amplitude_mm: _Depth = Range(25, 110)
    wavelength_mm: Annotated[Range, Bounds(20, 1e5, "mm")] = Range(280, 800)
    stretch_mm: Annotated[Range, Bounds(20, 1e5, "mm")] = Range(250, 600)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-50, 50)
    marks: RibMarksConfig = field(default_factory=RibMarksConfig)


@dataclass(frozen=True)
class PerforationConfig:
    """Torn hole.

    Attributes:
        diameter_mm: Mean diameter.
        rim_mm: Width of the rim that is bent inward.
        depth_mm: Displacement of the rim at the edge of the hole.
        lobes: Amplitude of each of the five harmonics of the outline, as a share of the radius.
        torn: Probability that the hole is a slit, flap, triangle or L instead of a star.
        tear_length_mm: Length of such a tear.
        tear_aspect: Length divided by width.
        split: Probability that a tear is a long split along a rib or across the ribs.
        split_length_mm: Length of such a split.
        split_gape_mm: Width of such a split.
        teeth_mm: Height of the teeth of its edges.
        twist: Amount by which its lower lip bends less than the upper; above 1 it bends outward.
        at_castings: Probability that a hole in the roof is near a casting. Its rim then ends within
            350 mm of the frame in both directions.
    """

    diameter_mm: Annotated[Range, Bounds(5, 2000, "mm")] = Range(90, 320)
    rim_mm: Annotated[Range, Bounds(5, 1000, "mm")] = Range(50, 150)
    depth_mm: _Depth = Range(35, 100)
    lobes: Annotated[Range, Bounds(0.0, LOBE_LIMIT)] = Range(0.05, 0.16)
    torn: Share = 0.85
    tear_length_mm: _Extent = Range(90, 700)
    tear_aspect: Annotated[Range, Bounds(1.0, 100.0)] = Range(2.0, 7.0)
    split: Share = 0.15
    split_length_mm: _Extent = Range(500, 2500)
    split_gape_mm: _Extent = Range(15, 90)
    teeth_mm: _Depth = Range(1, 9)
    twist: Annotated[Range, Bounds(0.0, 2.0)] = Range(0.0, 1.6)
    at_castings: Share = 0.7


@dataclass(frozen=True)
class ScrapeConfig:
    """Bundle of parallel scratches without displacement.

    Attributes:
        length_mm: Length of the bundle.
        width_mm: Height of the bundle.
        turn_deg: Angle between the scratches and the horizontal.
        pitch_mm: Distance between scratches.
        density: Probability of a scratch at each such distance.
        contact_mm: Depth behind the outermost sheet up to which it is scraped. Small values leave
            the troughs of the corrugation alone.
        paint: Probability that the scratches show the paint of another object.
        beside: Probability that a dent or a bowed area has a scrape beside it. It applies where
            `kinds` has scrapes.
    """

    length_mm: _Extent = Range(300, 2500)
    width_mm: _Extent = Range(60, 450)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-12, 12)
    pitch_mm: Annotated[Range, Bounds(1.0, 500.0, "mm")] = Range(6, 24)
    density: Annotated[Range, UNIT] = Range(0.3, 0.9)
    contact_mm: Annotated[Range, Bounds(5.0, MOST_CONTACT_MM, "mm")] = Range(8, 60)
    paint: Share = 0.35
    beside: Share = 0.5


@dataclass(frozen=True)
class DamageConfig:
    """Frequency and kinds of damage (SeaFront paper, Table 2).

    Attributes:
        probability: Probability that a container is damaged.
        count: Number of damages of a damaged container; all numbers are equally likely.
        kinds: Kinds to draw from; all are equally likely. `scrape` is not among the paper's kinds.
            It becomes a sixth class of the damage task where it is listed.
        faces: Faces to draw from; axis damages are not limited to them but take any edge. The
            extents below are cut to the size of the face.
        mask_threshold_mm: Displacement above which a pixel belongs to the mask of a damage. The
            mask of a scrape covers the area of its scratches that no other damage moves.
    """

    probability: Share = 0.4
    count: Annotated[tuple[int, int], Bounds(0, MAX_INSTANCES)] = (1, 4)
    kinds: tuple[Annotated[str, OneOf(ALL_DAMAGE_CLASSES)], ...] = DAMAGE_CLASSES
    faces: tuple[Annotated[str, OneOf(SHEET_FACES)], ...] = ("front", "back", "door", "no_door")
    mask_threshold_mm: Annotated[float, Bounds(0.1, 1000.0, "mm")] = 5.0
    axis: AxisConfig = field(default_factory=AxisConfig)
    concave: ConcaveConfig = field(default_factory=ConcaveConfig)
    dented: DentedConfig = field(default_factory=DentedConfig)
    perforation: PerforationConfig = field(default_factory=PerforationConfig)
    scrape: ScrapeConfig = field(default_factory=ScrapeConfig)

    @property
    def segmentation_classes(self) -> tuple[str, ...]:
        """Classes of the damage task, in the order of YOLO labels."""
        return segmentation_classes(self.kinds)

    def __post_init__(self) -> None:
        """Refuse repeated names, and damages that have no face."""
        for name in ("kinds", "faces"):
            check_distinct(name, getattr(self, name), "each is as likely as any other")
        if not self.faces and set(self.kinds) - {"axis"}:
            raise ConfigError("faces: the list is empty; give at least one, or kinds: [axis]")

    @property
    def bulge_mm(self) -> float:
        """Largest outward displacement of a face by one damage."""
        if not (self.probability > 0 and self.count[1] > 0):
            return 0.0
        bulge, hole, most = self.concave, self.perforation, 0.0
        if "concave" in self.kinds and bulge.outward > 0:
            most = bulge.depth_mm.hi
        if "perforation" in self.kinds and hole.torn > 0:
            most = max(most, hole.depth_mm.hi * (hole.twist.hi - 1))
        return most

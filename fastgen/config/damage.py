"""Ranges of the four kinds of damage, SeaFront paper, section 3.3.2; all lengths in millimetres."""

from dataclasses import dataclass, field

from fastgen.classes import DAMAGE_CLASSES
from fastgen.errors import ConfigError
from fastgen.scene.faces import SHEET_FACES
from fastgen.scene.limits import LOBE_LIMIT, MAX_INSTANCES
from fastgen.validation import UNIT, Range, bounds, check_distinct, check_known, check_order

EXTENT = bounds(5.0, 20000.0, "mm")
"""Of what a face cuts off. Fields are scaled by their extents, which must not vanish."""

DEPTH = bounds(0.0, 2400.0, "mm")
"""Of what goes in, or to a side: a container is 2438 mm wide, and what is pushed in deeper comes
out on the other side."""

REACH = bounds(5.0, 2400.0, "mm")
"""As EXTENT, of what no face cuts off."""


@dataclass(frozen=True)
class AxisConfig:
    """An edge or corner post pushed in.

    length_mm: along the edge.
    reach_mm: how far its neighbours are dragged along.
    depth_mm: at its deepest.
    """

    length_mm: Range = field(default=Range(700, 1900), metadata=EXTENT)
    reach_mm: Range = field(default=Range(320, 650), metadata=REACH)
    depth_mm: Range = field(default=Range(110, 260), metadata=DEPTH)


@dataclass(frozen=True)
class ConcaveConfig:
    """A whole area of a face bowed.

    length_mm: across the face.
    width_mm: up the face.
    depth_mm: at its deepest.
    outward: probability that it bulges instead.
    """

    length_mm: Range = field(default=Range(900, 2600), metadata=EXTENT)
    width_mm: Range = field(default=Range(800, 2000), metadata=EXTENT)
    depth_mm: Range = field(default=Range(110, 250), metadata=DEPTH)
    outward: float = field(default=0.3, metadata=UNIT)


@dataclass(frozen=True)
class DentedConfig:
    """A fine fold along a path.

    length_mm: of the path.
    width_mm: of what sinks along it.
    depth_mm: of the crease, where it is deepest.
    crease_mm: half width of the crease.
    sink_share: part of the depth that the surroundings sink by.
    amplitude_mm: how far the path swings where it does.
    wavelength_mm: of its swings.
    stretch_mm: it swings and runs straight by turns of this length.
    turn_deg: angle of the path against the horizontal.
    """

    length_mm: Range = field(default=Range(600, 1700), metadata=EXTENT)
    width_mm: Range = field(default=Range(180, 420), metadata=REACH)
    depth_mm: Range = field(default=Range(40, 90), metadata=DEPTH)
    crease_mm: Range = field(default=Range(35, 70), metadata=bounds(5, 1000, "mm"))
    sink_share: Range = field(default=Range(0.25, 0.5), metadata=UNIT)
    amplitude_mm: Range = field(default=Range(25, 110), metadata=DEPTH)
    wavelength_mm: Range = field(default=Range(280, 800), metadata=bounds(20, 1e5, "mm"))
    stretch_mm: Range = field(default=Range(250, 600), metadata=bounds(20, 1e5, "mm"))
    turn_deg: Range = field(default=Range(-50, 50), metadata=bounds(-180, 180, "degrees"))


@dataclass(frozen=True)
class PerforationConfig:
    """A torn hole.

    diameter_mm: on the mean.
    rim_mm: width of the sheet around it that is bent in.
    depth_mm: how far it is, at the edge.
    lobes: how far the outline strays from a circle, as a share of the radius, five times over.
    """

    diameter_mm: Range = field(default=Range(90, 320), metadata=bounds(5, 2000, "mm"))
    rim_mm: Range = field(default=Range(50, 150), metadata=bounds(5, 1000, "mm"))
    depth_mm: Range = field(default=Range(35, 100), metadata=DEPTH)
    lobes: Range = field(default=Range(0.05, 0.16), metadata=bounds(0.0, LOBE_LIMIT))


@dataclass(frozen=True)
class DamageConfig:
    """How often a container is damaged and how (SeaFront paper, Table 2).

    probability: of a container that is damaged.
    count: how many damages it has then, each number as likely.
    kinds: axis, concave, dented, perforation; each as likely as any other.
    faces: front, back, door, no_door, roof; where all but axis happen, which takes any edge.
        Lengths and widths below are cut to what a face has room for.
    mask_threshold_mm: the mask of a damage is where it moved the sheet farther than this.
    """

    probability: float = field(default=0.4, metadata=UNIT)
    count: tuple[int, int] = field(default=(1, 4), metadata=bounds(0, MAX_INSTANCES))
    kinds: tuple[str, ...] = DAMAGE_CLASSES
    faces: tuple[str, ...] = ("front", "back", "door", "no_door")
    mask_threshold_mm: float = field(default=5.0, metadata=bounds(0.1, 1000.0, "mm"))
    axis: AxisConfig = field(default_factory=AxisConfig)
    concave: ConcaveConfig = field(default_factory=ConcaveConfig)
    dented: DentedConfig = field(default_factory=DentedConfig)
    perforation: PerforationConfig = field(default_factory=PerforationConfig)

    def __post_init__(self) -> None:
        """Hold names to those that exist and the counts to their order."""
        for i, kind in enumerate(self.kinds):
            check_known(f"kinds[{i}]", kind, DAMAGE_CLASSES)
        for i, face in enumerate(self.faces):
            check_known(f"faces[{i}]", face, SHEET_FACES)
        for name in ("kinds", "faces"):
            check_distinct(name, getattr(self, name), "each is as likely as any other")
        if not self.faces and set(self.kinds) - {"axis"}:
            raise ConfigError("faces: the list is empty; give at least one, or kinds: [axis]")
        check_order("count", self.count)

    @property
    def bulge_mm(self) -> float:
        """How far a damage may stand out of its face."""
        damaged = self.probability > 0 and self.count[1] > 0
        bulges = damaged and "concave" in self.kinds and self.concave.outward > 0
        return self.concave.depth_mm.hi if bulges else 0.0

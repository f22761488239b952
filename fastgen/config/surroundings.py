"""Surroundings of the container: further containers, vehicles below them, and the ground."""

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import MinLen

from fastgen.config.fields import HexColors, Weight
from fastgen.scene.limits import GROUNDS, LOWEST_GROUND_MM, MAX_NEIGHBOURS
from fastgen.validation import UNIT, Bounds, OneOf, Range, Share, check_weights

ARRANGEMENTS = ("alone", "lifted", "standing", "row", "stack", "trailer", "wagon", "twin")
"""Arrangements of a scene's containers."""

_Gap = Annotated[Range, Bounds(0.0, 20000.0, "mm")]
_Albedo = Annotated[Range, UNIT]


@dataclass(frozen=True)
class PlacementConfig:
    """Arrangement of the container, its neighbours and the ground.

    The cameras follow the container. A neighbour is not placed if it would overlap something or be
    within 300 mm of a camera. Neighbours may hide at most 60 % of the container's visible box from
    a camera. A camera less than 300 mm above the ground is raised to that height; below a lifted
    container, the ground is lowered instead.

    Attributes:
        arrangements: Relative frequency of each arrangement. alone: only the container and the
            HDRI. lifted: in the air above its neighbours. standing: on the ground without
            neighbours. row: neighbours beside it and at its ends. stack: in a pile among other
            piles. trailer: on a trailer, with trailers in other lanes. wagon: on a rail wagon,
            with other wagons around. twin: two 20-foot containers end to end, on a trailer or
            lifted; containers of other kinds draw one of the other arrangements.
        neighbours: Number of further containers; all numbers are equally likely. A twin has one
            more, its second container.
        lift_mm: Height of a lifted container above the ground.
        lifted_twins: Share of twins that are lifted.
        tiers: Containers in a pile; all numbers are equally likely. A pile has containers of one
            length. Fewer are placed if there are not enough neighbours.
        tier_gap_mm: Height of the twist locks between the containers of a pile.
        row_gap_mm: Gap between the long sides of neighbours in a row and of piles.
        end_gap_mm: Gap between the ends of neighbours in a row, of piles and of wagons.
        twin_gap_mm: Gap between the ends of twins.
        lane_mm: Distance between the centre lines of adjacent lanes or tracks.
        islands: Probability of raised islands with bollards on both sides of a trailer's lane.
        yaw_deg: Deviation of a neighbour's or pile's direction from that of the container.
        turned: Probability that the door of a neighbour is at the other end.
        offset_mm: Deviation of a neighbour's or pile's position, along and across.
        lane_offset_mm: Deviation along the lane of containers in lanes, instead of offset_mm.
        damaged: Frequency of damage on neighbours, as a share of damage.probability.
        marked: Frequency of markers on neighbours, as a share of markings.marked_containers.
        same_paint: Probability that a neighbour has the color of the container.
    """

    arrangements: dict[Annotated[str, OneOf(ARRANGEMENTS)], Weight] = field(
        default_factory=lambda: {"alone": 1.0}
    )
    neighbours: Annotated[tuple[int, int], Bounds(0, MAX_NEIGHBOURS)] = (1, 4)
    lift_mm: Annotated[Range, Bounds(0.0, -LOWEST_GROUND_MM, "mm")] = Range(1500, 9000)
    lifted_twins: Share = 0.3
    tiers: Annotated[tuple[int, int], Bounds(1, 9)] = (2, 4)
    tier_gap_mm: Annotated[Range, Bounds(0.0, 500.0, "mm")] = Range(25, 25)
    row_gap_mm: _Gap = Range(300, 900)
    end_gap_mm: _Gap = Range(350, 1200)
    twin_gap_mm: _Gap = Range(76, 76)
    lane_mm: Annotated[Range, Bounds(2500.0, 20000.0, "mm")] = Range(3500, 4500)
    islands: Share = 0.0
    yaw_deg: Annotated[Range, Bounds(-45.0, 45.0, "degrees")] = Range(-1.5, 1.5)
    turned: Share = 0.5
    offset_mm: Annotated[Range, Bounds(-5000.0, 5000.0, "mm")] = Range(-60, 60)
    lane_offset_mm: Annotated[Range, Bounds(-30000.0, 30000.0, "mm")] = Range(-4000, 4000)
    damaged: Share = 0.5
    marked: Share = 1.0
    same_paint: Share = 0.2

    def __post_init__(self) -> None:
        """Refuse arrangements without any weight."""
        check_weights("arrangements", self.arrangements.values())

    @property
    def chosen(self) -> frozenset[str]:
        """Names of the arrangements that may occur."""
        return frozenset(name for name, weight in self.arrangements.items() if weight > 0)

    @property
    def grounded(self) -> frozenset[str]:
        """Names of the arrangements that may occur and have ground just below the container."""
        in_the_air = {"alone", "lifted"} | ({"twin"} if self.lifted_twins == 1 else set())
        return self.chosen - in_the_air

    @property
    def has_neighbours(self) -> bool:
        """True if a scene may have neighbours."""
        several = self.chosen - {"alone", "standing"}
        return "twin" in several or bool(several and self.neighbours[1] > 0)


@dataclass(frozen=True)
class GroundConfig:
    """Level ground below the containers, in all arrangements but alone.

    Attributes:
        kinds: Relative frequency of each kind of ground.
        asphalt: Albedo of dry asphalt; black when new, grey when old.
        concrete: Albedo of dry concrete.
        paving: Albedo of dry paving stones.
        wet_probability: Probability of wet ground in a scene without rain. In a scene with wet
            containers, the ground is at least as wet as they are.
        wetness: Wetness of wet ground; puddles cover low places first.
        wear: Strength of stains, cracks and patches.
        line_probability: Probability of painted lines along the containers.
        line_paint: Share of the paint that remains on the lines.
        line_colors: Colors of the lines; all are equally likely.
        line_spacing_mm: Distance between parallel lines.
        line_yaw_deg: Direction of the lines, relative to the length of the container.
        reach_mm: Horizontal distance at which the ground has faded completely into the HDRI. It
            starts to fade at half of this distance. Behind the containers of the scene, obstacles
            in the container map of an HDRI hide the ground.
    """

    kinds: Annotated[dict[Annotated[str, OneOf(GROUNDS)], Weight], MinLen(1)] = field(
        default_factory=lambda: {"asphalt": 0.5, "concrete": 0.25, "paving": 0.25}
    )
    asphalt: _Albedo = Range(0.05, 0.16)
    concrete: _Albedo = Range(0.2, 0.38)
    paving: _Albedo = Range(0.12, 0.3)
    wet_probability: Share = 0.15
    wetness: _Albedo = Range(0.3, 1.0)
    wear: _Albedo = Range(0.2, 1.0)
    line_probability: Share = 0.5
    line_paint: _Albedo = Range(0.1, 0.9)
    line_colors: HexColors = ("#dcdcd4", "#d8b23c")
    line_spacing_mm: Annotated[Range, Bounds(200.0, 1e5, "mm")] = Range(3000, 4500)
    line_yaw_deg: Annotated[Range, Bounds(-180.0, 180.0, "degrees")] = Range(-4, 4)
    reach_mm: Annotated[Range, Bounds(2000.0, 1.5e5, "mm")] = Range(25000, 60000)

    def __post_init__(self) -> None:
        """Refuse kinds without any weight."""
        check_weights("kinds", self.kinds.values())

    def albedo(self, kind: str) -> Range:
        """Return the albedo of dry ground of a kind."""
        return {"asphalt": self.asphalt, "concrete": self.concrete, "paving": self.paving}[kind]

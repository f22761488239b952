"""Sampling of arrangements: the support of the container, and possible sites of its neighbours."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fastgen.config.config import Config
from fastgen.sampling.ground import island_props, trailer_props, wagon_props
from fastgen.sampling.streams import Streams, weighted_choice
from fastgen.scene import Pose, Prop, Vec3
from fastgen.scene.boxes import rotation_of
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.limits import LOWEST_GROUND_MM

_WIDTH_MM = KINDS["20"].width_mm
"""Width of all kinds."""

_ROWS = range(-3, 4)
_COLUMNS = range(-1, 2)

_DISORDER = 1.5
"""Largest random number, in rows, that is added to the distances by which cells are sorted."""

_TIER_OFFSET_MM = 10.0
"""Largest offset of a container in a pile from the one below; twist locks allow no more."""

_ON_GROUND = 0.5
"""Share of the neighbours below a lifted container that are on the ground, not on a trailer."""

_VEHICLES = {"trailer": trailer_props, "wagon": wagon_props}

_PARTS = 13
"""Largest number of parts of a vehicle, because a scene has at most MAX_PROPS. Smaller parts are
not drawn."""

Cell = tuple[int, int]
"""Row and column of a pile; the container's own is (0, 0). Rows follow y and columns x."""


class Site(NamedTuple):
    """Place for a neighbour.

    Attributes:
        name: Prefix of its random streams.
        kind: Container kind.
        pose: Pose of the container in the world.
        props: Parts of the vehicle below it, in the world.
    """

    name: str
    kind: str
    pose: Pose
    props: tuple[Prop, ...] = ()


class Plan(NamedTuple):
    """Arrangement of a scene before its neighbours are chosen.

    Attributes:
        ground_mm: Height of the ground; None without ground.
        props: Parts of the vehicle below the container and of the islands beside its lane, in the
            world.
        below: Sites below the container, from the top; they are taken together or not at all.
        above: Sites on the container, from the bottom.
        twin: Site of the container's twin, or None.
        wanted: Number of neighbours besides the twin.
        piles: Further sites, the preferred ones first; each pile is filled from the bottom.
    """

    ground_mm: float | None = None
    props: tuple[Prop, ...] = ()
    below: tuple[Site, ...] = ()
    above: tuple[Site, ...] = ()
    twin: Site | None = None
    wanted: int = 0
    piles: Iterable[Sequence[Site]] = ()


def sample_plan(
    config: Config,
    kind: str,
    held: bool,
    floor_mm: float,
    streams: Streams,
    at_bottom: bool = False,
) -> Plan:
    """Sample the arrangement of a scene.

    Args:
        config: Distribution of scenes.
        kind: Kind of the container.
        held: True if a spreader is on the container, so that no container can be.
        floor_mm: Greatest height of the ground below a lifted container.
        streams: Function from the name of a property to its independent random generator.
        at_bottom: Put the container at the bottom of its pile.
    """
    weights = config.placement.arrangements
    if kind != "20":
        weights = {name: weight for name, weight in weights.items() if name != "twin"}
    name = weighted_choice(streams("placement"), weights)
    if name == "alone":
        return Plan()
    here = _Place(config, kind, floor_mm, streams)
    low, high = config.placement.neighbours
    count = int(streams("placement.neighbours").integers(low, high + 1))
    match name:
        case "standing":
            return Plan(0.0)
        case "row":
            cells = here.ordered(_ROWS, _COLUMNS)
            return Plan(0.0, wanted=count, piles=([here.bottom(cell, 0.0)] for cell in cells))
        case "stack":
            return here.stack(count, held, at_bottom)
        case "trailer":
            return here.on_vehicle("trailer", count, here.ordered(_ROWS, (0,)))
        case "wagon":
            return here.on_vehicle("wagon", count, here.ordered(_ROWS, _COLUMNS))
        case "lifted":
            return here.lifted(count)
        case _:
            return here.twins(count)


@dataclass(frozen=True)
class _Place:
    """Surroundings of one container."""

    config: Config
    kind: str
    floor_mm: float
    streams: Streams

    @cached_property
    def length_mm(self) -> float:
        return KINDS[self.kind].length_mm

    def draw(self, name: str) -> float:
        """Draw a length of the placement that all neighbours share."""
        return float(getattr(self.config.placement, name).draw(self.streams(f"placement.{name}")))

    def ordered(self, rows: Iterable[int], columns: Iterable[int]) -> list[Cell]:
        """Return all cells except the container's own in random order, near ones mostly first."""
        cells = [(row, column) for column in columns for row in rows]
        handicaps = self.streams("placement.order").uniform(0, _DISORDER, len(cells))
        far = [
            abs(row) + abs(column) + h for (row, column), h in zip(cells, handicaps, strict=True)
        ]
        return [cells[i] for i in np.argsort(far) if cells[i] != (0, 0)]

    def stack(self, count: int, held: bool, at_bottom: bool) -> Plan:
        """Return a plan with the container in a pile, among other piles."""
        rng = self.streams("placement.tiers")
        low, high = self.config.placement.tiers
        tiers = min(int(rng.integers(low, high + 1)), count + 1)
        lower = tiers - 1 if held else int(rng.integers(tiers))
        if at_bottom:
            lower = 0
        gap, bottom, top = self.draw("tier_gap_mm"), 0.0, KINDS[self.kind].height_mm
        below, above = [], []
        for tier in range(1, lower + 1):
            name = _name((0, 0), -tier)
            kind = self._kind(name, self.length_mm)
            bottom -= gap + KINDS[kind].height_mm
            below.append(self._in_pile(name, kind, Pose((0.0, 0.0, bottom))))
        for tier in range(1, 1 if held else tiers - lower):
            name = _name((0, 0), tier)
            kind = self._kind(name, self.length_mm)
            above.append(self._in_pile(name, kind, Pose((0.0, 0.0, top + gap))))
            top += gap + KINDS[kind].height_mm
        cells = self.ordered(_ROWS, _COLUMNS)
        piles = (self._pile(cell, bottom, gap) for cell in cells)
        return Plan(bottom, below=tuple(below), above=tuple(above), wanted=count, piles=piles)

    def on_vehicle(self, vehicle: str, count: int, cells: Iterable[Cell]) -> Plan:
        """Return a plan with all containers on vehicles in lanes or on tracks."""
        height, props = self._vehicle(vehicle, "placement", self.kind, Pose())
        if vehicle == "trailer":
            props += self._islands(-height)
        piles = ([self.bottom(cell, -height, vehicle)] for cell in cells)
        return Plan(-height, props=props, wanted=count, piles=piles)

    def lifted(self, count: int) -> Plan:
        """Return a plan with the container above neighbours on the ground and on trailers."""
        ground = self._ground_mm()
        cells = [(0, 0), *self.ordered(_ROWS, (0,))]
        return Plan(ground, wanted=count, piles=self._below(cells, ground))

    def twins(self, count: int) -> Plan:
        """Return a plan with two containers end to end on one trailer, or in the air."""
        rng = self.streams("placement.twin")
        apart = float(rng.choice([-1.0, 1.0])) * (self.length_mm + self.draw("twin_gap_mm"))
        # both doors are at the same end, so that a camera at that end sees a door in any case
        twin = Site("twin", self.kind, Pose((round(apart, 1), 0.0, 0.0)))
        cells = self.ordered(_ROWS, (0,))
        if rng.random() < self.config.placement.lifted_twins:
            ground = self._ground_mm()
            return Plan(ground, twin=twin, wanted=count, piles=self._below(cells, ground))
        middle = Pose((round(apart / 2, 1), 0.0, 0.0))
        height, props = self._vehicle("trailer", "placement", "40", middle)
        props += self._islands(-height)
        piles = ([self.bottom(cell, -height, "trailer")] for cell in cells)
        return Plan(-height, props=props, twin=twin, wanted=count, piles=piles)

    def bottom(
        self, cell: Cell, ground_mm: float, vehicle: str = "", in_lanes: bool = False
    ) -> Site:
        """Return a site on the ground or on a vehicle; vehicles are in lanes in any case."""
        placement, name = self.config.placement, _name(cell, 0)
        kind = self._kind(name)
        x, y = self._middle_mm(cell, kind, in_lanes or bool(vehicle))
        turn = 0.0
        rng = self.streams(f"{name}.pose")
        along = (
            placement.lane_offset_mm if in_lanes or vehicle == "trailer" else placement.offset_mm
        )
        x += along.draw(rng)
        aside, yaw = placement.offset_mm.draw(rng), placement.yaw_deg.draw(rng)
        if vehicle != "wagon":  # rails are straight
            y, turn = y + aside, yaw
        turn += 180.0 * float(rng.random() < placement.turned)
        pose = Pose((round(x, 1), round(y, 1), round(ground_mm, 1)), round(turn, 3))
        if not vehicle:
            return Site(name, kind, pose)
        height, props = self._vehicle(vehicle, name, kind, pose)
        lifted = (replace(prop, pose=_raised(prop.pose, height)) for prop in props)
        return Site(name, kind, _raised(pose, height), tuple(lifted))

    def _islands(self, ground_mm: float) -> tuple[Prop, ...]:
        """Return the parts of the islands beside the container's lane, if there are any."""
        rng = self.streams("placement.islands")
        if rng.random() >= self.config.placement.islands:
            return ()
        return island_props(self.draw("lane_mm"), ground_mm, rng)

    def _ground_mm(self) -> float:
        """Return the height of the ground below a lifted container."""
        return round(max(min(-self.draw("lift_mm"), self.floor_mm), LOWEST_GROUND_MM), 1)

    def _below(self, cells: Iterable[Cell], ground_mm: float) -> Iterator[list[Site]]:
        """Yield sites on the ground and on trailers below a lifted container."""
        for cell in cells:
            standing = self.streams(f"{_name(cell, 0)}.standing").random() < _ON_GROUND
            yield [self.bottom(cell, ground_mm, "" if standing else "trailer", in_lanes=True)]

    def _pile(self, cell: Cell, ground_mm: float, gap_mm: float) -> list[Site]:
        """Return the sites of a pile, from the bottom."""
        low, high = self.config.placement.tiers
        tiers = int(self.streams(f"{_name(cell, 0)}.tiers").integers(low, high + 1))
        sites = [self.bottom(cell, ground_mm)]
        for tier in range(1, tiers):
            last, name = sites[-1], _name(cell, tier)
            kind = self._kind(name, KINDS[last.kind].length_mm)
            pose = _raised(last.pose, KINDS[last.kind].height_mm + gap_mm)
            sites.append(self._in_pile(name, kind, pose))
        return sites

    def _in_pile(self, name: str, kind: str, pose: Pose) -> Site:
        """Return a site in a pile, with a small random offset and its door at a random end."""
        rng = self.streams(f"{name}.pose")
        x, y = rng.uniform(-_TIER_OFFSET_MM, _TIER_OFFSET_MM, 2).round(1).tolist()
        yaw = 180.0 * float(rng.random() < self.config.placement.turned)
        at = pose.position_mm
        moved = (round(at[0] + x, 1), round(at[1] + y, 1), round(at[2], 1))
        return Site(name, kind, Pose(moved, round(pose.yaw_deg + yaw, 3)))

    def _kind(self, name: str, length_mm: float | None = None) -> str:
        """Draw a container kind, of a given length if any is given."""
        kinds = self.config.container.kinds
        if length_mm is not None:
            kinds = {k: w for k, w in kinds.items() if KINDS[k].length_mm == length_mm}
        return weighted_choice(self.streams(f"{name}.kind"), kinds)

    def _middle_mm(self, cell: Cell, kind: str, in_lanes: bool) -> tuple[float, float]:
        """Return x and y of a cell's middle, before the deviation of its container."""
        row, column = cell
        placement, side, end = self.config.placement, int(np.sign(row)), int(np.sign(column))
        length = KINDS[kind].length_mm
        if in_lanes:
            y = row * self.draw("lane_mm")
        else:
            gaps = (
                placement.row_gap_mm.draw(self.streams(f"placement.row_gap.{side * number}"))
                for number in range(1, abs(row) + 1)
            )
            y = side * sum(_WIDTH_MM + gap for gap in gaps)
        rng = self.streams(f"{_name(cell, 0)}.along")
        if end:
            gap = placement.end_gap_mm.draw(rng)
            return end * (self.length_mm / 2 + gap + length / 2), y
        return float(rng.uniform(-1, 1)) * abs(self.length_mm - length) / 2, y

    def _vehicle(
        self, vehicle: str, name: str, kind: str, pose: Pose
    ) -> tuple[float, tuple[Prop, ...]]:
        """Return the height of a container on a vehicle, and the vehicle's parts in the world."""
        low_mm, parts = _VEHICLES[vehicle](kind, self.streams(f"{name}.vehicle"))
        props = sorted(parts, key=lambda prop: -math.prod(prop.size_mm))[:_PARTS]
        turn, at = rotation_of(pose), np.array(pose.position_mm)
        placed = []
        for prop in props:
            middle = at + turn @ np.array(prop.pose.position_mm)
            yaw = round(prop.pose.yaw_deg + pose.yaw_deg, 3)
            placed.append(replace(prop, pose=Pose(_rounded(middle), yaw)))
        return -low_mm, tuple(placed)


def _name(cell: Cell, tier: int) -> str:
    return f"neighbour.{cell[0]}.{cell[1]}.{tier}"


def _raised(pose: Pose, height_mm: float) -> Pose:
    x, y, z = pose.position_mm
    return Pose((x, y, round(z + height_mm, 1)), pose.yaw_deg)


def _rounded(point: np.ndarray) -> Vec3:
    x, y, z = (round(float(v), 1) for v in point)
    return x, y, z

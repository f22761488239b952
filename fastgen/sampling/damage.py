"""Sampling of container damages: kind, place, size and depth."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np

from fastgen.config.damage import DamageConfig
from fastgen.damages.draws import FRAME_MM, rounded_vector, turned
from fastgen.sampling.streams import Streams, one_of
from fastgen.sampling.visibility_estimates import LEAST_SHARE
from fastgen.scene import Damage, Vec3
from fastgen.scene.damage_kinds import Kind, SheetForm, kind_named
from fastgen.scene.door_gear import damaged_gear
from fastgen.scene.limits import MAX_INSTANCES

_CASTING_MM = 350.0
"""Distance from the frame within which the rim of a hole near a casting ends."""

_SHEET_MM = 15.0
"""Approximate depth of the sheet's outer flats behind the outermost plane of the castings."""

_MOST_DRAWS = 30
"""Draws of a damage that a camera should show."""


@dataclass(frozen=True)
class _Plane:
    """Sheet plane of one face seen from outside.

    Attributes:
        face: Name of the face.
        corner: Lower left corner in the container frame, float64 [3], mm.
        right: Unit vector to the right, float64 [3].
        up: Unit vector upward, float64 [3].
        size: Width and height, mm.
    """

    face: str
    corner: np.ndarray
    right: np.ndarray
    up: np.ndarray
    size: tuple[float, float]

    @property
    def inward(self) -> np.ndarray:
        return -np.cross(self.right, self.up)


def sample_damages(
    config: DamageConfig,
    size_mm: Vec3,
    streams: Streams,
    image_share: Callable[[Damage], float],
) -> tuple[Damage, ...]:
    """Sample the damages of one container.

    Args:
        config: Probabilities and ranges.
        size_mm: Outer length, width and height of the container.
        streams: Function from the name of a property to its independent random generator.
        image_share: Function from a damage to the largest part of an image that it covers, see
            DamageVisibility.image_share.

    Returns:
        Damages in the container frame, those of listed_kinds first; an empty tuple for an
        undamaged container. Damages of door gear that has one already are left out.
    """
    kinds = listed_kinds(config, streams)
    planes = _planes(size_mm)
    damages: list[Damage] = []
    beside: list[Damage] = []
    for i, kind in enumerate(map(kind_named, kinds)):
        rng = streams(f"damage.{i}")
        aimed = streams(f"damage.{i}.toward").random() < config.toward_cameras
        draw = partial(_drawn, kind, config, size_mm, planes, rng)
        damage = _best_seen(draw, image_share) if aimed else draw()
        gear = damaged_gear((*damages, damage))
        if len(gear) > len(set(gear)):
            continue
        damages.append(damage)
        if kind.draw is None:
            continue
        rng = streams(f"damage.{i}.scrape")
        scraped = "scrape" in config.kinds and kind.rubbed
        room = len(beside) + len(kinds) < MAX_INSTANCES
        if scraped and rng.random() < config.ranges_of("scrape").beside and room:
            beside.append(_beside(damage, config, planes[damage.face], rng))
    return (*damages, *beside)


def _best_seen(draw: Callable[[], Damage], image_share: Callable[[Damage], float]) -> Damage:
    """Return the first of _MOST_DRAWS damages that is large enough in an image, or the largest."""
    damage = draw()
    largest = image_share(damage)
    for _ in range(_MOST_DRAWS - 1):
        if largest >= LEAST_SHARE:
            break
        other = draw()
        covered = image_share(other)
        if covered > largest:
            damage, largest = other, covered
    return damage


def _drawn(
    kind: Kind,
    config: DamageConfig,
    size_mm: Vec3,
    planes: Mapping[str, _Plane],
    rng: np.random.Generator,
) -> Damage:
    """Draw a damage of a kind on a random face or edge."""
    ranges = config.ranges_of(kind.name)
    if kind.place is not None:
        return kind.place(ranges, size_mm, rng)
    assert kind.draw is not None, "a kind has either draw or place"
    plane = planes[one_of(rng, config.faces)]
    form = kind.draw(ranges, plane.face, plane.size, rng)
    return _on_sheet(kind.name, form, plane, rng)


def listed_kinds(config: DamageConfig, streams: Streams) -> list[str]:
    """Draw the kinds of one container's damages, without the scrapes beside them.

    The arguments are those of sample_damages, which returns these damages first and then the
    scrapes.
    """
    if streams("damage.any").random() >= config.probability or not config.kinds:
        return []
    low, high = config.count
    count = int(streams("damage.count").integers(low, high + 1))
    return list(map(str, streams("damage.kinds").choice(config.kinds, size=count)))


def within_limit(
    carried: Sequence[tuple[Damage, ...]], listed: Sequence[int]
) -> list[tuple[Damage, ...]]:
    """Limit the damages of each kind to the number that masks can distinguish.

    Scrapes beside other damages are dropped first, then damages at the end of the list.

    Args:
        carried: Damages of each container of the scene.
        listed: Number of each container's damages that are not scrapes beside others; these
            damages come first.
    """
    places = [
        (i >= listed[n], n, i) for n, damages in enumerate(carried) for i in range(len(damages))
    ]
    counts: Counter[str] = Counter()
    kept = set()
    for _, n, i in sorted(places):
        kind = carried[n][i].kind
        counts[kind] += 1
        if counts[kind] <= MAX_INSTANCES:
            kept.add((n, i))
    return [
        tuple(damage for i, damage in enumerate(damages) if (n, i) in kept)
        for n, damages in enumerate(carried)
    ]


def _planes(size_mm: Vec3) -> dict[str, _Plane]:
    length, width, height = size_mm
    x, y = length / 2 - _SHEET_MM, width / 2 - _SHEET_MM
    ex, ey, ez = np.eye(3)
    planes = (
        _Plane("front", np.array([-x, -y, 0]), ex, ez, (2 * x, height)),
        _Plane("back", np.array([x, y, 0]), -ex, ez, (2 * x, height)),
        _Plane("door", np.array([x, -y, 0]), ey, ez, (2 * y, height)),
        _Plane("no_door", np.array([-x, y, 0]), -ey, ez, (2 * y, height)),
        _Plane("roof", np.array([-x, -y, height - _SHEET_MM]), ex, ey, (2 * x, 2 * y)),
    )
    return {plane.face: plane for plane in planes}


def _place(
    plane: _Plane, form: SheetForm, half: tuple[float, float], rng: np.random.Generator
) -> tuple[float, float]:
    """Sample a center that keeps a box with these half extents inside the frame of the face."""
    room = [
        max(side / 2 - FRAME_MM - reach, 0.0) for side, reach in zip(plane.size, half, strict=True)
    ]
    x, y = (float(rng.uniform(-each, each)) for each in room)
    if form.place == "bottom":
        y = -room[1]
    if form.place == "casting":
        x, y = (
            math.copysign(max(each - abs(at) * _CASTING_MM / max(each, 1.0), 0.0), at)
            for each, at in zip(room, (x, y), strict=True)
        )
    return plane.size[0] / 2 + x, plane.size[1] / 2 + y


def _on_sheet(kind: str, form: SheetForm, plane: _Plane, rng: np.random.Generator) -> Damage:
    """Place a damage at a random position of the sheet."""
    half = turned(form.half_mm or (form.size_mm[0] / 2, form.size_mm[1] / 2), form.turn_deg)
    x, y = _place(plane, form, half, rng)
    return _placed(kind, form, plane, plane.corner + x * plane.right + y * plane.up)


def _beside(
    damage: Damage, config: DamageConfig, plane: _Plane, rng: np.random.Generator
) -> Damage:
    """Sample a scrape across a damage or just beside it, and move it inside the frame."""
    draw_scrape = kind_named("scrape").draw
    assert draw_scrape is not None
    form = draw_scrape(config.ranges_of("scrape"), plane.face, plane.size, rng)
    shift = [0.5 * extent * float(rng.uniform(-1, 1)) for extent in damage.size_mm]
    moved = (
        np.array(damage.origin_mm)
        + shift[0] * np.array(damage.along)
        + shift[1] * np.array(damage.across)
    )
    half = turned((form.size_mm[0] / 2, form.size_mm[1] / 2), form.turn_deg)
    x, y = (
        float(np.clip((moved - plane.corner) @ axis, FRAME_MM + reach, side - FRAME_MM - reach))
        for axis, side, reach in zip((plane.right, plane.up), plane.size, half, strict=True)
    )
    return _placed("scrape", form, plane, plane.corner + x * plane.right + y * plane.up)


def _placed(kind: str, form: SheetForm, plane: _Plane, origin: np.ndarray) -> Damage:
    turn = math.radians(form.turn_deg)
    return Damage(
        kind=kind,
        face=plane.face,
        origin_mm=rounded_vector(origin, 1),
        along=rounded_vector(math.cos(turn) * plane.right + math.sin(turn) * plane.up),
        across=rounded_vector(math.cos(turn) * plane.up - math.sin(turn) * plane.right),
        inward=rounded_vector(plane.inward),
        size_mm=form.size_mm,
        depth_mm=form.depth_mm,
        shape=form.shape,
        form=form.name,
        **asdict(form.wear),
    )

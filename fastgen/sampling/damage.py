"""Sampling of container damages: kind, place, size and depth."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from fastgen.config.damage import DamageConfig
from fastgen.sampling.damage_forms import (
    FRAME_MM,
    SHEET_FORMS,
    SheetForm,
    draw,
    draw_scrape,
    draw_wear,
    turned,
)
from fastgen.sampling.streams import Streams
from fastgen.scene import Damage, Vec3
from fastgen.scene.limits import MAX_INSTANCES
from fastgen.validation import Range

_CASTING_MM = 350.0
"""Distance from the frame within which the rim of a hole near a casting ends."""

_SHEET_MM = 15.0
"""Approximate depth of the sheet's outer flats behind the outermost plane of the castings."""


_KINK_APEX = Range(-0.5, 0.5)
"""Place of a kink's deepest point, in half lengths from its middle."""

_KINK_SOFTNESS = Range(0.03, 0.15)
"""Rounding of a kink's folds, as a share of its depth."""

_KINKS_ABOVE = 0.25
"""Share of the kinks in posts that are just below the upper casting; others are above the lower."""


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
) -> tuple[Damage, ...]:
    """Sample the damages of one container.

    Args:
        config: Probabilities and ranges.
        size_mm: Outer length, width and height of the container.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Damages in the container frame, those of listed_kinds first; an empty tuple for an
        undamaged container.
    """
    kinds = listed_kinds(config, streams)
    planes = _planes(size_mm)
    damages: list[Damage] = []
    beside: list[Damage] = []
    for i, kind in enumerate(kinds):
        rng = streams(f"damage.{i}")
        if kind == "axis":
            damages.append(_axis(config, size_mm, rng))
            continue
        plane = planes[str(rng.choice(config.faces))]
        form = SHEET_FORMS[kind](config, plane.face, plane.size, rng)
        damages.append(_on_sheet(kind, form, plane, rng))
        scraped = "scrape" in config.kinds and kind in ("concave", "dented")
        rng = streams(f"damage.{i}.scrape")
        room = len(beside) + len(kinds) < MAX_INSTANCES
        if scraped and rng.random() < config.scrape.beside and room:
            beside.append(_beside(damages[-1], config, plane, rng))
    return (*damages, *beside)


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


def _vector(v: np.ndarray, digits: int = 6) -> Vec3:
    x, y, z = (round(float(c), digits) + 0.0 for c in v)
    return x, y, z


def _on_sheet(kind: str, form: SheetForm, plane: _Plane, rng: np.random.Generator) -> Damage:
    """Place a damage at a random position of the sheet."""
    half = turned(form.half_mm or (form.size_mm[0] / 2, form.size_mm[1] / 2), form.turn_deg)
    x, y = _place(plane, form, half, rng)
    return _placed(kind, form, plane, plane.corner + x * plane.right + y * plane.up)


def _beside(
    damage: Damage, config: DamageConfig, plane: _Plane, rng: np.random.Generator
) -> Damage:
    """Sample a scrape across a damage or just beside it, and move it inside the frame."""
    form = draw_scrape(config, plane.face, plane.size, rng)
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
        origin_mm=_vector(origin, 1),
        along=_vector(math.cos(turn) * plane.right + math.sin(turn) * plane.up),
        across=_vector(math.cos(turn) * plane.up - math.sin(turn) * plane.right),
        inward=_vector(plane.inward),
        size_mm=form.size_mm,
        depth_mm=form.depth_mm,
        shape=form.shape,
        form=form.name,
        **asdict(form.wear),
    )


def _axis(config: DamageConfig, size_mm: Vec3, rng: np.random.Generator) -> Damage:
    """Sample a dent of one of the twelve edges, pushed in diagonally and clear of the castings."""
    c = config.axis
    half = np.array(size_mm) / 2
    kinked = bool(rng.random() < c.kinked)
    post = kinked and bool(rng.random() < c.kinked_posts)
    axis = 2 if post else int(rng.integers(3))
    others = [i for i in range(3) if i != axis]
    signs = rng.choice([-1.0, 1.0], size=2)
    inward, middle = np.zeros(3), np.array([0.0, 0.0, half[2]])
    for i, sign in zip(others, signs, strict=True):
        inward[i] = -sign / math.sqrt(2)
        middle[i] += sign * half[i]
    along = np.eye(3)[axis]
    room = 2 * half[axis] - 2 * FRAME_MM
    length = draw(rng, c.kink_length_mm if kinked else c.length_mm, room)
    slack = (room - length) / 2
    at = float(rng.uniform(-slack, slack))
    if post:
        at = slack * (1.0 if rng.random() < _KINKS_ABOVE else -1.0)
    damage = Damage(
        kind="axis",
        face=_edge_name(others, signs),
        origin_mm=_vector(middle + along * at, 1),
        along=_vector(along),
        across=_vector(np.cross(inward, along)),
        inward=_vector(inward),
        size_mm=(length, 2 * draw(rng, c.kink_reach_mm if kinked else c.reach_mm)),
        depth_mm=draw(rng, c.kink_depth_mm if kinked else c.depth_mm),
    )
    if not kinked:
        return damage
    shape = (draw(rng, _KINK_APEX, digits=3), draw(rng, _KINK_SOFTNESS, digits=4))
    return replace(damage, form="kinked", shape=shape, **asdict(draw_wear(rng)))


def _edge_name(others: list[int], signs: np.ndarray) -> str:
    """Return the two faces that meet at an edge, for example 'front.door'."""
    names = (("no_door", "door"), ("front", "back"), ("underside", "roof"))
    return ".".join(names[i][int(sign > 0)] for i, sign in zip(others, signs, strict=True))

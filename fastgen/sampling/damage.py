"""Sampling of container damages: kind, place, size and depth."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fastgen.config.damage import DamageConfig
from fastgen.sampling.streams import Streams
from fastgen.scene import Damage, Vec3
from fastgen.scene.limits import LOBES
from fastgen.validation import Range

_FRAME_MM = 190.0
"""Width of the posts and rails around a face, which sheet damages stay clear of."""

_SHEET_MM = 15.0
"""Approximate depth of the sheet's outer flats behind the outermost plane of the castings."""


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


@dataclass(frozen=True)
class _Form:
    """A sheet damage before it is placed.

    Attributes:
        size_mm: Full length along and width across.
        depth_mm: Largest displacement, positive inward.
        shape: Further parameters of the kind, see `scene.Damage`.
        turn_deg: Angle of its length against the face's horizontal.
        reach: Extent of the displaced sheet divided by `size_mm`.
        name: Form of the kind, see `scene.Damage`.
        paint_loss: Share of the worst places that is bare of paint.
        fresh: Share of the bare steel that has not rusted yet.
    """

    size_mm: tuple[float, float]
    depth_mm: float
    shape: tuple[float, ...] = ()
    turn_deg: float = 0.0
    reach: float = 1.0
    name: str = "plain"
    paint_loss: float = 1.0
    fresh: float = 0.0


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
        Damages in the container frame; an empty tuple for an undamaged container.
    """
    if streams("damage.any").random() >= config.probability or not config.kinds:
        return ()
    low, high = config.count
    count = int(streams("damage.count").integers(low, high + 1))
    kinds = streams("damage.kinds").choice(config.kinds, size=count)
    planes = _planes(size_mm)
    damages = []
    for i, kind in enumerate(kinds):
        rng = streams(f"damage.{i}")
        if kind == "axis":
            damages.append(_axis(config, size_mm, rng))
            continue
        plane = planes[str(rng.choice(config.faces))]
        form = _FORMS[str(kind)](config, plane, rng)
        damages.append(_on_sheet(str(kind), form, plane, rng))
    return tuple(damages)


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


def _draw(
    rng: np.random.Generator, values: Range, most: float = math.inf, digits: int = 2
) -> float:
    return round(min(values.draw(rng), most), digits)


def _place(
    plane: _Plane, half: tuple[float, float], rng: np.random.Generator
) -> tuple[float, float]:
    """Sample a center that keeps a box with these half extents inside the frame of the face."""
    at = []
    for side, reach in zip(plane.size, half, strict=True):
        room = max(side / 2 - _FRAME_MM - reach, 0.0)
        at.append(side / 2 + float(rng.uniform(-room, room)))
    return at[0], at[1]


def _vector(v: np.ndarray, digits: int = 6) -> Vec3:
    x, y, z = (round(float(c), digits) + 0.0 for c in v)
    return x, y, z


def _on_sheet(kind: str, form: _Form, plane: _Plane, rng: np.random.Generator) -> Damage:
    """Place a damage at a random position of the sheet."""
    size, turn = form.size_mm, math.radians(form.turn_deg)
    along = math.cos(turn) * plane.right + math.sin(turn) * plane.up
    across = math.cos(turn) * plane.up - math.sin(turn) * plane.right
    cos, sin = abs(math.cos(turn)), abs(math.sin(turn))
    half = (
        form.reach * (cos * size[0] + sin * size[1]) / 2,
        form.reach * (sin * size[0] + cos * size[1]) / 2,
    )
    x, y = _place(plane, half, rng)
    origin = plane.corner + x * plane.right + y * plane.up
    return Damage(
        kind=kind,
        face=plane.face,
        origin_mm=_vector(origin, 1),
        along=_vector(along),
        across=_vector(across),
        inward=_vector(plane.inward),
        size_mm=size,
        depth_mm=form.depth_mm,
        shape=form.shape,
        form=form.name,
        paint_loss=form.paint_loss,
        fresh=form.fresh,
    )


def _concave(config: DamageConfig, plane: _Plane, rng: np.random.Generator) -> _Form:
    c = config.concave
    creased = rng.random() < c.creased
    length = _draw(rng, c.length_mm, plane.size[0] - 2 * _FRAME_MM)
    width = _draw(rng, c.width_mm, plane.size[1] - 2 * _FRAME_MM)
    depth = _draw(rng, c.depth_mm)
    sign = -1.0 if rng.random() < c.outward else 1.0
    if not creased:
        return _Form((length, width), sign * depth)
    shape = (
        _angle(rng),
        *(round(float(rng.uniform(0.25, 0.75)), 3) for _ in range(5)),
        _draw(rng, c.crease_softness, digits=4),
        _draw(rng, c.flattened),
    )
    return _Form((length, width), sign * depth, shape, 0.0, 1.0, "creased", *_wear(rng))


def _dented(config: DamageConfig, plane: _Plane, rng: np.random.Generator) -> _Form:
    c = config.dented
    if rng.random() < c.marks.probability:
        return _rib_marks(config, plane, rng)
    length = _draw(rng, c.length_mm, min(plane.size) - 2 * _FRAME_MM)
    shape = (
        _draw(rng, c.crease_mm),
        _draw(rng, c.sink_share),
        _draw(rng, c.amplitude_mm),
        _draw(rng, c.wavelength_mm),
        round(float(rng.uniform(0, 2 * math.pi)), 4),
        _draw(rng, c.stretch_mm),
    )
    # The fold swings by its amplitude to both sides of its axis, which widens the damage.
    width = round(_draw(rng, c.width_mm) + 2 * shape[2], 2)
    depth, turn = _draw(rng, c.depth_mm), _draw(rng, c.turn_deg)
    return _Form((length, width), depth, shape, turn)


def _perforation(config: DamageConfig, plane: _Plane, rng: np.random.Generator) -> _Form:
    c = config.perforation
    if rng.random() < c.torn:
        return _tear(config, plane, rng)
    diameter = _draw(rng, c.diameter_mm)
    shape = [_draw(rng, c.rim_mm)]
    for _ in range(LOBES):
        shape.append(round(_draw(rng, c.lobes) * float(rng.choice([-1, 1])), 4))
        shape.append(round(float(rng.uniform(0, 2 * math.pi)), 4))
    reach = 1 + LOBES * c.lobes.hi + 2 * shape[0] / diameter
    return _Form((diameter, diameter), _draw(rng, c.depth_mm), tuple(shape), reach=reach)


def _rib_marks(config: DamageConfig, plane: _Plane, rng: np.random.Generator) -> _Form:
    c = config.dented.marks
    length = _draw(rng, c.length_mm, plane.size[0] - 2 * _FRAME_MM)
    size = (length, _draw(rng, c.height_mm))
    shape = (
        round(float(rng.uniform(1.0, 4.0)), 2),
        round(min(60.0, length / 3), 2),
        _draw(rng, c.unevenness),
        round(float(rng.uniform(300.0, 1200.0)), 1),
        _angle(rng),
        round(float(rng.uniform(0.8, 0.95)), 3),
    )
    form = _Form(size, _draw(rng, c.depth_mm), shape, _draw(rng, c.turn_deg), 1.0, "ribs")
    loss, fresh = _wear(rng)
    return replace(form, paint_loss=loss, fresh=fresh)


def _tear(config: DamageConfig, plane: _Plane, rng: np.random.Generator) -> _Form:
    c = config.perforation
    length = _draw(rng, c.tear_length_mm, min(plane.size) / 2)
    width = round(max(length / _draw(rng, c.tear_aspect), 12.0), 2)
    arm = round(length * float(rng.uniform(0.4, 0.9)), 2) if rng.random() < 0.2 else 0.0
    shape = (
        _draw(rng, c.rim_mm),
        round(float(rng.beta(0.5, 0.5)), 3),
        round(float(rng.beta(0.4, 0.4)), 3),
        _draw(rng, c.teeth_mm),
        _angle(rng),
        arm,
        _draw(rng, c.twist),
    )
    # most tears follow a rib or run along a rail
    turn = round(float(rng.choice([0.0, 90.0]) + rng.normal(0, 12)), 2)
    reach = 1 + 2 * (shape[0] + width + arm) / length
    return _Form(
        (length, width), _draw(rng, c.depth_mm), shape, turn, reach, "torn", *_wear(rng)
    )


def _angle(rng: np.random.Generator) -> float:
    return round(float(rng.uniform(0, 2 * math.pi)), 4)


def _wear(rng: np.random.Generator) -> tuple[float, float]:
    """Sample paint loss and freshness: some damages are clean, some bright, some rusty."""
    loss = float(rng.choice([0.0, 0.3, 0.7, 1.0], p=[0.25, 0.25, 0.25, 0.25]))
    fresh = float(rng.choice([0.0, 0.5, 1.0], p=[0.5, 0.25, 0.25]))
    return loss, fresh


_FORMS: dict[str, Callable[[DamageConfig, _Plane, np.random.Generator], _Form]] = {
    "concave": _concave,
    "dented": _dented,
    "perforation": _perforation,
}


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
    room = 2 * half[axis] - 2 * _FRAME_MM
    length = _draw(rng, c.kink_length_mm if kinked else c.length_mm, room)
    slack = (room - length) / 2
    at = float(rng.uniform(-slack, slack))
    if post:
        # three in four are just above the lower casting
        at = slack * (1.0 if rng.random() < 0.25 else -1.0)
    damage = Damage(
        kind="axis",
        face=_edge_name(others, signs),
        origin_mm=_vector(middle + along * at, 1),
        along=_vector(along),
        across=_vector(np.cross(inward, along)),
        inward=_vector(inward),
        size_mm=(length, 2 * _draw(rng, c.kink_reach_mm if kinked else c.reach_mm)),
        depth_mm=_draw(rng, c.kink_depth_mm if kinked else c.depth_mm),
    )
    if not kinked:
        return damage
    apex, softness = float(rng.uniform(-0.5, 0.5)), float(rng.uniform(0.03, 0.15))
    loss, fresh = _wear(rng)
    return replace(
        damage,
        form="kinked",
        shape=(round(apex, 3), round(softness, 4)),
        paint_loss=loss,
        fresh=fresh,
    )


def _edge_name(others: list[int], signs: np.ndarray) -> str:
    """Return the two faces that meet at an edge, for example 'front.door'."""
    names = (("no_door", "door"), ("front", "back"), ("underside", "roof"))
    return ".".join(names[i][int(sign > 0)] for i, sign in zip(others, signs, strict=True))

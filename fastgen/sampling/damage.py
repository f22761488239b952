"""Draws the damages of a scene: which kinds, where on the container, how large and how deep."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fastgen.config.damage import DamageConfig
from fastgen.scene import Damage, Vec3
from fastgen.scene.limits import LOBES
from fastgen.validation import Range

_FRAME_MM = 190.0
"""Posts and rails take this much of a face's border; damage of the sheet stays clear of it."""

_SHEET_MM = 15.0
"""The sheet's outer flats lie about this deep behind the outermost plane of the castings."""


@dataclass(frozen=True)
class _Plane:
    """A face seen from outside: corner and axes such that x runs right and y up; extent in mm."""

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
    streams: Callable[[str], np.random.Generator],
) -> tuple[Damage, ...]:
    """The damages of one container of outer size (length, width, height), often none.

    streams: an independent generator for each name.
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
        face = str(rng.choice(config.faces))
        damages.append(_SHEET_KINDS[str(kind)](config, face, planes[face], rng))
    return tuple(damages)


def _planes(size_mm: Vec3) -> dict[str, _Plane]:
    length, width, height = size_mm
    x, y = length / 2 - _SHEET_MM, width / 2 - _SHEET_MM
    ex, ey, ez = np.eye(3)
    return {
        "front": _Plane(np.array([-x, -y, 0]), ex, ez, (2 * x, height)),
        "back": _Plane(np.array([x, y, 0]), -ex, ez, (2 * x, height)),
        "door": _Plane(np.array([x, -y, 0]), ey, ez, (2 * y, height)),
        "no_door": _Plane(np.array([-x, y, 0]), -ey, ez, (2 * y, height)),
        "roof": _Plane(np.array([-x, -y, height - _SHEET_MM]), ex, ey, (2 * x, 2 * y)),
    }


def _draw(rng: np.random.Generator, values: Range, most: float = math.inf) -> float:
    return round(min(values.draw(rng), most), 2)


def _place(
    plane: _Plane, half: tuple[float, float], rng: np.random.Generator
) -> tuple[float, float]:
    """A centre on the sheet such that a box of these half extents stays within the frame."""
    at = []
    for side, reach in zip(plane.size, half, strict=True):
        room = max(side / 2 - _FRAME_MM - reach, 0.0)
        at.append(side / 2 + float(rng.uniform(-room, room)))
    return at[0], at[1]


def _vector(v: np.ndarray, digits: int = 6) -> Vec3:
    x, y, z = (round(float(c), digits) + 0.0 for c in v)
    return x, y, z


def _on_sheet(
    kind: str,
    face: str,
    plane: _Plane,
    size: tuple[float, float],
    depth: float,
    rng: np.random.Generator,
    turn_deg: float = 0.0,
    shape: tuple[float, ...] = (),
    reach: float = 1.0,
) -> Damage:
    turn = math.radians(turn_deg)
    along = math.cos(turn) * plane.right + math.sin(turn) * plane.up
    across = math.cos(turn) * plane.up - math.sin(turn) * plane.right
    cos, sin = abs(math.cos(turn)), abs(math.sin(turn))
    half = (
        reach * (cos * size[0] + sin * size[1]) / 2,
        reach * (sin * size[0] + cos * size[1]) / 2,
    )
    x, y = _place(plane, half, rng)
    origin = plane.corner + x * plane.right + y * plane.up
    return Damage(
        kind=kind,
        face=face,
        origin_mm=_vector(origin, 1),
        along=_vector(along),
        across=_vector(across),
        inward=_vector(plane.inward),
        size_mm=size,
        depth_mm=depth,
        shape=shape,
    )


def _concave(config: DamageConfig, face: str, plane: _Plane, rng: np.random.Generator) -> Damage:
    c = config.concave
    length = _draw(rng, c.length_mm, plane.size[0] - 2 * _FRAME_MM)
    width = _draw(rng, c.width_mm, plane.size[1] - 2 * _FRAME_MM)
    depth = _draw(rng, c.depth_mm)
    sign = -1.0 if rng.random() < c.outward else 1.0
    return _on_sheet("concave", face, plane, (length, width), sign * depth, rng)


def _dented(config: DamageConfig, face: str, plane: _Plane, rng: np.random.Generator) -> Damage:
    c = config.dented
    length = _draw(rng, c.length_mm, min(plane.size) - 2 * _FRAME_MM)
    shape = (
        _draw(rng, c.crease_mm),
        _draw(rng, c.sink_share),
        _draw(rng, c.amplitude_mm),
        _draw(rng, c.wavelength_mm),
        round(float(rng.uniform(0, 2 * math.pi)), 4),
        _draw(rng, c.stretch_mm),
    )
    # the path swings about its axis, so that the field reaches that much farther across
    width = round(_draw(rng, c.width_mm) + 2 * shape[2], 2)
    depth, turn = _draw(rng, c.depth_mm), _draw(rng, c.turn_deg)
    return _on_sheet("dented", face, plane, (length, width), depth, rng, turn, shape)


def _perforation(
    config: DamageConfig, face: str, plane: _Plane, rng: np.random.Generator
) -> Damage:
    c = config.perforation
    diameter = _draw(rng, c.diameter_mm)
    shape = [_draw(rng, c.rim_mm)]
    for _ in range(LOBES):
        shape.append(round(_draw(rng, c.lobes) * float(rng.choice([-1, 1])), 4))
        shape.append(round(float(rng.uniform(0, 2 * math.pi)), 4))
    reach = 1 + LOBES * c.lobes.hi + 2 * shape[0] / diameter
    return _on_sheet(
        "perforation", face, plane, (diameter, diameter), _draw(rng, c.depth_mm), rng,
        shape=tuple(shape), reach=reach,
    )  # fmt: skip


_SHEET_KINDS: dict[str, Callable[[DamageConfig, str, _Plane, np.random.Generator], Damage]] = {
    "concave": _concave,
    "dented": _dented,
    "perforation": _perforation,
}


def _axis(config: DamageConfig, size_mm: Vec3, rng: np.random.Generator) -> Damage:
    """One of the twelve edges pushed in along its diagonal, between the castings."""
    c = config.axis
    half = np.array(size_mm) / 2
    axis = int(rng.integers(3))
    others = [i for i in range(3) if i != axis]
    signs = rng.choice([-1.0, 1.0], size=2)
    inward, middle = np.zeros(3), np.array([0.0, 0.0, half[2]])
    for i, sign in zip(others, signs, strict=True):
        inward[i] = -sign / math.sqrt(2)
        middle[i] += sign * half[i]
    along = np.eye(3)[axis]
    room = 2 * half[axis] - 2 * _FRAME_MM
    length = _draw(rng, c.length_mm, room)
    slack = (room - length) / 2
    origin = middle + along * float(rng.uniform(-slack, slack))
    return Damage(
        kind="axis",
        face=_edge_name(others, signs),
        origin_mm=_vector(origin, 1),
        along=_vector(along),
        across=_vector(np.cross(inward, along)),
        inward=_vector(inward),
        size_mm=(length, 2 * _draw(rng, c.reach_mm)),
        depth_mm=_draw(rng, c.depth_mm),
    )


def _edge_name(others: list[int], signs: np.ndarray) -> str:
    """The two faces that meet at an edge, such as 'front.door'."""
    names = (("no_door", "door"), ("front", "back"), ("underside", "roof"))
    return ".".join(names[i][int(sign > 0)] for i, sign in zip(others, signs, strict=True))

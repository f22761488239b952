"""Sampling of surveyors' crayon marks, around damages and as often around nothing.

They have no label.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fastgen.config.markings import ChalkConfig
from fastgen.sampling.damage_spots import Spot
from fastgen.sampling.sheet import EDGE_MM, Sheet, has_slots, tenth
from fastgen.sampling.streams import Streams, one_of
from fastgen.scene import Color, Decal, Vec2
from fastgen.validation import Range

_RINGS = ("crayon_ring_1", "crayon_ring_2", "crayon_ring_3")
_SMALL_RINGS = ("crayon_ring_small_1", "crayon_ring_small_2")
_ARROWS = ("crayon_arrow_1", "crayon_arrow_2")
_SIGNS = ("crayon_cross", "crayon_tick", "crayon_slashes")
_CODES = tuple(f"crayon_code_{number}" for number in range(1, 8))

_SMALL_MM = 330.0
"""Largest mean side of a ring that is drawn with the strokes of small rings."""

_RING_MM = Range(120, 1200)
"""Sides of rings. Only the middle of a larger damage has a ring around it."""

_OVAL = 2.2
"""Largest ratio of the sides of a ring."""

_RING_SHARE = 0.6
_ARROW_SHARE = 0.2
"""Probability of a ring, and of an arrow. Other marks are crosses, ticks and slashes."""

_CODE_SHARE = 0.45
"""Probability that a code is written beside a mark."""

_SIGN_MM = (130.0, 380.0)
_CODE_MM = (100.0, 230.0)
_ARROW_MM = (200.0, 550.0)

_COLORS: tuple[Color, ...] = ((0.84, 0.83, 0.79), (0.84, 0.62, 0.06), (0.8, 0.22, 0.025))
"""Linear albedo of white, yellow and orange crayons."""


def sample_chalk(
    config: ChalkConfig,
    faces: Mapping[str, Sheet],
    spots: Sequence[Spot],
    others: Sequence[Decal],
    streams: Streams,
) -> list[Decal]:
    """Sample the crayon marks of a container.

    The probability does not depend on damage, and marks around nothing look the same, so that a
    mark tells little about the presence of a damage.

    Args:
        config: Probabilities and sizes.
        faces: Sheets by face.
        spots: Places of the damages.
        others: All other decals of the container.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals to paint after all others.
    """
    rng = streams("chalk")
    if rng.random() >= config.probability:
        return []
    color = _COLORS[int(rng.integers(len(_COLORS)))]
    low, high = config.count
    made: list[Decal] = []
    for number in range(int(rng.integers(low, high + 1))):
        rng = streams(f"chalk.{number}")
        spot = _nowhere(config, faces, rng)
        if spots and rng.random() < config.at_damage:
            spot = spots[int(rng.integers(len(spots)))]
        mark = _mark(faces[spot.face], spot, color, rng)
        here = [decal for decal in (*others, *made) if decal.face == spot.face]
        if mark and has_slots(mark, here):
            made += mark
    return made


def _nowhere(config: ChalkConfig, faces: Mapping[str, Sheet], rng: np.random.Generator) -> Spot:
    """Return a place without a damage of its own. Small ones are more frequent."""
    sheet = faces[one_of(rng, sorted(faces))]
    low, high = np.log(config.around_mm)
    width, height = np.exp(rng.uniform(low, high, 2))
    x, y = (rng.uniform(EDGE_MM, max(side - EDGE_MM, EDGE_MM + 1)) for side in sheet.size)
    return Spot(sheet.face, (float(x), float(y)), (float(width), float(height)))


def _mark(sheet: Sheet, spot: Spot, color: Color, rng: np.random.Generator) -> list[Decal]:
    """Return a ring, an arrow or a sign at a spot and sometimes a code; none without room."""
    luck, wear = rng.random(), round(float(rng.uniform(0.0, 0.45)), 3)

    def drawn(names: Sequence[str], center: Vec2, size: Vec2, turn_deg: float) -> Decal:
        return Decal(
            kind="emblem",
            class_name="",
            face=sheet.face,
            center_mm=(tenth(center[0]), tenth(center[1])),
            size_mm=(tenth(size[0]), tenth(size[1])),
            rotation_deg=round(turn_deg, 2),
            art=names[int(rng.integers(len(names)))],
            albedo=color,
            wear=wear,
        )

    size = _ring_size(sheet, spot, rng)
    rings = _SMALL_RINGS if sum(size) / 2 < _SMALL_MM else _RINGS
    mark = drawn(rings, spot.center_mm, size, float(rng.normal(0, 6)))
    if luck > _RING_SHARE or min(size) < _RING_MM.lo or not sheet.holds(mark):
        if luck < _RING_SHARE + _ARROW_SHARE:
            length, angle_deg = float(rng.uniform(*_ARROW_MM)), float(rng.uniform(0, 360))
            center = _before(spot, length, angle_deg)
            mark = drawn(_ARROWS, center, (length, 0.6 * length), angle_deg)
        else:
            side = float(rng.uniform(*_SIGN_MM))
            size = (side, side * float(rng.uniform(0.8, 1.25)))
            mark = drawn(_SIGNS, spot.center_mm, size, float(rng.normal(0, 8)))
    made = [mark]
    if rng.random() < _CODE_SHARE:
        (x, y), (width, height) = mark.center_mm, mark.size_mm
        side, side_of = float(rng.uniform(*_CODE_MM)), float(rng.choice((-1, 1)))
        center = (
            x + side_of * (width / 2 + 0.75 * side),
            y + float(rng.uniform(-0.4, 0.4)) * height,
        )
        made.append(drawn(_CODES, center, (1.1 * side, side), float(rng.normal(0, 6))))
    return [decal for decal in made if sheet.holds(decal)]


def _ring_size(sheet: Sheet, spot: Spot, rng: np.random.Generator) -> Vec2:
    """Return the size of a ring around a spot, or around its middle if the spot is too large."""
    sides = []
    for at, side, whole in zip(spot.center_mm, spot.size_mm, sheet.size, strict=True):
        room = 1.8 * (min(at, whole - at) - EDGE_MM)
        wanted = side * float(rng.uniform(1.6, 2.1)) + float(rng.uniform(30, 80))
        sides.append(min(max(wanted, _RING_MM.lo), room, _RING_MM.hi))
    width, height = sides
    # wider than necessary rather than a thin oval
    width, height = max(width, height / _OVAL), max(height, width / _OVAL)
    return width, height


def _before(spot: Spot, length: float, angle_deg: float) -> Vec2:
    """Return the centre of an arrow that points at a spot from outside."""
    right, up = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    away = (abs(right) * spot.size_mm[0] + abs(up) * spot.size_mm[1] + length) / 2 + 20
    return spot.center_mm[0] - away * right, spot.center_mm[1] - away * up

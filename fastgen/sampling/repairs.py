"""Sampling of repairs: welded patches, fresh paint and tape; they have no label."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fastgen.config.markings import RepairsConfig
from fastgen.sampling.colors import fresh_paint, mixed
from fastgen.sampling.damage_spots import Spot
from fastgen.sampling.sheet import Sheet, between, half_extent, has_slots, tenth
from fastgen.sampling.streams import Streams, one_of
from fastgen.scene import Color, Decal, Surface, Vec2
from fastgen.validation import Range

_PRIMER = 0.3
"""Probability that a patch is grey primer instead of paint."""

_SEAM_MM = Range(6, 14)
"""Width of a weld seam."""

_STRIP_MM = Range(250, 1100)
"""Length of a strip of tape."""

_OVER = 0.5
"""Probability that a repair at a damage lies over it instead of beside it."""

_BESIDE_MM = 200.0
"""Largest distance of a repair beside a damage."""

_TRIES = 12
"""Random positions tried at damages before a repair is put elsewhere."""

_TAPES: tuple[Color, ...] = ((0.44, 0.45, 0.46), (0.17, 0.1, 0.055))
"""Linear albedo of silver and of brown tape."""


def sample_repairs(
    config: RepairsConfig,
    faces: Mapping[str, Sheet],
    spots: Sequence[Spot],
    surface: Surface,
    others: Sequence[Decal],
    streams: Streams,
) -> list[Decal]:
    """Sample the repairs of a container, each in a free rectangle of a sheet.

    Args:
        config: Probabilities and sizes.
        faces: Sheets by face, after all other decals have been placed.
        spots: Places of the damages.
        surface: Paint and rust of the container.
        others: All other decals of the container.
        streams: Function from the name of a property to its independent random generator.

    Returns:
        Decals to paint before all others.
    """
    rng = streams("repairs")
    if rng.random() >= config.probability:
        return []
    fresh = fresh_paint(surface.paint.albedo, rng)
    low, high = config.count
    made: list[Decal] = []
    for number in range(int(rng.integers(low, high + 1))):
        rng = streams(f"repairs.{number}")
        if rng.random() < config.tape:
            parts = _tape(config, rng)
        else:
            grey = round(float(rng.uniform(0.12, 0.35)), 4)
            albedo = (grey, grey, grey) if rng.random() < _PRIMER else fresh
            parts = _patch(config, albedo, surface.rust.albedo, rng)
        placed = _placed(config, parts, faces, spots, rng)
        here = [each for each in (*others, *made) if placed and each.face == placed[0].face]
        if placed and has_slots(placed, here):
            made += placed
    return made


def _patch(
    config: RepairsConfig, albedo: Color, rust: Color, rng: np.random.Generator
) -> list[Decal]:
    """Return a rectangle around the origin, on a larger one if it has a weld seam."""
    size = (between(rng, config.side_mm), between(rng, config.side_mm))
    patch = Decal(
        kind="sticker",
        class_name="",
        face="front",
        center_mm=(0.0, 0.0),
        size_mm=size,
        rotation_deg=round(float(rng.normal(0, 0.7)), 2),
        art="patch",
        albedo=albedo,
        wear=round(float(rng.uniform(0.0, 0.3)), 3),
    )
    seam, rusted = 2 * between(rng, _SEAM_MM), float(rng.uniform(0.0, 0.8))
    if rng.random() >= config.seam:
        return [patch]
    dark = mixed(albedo, (0.0, 0.0, 0.0), 0.45)
    bead = replace(
        patch,
        size_mm=(tenth(size[0] + seam), tenth(size[1] + seam)),
        albedo=mixed(dark, rust, rusted),
    )
    return [bead, patch]


def _tape(config: RepairsConfig, rng: np.random.Generator) -> list[Decal]:
    """Return one to three parallel strips of tape around the origin."""
    count = int(rng.integers(1, 4))
    width, albedo = between(rng, config.tape_mm), _TAPES[int(rng.integers(len(_TAPES)))]
    angle = float(rng.choice((0.0, 90.0)) + rng.normal(0, 5))
    length, wear = _STRIP_MM.draw(rng), round(float(rng.uniform(0.0, 0.5)), 3)
    away = np.array([-math.sin(math.radians(angle)), math.cos(math.radians(angle))])
    made = []
    for i in range(count):
        shift = (i - (count - 1) / 2) * width * float(rng.uniform(0.8, 1.2))
        x, y = map(tenth, shift * away)
        made.append(
            Decal(
                kind="sticker",
                class_name="",
                face="front",
                center_mm=(x, y),
                size_mm=(tenth(length * rng.uniform(0.85, 1.0)), width),
                rotation_deg=round(angle + float(rng.normal(0, 1)), 2),
                art="patch",
                albedo=albedo,
                wear=wear,
            )
        )
    return made


def _placed(
    config: RepairsConfig,
    parts: Sequence[Decal],
    faces: Mapping[str, Sheet],
    spots: Sequence[Spot],
    rng: np.random.Generator,
) -> list[Decal]:
    """Move the parts of a repair from the origin to a free place, none if there is none."""
    ends = [np.abs(part.center_mm) + half_extent(part) for part in parts]
    width, height = (2 * float(end) for end in np.max(ends, axis=0))
    face, center = one_of(rng, sorted(faces)), None
    tries = _TRIES if spots and rng.random() < config.at_damage else 0
    for _ in range(tries):
        spot = spots[int(rng.integers(len(spots)))]
        at = _near(spot, (width, height), rng)
        if faces[spot.face].claim(at, (width, height)):
            face, center = spot.face, at
            break
    anywhere = Range(0.0, 1.0)
    center = center or faces[face].place((width, height), rng, anywhere, anywhere)
    if center is None:
        return []
    x, y = center
    return [
        replace(
            part, face=face, center_mm=(tenth(x + part.center_mm[0]), tenth(y + part.center_mm[1]))
        )
        for part in parts
    ]


def _near(spot: Spot, size: Vec2, rng: np.random.Generator) -> Vec2:
    """Return a place over or beside a damage. Nothing is put over holes."""
    shift = rng.uniform(-0.4, 0.4, 2) * spot.size_mm
    over = rng.random() < _OVER and not spot.hole
    axis, sign, gap = int(rng.integers(2)), rng.choice((-1, 1)), rng.uniform(0, _BESIDE_MM)
    if not over:
        shift[axis] = sign * ((spot.size_mm[axis] + size[axis]) / 2 + gap)
    x, y = map(tenth, spot.center_mm + shift)
    return x, y

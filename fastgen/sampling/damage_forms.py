"""Sampling of the size, shape and wear of damages, before they are placed on a container."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fastgen.config.damage import DamageConfig
from fastgen.scene.limits import LOBES
from fastgen.validation import Range

FRAME_MM = 190.0
"""Width of the posts and rails around a face, which sheet damages stay clear of."""

STEEL = (0.42, 0.41, 0.39)
_PRIMERS = ((0.26, 0.26, 0.27), (0.27, 0.09, 0.05))
_FOREIGN_PAINTS = (
    *((0.75, 0.75, 0.72), (0.04, 0.04, 0.05), (0.75, 0.5, 0.03), (0.45, 0.04, 0.03)),
    (0.05, 0.12, 0.35),
)


@dataclass(frozen=True)
class Wear:
    """Surface of a damage; see `scene.Damage` for its fields."""

    paint_loss: float = 1.0
    fresh: float = 0.0
    bare_albedo: tuple[float, float, float] = STEEL


@dataclass(frozen=True)
class SheetForm:
    """A damage of a sheet before it is placed.

    Attributes:
        size_mm: Full length along and full width across.
        depth_mm: Largest displacement, positive inward.
        shape: Further parameters of the form, see `scene.Damage`.
        turn_deg: Angle of its length against the face's horizontal.
        half_mm: Distances along and across from the origin that the displaced sheet reaches; half
            of `size_mm` where it is None.
        name: Form of the kind, see `scene.Damage`.
        wear: Its surface.
        place: 'anywhere' on the face, at the 'bottom', or near a 'casting'.
    """

    size_mm: tuple[float, float]
    depth_mm: float
    shape: tuple[float, ...] = ()
    turn_deg: float = 0.0
    half_mm: tuple[float, float] | None = None
    name: str = "plain"
    wear: Wear = Wear()
    place: str = "anywhere"


def draw(rng: np.random.Generator, values: Range, most: float = math.inf, digits: int = 2) -> float:
    """Draw a rounded value, at most `most`."""
    return round(min(values.draw(rng), most), digits)


def draw_wear(rng: np.random.Generator) -> Wear:
    """Draw a surface: some damages keep their paint, some are bright, some are rusty."""
    return Wear(
        paint_loss=float(rng.choice([0.0, 0.3, 0.7, 1.0])),
        fresh=float(rng.choice([0.0, 0.5, 1.0], p=[0.5, 0.25, 0.25])),
        bare_albedo=_bare(rng),
    )


def _bare(rng: np.random.Generator) -> tuple[float, float, float]:
    return (STEEL, *_PRIMERS)[int(rng.choice(3, p=[0.5, 0.3, 0.2]))]


def _angle(rng: np.random.Generator) -> float:
    return round(float(rng.uniform(0, 2 * math.pi)), 4)


_Size = tuple[float, float]


def _concave(config: DamageConfig, face: str, size: _Size, rng: np.random.Generator) -> SheetForm:
    c = config.concave
    creased = rng.random() < c.creased
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    width = draw(rng, c.width_mm, size[1] - 2 * FRAME_MM)
    depth = draw(rng, c.depth_mm)
    outward = rng.random() < c.outward
    low = outward and face != "roof" and bool(rng.random() < c.at_bottom)
    form = SheetForm(
        (length, width), -depth if outward else depth, place="bottom" if low else "anywhere"
    )
    if not creased:
        return form
    shape = (
        _angle(rng),
        *(round(float(rng.uniform(0.3, 0.95)), 3) for _ in range(5)),
        draw(rng, c.crease_softness, digits=4),
        draw(rng, c.flattened),
    )
    return replace(form, shape=shape, name="creased", wear=draw_wear(rng))


def _dented(config: DamageConfig, _face: str, size: _Size, rng: np.random.Generator) -> SheetForm:
    c = config.dented
    if rng.random() < c.marks.probability:
        return _rib_marks(config, size, rng)
    length = draw(rng, c.length_mm, min(size) - 2 * FRAME_MM)
    shape = (
        draw(rng, c.crease_mm),
        draw(rng, c.sink_share),
        draw(rng, c.amplitude_mm),
        draw(rng, c.wavelength_mm),
        _angle(rng),
        draw(rng, c.stretch_mm),
    )
    # the fold swings by its amplitude to both sides of its axis, which widens the damage
    width = round(draw(rng, c.width_mm) + 2 * shape[2], 2)
    depth, turn = draw(rng, c.depth_mm), draw(rng, c.turn_deg)
    return SheetForm((length, width), depth, shape, turn, wear=draw_wear(rng))


def _rib_marks(config: DamageConfig, size: _Size, rng: np.random.Generator) -> SheetForm:
    c = config.dented.marks
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    height = draw(rng, c.height_mm)
    shape = (
        round(float(rng.uniform(1.0, 4.0)), 2),
        round(min(60.0, length / 3), 2),
        draw(rng, c.unevenness),
        round(float(rng.uniform(300.0, 1200.0)), 1),
        _angle(rng),
        round(float(rng.uniform(0.8, 0.95)), 3),
    )
    depth, turn = draw(rng, c.depth_mm), draw(rng, c.turn_deg)
    return SheetForm((length, height), depth, shape, turn, name="ribs", wear=draw_wear(rng))


def _perforation(
    config: DamageConfig, face: str, size: _Size, rng: np.random.Generator
) -> SheetForm:
    c = config.perforation
    place = "casting" if face == "roof" and rng.random() < c.at_castings else "anywhere"
    if rng.random() < c.torn:
        return replace(_tear(config, size, rng), place=place)
    diameter = draw(rng, c.diameter_mm)
    shape = [draw(rng, c.rim_mm)]
    for _ in range(LOBES):
        shape.append(round(draw(rng, c.lobes) * float(rng.choice([-1, 1])), 4))
        shape.append(_angle(rng))
    half = diameter / 2 * (1 + LOBES * c.lobes.hi) + shape[0]
    depth = draw(rng, c.depth_mm)
    return SheetForm((diameter, diameter), depth, tuple(shape), half_mm=(half, half), place=place)


def _tear(config: DamageConfig, size: _Size, rng: np.random.Generator) -> SheetForm:
    c = config.perforation
    split = bool(rng.random() < c.split)
    if split:
        length = draw(rng, c.split_length_mm, min(size) - 2 * FRAME_MM)
        width = draw(rng, c.split_gape_mm, length)
    else:
        length = draw(rng, c.tear_length_mm, min(size) / 2)
        width = round(max(length / draw(rng, c.tear_aspect), 12.0), 2)
    has_arm = not split and rng.random() < 0.2
    arm = round(length * float(rng.uniform(0.4, 0.9)), 2) if has_arm else 0.0
    shape = (
        draw(rng, c.rim_mm),
        round(float(rng.beta(0.5, 0.5)), 3),
        round(float(rng.beta(0.4, 0.4)), 3),
        draw(rng, c.teeth_mm),
        _angle(rng),
        arm,
        draw(rng, c.twist),
    )
    # most tears follow a rib or run along a rail
    turn = round(float(rng.choice([0.0, 90.0]) + rng.normal(0, 2 if split else 12)), 2)
    half = (length / 2 + width / 2 + shape[0], max(width + shape[3], arm) + shape[0])
    depth = draw(rng, c.depth_mm)
    return SheetForm((length, width), depth, shape, turn, half, "torn", draw_wear(rng))


def draw_scrape(
    config: DamageConfig, _face: str, size: _Size, rng: np.random.Generator
) -> SheetForm:
    """Draw a scrape."""
    c = config.scrape
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    width = draw(rng, c.width_mm, size[1] - 2 * FRAME_MM)
    shape = (
        draw(rng, c.pitch_mm),
        draw(rng, c.density),
        draw(rng, c.contact_mm),
        round(float(rng.uniform(0.1, 0.5)) * length, 2),
        _angle(rng),
        round(float(rng.uniform(0.0, 12.0)), 2),
    )
    foreign = rng.random() < c.paint
    paint = _FOREIGN_PAINTS[int(rng.integers(len(_FOREIGN_PAINTS)))]
    wear = Wear(
        paint_loss=round(float(rng.uniform(0.5, 1.0)), 3),
        fresh=1.0 if foreign else float(rng.choice([0.0, 0.5, 1.0], p=[0.25, 0.25, 0.5])),
        bare_albedo=paint if foreign else _bare(rng),
    )
    return SheetForm((length, width), 0.0, shape, draw(rng, c.turn_deg), wear=wear)


SheetSampler = Callable[[DamageConfig, str, _Size, np.random.Generator], SheetForm]

SHEET_FORMS: dict[str, SheetSampler] = {
    "concave": _concave,
    "dented": _dented,
    "perforation": _perforation,
    "scrape": draw_scrape,
}
"""Function by kind that draws a form, given the name of the face and its width and height in mm."""

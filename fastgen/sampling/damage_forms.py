"""Sampling of the size, shape and wear of damages, before they are placed on a container."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fastgen.config.damage import DamageConfig
from fastgen.geometry.damage_forms.creased import SIDES
from fastgen.scene.limits import LOBES
from fastgen.validation import Range

FRAME_MM = 190.0
"""Width of the posts and rails around a face, which sheet damages stay clear of."""

STEEL = (0.42, 0.41, 0.39)
"""Linear albedo of bare steel."""

_BARE, _BARE_SHARES = (STEEL, (0.26, 0.26, 0.27), (0.27, 0.09, 0.05)), (0.5, 0.3, 0.2)
"""Linear albedo of bare places, steel and two primers, and how frequent each is."""

_PAINT_LOSS = (0.0, 0.3, 0.7, 1.0)
"""Values of `Wear.paint_loss`, all equally likely."""

_FRESH, _FRESH_SHARES, _SCRAPE_FRESH_SHARES = (0.0, 0.5, 1.0), (0.5, 0.25, 0.25), (0.25, 0.25, 0.5)
"""Values of `Wear.fresh`, and how frequent each is; scrapes are fresh more frequently."""

_FOREIGN_PAINTS = (
    *((0.75, 0.75, 0.72), (0.04, 0.04, 0.05), (0.75, 0.5, 0.03), (0.45, 0.04, 0.03)),
    (0.05, 0.12, 0.35),
)
"""Linear albedo of the paints that other objects leave in scrapes."""


_CREASED_SIDES = Range(0.3, 0.95)
"""Distance of each side of a folded area from its middle, as a share of half its size."""

_RIBS_SOFTNESS_MM = Range(1.0, 4.0)
"""Length over which the edge of a rib mark is rounded."""

_RIBS_RAMP_MM, _RIBS_RAMP = 60.0, 1 / 3
"""Length over which a row of rib marks runs out, and its largest share of the row."""

_RIBS_WAVELENGTH_MM = Range(300.0, 1200.0)
"""Wavelength of the unevenness of rib marks."""

_RIBS_GIVE = Range(0.8, 0.95)
"""Displacement of a rib as a share of how far the object reached in; the rest sprang back."""

_TEAR_BELLY, _TEAR_WEDGE = (0.5, 0.5), (0.4, 0.4)
"""Beta distributions of a tear's belly (share below its line) and wedge; extremes are likely."""

_TEAR_LEAST_MM = 12.0
"""Smallest width of a tear that is not a split."""

_TEARS_WITH_ARM, _TEAR_ARM = 0.2, Range(0.4, 0.9)
"""Share of tears, except splits, with a second slit; its length as a share of the first."""

_TEAR_TURNS_DEG, _TEAR_SPREAD_DEG, _SPLIT_SPREAD_DEG = (0.0, 90.0), 12.0, 2.0
"""Tears run along a rail or follow a rib, with these standard deviations."""

_SCRAPE_RAGGED = Range(0.1, 0.5)
"""Raggedness of the ends of a scrape, as a share of its length."""

_SCRAPE_WAVE_MM = Range(0.0, 12.0)
"""Waviness of the scratches."""

_SCRAPE_PAINT_LOSS = Range(0.5, 1.0)
"""Share of the deepest scratches that is bare."""


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
        paint_loss=float(rng.choice(_PAINT_LOSS)),
        fresh=float(rng.choice(_FRESH, p=_FRESH_SHARES)),
        bare_albedo=_bare(rng),
    )


def _bare(rng: np.random.Generator) -> tuple[float, float, float]:
    return _BARE[int(rng.choice(len(_BARE), p=_BARE_SHARES))]


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
        *(draw(rng, _CREASED_SIDES, digits=3) for _ in range(SIDES)),
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
        draw(rng, _RIBS_SOFTNESS_MM),
        round(min(_RIBS_RAMP_MM, _RIBS_RAMP * length), 2),
        draw(rng, c.unevenness),
        draw(rng, _RIBS_WAVELENGTH_MM, digits=1),
        _angle(rng),
        draw(rng, _RIBS_GIVE, digits=3),
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
        width = round(max(length / draw(rng, c.tear_aspect), _TEAR_LEAST_MM), 2)
    has_arm = not split and rng.random() < _TEARS_WITH_ARM
    arm = round(length * _TEAR_ARM.draw(rng), 2) if has_arm else 0.0
    shape = (
        draw(rng, c.rim_mm),
        round(float(rng.beta(*_TEAR_BELLY)), 3),
        round(float(rng.beta(*_TEAR_WEDGE)), 3),
        draw(rng, c.teeth_mm),
        _angle(rng),
        arm,
        draw(rng, c.twist),
    )
    spread = _SPLIT_SPREAD_DEG if split else _TEAR_SPREAD_DEG
    turn = round(float(rng.choice(_TEAR_TURNS_DEG) + rng.normal(0, spread)), 2)
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
    pitch, density, contact = (draw(rng, each) for each in (c.pitch_mm, c.density, c.contact_mm))
    ragged, phase, wave = _SCRAPE_RAGGED.draw(rng), _angle(rng), draw(rng, _SCRAPE_WAVE_MM)
    foreign = rng.random() < c.paint
    paint = _FOREIGN_PAINTS[int(rng.integers(len(_FOREIGN_PAINTS)))]
    wear = Wear(
        paint_loss=draw(rng, _SCRAPE_PAINT_LOSS, digits=3),
        fresh=1.0 if foreign else float(rng.choice(_FRESH, p=_SCRAPE_FRESH_SHARES)),
        bare_albedo=paint if foreign else _bare(rng),
    )
    turn = draw(rng, c.turn_deg)
    # a turned scrape may be too long for its face
    extents = turned((length, width), turn)
    fit = min(1.0, *((side - 2 * FRAME_MM) / e for side, e in zip(size, extents, strict=True)))
    length, width = round(fit * length, 2), round(fit * width, 2)
    shape = (pitch, density, contact, round(ragged * length, 2), phase, wave)
    return SheetForm((length, width), 0.0, shape, turn, wear=wear)


def turned(size: _Size, turn_deg: float) -> _Size:
    """Return the width and height of an upright box around a turned rectangle."""
    cos, sin = (abs(f(math.radians(turn_deg))) for f in (math.cos, math.sin))
    return cos * size[0] + sin * size[1], sin * size[0] + cos * size[1]


SheetSampler = Callable[[DamageConfig, str, _Size, np.random.Generator], SheetForm]

SHEET_FORMS: dict[str, SheetSampler] = {
    "concave": _concave,
    "dented": _dented,
    "perforation": _perforation,
    "scrape": draw_scrape,
}
"""Function by kind that draws a form, given the name of the face and its width and height in mm."""

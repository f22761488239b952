"""Scrapes: bundles of scratches to primer or steel, or with the paint of another object.

They move nothing. shaders/damage_scrape.glsl is the GLSL twin.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from fastgen.damages.draws import (
    FRAME_MM,
    MOST_CONTACT_MM,
    Contact,
    Extent,
    Size,
    draw,
    draw_angle,
    draw_bare,
    fitted,
)
from fastgen.damages.fields import in_contact
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import (
    PHASE,
    Array,
    Form,
    Kind,
    Parameter,
    SheetForm,
    Wear,
    half_size,
    millimetres,
)
from fastgen.validation import UNIT, Bounds, Range, Share

_FRESH, _FRESH_SHARES = (0.0, 0.5, 1.0), (0.25, 0.25, 0.5)
"""Values of `Wear.fresh`, and how frequent each is."""

_FOREIGN_PAINTS = (
    *((0.75, 0.75, 0.72), (0.04, 0.04, 0.05), (0.75, 0.5, 0.03), (0.45, 0.04, 0.03)),
    (0.05, 0.12, 0.35),
)
"""Linear albedo of the paints that other objects leave in scrapes."""

_RAGGED = Range(0.1, 0.5)
"""Raggedness of the ends of a scrape, as a share of its length."""

_WAVE_MM = Range(0.0, 12.0)
"""Waviness of the scratches."""

_PAINT_LOSS = Range(0.5, 1.0)
"""Share of the deepest scratches that is bare."""


@dataclass(frozen=True)
class ScrapeConfig:
    """Bundle of scratches that spread slightly, without displacement.

    Attributes:
        length_mm: Length of the bundle.
        width_mm: Height of the bundle.
        turn_deg: Angle between the scratches and the horizontal.
        pitch_mm: Distance between scratches.
        density: Probability of a scratch at each such distance.
        contact_mm: Depth behind the outermost sheet up to which it is scraped. Small values leave
            the troughs of the corrugation alone.
        paint: Probability that the scratches show the paint of another object.
        beside: Probability that a dent or a concave area has a scrape beside it. It applies where
            `kinds` has scrapes.
    """

    length_mm: Extent = Range(300, 2500)
    width_mm: Extent = Range(60, 450)
    turn_deg: Annotated[Range, Bounds(-180, 180, "degrees")] = Range(-12, 12)
    pitch_mm: Annotated[Range, Bounds(1.0, 500.0, "mm")] = Range(6, 24)
    density: Annotated[Range, UNIT] = Range(0.3, 0.9)
    contact_mm: Contact = Range(8, 60)
    paint: Share = 0.35
    beside: Share = 0.5


def _marked(damage: Damage, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
    """Test which points are scraped. The ends are ragged: their place varies with the height."""
    pitch_mm, _, contact_mm, ragged_mm, phase, _ = damage.shape
    half_length, half_width = half_size(damage)
    ragged = 0.5 + 0.3 * np.sin(v / (3.1 * pitch_mm) + phase) + 0.2 * np.sin(v / pitch_mm - phase)
    outside = np.maximum(np.abs(v) - half_width, np.abs(u) - half_length + ragged_mm * ragged)
    return np.asarray((outside < 0) & in_contact(w, contact_mm))


def _draw(c: ScrapeConfig, _face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    length = draw(rng, c.length_mm, size[0] - 2 * FRAME_MM)
    width = draw(rng, c.width_mm, size[1] - 2 * FRAME_MM)
    pitch, density, contact = (draw(rng, each) for each in (c.pitch_mm, c.density, c.contact_mm))
    ragged, phase, wave = _RAGGED.draw(rng), draw_angle(rng), draw(rng, _WAVE_MM)
    foreign = rng.random() < c.paint
    paint = _FOREIGN_PAINTS[int(rng.integers(len(_FOREIGN_PAINTS)))]
    wear = Wear(
        paint_loss=draw(rng, _PAINT_LOSS, digits=3),
        fresh=1.0 if foreign else float(rng.choice(_FRESH, p=_FRESH_SHARES)),
        bare_albedo=paint if foreign else draw_bare(rng),
    )
    turn = draw(rng, c.turn_deg)
    length, width = fitted((length, width), size, turn)
    shape = (pitch, density, contact, round(ragged * length, 2), phase, wave)
    return SheetForm((length, width), 0.0, shape, turn, wear=wear)


SCRAPE = Form(
    name="plain",
    glsl="scrape",
    shader="damage_scrape.glsl",
    marked=_marked,
    parameters=(
        millimetres("distance between scratches"),
        Parameter("density of scratches", 0.0, 1.0),
        millimetres("depth behind the face up to which the sheet is scraped", high=MOST_CONTACT_MM),
        millimetres("raggedness of the ends", 0.0),
        PHASE,
        millimetres("waviness of the scratches", 0.0),
    ),
)

KIND = Kind("scrape", (SCRAPE,), ScrapeConfig, _draw, leaks=True)

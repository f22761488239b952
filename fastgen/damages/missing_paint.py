"""Paint that has flaked off in patches, down to primer or steel.

It moves nothing. shaders/damage_missing_paint.glsl is the GLSL twin.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fastgen.damages.draws import (
    MOST_CONTACT_MM,
    Contact,
    Extent,
    Size,
    draw,
    draw_angle,
    draw_bare,
    fitted,
)
from fastgen.damages.fields import PATCH, in_patch
from fastgen.scene.damage_kinds import STEEL, Form, Kind, Parameter, SheetForm, Wear, millimetres
from fastgen.validation import UNIT, Bounds, Range

_HEIGHT = Range(0.0, 0.5)
"""Height of the middle of the patch above its outline; low ones consist of many flakes."""


@dataclass(frozen=True)
class MissingPaintConfig:
    """Paint that has flaked off in patches.

    Attributes:
        length_mm: Horizontal size; along the container on the roof.
        height_mm: Vertical size; across the container on the roof.
        flake_mm: Size of the flakes.
        contact_mm: Depth behind the outermost sheet up to which paint is missing.
        steel: Share of the flaked area that is bare to the steel; the rest shows the primer.
        fresh: Share of the bare steel that has not rusted.
    """

    length_mm: Extent = Range(300, 1800)
    height_mm: Extent = Range(250, 1200)
    flake_mm: Annotated[Range, Bounds(15.0, 1000.0, "mm")] = Range(60, 250)
    contact_mm: Contact = Range(45, 90)
    steel: Annotated[Range, UNIT] = Range(0.0, 0.8)
    fresh: Annotated[Range, UNIT] = Range(0.3, 1.0)


def _draw(c: MissingPaintConfig, _face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    extents = fitted((draw(rng, c.length_mm), draw(rng, c.height_mm)), size)
    shape = (
        round(max(c.flake_mm.draw(rng) / 3, 5.0), 2),
        draw_angle(rng),
        draw(rng, _HEIGHT, digits=3),
        draw(rng, c.steel, digits=3),
        draw(rng, c.contact_mm),
    )
    wear = Wear(fresh=draw(rng, c.fresh, digits=3), bare_albedo=draw_bare(rng))
    return SheetForm(extents, shape=shape, wear=wear)


KIND = Kind(
    "missing_paint",
    (
        Form(
            name="plain",
            glsl="missing_paint",
            shader="damage_missing_paint.glsl",
            marked=in_patch,
            parameters=(
                *PATCH,
                Parameter("share that is bare to the steel", 0.0, 1.0),
                millimetres(
                    "depth behind the face up to which paint is missing", high=MOST_CONTACT_MM
                ),
            ),
            constants={"MISSING_PAINT_STEEL": "vec3({}, {}, {})".format(*STEEL)},
        ),
    ),
    MissingPaintConfig,
    _draw,
)

"""Sheet that corrosion has perforated: an area of thick rust with dark pits and small holes.

It moves nothing, and its holes do not show the interior. shaders/damage_rust_through.glsl is the
GLSL twin.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fastgen.damages.draws import MOST_CONTACT_MM, Contact, Extent, Size, draw, draw_angle, fitted
from fastgen.damages.fields import PATCH, in_patch
from fastgen.scene.damage_kinds import Form, Kind, Parameter, SheetForm, millimetres
from fastgen.validation import UNIT, Range, Share

_SCALE = Range(0.06, 0.12)
"""Scale of the outline, as a share of the mean size."""

_HEIGHT = Range(0.5, 1.0)
"""Height of the middle of the patch above its outline."""


@dataclass(frozen=True)
class RustThroughConfig:
    """Area that has rusted through: thick rust with dark pits and small holes.

    Attributes:
        length_mm: Horizontal size; along the container on the roof.
        height_mm: Vertical size; across the container on the roof.
        contact_mm: Depth behind the outermost sheet up to which it is rusty.
        pits: Amount of pits and holes; at 0 there are hardly any.
        at_bottom: Probability that it is at the bottom of its face, where water stays.
    """

    length_mm: Extent = Range(250, 1300)
    height_mm: Extent = Range(160, 700)
    contact_mm: Contact = Range(45, 90)
    pits: Annotated[Range, UNIT] = Range(0.2, 1.0)
    at_bottom: Share = 0.6


def _draw(c: RustThroughConfig, face: str, size: Size, rng: np.random.Generator) -> SheetForm:
    length, height = fitted((draw(rng, c.length_mm), draw(rng, c.height_mm)), size)
    shape = (
        round(max(_SCALE.draw(rng) * (length + height) / 2, 5.0), 2),
        draw_angle(rng),
        draw(rng, _HEIGHT, digits=3),
        draw(rng, c.pits, digits=3),
        draw(rng, c.contact_mm),
    )
    low = face != "roof" and rng.random() < c.at_bottom
    return SheetForm((length, height), shape=shape, place="bottom" if low else "anywhere")


KIND = Kind(
    "rust_through",
    (
        Form(
            name="plain",
            glsl="rust_through",
            shader="damage_rust_through.glsl",
            marked=in_patch,
            parameters=(
                *PATCH,
                Parameter("amount of pits", 0.0, 1.0),
                millimetres("depth behind the face up to which it is rusty", high=MOST_CONTACT_MM),
            ),
        ),
    ),
    RustThroughConfig,
    _draw,
    leaks=True,
)

"""Parameters of each form of damage: the numbers of `Damage.shape`."""

from collections.abc import Mapping
from typing import NamedTuple

from fastgen.scene.limits import FARTHEST, LOBE_LIMIT, LOBES, MOST_CONTACT_MM


class Parameter(NamedTuple):
    """One number of `Damage.shape`.

    Attributes:
        name: What it is, with its unit.
        low: Smallest value.
        high: Largest value.
    """

    name: str
    low: float
    high: float


_LEAST = 1e-3
"""Smallest value of numbers that fields are divided by."""

_PHASE = Parameter("phase in radians", -FARTHEST, FARTHEST)
_SOFTNESS = Parameter("softness of the folds, as a share of the depth", _LEAST, 1.0)


def _mm(name: str, low: float = _LEAST, high: float = FARTHEST) -> Parameter:
    return Parameter(f"{name} in mm", low, high)


SHAPES: Mapping[tuple[str, str], tuple[Parameter, ...]] = {
    ("axis", "plain"): (),
    ("axis", "kinked"): (
        Parameter("place of the deepest point, in half lengths from the middle", -0.9, 0.9),
        _SOFTNESS,
    ),
    ("concave", "plain"): (),
    ("concave", "creased"): (
        _PHASE,
        *(Parameter(f"distance of side {k + 1}, as a share of half the size", 0.1, 2.0)
          for k in range(5)),
        _SOFTNESS,
        Parameter("share by which the corrugation is flattened", 0.0, 1.0),
    ),
    ("dented", "plain"): (
        _mm("half width of the crease"),
        Parameter("depth of the sunken area, as a share of the depth", 0.0, 1.0),
        _mm("amplitude", -FARTHEST),
        _mm("wavelength"),
        _PHASE,
        _mm("stretch length"),
    ),
    ("dented", "ribs"): (
        _mm("length over which the edge of a mark is rounded"),
        _mm("length over which the row runs out at its ends"),
        Parameter("unevenness of the depth along the row", 0.0, 1.0),
        _mm("wavelength of the unevenness"),
        _PHASE,
        Parameter("displacement, as a share of how far the object reaches in", 0.0, 1.0),
    ),
    ("perforation", "plain"): (
        _mm("width of the rim"),
        *(Parameter(f"{what} of harmonic {k + 2}", low, high)
          for k in range(LOBES)
          for what, low, high in (("share", -LOBE_LIMIT, LOBE_LIMIT),
                                  ("phase in radians", -FARTHEST, FARTHEST))),
    ),
    ("perforation", "torn"): (
        _mm("width of the rim"),
        Parameter("share of the gape below the line of the tear", 0.0, 1.0),
        Parameter("likeness to a wedge", 0.0, 1.0),
        _mm("height of the teeth", 0.0),
        _PHASE,
        _mm("length of the second slit", 0.0),
        Parameter("amount by which the lower lip bends less than the upper", 0.0, 2.0),
    ),
    ("scrape", "plain"): (
        _mm("distance between scratches"),
        Parameter("density of scratches", 0.0, 1.0),
        _mm("depth behind the face up to which the sheet is scraped", high=MOST_CONTACT_MM),
        _mm("raggedness of the ends", 0.0),
        _PHASE,
        _mm("waviness of the scratches", 0.0),
    ),
}  # fmt: skip
"""Parameters by the kind and the form of a damage."""

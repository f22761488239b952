"""Layouts and codes of container identifiers."""

from dataclasses import dataclass, field
from typing import Annotated

from fastgen.config.own_decals import Face, OwnerCode
from fastgen.decals.identifier_layout import LAYOUTS
from fastgen.validation import Bounds, OneOf, Share, check_weights

_Weights = dict[Annotated[str, OneOf(LAYOUTS)], Annotated[float, Bounds(0.0, 1e6)]]


@dataclass(frozen=True)
class IdentifierConfig:
    """How identifiers are written (ISO 6346, section 7, and the practice of container makers).

    Attributes:
        layouts: Relative frequency of each layout by face. rows: owner code, serial number and
            check digit in one line, on doors on both sides of a locking bar. block: one below
            another. column: letters below one another. A layout without room is replaced by
            another one. A face that is not listed has rows.
        owner_codes: Owner codes to draw from. If the list is empty, the three letters are random.
        brand_codes: Probability that a container has an owner code of its brand; not used if
            owner_codes is given. Most containers of a line are leased and have other codes.
        check_digit_box: Probability of the frame around the check digit.
        rib_pitch: Probability that the letters of rows or a block on a long side are spaced by half
            waves, one on each flat. On the end without doors, all are where they fit, as the flanks
            of most such walls are steep.
        painted_over: Probability that a container has an older identifier under a patch of fresh
            paint, below or beside the present one. Its letters may show faintly through the paint
            and have no label.
    """

    layouts: dict[Face, _Weights] = field(
        default_factory=lambda: {
            "front": {"rows": 0.15, "block": 0.4, "column": 0.45},
            "back": {"rows": 0.15, "block": 0.4, "column": 0.45},
            "door": {"rows": 0.9, "block": 0.1},
            "no_door": {"rows": 0.3, "block": 0.25, "column": 0.45},
            "roof": {"rows": 1.0},
        }
    )
    owner_codes: tuple[OwnerCode, ...] = ()
    brand_codes: Share = 0.25
    check_digit_box: Share = 0.93
    rib_pitch: Share = 0.35
    painted_over: Share = 0.12

    def __post_init__(self) -> None:
        """Refuse faces without any weight."""
        for face, weights in self.layouts.items():
            hint = "give at least one above 0, or leave the face out"
            check_weights(f"layouts.{face}", weights.values(), hint)

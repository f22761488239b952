"""Paint of containers and its ageing."""

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import MinLen

from fastgen.config.fields import HexColor, HexColors, Weight
from fastgen.errors import ConfigError
from fastgen.scene.limits import MIN_ROUGHNESS
from fastgen.validation import UNIT, Bounds, Range

_Reach = Annotated[Range, Bounds(1.0, 1e6, "mm")]
_Roughness = Annotated[Range, Bounds(MIN_ROUGHNESS, 1.0)]
_Size = Annotated[Range, Bounds(50, 1e5, "mm")]


@dataclass(frozen=True)
class SurfaceConfig:
    """Paint and its ageing (SeaFront paper, section 3.2), layer by layer as in its Fig. 5.

    Attributes:
        colors: Colors of undamaged paint by name.
        color_weights: Relative frequency of each color; 1 for a color that is not named. Names that
            are not in `colors` have no effect, so a file may replace a preset's colors alone.
        roughness: Perceptual GGX roughness of undamaged paint.
        tone_variation: Variation of the paint's tone over a side.
        bleach: Loss of colour to the sun, in uneven columns and most on the roof.
        ageing_strength: Strength of the darkening toward the corners of each panel.
        ageing_reach_mm: Distance from a corner up to which it is visible.
        dirt_strength: Strength of the deposit along edges.
        dirt_reach_mm: Distance from an edge up to which it is visible.
        dirt_color: Color of the deposit.
        dirt_streaks: Strength of the dark streaks that run down from upper edges.
        rust_coverage: Share of the sheet that is rusty, not counting rust runs, scrapes and
            damages. Most of it lies along edges, above all the lower ones, and little on open
            panels; frame and castings are rustier. The drawn position in the range is squared, so
            low values prevail.
        rust_scale_mm: Size of the patches.
        rust_colors: Colors of the rust; all are equally likely.
        rust_roughness: Perceptual GGX roughness of rust.
        scratch_coverage: Share of the sheet under fine bright scratches; values above 0.1 add no
            more.
        scrapes: Share of the steel that forks and spreaders have scraped, at their heights on walls
            and doors, on the outer flats of the corrugation. On rusty containers scrapes rust.
        wear_strength: Unevenness of the paint's reflection.
        wear_scale_mm: Size of the noise of wear, scratches and dirt.
    """

    colors: Annotated[dict[str, HexColor], MinLen(1)] = field(
        default_factory=lambda: {
            "oxide red": "#6b2a22",
            "maroon": "#57202a",
            "rust brown": "#6e3b26",
            "signal blue": "#1f4e84",
            "navy": "#1c2c48",
            "sky blue": "#4a86ad",
            "turquoise": "#24777a",
            "sea green": "#2a6650",
            "leaf green": "#3c7a45",
            "olive": "#5a5d3c",
            "traffic orange": "#c4561f",
            "amber": "#d08a22",
            "cream": "#c9bfa2",
            "light grey": "#a3a6a6",
            "mid grey": "#6d7276",
            "white": "#d2d3ce",
            "magenta": "#9a2b62",
            "charcoal": "#3a3d40",
        }
    )
    color_weights: dict[str, Weight] = field(default_factory=dict)
    roughness: _Roughness = Range(0.38, 0.62)
    tone_variation: Annotated[Range, UNIT] = Range(0.02, 0.12)
    bleach: Annotated[Range, UNIT] = Range(0.0, 0.6)
    ageing_strength: Annotated[Range, UNIT] = Range(0.1, 0.6)
    ageing_reach_mm: _Reach = Range(300, 1100)
    dirt_strength: Annotated[Range, UNIT] = Range(0.05, 0.55)
    dirt_reach_mm: _Reach = Range(60, 320)
    dirt_color: HexColor = "#a8a59c"
    dirt_streaks: Annotated[Range, UNIT] = Range(0.0, 0.7)
    rust_coverage: Annotated[Range, UNIT] = Range(0.0, 0.12)
    rust_scale_mm: _Size = Range(500, 1400)
    rust_colors: HexColors = ("#5e3823", "#6e4529", "#4d2c20", "#7a4f30")
    rust_roughness: _Roughness = Range(0.8, 0.95)
    scratch_coverage: Annotated[Range, UNIT] = Range(0.0, 0.003)
    scrapes: Annotated[Range, UNIT] = Range(0.0, 0.3)
    wear_strength: Annotated[Range, UNIT] = Range(0.1, 0.6)
    wear_scale_mm: _Size = Range(700, 2500)

    def __post_init__(self) -> None:
        """Refuse colors without any weight."""
        if sum(self.weights) <= 0:
            raise ConfigError("color_weights: all colors have weight 0; give at least one above 0")

    @property
    def weights(self) -> list[float]:
        """Relative frequency of each color, in the order of `colors`."""
        return [self.color_weights.get(name, 1.0) for name in self.colors]

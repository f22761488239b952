"""Material layers of a container: paint, ageing, dirt, rust, scratches and wear."""

from dataclasses import dataclass
from typing import Annotated

from fastgen.scene.limits import Number
from fastgen.validation import Bounds, Share

Color = tuple[Share, Share, Share]
Vec2 = tuple[Number, Number]

_Reach = Annotated[float, Bounds(0.0, 1e6, "mm")]
_Scale = Annotated[float, Bounds(1.0, 1e6, "mm")]


@dataclass(frozen=True)
class Paint:
    """Base coat.

    Attributes:
        name: Name of the color in the configuration.
        albedo: Linear color.
        roughness: Perceptual GGX roughness of undamaged paint.
        tone_variation: Variation of the tone over a side.
        bleach: Loss of colour to the sun.
    """

    name: str
    albedo: Color
    roughness: Share
    tone_variation: Share
    bleach: Share = 0.0


@dataclass(frozen=True)
class Ageing:
    """Darkening toward the corners of each panel; `reach_mm` is measured from a corner."""

    strength: Share
    reach_mm: _Reach


@dataclass(frozen=True)
class Dirt:
    """Deposit on the paint.

    Attributes:
        strength: Strength of the light grey deposit along edges.
        reach_mm: Distance from an edge up to which it is visible.
        albedo: Linear color of the deposit.
        streaks: Strength of the dark streaks below upper edges.
    """

    strength: Share
    reach_mm: _Reach
    albedo: Color
    streaks: Share = 0.0


@dataclass(frozen=True)
class Rust:
    """Ochre corrosion that breaks through the paint.

    Attributes:
        coverage: Share of the sheet that is rusty.
        scale_mm: Size of the patches.
        albedo: Linear color.
        roughness: Perceptual GGX roughness.
    """

    coverage: Share
    scale_mm: _Scale
    albedo: Color
    roughness: Share


@dataclass(frozen=True)
class Scratches:
    """Places without paint, down to primer or steel.

    Attributes:
        coverage: Share of the sheet under fine bright lines.
        scrapes: Share of the steel at fork and spreader height that is scraped.
    """

    coverage: Share
    scrapes: Share = 0.0


@dataclass(frozen=True)
class Wear:
    """Uneven reflection of worn paint.

    Attributes:
        strength: How far noise spreads the roughness of exposed paint.
        scale_mm: Size of the noise tile, which scratches and dirt share.
    """

    strength: Share
    scale_mm: _Scale


@dataclass(frozen=True)
class Surface:
    """All material layers of one container; `noise_offset_mm` shifts their noise."""

    paint: Paint
    ageing: Ageing
    dirt: Dirt
    rust: Rust
    scratches: Scratches
    wear: Wear
    noise_offset_mm: Vec2

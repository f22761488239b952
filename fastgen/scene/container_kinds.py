"""Container kinds after ISO 668 and the corrugation profiles of their walls."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContainerKind:
    """External length, width and height in mm (ISO 668) and the size-type code (ISO 6346)."""

    length_mm: float
    width_mm: float
    height_mm: float
    size_type: str

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """Length, width, height in mm."""
        return self.length_mm, self.width_mm, self.height_mm


KINDS: Mapping[str, ContainerKind] = MappingProxyType(
    {
        "20": ContainerKind(6058.0, 2438.0, 2591.0, "22G1"),
        "40": ContainerKind(12192.0, 2438.0, 2591.0, "42G1"),
        "40HC": ContainerKind(12192.0, 2438.0, 2896.0, "45G1"),
        "45HC": ContainerKind(13716.0, 2438.0, 2896.0, "L5G1"),
    }
)


def mm_away(points_mm: Array, kind: str) -> Array:
    """How far points [..., 3] are from the box around a container of a kind, below 0 inside of it;
    [...]."""
    length, width, height = KINDS[kind].size_mm
    outside = np.abs(points_mm - (0.0, 0.0, height / 2)) - (length / 2, width / 2, height / 2)
    most = outside.max(axis=-1)
    away: Array = np.where(most < 0, most, np.linalg.norm(np.maximum(outside, 0), axis=-1))
    return away


_DEEPEST_MM = 120.0
"""A deeper wave would not fit between a wall's plane and the inner side of a casting."""

_SHORTEST_MM = 40.0
"""A shorter pitch multiplies the triangles beyond use."""


@dataclass(frozen=True)
class Wave:
    """A trapezoidal corrugation.

    pitch_mm: of a whole wave, 40 to 1000: outer_mm + 2 slope_mm + inner_mm.
    depth_mm: across the wall, over 0, at most 120; what a wall's frame has room for.
    outer_mm: width of the outer flat.
    slope_mm: width of a slope, along the wall.
    inner_mm: width of the inner flat.

    Raises ConfigError for widths that do not add up or cannot be built.
    """

    pitch_mm: float
    depth_mm: float
    outer_mm: float
    slope_mm: float
    inner_mm: float

    def __post_init__(self) -> None:
        """Hold the widths to their sum and the depth to what the frame can take."""
        for name in ("outer_mm", "slope_mm", "inner_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name}: {getattr(self, name):g} is no width; give mm above 0")
        total = self.outer_mm + 2 * self.slope_mm + self.inner_mm
        if abs(total - self.pitch_mm) > 1e-6 * total:
            raise ConfigError(
                f"pitch_mm: {self.pitch_mm:g} is not outer + 2 slope + inner = {total:g}; "
                "make them agree"
            )
        if not _SHORTEST_MM <= self.pitch_mm <= 1000:
            raise ConfigError(f"pitch_mm: {self.pitch_mm:g} is outside {_SHORTEST_MM:g} to 1000 mm")
        if not 0 < self.depth_mm <= _DEEPEST_MM:
            raise ConfigError(
                f"depth_mm: {self.depth_mm:g} does not fit the frame; "
                f"give mm above 0, at most {_DEEPEST_MM:g}"
            )


@dataclass(frozen=True)
class WallProfiles:
    """Corrugation of the walls; common makers' figures.

    side: of both long sides.
    end: of no_door, the end without doors.
    roof: of the roof.
    """

    side: Wave = field(default_factory=lambda: Wave(278.0, 36.0, 72.0, 68.0, 70.0))
    end: Wave = field(default_factory=lambda: Wave(250.0, 46.0, 110.0, 18.0, 104.0))
    roof: Wave = field(default_factory=lambda: Wave(209.0, 20.0, 91.0, 13.5, 91.0))

    def deepened(self, scale: float) -> "WallProfiles":
        """The profiles with their depths times `scale`, to a thousandth of a millimetre.

        Raises ConfigError where that makes one too deep or too shallow.
        """
        waves = {}
        for name, wave in vars(self).items():
            try:
                waves[name] = replace(wave, depth_mm=round(wave.depth_mm * scale, 3))
            except ConfigError as error:
                raise ConfigError(f"{scale:g} times {name}: {error}") from None
        return WallProfiles(**waves)

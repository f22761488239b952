"""Container kinds of ISO 668 and the corrugation profiles of their walls."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.validation import Bounds

Array = NDArray[np.float64]

CASTING_MM = (178.0, 162.0, 118.0)
"""Size of a corner casting along x, y and z; ISO 1161."""


@dataclass(frozen=True)
class ContainerKind:
    """External size in mm (ISO 668) and size-type code (ISO 6346) of a container."""

    length_mm: float
    width_mm: float
    height_mm: float
    size_type: str

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """Length, width and height in mm."""
        return self.length_mm, self.width_mm, self.height_mm


KINDS: Mapping[str, ContainerKind] = MappingProxyType(
    {
        "20": ContainerKind(6058.0, 2438.0, 2591.0, "22G1"),
        "40": ContainerKind(12192.0, 2438.0, 2591.0, "42G1"),
        "40HC": ContainerKind(12192.0, 2438.0, 2896.0, "45G1"),
        "45HC": ContainerKind(13716.0, 2438.0, 2896.0, "L5G1"),
    }
)


SIZE_TYPES: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "20": {"22G1": 0.88, "22G0": 0.05, "2210": 0.07},
        "40": {"42G1": 0.87, "42G0": 0.05, "4310": 0.08},
        "40HC": {"45G1": 0.92, "45G0": 0.04, "4510": 0.04},
        "45HC": {"L5G1": 0.95, "L5G0": 0.05},
    }
)
"""Size-type codes of dry freight containers and their relative frequency, by kind. G1 has vents, G0
has none (ISO 6346:1995, annexes D and E); numbers alone are codes of the edition of 1984."""


def mm_away(points_mm: Array, kind: str) -> Array:
    """Return the signed distance in mm of points from the bounding box of a container.

    Args:
        points_mm: Points [..., 3] in the container frame.
        kind: A key of KINDS.

    Returns:
        Distances [...], negative inside the box.
    """
    length, width, height = KINDS[kind].size_mm
    outside = np.abs(points_mm - (0.0, 0.0, height / 2)) - (length / 2, width / 2, height / 2)
    most = outside.max(axis=-1)
    away: Array = np.where(most < 0, most, np.linalg.norm(np.maximum(outside, 0), axis=-1))
    return away


_DEPTH = Bounds(0.001, 120.0, "mm")
"""A deeper wave would not fit between the plane of a wall and the inner side of a casting."""

_PITCH = Bounds(40.0, 1000.0, "mm")
"""A shorter pitch multiplies the triangles and shows no more."""

_Width = Annotated[float, Bounds(0.001, 1000.0, "mm")]


@dataclass(frozen=True)
class Wave:
    """A trapezoidal corrugation.

    Attributes:
        pitch_mm: Length of one wave: outer_mm + 2 slope_mm + inner_mm.
        depth_mm: Depth across the wall.
        outer_mm: Width of the outer flat.
        slope_mm: Width of a slope, measured along the wall.
        inner_mm: Width of the inner flat.

    Raises:
        ConfigError: if the widths do not add up to the pitch.
    """

    pitch_mm: Annotated[float, _PITCH]
    depth_mm: Annotated[float, _DEPTH]
    outer_mm: _Width
    slope_mm: _Width
    inner_mm: _Width

    def __post_init__(self) -> None:
        """Check that the widths add up."""
        total = self.outer_mm + 2 * self.slope_mm + self.inner_mm
        if abs(total - self.pitch_mm) > 1e-6 * total:
            raise ConfigError(
                f"pitch_mm: {self.pitch_mm:g} is not outer_mm + 2 slope_mm + inner_mm = {total:g}; "
                "make them agree"
            )


@dataclass(frozen=True)
class WallProfiles:
    """Corrugation of the walls; typical values of manufacturers.

    Attributes:
        side: Both long sides.
        end: The end without doors, no_door.
        roof: The roof.
    """

    side: Wave = field(default_factory=lambda: Wave(278.0, 36.0, 72.0, 68.0, 70.0))
    end: Wave = field(default_factory=lambda: Wave(250.0, 46.0, 110.0, 18.0, 104.0))
    roof: Wave = field(default_factory=lambda: Wave(209.0, 20.0, 91.0, 13.5, 91.0))

    def deepened(self, scale: float) -> "WallProfiles":
        """Return the profiles with depths multiplied by `scale`, rounded to 0.001 mm.

        Raises:
            ConfigError: if a wave gets too deep or too shallow.
        """
        waves = {}
        for name, wave in vars(self).items():
            depth_mm = round(wave.depth_mm * scale, 3)
            if not _DEPTH.lo <= depth_mm <= _DEPTH.hi:
                raise ConfigError(
                    f"{scale:g} times {name}.depth_mm is {depth_mm:g}, which does not fit the "
                    f"frame; the depth must be {_DEPTH.words}"
                )
            waves[name] = replace(wave, depth_mm=depth_mm)
        return WallProfiles(**waves)

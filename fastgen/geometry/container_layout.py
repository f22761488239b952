"""Dimensions of a container: positions of its members by kind and corrugation.

Inset d is the distance from the castings' outer plane at an end, inset e the distance from the one
at a side; both in mm.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.scene.container_kinds import CASTING_MM, ContainerKind, WallProfiles

Array = NDArray[np.float64]


OVERLAP_MM = 5.0
"""Parts overlap by this much, so that no ray passes between them."""

BESIDE_MM = 1.0
"""Offset between parallel surfaces of parts that overlap. In one plane they would flicker."""

FLOOR_MM = 145.0
BASE_RAIL_TOP_MM = 162.0
FRONT_SILL_TOP_MM = 120.0
RING_BOTTOM_MM = 11.0
"""z of the lower edge of rails and sills; ISO 668 keeps the base 12.5 mm (+5, -1.5) off the
ground."""

RING_TOP_MM = 5.0
"""Distance of rails and headers below the plane of the top castings."""

DOOR_RING_MM = 12.0
"""Inset d of the rear posts, the gutter and the sill's lip; all door gear lies deeper."""


@dataclass(frozen=True)
class Layout:
    """Positions of the members of one container; depths follow the corrugations they cover.

    Attributes:
        kind: Outer dimensions.
        profiles: Corrugation of the walls.
        max_edge_mm: Longest edge on corrugated walls and door leaves.
        side_recess_mm: Inset e of the side walls' outermost flats.
        end_recess_mm: Inset d of the front end wall's outermost flats.
        roof_recess_mm: Depth of the roof's outermost flats below the castings' plane.
        frame_recess_mm: Inset of posts and top rails.
    """

    kind: ContainerKind
    profiles: WallProfiles
    max_edge_mm: float

    side_recess_mm: float = 14.0
    end_recess_mm: float = 16.0
    roof_recess_mm: float = 6.0
    frame_recess_mm: float = 4.0

    @property
    def half(self) -> tuple[float, float]:
        """Half length and half width."""
        return self.kind.length_mm / 2, self.kind.width_mm / 2

    @property
    def top(self) -> float:
        """Height of the outer box."""
        return self.kind.height_mm

    @property
    def side_inner_mm(self) -> float:
        """Inset e of the rails' inner faces, behind the side wall's inner flats."""
        return max(64.0, self.side_recess_mm + self.profiles.side.depth_mm + 10)

    @property
    def end_inner_mm(self) -> float:
        """Inset d of the front end header's and sill's inner faces."""
        return max(66.0, self.end_recess_mm + self.profiles.end.depth_mm + 10)

    @property
    def post_mm(self) -> float:
        """Insets d and e of the square front posts' inner faces, equal to their width."""
        return max(84.0, self.side_inner_mm, self.end_inner_mm)

    @property
    def bottom_rail_recess_mm(self) -> float:
        """Inset e of the bottom rails, which overlap the posts."""
        return self.frame_recess_mm + BESIDE_MM

    @property
    def rail_bottom_mm(self) -> float:
        """z of the lower edge of the top rails and the front header."""
        return self.top - max(65.0, self.roof_recess_mm + self.profiles.roof.depth_mm + 15)

    @property
    def door_post_mm(self) -> tuple[float, float]:
        """Insets d and e of the rear posts' inner faces."""
        return 150.0, max(112.0, self.side_inner_mm)

    def outside_castings(self, points_mm: Array) -> NDArray[np.bool_]:
        """Test which points [..., 3] lie outside all corner fittings; bool [...]."""
        half_length, half_width = self.half
        long, wide, high = CASTING_MM
        x, y, z = np.moveaxis(np.abs(points_mm), -1, 0)
        near_corner = (x > half_length - long) & (y > half_width - wide)
        outside: NDArray[np.bool_] = ~(near_corner & ((z < high) | (z > self.top - high)))
        return outside

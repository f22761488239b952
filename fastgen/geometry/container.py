"""ISO freight containers as meshes: kind and corrugation in, triangles with one atlas out.

Parts are as fine as a camera resolves. At 640 pixels across a 36 mm sensor, a pixel at 10 m covers
36 / f * 10 m / 640: 12.5 mm for f = 45 mm (the ends), 20 mm for f = 28 mm and 39 mm for
f = 14.5 mm (the sides).

- Door leaves: cells of 50 mm across the locking bars, because their shade changes over that.
- Corrugation: each facet of 13 mm or more is geometry, because the waves shade a wall at any
  distance. Ridges are cut by max_edge_mm only so that they can bend.
- Locking bars, 34 mm, under 3 px: 8 sides. Hinge knuckles, 28 mm: 6 sides. Casting apertures, 51 to
  124 mm, 4 to 10 px: 12 points. Cams, jaws, brackets, handles, lugs: blocks, 2 to 8 px.
- Below the floor there are only fork pockets. Cross members would hang behind the rails, and change
  0.01 % of the objects' pixels.

With the default profiles and max_edge_mm = 150:

    kind   triangles  vertices  charts  atlas in m    filled
    20        25,516    28,458     104  11.4 x 11.1     80 %
    40        39,976    43,490     100  13.2 x 13.8     89 %
    40HC      42,452    46,034     100  13.2 x 14.7     88 %
    45HC      46,312    50,054     100  14.9 x 14.6     87 %
"""

from fastgen.errors import ConfigError
from fastgen.geometry.container_castings import castings
from fastgen.geometry.container_layout import Layout
from fastgen.geometry.container_parts import base, frame
from fastgen.geometry.container_walls import panels
from fastgen.geometry.door import leaves
from fastgen.geometry.door_gear import gasket_lip, gear
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.stored_mesh import stored
from fastgen.geometry.unfold import assemble
from fastgen.scene.container_kinds import KINDS, WallProfiles
from fastgen.validation import check_known

VERSION = 10  # raise when the stored arrays change

NOMINAL_PROFILES = WallProfiles()

_EDGE_LIMITS_MM = (25.0, 2000.0)


def build_container(
    kind: str, profiles: WallProfiles = NOMINAL_PROFILES, max_edge_mm: float = 150.0
) -> Mesh:
    """Build the mesh of a closed container, or read it from the disk cache.

    `shape_library.SHAPES` keeps the meshes that scenes use.

    Args:
        kind: One of KINDS.
        profiles: Corrugation of the walls.
        max_edge_mm: Longest edge on corrugated walls and door leaves, diagonals included.

    Returns:
        A new Mesh with read-only arrays.

    Raises:
        ConfigError: The kind is unknown, max_edge_mm is out of range, or a wave does not fit its
            wall.
    """
    check_known("container kind", kind, KINDS)
    low, high = _EDGE_LIMITS_MM
    if not low <= max_edge_mm <= high:
        raise ConfigError(f"max_edge_mm: {max_edge_mm:g} is outside {low:g} to {high:g} mm")
    return stored(
        "container",
        VERSION,
        (kind, profiles, max_edge_mm),
        lambda: _assembled(Layout(KINDS[kind], profiles, max_edge_mm)),
    )


def container_outline(kind: str, profiles: WallProfiles = NOMINAL_PROFILES) -> Mesh:
    """Build the same surface with as few triangles as possible; see build_container."""
    return build_container(kind, profiles, _EDGE_LIMITS_MM[1])


def _assembled(layout: Layout) -> Mesh:
    walls = panels(layout)
    door_sheets, door_flats = leaves(layout)
    sheets = [
        *(wall.sheet for wall in walls.values()),
        *door_sheets,
        *gear(layout),
        *frame(layout, walls),
        *castings(layout),
        *base(layout),
        gasket_lip(layout),
    ]
    flats = {face: wall.flats for face, wall in walls.items()} | {"door": door_flats}
    return assemble(sheets, layout.kind.size_mm, flats)

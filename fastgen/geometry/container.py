"""ISO freight containers as meshes: kind and corrugation in, triangles with one atlas out.

How fine the parts are follows from what a camera resolves. At 640 pixels across a 36 mm sensor one
pixel is 36 / f * distance / 640: 12.5 mm for f = 45 mm at 10 m (the ends), 20 mm for f = 28 mm and
39 mm for f = 14.5 mm, both also at 10 m (the sides).

- The door's leaves: cells of 50 mm across the locking bars, whose shade changes over that.
- Corrugation: every facet of 13 mm and more is real geometry, since the waves shade a wall at any
  distance; ridges are cut by max_edge_mm only to bend later.
- Locking bars, 34 mm, under 3 px: 8 sides. Hinge knuckles, 28 mm: 6. Casting apertures, 51 to
  124 mm, 4 to 10 px: 12 points. Cams, jaws, brackets, handles, lugs: blocks, 2 to 8 px.
- Members under the floor are seen from far below or not at all: C sections cut every 400 mm,
  for a lens bends corners only.

With the usual profiles and max_edge_mm = 150:

    kind   triangles  vertices  charts  atlas in m    filled
    20        26,036    29,656     118  11.6 x 11.2     84 %
    40        41,936    46,368     138  14.5 x 14.2     92 %
    40HC      44,246    48,746     138  14.9 x 14.6     92 %
    45HC      48,406    53,116     143  15.8 x 15.4     91 %
"""

from functools import lru_cache

from fastgen.errors import ConfigError
from fastgen.geometry.container_castings import castings
from fastgen.geometry.container_layout import Layout
from fastgen.geometry.container_parts import base, frame
from fastgen.geometry.container_walls import panels
from fastgen.geometry.door import leaves
from fastgen.geometry.door_gear import gear
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.stored_mesh import stored
from fastgen.geometry.unfold import assemble
from fastgen.scene.container_kinds import KINDS, WallProfiles
from fastgen.validation import check_known

_USUAL = WallProfiles()

_EDGE_LIMITS_MM = (25.0, 2000.0)


def build_container(kind: str, profiles: WallProfiles = _USUAL, max_edge_mm: float = 150.0) -> Mesh:
    """The mesh of a closed container, see Mesh for its arrays and frame.

    kind: one of KINDS. profiles: corrugation of the walls. max_edge_mm: no edge on the corrugated
    walls and the door leaves is longer, diagonals included. Calls with equal arguments return the
    same object. Raises ConfigError for an unknown kind, an edge length out of range, or a wave
    that does not fit its wall.
    """
    check_known("container kind", kind, KINDS)
    low, high = _EDGE_LIMITS_MM
    if not low <= max_edge_mm <= high:
        raise ConfigError(f"max_edge_mm: {max_edge_mm:g} is outside {low:g} to {high:g} mm")
    return _built(kind, profiles, max_edge_mm)


def container_outline(kind: str, profiles: WallProfiles = _USUAL) -> Mesh:
    """The same surface of as few triangles as can be, for what asks where it is at rest."""
    return build_container(kind, profiles, _EDGE_LIMITS_MM[1])


@lru_cache(maxsize=64)
def _built(kind: str, profiles: WallProfiles, max_edge_mm: float) -> Mesh:
    return stored(
        "container",
        (kind, profiles, max_edge_mm),
        lambda: _assembled(Layout(KINDS[kind], profiles, max_edge_mm)),
    )


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
    ]
    flats = {face: wall.flats for face, wall in walls.items()} | {"door": door_flats}
    return assemble(sheets, layout.kind.size_mm, flats)

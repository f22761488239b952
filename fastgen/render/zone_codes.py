"""Numbers by which shaders recognise the zones of container, seals and spreader."""

from fastgen.geometry.mesh import MAX_ZONES
from fastgen.geometry.seals import SEAL_ZONES

SPREADER_ZONE = MAX_ZONES
"""First zone number of the spreader."""

SEAL_ZONE = SPREADER_ZONE - SEAL_ZONES
"""First zone number of the seals. The container's zones have smaller numbers."""

HOLE_ZONE = 1000
"""Zone number of sheet that a perforation tore away. Real zones have smaller numbers."""

ZONE_TURN, ZONE_GEAR, ZONE_SMALL, ZONE_LEVEL = 16, 64, 128, 256
"""Parts of a zone's code, see shaders/zone.glsl: the step of one quarter turn, above the material's
number; and the bits of door gear, of small pieces and of horizontal surfaces."""

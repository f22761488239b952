"""Numbers by which shaders recognise the zones of container, seals and spreader."""

from fastgen.geometry.mesh import MAX_ZONES
from fastgen.geometry.seals import SEAL_ZONES
from fastgen.scene.faces import SHEET_FACES

SPREADER_ZONE = MAX_ZONES
"""First zone number of the spreader."""

SEAL_ZONE = SPREADER_ZONE - SEAL_ZONES
"""First zone number of the seals. The container's zones have smaller numbers."""

HOLE_ZONE = 1000
"""Zone number of sheet that a damage tore away. Real zones have smaller numbers."""

ZONE_TURN, ZONE_GEAR, ZONE_SMALL, ZONE_LEVEL, ZONE_SHEET = 16, 64, 128, 256, 512
"""Parts of a zone's code, see shaders/zone.glsl: the step of one quarter turn, above the material's
number; the bits of door gear, of small pieces and of horizontal surfaces; and the step of the
sheet's number, which is 0 for parts that carry no decals."""

DECAL_SHEET = 8
"""Step of the sheet's number in the code of a decal, above the number of the decal's kind."""

SHEET_NUMBERS = {face: number for number, face in enumerate(SHEET_FACES, start=1)}
"""Numbers of the sheets that carry decals, by the name of their chart."""

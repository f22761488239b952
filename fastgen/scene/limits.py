"""Limits of a scene: what the labels can distinguish and what the renderer can draw."""

from typing import Annotated

from fastgen.validation import Bounds

MM = 1e-3
"""Metres per millimetre: scene data is in mm, the GPU and view space in metres."""

NEAR_M = 0.1
FAR_M = 200.0
"""Near and far plane of every camera, in metres along its optical axis."""

CAMERA_REACH_MM = (FAR_M - 20.0) / MM
"""Largest distance of a camera from a container; a whole container then fits before FAR_M."""

MAX_DAMAGES = 112
"""Damages per scene; they fit the 16 KiB that every driver grants a uniform block."""

MAX_FORMS = 48
"""Forms of damage that one program of the renderer can draw; their ends share the block of the
damages."""

MAX_DECALS = 4096
"""Decals per scene; a texture has a row for each, and every driver supports several times more."""

MOST_NEARBY, NEARBY_MM = 8, 116.0
"""Most decals that the renderer draws near one place, and the distance of boxes that are near.

The distance is a cell of the renderer's grid, and the margin of a decal on both sides."""

MAX_NEIGHBOURS = 15
"""Containers of a scene beside the first; see object_ids for the ids of each."""

MAX_PROPS = 64
"""Props of a scene; each has a bit in the tile masks of render/ground_plan.py."""

LOWEST_GROUND_MM = -1e5
"""Lowest height of the ground."""

GROUNDS = ("asphalt", "concrete", "paving")
"""Kinds of ground."""

MAX_INSTANCES = 99
"""Damages of one kind per scene. A mask value is category * 100 + instance."""

GLYPH_RANGE = 4096
"""Upper limit of the letters in a text, exclusive. Two letter numbers a and b are stored as
a * GLYPH_RANGE + b, which stays below 2^24 and is therefore exact in float32."""

DECAL_KINDS = {
    **{"marker": 0, "text": 1, "sticker": 2, "emblem": 3},
    **{"stripes": 4, "patch": 5, "triangle": 6},
}
"""Number of each decal kind in the shaders."""

COMPUTED_ART = ("stripes", "patch")
"""Artwork that the shaders compute. Scenes store these decals as stickers."""

HASPS = 4
"""Hasps of a door, one at the end of each locking bar's handle. Each can carry a seal."""

GAP_LIMITS_MM = (0.0, 200.0)
"""Distance between container and spreader; a wider gap would not look connected."""

MIN_ROUGHNESS = 0.045
"""Lowest perceptual roughness that is shaded. It is Filament's limit for single precision (Guy and
Agopian 2018, Physically Based Rendering in Filament)."""

CORNERS = tuple(f"{level} {side}" for level in ("top", "bottom") for side in ("left", "right"))
"""Corners of an image, for date stamps."""

OVERCAST_LX = 1e4
"""Illuminance of level ground on an overcast day, in lux."""

ILLUMINANCE_LIMITS_LX = (1e-3, 2e5)
"""Illuminance of level ground: from starlight to more than the sun in the zenith, in lux."""

MAX_LAMPS = 2
"""Lamps of a scene; more would leave no directional lights of the environment."""

LONGEST_JSON = 64 << 20
"""Most characters of a scene as JSON; MAX_DECALS decals need about a tenth."""

WHOLE = Bounds(0, 2**63 - 1)
"""Bounds of seeds and indices."""

FARTHEST = 1e6
"""Largest magnitude of any number in a scene; the GPU computes in float32."""

Number = Annotated[float, Bounds(-FARTHEST, FARTHEST)]
Degrees = Annotated[float, Bounds(-FARTHEST, FARTHEST, "degrees")]
Millimetres = Annotated[float, Bounds(-FARTHEST, FARTHEST, "mm")]
Length = Annotated[float, Bounds(1e-3, 1e6, "mm")]

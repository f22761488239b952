"""Limits that a scene must keep: what labels can tell apart and what the renderer can draw."""

MM = 1e-3
"""Metres in a millimetre: scene data is in mm, the GPU and view space in metres."""

NEAR_M = 0.1
FAR_M = 200.0

MAX_DAMAGES = 128
"""Damages in one scene that fit the 16 KiB that every driver gives a uniform block."""

MAX_INSTANCES = 99
"""A mask value is class * 100 + instance, so that a hundredth would pass for the next class."""

GLYPH_RANGE = 4096
"""More than the letters of a text, as scene_check sees to: a * GLYPH_RANGE + b is below 2^24 for
two of their numbers, and float32 holds it exactly."""

DECAL_KINDS = {"marker": 0, "text": 1, "sticker": 2, "emblem": 3, "stripes": 4}

LOBES = 5
"""Harmonics of a hole's outline; more would be finer than the mesh and most pixels."""

LOBE_LIMIT = 0.19
"""Of each harmonic, as a share of the mean radius: all together leave a hole about its centre."""

GAP_LIMITS_MM = (0.0, 200.0)
"""Wider, nothing would look held any more."""

MIN_ROUGHNESS = 0.045
"""Least perceptual roughness that is shaded: Filament's where it computes in single precision (Guy
and Agopian 2018, Physically Based Rendering in Filament)."""

CORNERS = tuple(f"{level} {side}" for level in ("top", "bottom") for side in ("left", "right"))

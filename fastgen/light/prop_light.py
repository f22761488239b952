"""Constants of the light on props, for ground_props.glsl and its twin in render/scene_bodies.py."""

from fastgen.light.reflectance import DIELECTRIC_F0

AMBIENT_BESIDE_M = 0.3
"""Distance in front of a face of the place on the ground whose light without directional lights the
face receives."""

SUNLIT_BESIDE_M = 0.8
"""The same for directional lights, and the radius over which their shadows are blurred there."""

LOWEST_SHARE, OPEN_M = 0.55, 0.4
"""Share of this light that a prop gets at the ground, and height from which on it gets all."""

SHEEN = DIELECTRIC_F0
"""Reflectance of paint at normal incidence. It is added to the albedo, because props are rough, and
doubles the brightness of black parts."""

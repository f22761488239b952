"""Numbers of the tone curve: Khronos PBR Neutral (Khronos Group 2024, specification section 2).

shaders/tone.glsl draws with it, sensor/light.py goes back from what is displayed to light.
"""

FRESNEL = 0.04
"""Offset that a dielectric's reflection adds to every colour, taken off again."""

SHOULDER = 0.8
"""Peak of what is shown as it is, before the offset is taken off."""

DESATURATION = 0.15
"""How fast colours lean to white beyond it."""

"""Configuration values that switch effects off."""

EVEN_PAINT = {
    "rust_coverage": 0,
    "dirt_strength": 0,
    "ageing_strength": 0,
    "tone_variation": 0,
    "scratch_coverage": 0,
    "wear_strength": 0,
    "bleach": 0,
    "dirt_streaks": 0,
    "scrapes": 0,
}
"""Values of `surface` for clean paint of one colour and roughness."""

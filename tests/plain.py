"""Configuration values that switch effects off, and scenes without surroundings."""

from dataclasses import replace

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

NO_REPAIRS = {"repairs": {"probability": 0}, "chalk": {"probability": 0}}
"""Values of `markings` without repairs and surveyors' chalk."""

_NOWHERE = {"front": 0, "back": 0, "door": 0, "no_door": 0}
FEW_DECALS = {
    "marked_containers": 0,
    "removed_markers": 0,
    "second_identifier": 0,
    "brand": _NOWHERE,
    "main_text": _NOWHERE,
    "stickers_per_face": 0,
    "patches_per_face": 0,
    "runs": 0,
    **NO_REPAIRS,
    "height_marks": 0,
}
"""Values of `markings` that halve the time to sample a scene, and change nothing else in it."""


def bare(scene):
    """Return a scene with its first container, and nothing on or around it."""
    return replace(
        scene,
        decals=(),
        seals=(),
        neighbours=(),
        props=(),
        ground=None,
        spreader=replace(scene.spreader, present=False),
    )

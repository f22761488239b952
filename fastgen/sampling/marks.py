"""Sampling of the marks of the IMDG Code, which a configuration switches on."""

import math
from collections.abc import Mapping

import numpy as np

from fastgen.config.markings import MarkingsConfig
from fastgen.decals.artwork import Mark, marks
from fastgen.sampling.sheet import Sheet, tenth
from fastgen.sampling.streams import Streams
from fastgen.scene import Decal
from fastgen.validation import Range

_KINDS = {
    "limited_quantity": "marker",
    "environmentally_hazardous": "marker",
    "elevated_temperature": "triangle",
}
"""Kind of decal of each mark that is no rectangle."""

_SCALES = Range(1.0, 1.25)
"""Sizes of marks relative to the smallest that the code allows."""


def sample_marks(
    config: MarkingsConfig, faces: Mapping[str, Sheet], streams: Streams
) -> list[Decal]:
    """Sample the marks of a container, except those for which a face has no room."""
    made = []
    for name, share in config.marks.items():
        rng = streams(f"marks.{name}")
        if rng.random() >= share:
            continue
        mark, scale = marks()[name], _SCALES.draw(rng)
        for face in mark.where or config.marker_faces:
            made += _placed(config, mark, scale, faces[face], rng)
    return made


def _placed(
    config: MarkingsConfig, mark: Mark, scale: float, sheet: Sheet, rng: np.random.Generator
) -> list[Decal]:
    """Return the mark at a free place of a sheet, or an empty list."""
    tilt_deg = round(config.marker_tilt_deg.draw(rng), 2)
    width, height = (tenth(scale * side) for side in mark.size_mm)
    across, up = math.cos(math.radians(tilt_deg)), abs(math.sin(math.radians(tilt_deg)))
    room = (width * across + height * up, height * across + width * up)
    anywhere = Range(0.0, 1.0)
    center = sheet.place(room, rng, anywhere, anywhere)
    wear = round(config.marker_wear.draw(rng), 3)
    if center is None:
        return []
    kind = _KINDS.get(mark.name, "sticker")
    size = (width, height)
    return [Decal(kind, mark.name, sheet.face, center, size, tilt_deg, mark.name, wear=wear)]

"""Faces of a container, and the axes of each face as seen from outside."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

FACES = ("front", "back", "door", "no_door", "roof", "underside")
"""front: -y, back: +y, door: +x, no_door: -x, roof: +z, underside: -z."""

SHEET_FACES = ("front", "back", "door", "no_door", "roof")
"""Faces that can carry decals and damage."""

CORRUGATED_ALONG_Y = "door"
"""Face whose corrugation runs along sheet y; that of the others runs along sheet x."""


@dataclass(frozen=True)
class Axes:
    """Unit vectors of a face in the container frame, for a viewer in front of it.

    Attributes:
        right: To the right of the viewer.
        up: Upward for the viewer.
        out: Out of the face, toward the viewer.
    """

    right: tuple[float, float, float]
    up: tuple[float, float, float]
    out: tuple[float, float, float]


FACE_AXES: Mapping[str, Axes] = MappingProxyType(
    {
        "front": Axes((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        "back": Axes((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
        "door": Axes((0, 1, 0), (0, 0, 1), (1, 0, 0)),
        "no_door": Axes((0, -1, 0), (0, 0, 1), (-1, 0, 0)),
        "roof": Axes((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        "underside": Axes((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    }
)
"""Axes by face. right x up = out for every face, so no decal is mirrored."""

"""Decal: one thing printed or stuck on a container.

Decals are placed in sheet coordinates of their face: origin at the lower left corner of the face's
chart seen from outside, x to the right, y up, measured along the unfolded sheet.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from fastgen.classes import CLASS_NAME
from fastgen.decals.glyphs import font_named
from fastgen.decals.lettering import Lettering, TextPart, layout
from fastgen.scene.faces import SHEET_FACES
from fastgen.scene.limits import COMPUTED_ART, DECAL_KINDS, Degrees, Length, Millimetres
from fastgen.scene.surface import Color, Vec2
from fastgen.validation import Flag, Matching, OneOf, Share


@dataclass(frozen=True)
class Decal:
    """One thing printed or stuck on the sheet.

    Attributes:
        kind: 'marker', 'text', 'sticker', 'triangle' or 'emblem'.
        class_name: Label class; '' for decals without a label.
        face: Face that it lies on.
        center_mm: Centre in sheet coordinates. What reaches beyond the sheet is cut off.
        size_mm: Width and height of the drawn rectangle before its rotation. For a marker this is
            the square that stands on its corner, for a text the tight box around its ink. A
            triangle has its tip in the middle of the upper side.
        rotation_deg: Counter-clockwise rotation on the sheet.
        art: Name of the marker, sticker or emblem, as in `artwork.art_layers`, or in
            `MarkingsConfig.own_art` for one of the configuration; 'stripes' for the bands of high
            cubes, 'patch' for a repainted rectangle.
        lines: Text, one string per line. In vertical text the letters of a line are below one
            another, and lines are columns from left to right.
        parts: Parts of a text with places of their own; they decide the layout if there are any,
            and hold the letters of `lines` in the same order.
        font: Name of the font of a text, as in `glyphs.font_named`.
        vertical: Whether a text is vertical.
        cap_mm: Height of the capitals of a text.
        albedo: Linear color of texts, emblems, stripes and patches.
        wear: Wear of the print. Texts, emblems, stripes and patches lose this share of their ink
            in flakes.
            Markers and stickers are scratched and dirty, and peel off in patches.
        tint: Linear color that multiplies the artwork of markers, stickers and triangles.
        fade: Bleaching of markers, stickers and triangles.
        torn: Shares of the half width and half height that are torn off a marker or sticker at its
            left, right, top and bottom. The label keeps the whole decal.
    """

    kind: Annotated[str, OneOf(tuple(kind for kind in DECAL_KINDS if kind not in COMPUTED_ART))]
    class_name: Annotated[
        str,
        Matching(f"{CLASS_NAME}|", "is not a class name; give a class of the marker task or ''"),
    ]
    face: Annotated[str, OneOf(SHEET_FACES)]
    center_mm: Vec2
    size_mm: tuple[Length, Length]
    rotation_deg: Degrees = 0.0
    art: str = ""
    lines: tuple[str, ...] = ()
    parts: tuple[TextPart, ...] = ()
    font: str = ""
    vertical: Flag = False
    cap_mm: Millimetres = 0.0
    albedo: Color = (0.8, 0.8, 0.8)
    wear: Share = 0.0
    tint: Color = (1.0, 1.0, 1.0)
    fade: Share = 0.0
    torn: tuple[Share, Share, Share, Share] = (0.0, 0.0, 0.0, 0.0)

    @property
    def text(self) -> str:
        """The lines joined by single spaces; '' for markers and stickers."""
        return " ".join(self.lines)

    @property
    def lettering(self) -> Lettering:
        """Size of a text, and position of each of its glyphs and parts."""
        return layout(self.lines, font_named(self.font), self.cap_mm, self.vertical, self.parts)

    @property
    def turn(self) -> NDArray[np.float64]:
        """Rotation [2, 2] from the decal's axes to its sheet's: columns are its right and up."""
        angle = np.deg2rad(self.rotation_deg)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

"""The members of a ship-to-shore crane's spreader: frame, end beams, flippers, headblock, cables.

Sizes are common to manufacturers' drawings of single-lift telescopic spreaders, to a few
centimetres; a camera at 10 m resolves no more. Heights named `above` are measured from the
spreader's lower plane. An `end` is -1 (no_door) or 1 (door); a `side` is -1 (front) or 1 (back).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fastgen.geometry.container_castings import APERTURE_CENTER_MM
from fastgen.geometry.container_layout import BESIDE_MM
from fastgen.geometry.container_parts import ring
from fastgen.geometry.unfold import Patch, Sheet, beside, box, prism, regular
from fastgen.scene.container_kinds import ContainerKind

TIERS = ("frame", "headblock", "cables")
"""Tiers of a spreader from bottom to top, each narrower than the one below. Charts are named
spreader.TIER.PART."""

_CABLE_LENGTH_MM = 12000.0
"""Modelled length of the hoist cables, which ends above the upper edge of usual images."""

FLIPPER_REACH_MM = 330.0
"""Distance of a lowered flipper's end below the spreader's lower plane."""

FLIPPER_GAP_MM = 30.0
"""Least distance of a lowered flipper from the planes of the container's sides and ends."""

_SIGNS = (-1.0, 1.0)

_BEAM_Y_MM = 520.0
"""Distance of the two main beams, and of the sheaves above them, from the middle."""

_FRAME_HALF_MM = 2650.0
"""Half the length of the main frame, which fits into a spreader retracted to 20 feet."""

CUT_MM = 150.0
"""Spacing of cuts across members. Indirect light is interpolated between vertices, and members
shade each other where they meet."""

_PIVOT_MM = 200.0
"""Height of the flippers' pivot: raised flippers are lowered ones mirrored at this height."""

_HEADBLOCK_MM = (690.0, 1000.0)
"""Lower and upper edge of the headblock's beams above the spreader's lower plane."""

_SHEAVE_X_MM, _SHEAVE_Z_MM, _SHEAVE_RADIUS_MM = 950.0, 1250.0, 330.0

_CABLE_RADIUS_MM = 30.0
"""Distance of a cable's four edges from its axis.

Seen from all around, a cable is 54 mm wide on average, like two hoist ropes side by side. Thinner
cables are dashes before a bright sky, which outshines a pixel that a cable covers in part.
"""


@dataclass(frozen=True)
class Hang:
    """Position of a spreader over its container.

    Attributes:
        kind: The container.
        gap_mm: Distance of the spreader's lower plane from the castings' upper plane.
        cut_mm: Spacing of cuts across members.
    """

    kind: ContainerKind
    gap_mm: float
    cut_mm: float = CUT_MM

    @property
    def base(self) -> float:
        """z of the spreader's lower plane in the container frame."""
        return self.kind.height_mm + self.gap_mm

    def block(
        self, x: tuple[float, float], y: tuple[float, float], above: tuple[float, float]
    ) -> Patch:
        """Return a box from ranges of x and y in any order, and of the height above `base`."""
        low, high = (min(x), min(y), self.base + above[0]), (max(x), max(y), self.base + above[1])
        return box(low, high, self.cut_mm)


def frame(hang: Hang) -> list[Sheet]:
    """Return the main frame: two box beams and cross members."""
    sheets = [
        _painted(
            f"spreader.frame.{name}",
            hang.block(
                (-_FRAME_HALF_MM, _FRAME_HALF_MM), _around(side * _BEAM_Y_MM, 150.0), (110.0, 560.0)
            ),
        )
        for name, side in (("front", -1.0), ("back", 1.0))
    ]
    inner = (-_BEAM_Y_MM + 140.0, _BEAM_Y_MM - 140.0)
    cross = [
        hang.block(_around(x, 110.0), inner, (170.0, 500.0)) for x in (-2500.0, -850, 850, 2500)
    ]
    return [*sheets, _painted("spreader.frame.cross", beside(cross))]


def ends(hang: Hang) -> list[Sheet]:
    """Return telescopic beams, and end beams across with the housings of the twistlocks.

    Twistlocks are not modelled: only their stems would show, in the gap above the castings.
    """
    sheets = []
    half_length, half_width = hang.kind.length_mm / 2, hang.kind.width_mm / 2
    for name, end in (("no_door", -1.0), ("door", 1.0)):
        drawn_out = (end * (_FRAME_HALF_MM - 400.0), end * (half_length - 200.0))
        beams = [
            hang.block(drawn_out, _around(side * _BEAM_Y_MM, 110.0), (160.0, 490.0))
            for side in _SIGNS
        ]
        across = (20.0 - half_width, half_width - 20.0)
        beam = hang.block((end * (half_length - 260), end * (half_length - 12)), across, (70, 450))
        housings = []
        for side in _SIGNS:
            x = end * (half_length - APERTURE_CENTER_MM[0])
            y = side * (half_width - APERTURE_CENTER_MM[1])
            housings.append(hang.block(_around(x, 106.0), _around(y, 95.0), (0.0, 300.0)))
        # plates that carry the end beam's load into the telescopic beams
        gussets = [
            hang.block(
                (end * (half_length - 700), end * (half_length - 250)), _around(y, 20.0), (80, 620)
            )
            for y in (-_BEAM_Y_MM - 135, -_BEAM_Y_MM + 135, _BEAM_Y_MM - 135, _BEAM_Y_MM + 135)
        ]
        parts = beside([beam, *beams, *housings, *gussets])
        sheets.append(_painted(f"spreader.frame.{name}", parts))
    return sheets


def flippers(hang: Hang, down: tuple[bool, bool]) -> list[Sheet]:
    """Return the gather guides at the corners: bent plates beside each side and end.

    Args:
        hang: Position of the spreader.
        down: True where the flippers of the front and of the back side are lowered.
    """
    half = np.array([hang.kind.length_mm / 2, hang.kind.width_mm / 2])
    patches: list[Patch] = []
    for side, lowered in zip(_SIGNS, down, strict=True):
        for end in _SIGNS:
            for across in (0, 1):  # the axis normal to the plate
                patches.extend(_guide(hang, half, np.array([end, side]), across, lowered))
    return [_painted("spreader.frame.flippers", beside(patches))]


def headblock(hang: Hang) -> list[Sheet]:
    """Return the headblock and the cabinets on the frame beside it.

    The headblock has two beams on four feet, the cable basket and four sheaves.
    """
    low, high = _HEADBLOCK_MM
    beams = [
        hang.block((-1500.0, 1500.0), _around(side * _BEAM_Y_MM, 130.0), (low, high))
        for side in _SIGNS
    ]
    feet = [
        hang.block(_around(x, 120.0), _around(side * _BEAM_Y_MM, 105.0), (550.0, low + 10))
        for x in (-1250.0, 1250.0)
        for side in _SIGNS
    ]
    inner = (-_BEAM_Y_MM + 120.0, _BEAM_Y_MM - 120.0)
    cross = [hang.block(_around(x, 150.0), inner, (low + 20, high - 20)) for x in (-1100.0, 1100)]
    cabinets = [
        hang.block(_around(-2050.0, 340.0), (-620.0, 620.0), (555.0, 1080.0)),
        hang.block(_around(2080.0, 300.0), (-560.0, 560.0), (555.0, 920.0)),
    ]
    basket = prism(
        regular((0.0, 0.0), 420.0, 12),
        (hang.base + 480.0, hang.base + 1300.0),
        2,
        capped=(True, True),
    )
    cheeks, sheaves = [], []
    z = hang.base + _SHEAVE_Z_MM
    for x in (-_SHEAVE_X_MM, _SHEAVE_X_MM):
        for side in _SIGNS:
            y = side * _BEAM_Y_MM
            wheel = regular((z, x), _SHEAVE_RADIUS_MM, 16)
            sheaves.append(prism(wheel, _around(y, 45.0), 1, capped=(True, True)))
            foot = hang.base + high - 10
            plate = [(foot, x - 300), (foot, x + 300), (z + 190, x + 130), (z + 190, x - 130)]
            for middle in (y - 80.0, y + 80.0):
                stations = _around(middle, 18.0)
                cheeks.append(prism(ring(plate), stations, 1, capped=(True, True)))
    return [
        _painted("spreader.headblock.beams", beside([*beams, *cross, *feet, *cheeks])),
        Sheet(
            "spreader.headblock.boxes", "roof", "galvanized", "frame", beside([basket, *cabinets])
        ),
        Sheet("spreader.headblock.sheaves", "roof", "cable", "frame", beside(sheaves)),
    ]


def cables(hang: Hang) -> list[Sheet]:
    """Return eight vertical cables with four sides, two from each sheave."""
    z = hang.base + _SHEAVE_Z_MM
    falls = []
    for x in (-_SHEAVE_X_MM, _SHEAVE_X_MM):
        for side in _SIGNS:
            for turn in _SIGNS:
                axis = (x + turn * _SHEAVE_RADIUS_MM, side * _BEAM_Y_MM)
                outline = regular(axis, _CABLE_RADIUS_MM, 4)
                stations = (z, z + _CABLE_LENGTH_MM)
                falls.append(prism(outline, stations, 2, capped=(True, True)))
    return [Sheet("spreader.cables.falls", "roof", "cable", "frame", beside(falls))]


def _painted(name: str, patch: Patch) -> Sheet:
    return Sheet(name, "roof", "spreader", "frame", patch)


def _around(middle: float, half: float) -> tuple[float, float]:
    return middle - half, middle + half


def _guide(
    hang: Hang, half: np.ndarray, signs: np.ndarray, across: int, lowered: bool
) -> Iterable[Patch]:
    """Yield the parts of one gather guide: two pieces of its plate, and its arm.

    Args:
        hang: Position of the spreader.
        half: Half length and half width of the container.
        signs: The corner.
        across: Axis normal to the plate, 0 or 1.
        lowered: Whether the guide is lowered.
    """
    # points (outward, above): distance outside the container's plane, and height above the
    # spreader's lower plane when lowered
    gap = FLIPPER_GAP_MM
    straight = [(gap, 300.0), (gap + 25, 300), (gap + 25, -70), (gap, -70)]
    splayed = [(gap, -60.0), (gap + 25, -60), (gap + 125, -FLIPPER_REACH_MM)]
    splayed.append((gap + 98, -FLIPPER_REACH_MM))
    arm = [(-20.0, 270.0), (gap + 10, 270), (gap + 10, 150), (-20, 150)]
    along = 1 - across
    corner = signs[along] * half[along]
    ranges = ((330.0, 15.0), (330.0 - BESIDE_MM, 15.0 - BESIDE_MM), (180.0, -40.0))
    for profile, (inside, outside) in zip((straight, splayed, arm), ranges, strict=True):
        outward, above = np.array(profile).T
        place = signs[across] * (half[across] + outward)
        height = hang.base + (above if lowered else 2 * _PIVOT_MM - above)
        # a prism's outline is in the axes that follow its own: y, z for x; z, x for y
        columns = (place, height) if along == 0 else (height, place)
        outline = ring(list(zip(*columns, strict=True)))
        width = sorted((corner - signs[along] * inside, corner + signs[along] * outside))
        yield prism(outline, width, along, capped=(True, True))

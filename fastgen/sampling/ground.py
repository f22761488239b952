"""Sampling of trailers, wagons and islands on the ground, as boxes and cylinders."""

from collections.abc import Iterable

import numpy as np

from fastgen.scene import Color, Pose, Prop, Vec3
from fastgen.scene.container_kinds import KINDS

_DECK_MM = {"trailer": (1100.0, 1250.0), "wagon": (1140.0, 1180.0)}
"""Height of the deck above road or rail."""

_CHASSIS_COLORS: tuple[Color, ...] = (
    (0.03, 0.03, 0.032),
    (0.12, 0.12, 0.12),
    (0.22, 0.035, 0.025),
    (0.03, 0.06, 0.16),
    (0.24, 0.2, 0.05),
)
_WAGON_COLORS: tuple[Color, ...] = (
    (0.09, 0.05, 0.035),
    (0.07, 0.07, 0.07),
    (0.16, 0.035, 0.03),
    (0.05, 0.07, 0.1),
)
_RUBBER: Color = (0.025, 0.025, 0.026)
_STEEL: Color = (0.16, 0.155, 0.15)
_RUST: Color = (0.09, 0.055, 0.04)
_LAMP_RED: Color = (0.3, 0.015, 0.012)

_TYRE_MM = 1000.0
_WHEEL_MM = 920.0
"""Diameter of a wheel of a wagon; UIC 510-2."""

_GAUGE_MM = 1435.0
_RAIL_HEAD_MM = 70.0
_RAIL_MM = 40.0
"""Height of rails above the ground of a terminal, in which they are embedded."""

_BOGIE_WHEELBASE_MM = 1800.0
"""Type Y25."""

_KERB_MM = 150.0
_BOLLARD_MM = 170.0
_BOLLARD_TALL_MM = (600.0, 900.0)
"""Height above the kerb; props have to be below all containers, and so below any deck."""

_ISLAND_WIDE_MM = (400.0, 900.0)
_ISLAND_CLEAR_MM = 500.0
"""Least room between the containers of two lanes that an island leaves."""

_ISLAND_SPANS_MM = (7000.0, 18000.0), (-4000.0, 4000.0)
"""Length of islands, and the place of their middle along the lane."""

_KERB_COLORS: tuple[Color, ...] = ((0.3, 0.29, 0.27), (0.22, 0.215, 0.21), (0.55, 0.42, 0.06))
_BOLLARD_COLORS: tuple[Color, ...] = ((0.62, 0.45, 0.03), (0.5, 0.05, 0.04), (0.55, 0.55, 0.54))

Built = tuple[float, tuple[Prop, ...]]


def trailer_props(kind: str, rng: np.random.Generator) -> Built:
    """Sample a chassis trailer that carries one container, with its rear below the door.

    Args:
        kind: Container kind.
        rng: Random stream of the trailer.

    Returns:
        Height of the ground in the frame of the container, and the parts in that frame.
    """
    deck = float(np.round(rng.uniform(*_DECK_MM["trailer"])))
    paint = _darkened(_CHASSIS_COLORS, rng)
    half, width = KINDS[kind].length_mm / 2, KINDS[kind].width_mm
    axles = 2 if kind == "20" else int(rng.integers(2, 4))
    last = half - rng.uniform(900, 1500)
    axle_x = [float(np.round(last - 1310 * i)) for i in range(axles)]
    tyre = 560.0 if rng.random() < 0.6 else 385.0  # twin or wide tyres
    axle_z = _TYRE_MM / 2 - deck
    parts = [
        *_mirrored((0, 480, -190), (2 * half + 100, 130, 340), paint),
        # bolsters below the castings, and two cross beams
        *(_box((x, 0, -85), (200, width, 170), paint) for x in (-half + 140, half - 140)),
        *(_box((x, 0, -160), (100, 900, 180), paint) for x in (-half / 3, half / 3)),
        _box((half + 60, 0, 480 - deck), (100, width - 40, 130), paint),
        *_mirrored((half + 60, width / 2 - 330, 660 - deck), (70, 420, 140), _LAMP_RED),
        *_mirrored((-half + 2300, 560, -(deck + 200) / 2), (130, 130, deck - 240), _STEEL),
        *_mirrored((-half + 2300, 560, 20 - deck), (300, 260, 40), _STEEL),
    ]
    for x in axle_x:
        parts += _wheels(x, axle_z, width / 2 - 10, tyre, _TYRE_MM, _RUBBER)
        parts.append(_cylinder((x, 0, axle_z), 260, width + 20, _STEEL))  # its ends are the hubs
    return -deck, tuple(parts)


def wagon_props(kind: str, rng: np.random.Generator) -> Built:
    """Sample a flat wagon that carries one container, on rails that are embedded in the ground.

    Args:
        kind: Container kind.
        rng: Random stream of the wagon.

    Returns:
        Height of the ground in the frame of the container, and the parts in that frame.
    """
    deck = float(np.round(rng.uniform(*_DECK_MM["wagon"])))
    paint = _darkened(_WAGON_COLORS, rng)
    half = KINDS[kind].length_mm / 2 + float(np.round(rng.uniform(250, 700)))
    axle_z = _WHEEL_MM / 2 - deck
    bogie_x = half - 1850
    parts = [
        *_mirrored((0, 1180, -190), (2 * half, 110, 360), paint),
        _box((0, 0, -230), (2 * half, 420, 300), paint),
        *(_box((x, 0, -220), (160, 2500, 420), paint) for x in (-half, half)),
        *_mirrored(
            (0, _GAUGE_MM / 2 + 30, _RAIL_MM / 2 - _RAIL_MM - deck),
            (2 * half + 60000, _RAIL_HEAD_MM, _RAIL_MM),
            _STEEL,
        ),
    ]
    for end in (-1, 1):
        for side in (-1, 1):
            center = (end * (half + 350), side * 875.0, -180.0)
            parts.append(_cylinder(center, 340, 60, _STEEL, yaw_deg=90.0))
        parts += _mirrored(
            (end * bogie_x, _GAUGE_MM / 2 + 260, axle_z + 20), (2500, 160, 330), _RUST
        )
        for axle in (-1, 1):
            x = end * bogie_x + axle * _BOGIE_WHEELBASE_MM / 2
            parts += _wheels(x, axle_z, _GAUGE_MM / 2 + 65, 135, _WHEEL_MM, _RUST)
    return -deck - _RAIL_MM, tuple(parts)


def island_props(lane_mm: float, ground_mm: float, rng: np.random.Generator) -> tuple[Prop, ...]:
    """Sample the raised islands on both sides of a lane, with bollards at their ends.

    Args:
        lane_mm: Distance between the middles of lanes, along x; one of them is at y = 0.
        ground_mm: Height of the ground.
        rng: Random stream of the islands.
    """
    wide = min(lane_mm - KINDS["20"].width_mm - _ISLAND_CLEAR_MM, rng.uniform(*_ISLAND_WIDE_MM))
    if wide < _ISLAND_WIDE_MM[0] / 2:
        return ()
    wide = float(np.round(wide))
    long, middle = (float(np.round(rng.uniform(*span))) for span in _ISLAND_SPANS_MM)
    kerb, paint = _darkened(_KERB_COLORS, rng), _darkened(_BOLLARD_COLORS, rng)
    tall = float(np.round(rng.uniform(*_BOLLARD_TALL_MM)))
    y = round(lane_mm / 2, 1)
    parts = _mirrored((middle, y, ground_mm + _KERB_MM / 2), (long, wide, _KERB_MM), kerb)
    for end in (-1, 1):
        center = (middle + end * (long / 2 - 350), y, ground_mm + _KERB_MM + tall / 2)
        parts += _mirrored(center, (_BOLLARD_MM, _BOLLARD_MM, tall), paint)
    return tuple(parts)


def _darkened(colors: tuple[Color, ...], rng: np.random.Generator) -> Color:
    """Draw one of some colors, in a random shade."""
    color = np.array(colors[rng.integers(len(colors))]) * rng.uniform(0.7, 1.2)
    red, green, blue = np.round(color, 4).tolist()
    return red, green, blue


def _box(center: Vec3, size: Vec3, albedo: Color) -> Prop:
    return Prop("box", Pose(center), size, albedo)


def _mirrored(center: Vec3, size: Vec3, albedo: Color) -> list[Prop]:
    """Return a box on each side of the x axis."""
    x, y, z = center
    return [_box((x, side * y, z), size, albedo) for side in (-1, 1)]


def _cylinder(
    center: Vec3, diameter: float, length: float, albedo: Color, yaw_deg: float = 0.0
) -> Prop:
    return Prop("cylinder", Pose(center, yaw_deg), (diameter, length, diameter), albedo)


def _wheels(
    x: float, z: float, outer: float, width: float, diameter: float, albedo: Color
) -> Iterable[Prop]:
    """Return the wheels at both ends of an axle; `outer` is the distance of their outer sides."""
    y = outer - width / 2
    return [_cylinder((x, side * y, z), diameter, width, albedo) for side in (-1, 1)]

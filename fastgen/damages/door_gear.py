"""Damaged gear of the door: bent bars, missing bars, open handles and hanging gaskets.

A bent bar leans outward from two stations of its mesh to a kink at a third, so the drawn bar has
exactly the displacement of the field; brackets on this part are pulled out with it. A missing bar
with its cams and handle is moved behind the leaf, where nothing shows it. An open handle is
sheared away from the leaf, about its bar. A hanging gasket is a lip, hidden between the leaves,
that bows out of the door. shaders/damage_door_gear.glsl is the GLSL twin.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from fastgen.damages.draws import Depth, Extent, draw, rounded_vector
from fastgen.scene import Damage, Vec3
from fastgen.scene.damage_kinds import (
    LEAST,
    Array,
    Form,
    Kind,
    Parameter,
    half_size,
    millimetres,
)
from fastgen.scene.door_gear import (
    BAR_END_MM,
    BAR_INSET_MM,
    BAR_RADIUS_MM,
    BAR_Y_MM,
    CAM_MM,
    HANDLE_INSETS_MM,
    HANDLE_MM,
    LIP_END_MM,
    LIP_INSET_MM,
    LIP_Y_MM,
    bar_stations_mm,
    handle_side,
    hasp_mm,
)
from fastgen.validation import Bounds, Range, Share

_AROUND_MM = 26.0
"""Distance from a bar's axis within which a bend acts: brackets end at 25 mm, the leaf is at 27."""

_PIECES = (2, 4)
"""Fewest and most pieces of a bar that one bend takes."""

_HUB_MM = (24.0, 35.0, 20.0)
"""Half extents of a handle's hub across its bar, along it and inward."""

_CAM_HALF_MM = (45.0, 19.0)
"""Half extents of a cam across its bar and along it."""

_LEVER_HALF_MM = (15.0, 7.0)
"""Half extents of a handle upward and inward; its own are 14 and 6 mm."""

_CLEAR_MM = 1.4
"""Distance from the bar's surface, or the end of a handle, up to which it is taken along."""

_BEHIND_MM = 65.0
"""Distance behind a bar's axis up to which the door is marked: it ends behind the swages."""

_PROUD_MM = 20.0
"""Distance in front of a bar's axis up to which the door is marked; brackets are within it."""

_HIDDEN_MM = 90.0
"""Displacement of a missing bar. It is then behind the leaf and inside header and sill."""

_AROUND_LIP_MM = 14.0
"""Distance from the lip's axis within which a hanging gasket acts: the lip ends at 11 mm, and the
edges of the leaves begin at 18 mm."""

_FREE_ENDS = 0.35
"""Share of hanging gaskets whose lower end hangs free."""

_GASKET_APEX = (-0.5, 0.1)
"""Place of a bow's farthest point, in half lengths above its middle: gravity pulls it down."""

_GASKET_TURN_DEG = (5.0, 20.0)
"""Angle to either side at which a gasket hangs out. A larger one would lead through the leaf."""

_GasketLength = Annotated[Range, Bounds(250.0, 20000.0, "mm")]
"""Length of a hanging gasket; shorter ones would have too few stations of the lip to bend."""


def _bent(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    """Two straight parts meet at a kink at `apex` half lengths."""
    (apex,) = damage.shape
    half_length, half_width = half_size(damage)
    t = u / half_length
    rise = np.minimum((1 + t) / (1 + apex), (1 - t) / (1 - apex))
    around = (np.abs(v) < half_width) & (np.abs(w) < half_width)
    return np.asarray(damage.depth_mm * np.maximum(rise, 0.0) * around)


def _on_bar(damage: Damage, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
    """Test which points at u, v and w [...] belong to a missing bar, its cams or handle."""
    handle_at, handle_mm = damage.shape
    half_length, _ = half_size(damage)
    aside, deep = np.abs(v), np.abs(w)
    thick = BAR_RADIUS_MM + _CLEAR_MM
    bar = (aside < thick) & (np.abs(u) < half_length + _CLEAR_MM)
    cam_at = half_length + BAR_END_MM - CAM_MM
    cam = (aside < _CAM_HALF_MM[0]) & (np.abs(np.abs(u) - cam_at) < _CAM_HALF_MM[1])
    above = np.abs(u - handle_at)
    hub = (aside < _HUB_MM[0]) & (above < _HUB_MM[1]) & (deep < _HUB_MM[2])
    lever = (v >= 0) & (v < handle_mm + _CLEAR_MM) & (above < _LEVER_HALF_MM[0])
    lever &= np.abs(w + _LEVER_FRONT_MM) < _LEVER_HALF_MM[1]
    return np.asarray(((bar | cam) & (deep < thick)) | hub | lever)


_LEVER_FRONT_MM = BAR_INSET_MM - sum(HANDLE_INSETS_MM) / 2
"""Distance of a handle's middle in front of its bar's axis."""


def _hidden(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    return np.asarray(damage.depth_mm * _on_bar(damage, u, v, w))


def _uncovered(damage: Damage, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
    """Test which points at u, v and w [...] of the rest of the door the bar was in front of."""
    half_length, half_width = half_size(damage)
    strip = (np.abs(u) < half_length) & (np.abs(v) < half_width)
    strip &= (w > -_PROUD_MM) & (w < _BEHIND_MM)
    return np.asarray(strip & ~_on_bar(damage, u, v, w))


def _missing_reach(damage: Damage) -> tuple[float, float]:
    half_length, half_width = half_size(damage)
    aside = max(damage.shape[1] + _CLEAR_MM, half_width, _CAM_HALF_MM[0], _BEHIND_MM)
    # cams and the hub of a short bar extend beyond its ends
    along = max(
        half_length + _CLEAR_MM,
        abs(half_length + BAR_END_MM - CAM_MM) + _CAM_HALF_MM[1],
        abs(damage.shape[0]) + _HUB_MM[1],
    )
    return along, aside


def _opened(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    """The displacement grows from 0 at the bar to the depth at the end of the handle."""
    half_length, half_width = half_size(damage)
    lever = (np.abs(u) < half_length) & (np.abs(v) < half_width) & (np.abs(w) < _LEVER_HALF_MM[1])
    return np.asarray(damage.depth_mm * 0.5 * (1 + u / half_length) * lever)


def _opened_reach(damage: Damage) -> tuple[float, float]:
    half_length, half_width = half_size(damage)
    return half_length, max(half_width, _LEVER_HALF_MM[1])


def _hanging(damage: Damage, u: Array, v: Array, w: Array) -> Array:
    """Return the displacement: two half parabolas that meet at `apex`; at -1 the lower end is
    free."""
    (apex,) = damage.shape
    half_length, half_width = half_size(damage)
    t = u / half_length
    flank = np.where(t < apex, (apex - t) / max(1 + apex, LEAST), (t - apex) / (1 - apex))
    on_lip = (np.hypot(v, w) < half_width) & (np.abs(t) <= 1)
    return np.asarray(damage.depth_mm * np.maximum(1 - flank * flank, 0.0) * on_lip)


_SHADER = "damage_door_gear.glsl"

_FORMS = (
    Form(
        name="bent_bar",
        glsl="bent_bar",
        shader=_SHADER,
        amount=_bent,
        along_edge=True,
        parameters=(Parameter("place of the kink, in half lengths from the middle", -0.9, 0.9),),
    ),
    Form(
        name="missing_bar",
        glsl="missing_bar",
        shader=_SHADER,
        amount=_hidden,
        marked=_uncovered,
        reach=_missing_reach,
        along_edge=True,
        parameters=(
            millimetres("place of the handle along the bar, from its middle", -1500, 1500),
            millimetres("length of the handle", 0, 500),
        ),
        constants={
            "MISSING_BAR_THICK_MM": f"{BAR_RADIUS_MM + _CLEAR_MM:.2f}",
            "MISSING_BAR_CLEAR_MM": f"{_CLEAR_MM:.2f}",
            "MISSING_BAR_CAM_MM": f"{CAM_MM - BAR_END_MM:.2f}",
            "MISSING_BAR_CAM_HALF_MM": "vec2({}, {})".format(*_CAM_HALF_MM),
            "MISSING_BAR_HUB_MM": "vec3({}, {}, {})".format(*_HUB_MM),
            "MISSING_BAR_LEVER_FRONT_MM": f"{_LEVER_FRONT_MM:.2f}",
            "MISSING_BAR_PROUD_MM": f"{_PROUD_MM:.2f}",
            "MISSING_BAR_BEHIND_MM": f"{_BEHIND_MM:.2f}",
        },
    ),
    Form(
        name="open_handle",
        glsl="open_handle",
        shader=_SHADER,
        amount=_opened,
        reach=_opened_reach,
        along_edge=True,
        constants={"HANDLE_HALF_MM": "vec2({}, {})".format(*_LEVER_HALF_MM)},
    ),
    Form(
        name="hanging_gasket",
        glsl="hanging_gasket",
        shader=_SHADER,
        amount=_hanging,
        along_edge=True,
        parameters=(Parameter("place of the farthest point, in half lengths", -1.0, 0.9),),
    ),
)


@dataclass(frozen=True)
class DoorGearConfig:
    """Locking bar that is bent or missing or has an open handle, or a gasket that hangs out.

    Attributes:
        gasket: Probability that a part of the gasket hangs out from between the leaves. Otherwise a
            locking bar is damaged.
        missing: Probability that the bar is missing, with its cams and handle.
        open: Probability that the handle of another bar is open. Otherwise the bar is bent outward.
        length_mm: Length of a bend, rounded to whole pieces of about 280 mm.
        depth_mm: Outward displacement of a bent bar.
        swing_mm: Outward displacement of the end of an open handle.
        gasket_length_mm: Length of the part that hangs out.
        gasket_depth_mm: Largest displacement of a hanging gasket. The leaves hide the gasket up to
            about 40 mm.
    """

    gasket: Share = 0.2
    missing: Share = 0.3
    open: Share = 0.35
    length_mm: Extent = Range(500, 1150)
    depth_mm: Depth = Range(30, 150)
    swing_mm: Depth = Range(60, 180)
    gasket_length_mm: _GasketLength = Range(350, 1100)
    gasket_depth_mm: Depth = Range(80, 220)


def _place(c: DoorGearConfig, size_mm: Vec3, rng: np.random.Generator) -> Damage:
    """Sample the damage of one part of the gear."""
    length, _, height = size_mm
    if rng.random() < c.gasket:
        return _hanging_gasket(c, length, height, rng)
    bar = int(rng.integers(len(BAR_Y_MM)))
    x, y, side = length / 2 - BAR_INSET_MM, BAR_Y_MM[bar], handle_side(bar)
    up, toward, inward = (0.0, 0.0, 1.0), (0.0, side, 0.0), (-1.0, 0.0, 0.0)
    handle_z = hasp_mm(bar)[1]
    if rng.random() < c.missing:
        return Damage(
            "door_gear", "door", (x, y, height / 2), up, toward, inward,
            (height - 2 * BAR_END_MM, 2 * BAR_RADIUS_MM), _HIDDEN_MM,
            (handle_z - height / 2, HANDLE_MM), "missing_bar",
        )  # fmt: skip
    if rng.random() < c.open:
        middle = (x + _LEVER_FRONT_MM, y + side * HANDLE_MM / 2, handle_z)
        return Damage(
            "door_gear", "door", middle, toward, up, inward,
            (HANDLE_MM + 2 * _CLEAR_MM, 2 * _LEVER_HALF_MM[0]), -draw(rng, c.swing_mm),
            form="open_handle",
        )  # fmt: skip
    low, kink, high = _bend_mm(draw(rng, c.length_mm), height, handle_z, rng)
    apex = round((2 * kink - low - high) / (high - low), 6)
    return Damage(
        "door_gear", "door", (x, y, round((low + high) / 2, 2)), up, toward, inward,
        (round(high - low, 2), 2 * _AROUND_MM), -draw(rng, c.depth_mm), (apex,), "bent_bar",
    )  # fmt: skip


def _hanging_gasket(
    c: DoorGearConfig, length_mm: float, height_mm: float, rng: np.random.Generator
) -> Damage:
    """Sample a bow of the lip, to either side and outward, or its free lower end."""
    low, high = LIP_END_MM, height_mm - LIP_END_MM
    extent = draw(rng, c.gasket_length_mm, high - low)
    free = rng.random() < _FREE_ENDS
    # a free end begins below the lip, so that rounding does not leave its lowest corners behind
    start = low - 1.0 if free else float(rng.uniform(low, high - extent))
    apex = -1.0 if free else round(float(rng.uniform(*_GASKET_APEX)), 3)
    aside = math.radians(float(rng.uniform(*_GASKET_TURN_DEG)) * rng.choice((-1.0, 1.0)))
    inward = (-math.cos(aside), math.sin(aside), 0.0)
    return Damage(
        "door_gear",
        "door",
        (length_mm / 2 - LIP_INSET_MM, LIP_Y_MM, round(start + extent / 2, 2)),
        (0.0, 0.0, 1.0),
        rounded_vector(np.cross(inward, (0.0, 0.0, 1.0))),
        rounded_vector(np.array(inward)),
        (extent, 2 * _AROUND_LIP_MM),
        -draw(rng, c.gasket_depth_mm),
        (apex,),
        "hanging_gasket",
    )


def _bend_mm(
    length_mm: float, height_mm: float, handle_z: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Draw the z of a bend's lower end, kink and upper end, clear of the cams and the handle."""
    stations = bar_stations_mm(height_mm).tolist()
    wanted = round(length_mm / (stations[1] - stations[0]))
    pieces = min(max(wanted, _PIECES[0]), _PIECES[1])
    first = [
        i
        for i in range(1, len(stations) - 1 - pieces)
        if not stations[i] - _HUB_MM[1] < handle_z < stations[i + pieces] + _HUB_MM[1]
    ]
    at = int(rng.choice(first))
    kink = int(rng.integers(at + 1, at + pieces))
    return stations[at], stations[kink], stations[at + pieces]


def _bulge_mm(c: DoorGearConfig) -> float:
    return max(c.depth_mm.hi, c.swing_mm.hi, c.gasket_depth_mm.hi)


KIND = Kind("door_gear", _FORMS, DoorGearConfig, place=_place, bulge_mm=_bulge_mm, on_gear=True)

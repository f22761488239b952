"""Places inside the port: a gate, a yard of single rows, and rail sidings. Metres."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from panoramas import models
from panoramas.shapes import Shape, place

if TYPE_CHECKING:
    from panoramas.port import Builder

CLEAR: dict[str, tuple[float, float, float, float]] = {
    "gate": (-720.0, 90.0, -520.0, 190.0),
    "aisle": (0.0, 80.0, 172.0, 142.0),
    "rail": (-420.0, 229.0, 420.0, 256.0),
}
"""Area x0, y0, x1, y1 of each place, which yard, masts and traffic leave free."""

TRUCK_TINTS = ((0.6, 0.6, 0.58), (0.55, 0.28, 0.03), (0.4, 0.05, 0.03), (0.03, 0.09, 0.28))
GATE_X, GATE_Y, LANES, LANE_M = -600.0, 140.0, 10, 4.6
TRACKS_Y = (234.5, 239.5, 244.5, 249.5)
ROW_M, BAY_M = 4.2, 12.7


def build_gate(port: "Builder") -> None:
    """Add a truck gate: lanes along x below a canopy, with islands, booths, barriers and trucks."""
    first = GATE_Y - LANES * LANE_M / 2
    place(_gate().mesh("gate"), (GATE_X, first, 0), 0, (0.03, 0.09, 0.28))
    for lane in range(LANES):
        y = first + (lane + 0.5) * LANE_M
        port.light((GATE_X, y, 6.0), 0.03)
        inward = lane < LANES // 2
        for queue in range(5):
            x = GATE_X + (-38.0 + 22.0 * queue if inward else 38.0 - 22.0 * queue)
            x += port.rng.uniform(-2, 2)
            taken = port.rng.random() < (0.8 if queue < 2 else 0.45)
            if taken and np.hypot(x - port.v.eye[0], y - port.v.eye[1]) > 12.5:
                _loaded_truck(port, x, y, 0.0 if inward else 180.0)
    for k in range(16):  # trailers parked outside
        x, y = -690.0 + 14.5 * (k % 2), 96.0 + 5.6 * (k // 2)
        if port.rng.random() < 0.75:
            _loaded_truck(port, x, y, 0.0)
    mast = models.light_mast(port.v.lamp)
    for x, y in ((-650.0, 112.0), (-650.0, 168.0), (-545.0, 112.0), (-545.0, 168.0)):
        place(mast, (x, y, 0))
        port.light((x, y, 30.5), 1.0)


def _loaded_truck(port: "Builder", x: float, y: float, turn: float) -> None:
    place(port.truck, (x, y, 0), turn, TRUCK_TINTS[int(port.rng.integers(len(TRUCK_TINTS)))])
    if port.rng.random() < 0.85:
        port.box(40, (x, y, 1.45), port.color(), turn)


def _gate() -> Shape:
    """Return canopy, islands, booths, barriers and lane lines; the first lane begins at y = 0."""
    s, width = Shape(), LANES * LANE_M
    s.box((-7, -2, 6.3), (7, width + 2, 7.3), "crane")
    s.box((-7.1, -2.1, 6.6), (7.1, width + 2.1, 7.0), "white")
    for y in np.arange(LANE_M / 2, width, LANE_M):
        for x in (-4.0, 0.0, 4.0):
            s.box((x - 0.7, y - 0.1, 6.24), (x + 0.7, y + 0.1, 6.3), "led")
        s.box((-7.2, y - 0.5, 6.65), (-7.1, y + 0.5, 6.95), "beacon")  # signal of the lane
    for lane in range(LANES + 1):
        y = lane * LANE_M
        s.box((-13, y - 0.55, 0), (13, y + 0.55, 0.18), "concrete")
        for x in (-13.4, 13.0):
            s.box((x, y - 0.55, 0), (x + 0.4, y + 0.55, 1.0), "yellow")
        for x in (-6.0, 6.0):
            s.box((x - 0.2, y - 0.2, 0), (x + 0.2, y + 0.2, 6.3), "galvanized")
        s.box((-2.0, y - 0.5, 0.18), (1.0, y + 0.5, 2.7), "white")
        s.box((-1.8, y - 0.52, 1.2), (0.8, y + 0.52, 2.2), "window")
        s.box((3.2, y - 0.2, 0.18), (3.6, y + 0.2, 1.2), "yellow")
        if lane < LANES:
            s.beam((3.4, y + 0.2, 1.05), (3.4, y + LANE_M - 0.8, 1.05), 0.08, 0.12, "red")
        for x in (-9.0, 9.0):  # poles of the cameras that read identifiers
            s.tube((x, y, 0.18), (x, y, 4.6), (0.07, 0.07), "galvanized", 8)
            s.box((x - 0.35, y - 0.12, 4.3), (x + 0.05, y + 0.12, 4.55), "dark")
    for y in np.arange(0, width + 1, LANE_M):
        for x0, x1 in ((-90, -14), (14, 90)):
            for x in np.arange(x0, x1, 6.0):
                s.box((x, y - 0.07, 0), (x + 3, y + 0.07, 0.004), "white")
    for x in np.arange(-60.0, 61.0, 3.0):  # fence beside the lanes
        for y in (-6.0, width + 6.0):
            s.tube((x, y, 0), (x, y, 2.4), (0.04, 0.04), "galvanized", 6)
            for z in (0.3, 0.9, 1.5, 2.1):
                s.beam((x, y, z), (x + 3, y, z), 0.02, 0.03, "galvanized")
    return s


def build_aisle(port: "Builder") -> None:
    """Add single rows of containers along x with aisles for straddle carriers between them."""
    x0, y0, x1, y1 = CLEAR["aisle"]
    lines = Shape()
    for y in np.arange(y0 + 2.0, y1, ROW_M):
        lines.box((x0, y + ROW_M / 2 - 0.05, 0), (x1, y + ROW_M / 2 + 0.05, 0.004), "yellow")
        if abs(y - port.v.eye[1]) < 0.8 * ROW_M / 2 + 1.22:
            continue
        tall = port.rng.uniform(1.0, 3.0)
        for x in np.arange(x0 + 14, x1 - 8, BAY_M):
            levels = int(np.clip(round(port.rng.normal(tall, 0.8)), 0, 3))
            twenty = port.rng.random() < 0.25
            for level in range(levels):
                z, turn = level * models.HEIGHT, 180.0 * int(port.rng.random() < 0.5)
                aside = port.rng.normal(0, 0.04)
                if twenty:
                    port.box(20, (x - 3.1, y + aside, z), port.color(), turn)
                    port.box(20, (x + 3.1, y + aside, z), port.color(), turn)
                else:
                    port.box(40, (x, y + aside, z), port.color(), turn)
    place(lines.mesh("row lines"), (0, 0, 0))


def build_rail(port: "Builder") -> None:
    """Add rail sidings along x below rail-mounted cranes, with trains of container wagons."""
    track, wagon = _track().mesh("track"), _wagon().mesh("wagon")
    for y in TRACKS_Y:
        place(track, (0, y, 0))
        if abs(y - port.v.eye[1]) < 2.0:
            continue
        start = port.rng.uniform(-330, -250)
        for k in range(int(port.rng.integers(26, 36))):
            x = start + 14.4 * k
            place(wagon, (x, y, 0), 0, (0.16, 0.05, 0.03))
            kind = port.rng.random()
            if kind < 0.6:
                port.box(40, (x, y, 1.32), port.color(), 0.0)
            elif kind < 0.85:
                port.box(20, (x - 3.1, y, 1.32), port.color(), 0.0)
                port.box(20, (x + 3.1, y, 1.32), port.color(), 180.0)
    for x in (-95.0, 64.0):
        mesh = models.yard_crane(port.rng.uniform(5, 18))
        place(mesh, (x, 230.2, 0), 0, (0.42, 0.06, 0.04))
        port.light((x, 233.2, 19), 0.12)


def _track() -> Shape:
    """Return 840 m of track along x: ballast, sleepers and rails."""
    s = Shape()
    s.box((-420, -1.7, 0), (420, 1.7, 0.16), "rock")
    for x in np.arange(-420, 420, 0.65):
        s.box((x, -1.3, 0.12), (x + 0.25, 1.3, 0.22), "concrete")
    for y in (-0.753, 0.753):  # 1435 mm between the heads of the rails
        s.box((-420, y - 0.035, 0.22), (420, y + 0.035, 0.37), "steel")
    return s


def _wagon() -> Shape:
    """Return a flat wagon of 13.6 m on two bogies, along x."""
    s = Shape()
    for y in (-1.1, 1.1):
        s.box((-6.6, y - 0.12, 0.95), (6.6, y + 0.12, 1.3), "crane")
    for x in (-6.6, -3.0, 0.0, 3.0, 6.4):
        s.box((x, -1.1, 1.0), (x + 0.2, 1.1, 1.25), "crane")
    for x in (-6.8, 6.6):
        s.box((x, -1.2, 0.95), (x + 0.2, 1.2, 1.3), "dark")
        for y in (-0.87, 0.87):
            s.tube((x - 0.3, y, 1.06), (x + 0.5, y, 1.06), (0.2, 0.2), "dark", 12)
    for x in (-5.3, -3.5, 3.5, 5.3):
        for y in (-0.76, 0.76):
            s.tube((x, y - 0.07, 0.83), (x, y + 0.07, 0.83), (0.46, 0.46), "dark", 18)
        s.box((x - 0.2, -1.05, 0.7), (x + 0.2, 1.05, 0.95), "dark")
    return s


BUILDERS: dict[str, Callable[["Builder"], None]] = {
    "gate": build_gate,
    "aisle": build_aisle,
    "rail": build_rail,
}
"""Function that adds each place to the port."""

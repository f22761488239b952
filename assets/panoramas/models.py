"""Meshes of the port's containers, vehicles and machines. Metres, z up, standing on z = 0."""

from collections.abc import Callable

import bpy
import numpy as np

from panoramas.shapes import Shape

WIDTH, HEIGHT = 2.44, 2.75
LENGTHS = {20: 6.06, 40: 12.19}
_WAVE = (
    (0.0, 0.0),
    (0.072, 0.0),
    (0.14, 0.036),
    (0.21, 0.036),
)  # one rib: (along the wall, inward)
_PITCH = 0.278


def container(feet: int, painted: bool, rng: np.random.Generator) -> bpy.types.Mesh:
    """Return a container along x, centred over the origin, doors at +x; painted: with a livery."""
    shape, long = Shape(), LENGTHS[feet]
    half, side = long / 2, WIDTH / 2
    ribs = int((long - 0.5) / _PITCH)
    run = [(-half + 0.25 + i * _PITCH + a, d) for i in range(ribs) for a, d in _WAVE]
    for face in (-1, 1):
        wall = [(x, face * (side - 0.03 - d), z) for x, d in run for z in (0.16, HEIGHT - 0.1)]
        _strip(shape, wall, face > 0)
    end_run = [(-side + 0.2 + i * _PITCH + a, d) for i in range(7) for a, d in _WAVE]
    wall = [(-half + 0.05 + d, y, z) for y, d in end_run for z in (0.16, HEIGHT - 0.1)]
    _strip(shape, wall, True)
    shape.box(
        (-half + 0.1, -side + 0.1, HEIGHT - 0.09), (half - 0.1, side - 0.1, HEIGHT - 0.03), "box"
    )
    shape.box((half - 0.1, -side + 0.1, 0.15), (half - 0.06, side - 0.1, HEIGHT - 0.1), "box")
    for y in (-side, side - 0.12):  # rails, posts and castings
        for z in (0.0, HEIGHT - 0.11):
            shape.box((-half, y, z), (half, y + 0.12, z + (0.16 if z == 0 else 0.11)), "box")
        for x in (-half, half - 0.16):
            shape.box((x, y, 0.1), (x + 0.16, y + 0.12, HEIGHT - 0.1), "box")
            for z in (0.0, HEIGHT - 0.12):
                shape.box((x - 0.004, y - 0.004, z), (x + 0.18, y + 0.124, z + 0.124), "dark")
    for x in (-half, half - 0.12):
        shape.box((x, -side, 0.0), (x + 0.12, side, 0.16), "box")
        shape.box((x, -side, HEIGHT - 0.12), (x + 0.12, side, HEIGHT), "box")
    for y in (-0.85, -0.4, 0.4, 0.85):
        shape.tube(
            (half - 0.03, y, 0.1), (half - 0.03, y, HEIGHT - 0.1), (0.02, 0.02), "galvanized", 5
        )
    shape.box((half - 0.061, -0.01, 0.16), (half - 0.05, 0.01, HEIGHT - 0.12), "dark")
    for y in (0.35, 0.55, 0.7):  # identifier and weights on the right door
        shape.box((half - 0.062, y, HEIGHT - 0.5), (half - 0.052, y + 0.12, HEIGHT - 0.4), "livery")
    shape.box((half - 0.062, 0.3, 1.0), (half - 0.052, 0.8, 1.3), "livery")
    if painted:
        _livery(shape, half, side, rng)
    for face in (-1, 1):
        for i in range(7):
            x = face * (half - 1.6 + 0.13 * i)
            shape.box(
                (x, face * (side - 0.032), HEIGHT - 0.48),
                (x + 0.09, face * (side - 0.022), HEIGHT - 0.36),
                "livery",
            )
    return shape.mesh(f"container {feet}")


def _strip(shape: Shape, wall: list[tuple[float, float, float]], outward: bool) -> None:
    count = len(wall) // 2 - 1
    faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(count)]
    shape.add(wall, [f[::-1] for f in faces] if outward else faces, "box")


def _livery(shape: Shape, half: float, side: float, rng: np.random.Generator) -> None:
    """Add a stripe, or a mark of squares, to both sides, without any text."""
    low, tall = rng.choice((0.55, 1.0, 1.75)), rng.choice((0.16, 0.3, 0.45))
    x, z = rng.uniform(-0.7, 0.4) * half, rng.uniform(0.8, 1.1)
    squares = {
        "block": [((0.0, 0.0), (1.0, 1.0))],
        "two": [((0.0, 0.5), (0.6, 1.1)), ((0.7, 0.0), (1.3, 0.6))],
        "frame": [
            *(((0.0, v), (1.1, v + 0.2)) for v in (0.0, 0.9)),
            *(((u, 0.2), (u + 0.2, 0.9)) for u in (0.0, 0.9)),
        ],
    }[str(rng.choice(("block", "two", "frame")))]
    plates = [((x + u0, z + v0), (x + u1, z + v1)) for (u0, v0), (u1, v1) in squares]
    if rng.random() < 0.6:
        plates = [((0.3 - half, low), (half - 0.3, low + tall))]
    for face in (-1, 1):
        for (x0, z0), (x1, z1) in plates:
            shape.box((x0, face * (side - 0.03), z0), (x1, face * (side - 0.018), z1), "livery")


def quay_crane(boom_up: bool, trolley_y: float, hoist_z: float) -> bpy.types.Mesh:
    """Return a ship-to-shore crane on rails at y = 0 and 30, with its boom over the water at y <
    0."""
    s, top = Shape(), 43.0
    for x in (-9.0, 9.0):
        for y in (0.0, 30.0):
            s.beam((x, y, 2.4), (x, y, top), 1.5, 1.3, "crane")
            s.box((x - 4.5, y - 0.6, 1.2), (x + 4.5, y + 0.6, 2.6), "crane")
            for k in range(-4, 5):
                s.tube((x + k, y - 0.3, 0.4), (x + k, y + 0.3, 0.4), (0.4, 0.4), "dark", 10)
            s.box((x - 4.3, y - 0.5, 0.45), (x + 4.3, y + 0.5, 1.2), "dark")
        s.beam((x, 0, 15.0), (x, 30, 15.0), 1.2, 2.0, "crane")
        s.beam((x, 0, 40.0), (x, 30, 40.0), 1.0, 1.6, "crane")
        s.beam((x, 0.5, 39.0), (x, 15, 16.0), 0.7, 0.7, "crane")
        s.beam((x, 29.5, 39.0), (x, 15, 16.0), 0.7, 0.7, "crane")
        s.beam((x, 0, top), (0.35 * x, 5, 70.0), 0.9, 0.9, "crane")
        s.beam((x, 30, top), (0.35 * x, 5, 70.0), 0.5, 0.5, "crane")
    for y in (0.0, 30.0):
        s.beam((-9, y, 15.0), (9, y, 15.0), 1.2, 2.0, "crane")
        s.beam((-9, y, 41.5), (9, y, 41.5), 1.0, 1.6, "crane")
    s.beam((-3.5, 5, 70), (3.5, 5, 70), 1.0, 1.0, "crane")
    for x in (-3.0, 3.0):  # girder over the quay, and boom
        s.beam((x, 0, 44.5), (x, 50, 44.5), 0.9, 2.2, "crane")
        tip = (x, -12.0, 44.5 + 55.0) if boom_up else (x, -58.0, 44.5)
        s.beam((x, 0, 44.5), tip, 0.9, 2.0, "crane")
        s.beam((0.9 * x, 5, 70), (x, 47, 45.5), 0.22, 0.3, "crane")
        for part in (0.45, 0.9):
            foot = np.array((x, 0, 45.3)) + part * (np.array(tip) - (x, 0, 44.5))
            s.beam((0.9 * x, 5, 70), foot, 0.22, 0.3, "crane")
        for k in range(0, 50, 4):
            s.beam((1.35 * x, k, 44.4), (1.35 * x, k, 45.6), 0.06, 0.06, "galvanized")
        s.beam((1.35 * x, 0, 45.6), (1.35 * x, 50, 45.6), 0.06, 0.06, "galvanized")
        s.beam((1.25 * x, 0, 44.3), (1.25 * x, 50, 44.3), 0.9, 0.08, "galvanized")
    for k in range(10):
        y = 5.0 * k
        s.beam((-3, y, 44), (3, y, 44), 0.4, 0.5, "crane")
        if not boom_up:
            s.beam((-3, -5.6 * k, 44), (3, -5.6 * k, 44), 0.4, 0.5, "crane")
    s.box((-4.5, 28, 46), (4.5, 45, 51.5), "white")  # machinery house
    s.box((-4.55, 30, 48.6), (4.55, 43, 49.6), "crane")
    s.box((-2.6, trolley_y - 3, 43.2), (2.6, trolley_y + 3, 44.2), "dark")
    s.box((2.8, trolley_y - 1.4, 39.6), (5.0, trolley_y + 1.4, 42.2), "white")
    s.box((2.7, trolley_y - 1.5, 39.9), (5.1, trolley_y + 1.5, 41.4), "window")
    for x in (-2.2, 2.2):
        for y in (-1.0, 1.0):
            s.beam((x, trolley_y + y, hoist_z + 0.6), (x, trolley_y + y, 43.5), 0.05, 0.05, "dark")
    s.box((-6.0, trolley_y - 1.1, hoist_z), (6.0, trolley_y + 1.1, hoist_z + 0.45), "yellow")
    for flight in range(9):  # stairs up a landward leg
        z, flip = 3 + 4.4 * flight, 1 if flight % 2 else -1
        s.beam((10.3, 30 - 2 * flip, z), (10.3, 30 + 2 * flip, z + 4.4), 0.8, 0.12, "galvanized")
        s.beam(
            (10.7, 30 - 2 * flip, z + 1), (10.7, 30 + 2 * flip, z + 5.4), 0.05, 0.05, "galvanized"
        )
        s.box(
            (9.6, 30 + 2 * flip - 0.7, z + 4.3), (11.0, 30 + 2 * flip + 0.7, z + 4.4), "galvanized"
        )
    for x in (-9, 9):
        for y in (-2.0, 32.0):
            s.box((x - 0.5, y - 0.3, 14.6), (x + 0.5, y + 0.3, 15.0), "led")
    s.box((-0.2, 4.8, 70.5), (0.2, 5.2, 71.1), "beacon")
    return s.mesh("quay crane")


def yard_crane(trolley: float) -> bpy.types.Mesh:
    """Return a rubber-tyred gantry crane over six rows and a lane, with legs at y = 0 and 23.5.

    It drives along x.
    """
    s = Shape()
    for y in (0.0, 23.5):
        for x in (-3.6, 3.6):
            s.beam((x, y, 1.6), (0.75 * x, y, 19.5), 0.9, 0.8, "crane")
            for k in (-0.9, 0.9):
                s.tube((x + k, y - 0.35, 0.8), (x + k, y + 0.35, 0.8), (0.8, 0.8), "rubber", 16)
        s.beam((-5, y, 1.8), (5, y, 1.8), 1.0, 0.9, "crane")
        s.beam((-2.7, y, 19.0), (2.7, y, 19.0), 0.7, 0.8, "crane")
    for x in (-2.7, 2.7):
        s.beam((x, -1.5, 20.2), (x, 25, 20.2), 0.8, 1.6, "crane")
        s.beam((1.4 * x, -1.5, 21.6), (1.4 * x, 25, 21.6), 0.05, 0.05, "galvanized")
        for k in range(14):
            s.beam(
                (1.4 * x, 1.9 * k - 1, 20.5), (1.4 * x, 1.9 * k - 1, 21.6), 0.05, 0.05, "galvanized"
            )
    s.box((-3.2, trolley - 1.8, 21.0), (3.2, trolley + 1.8, 22.6), "white")
    s.box((3.2, trolley - 1.2, 17.2), (5.0, trolley + 1.2, 19.4), "white")
    s.box((3.1, trolley - 1.3, 17.5), (5.1, trolley + 1.3, 18.7), "window")
    s.box((-6.0, trolley - 1.1, 13.0), (6.0, trolley + 1.1, 13.4), "yellow")
    for x in (-2.0, 2.0):
        for y in (-0.9, 0.9):
            s.beam((x, trolley + y, 13.4), (x, trolley + y, 21), 0.05, 0.05, "dark")
    s.box((-5, -2.6, 2.4), (1, -0.6, 4.6), "white")  # power pack
    s.box((-1.5, 3, 19.2), (1.5, 3.6, 19.4), "led")
    s.box((-1.5, 20, 19.2), (1.5, 20.6, 19.4), "led")
    return s.mesh("yard crane")


def light_mast(lamp: str) -> bpy.types.Mesh:
    """Return a 32 m mast with a ring of eight floodlights."""
    s = Shape()
    s.box((-0.9, -0.9, 0), (0.9, 0.9, 0.8), "galvanized")
    s.tube((0, 0, 0.8), (0, 0, 32), (0.38, 0.16), "galvanized", 12)
    s.tube((0, 0, 31.2), (0, 0, 31.5), (1.5, 1.5), "galvanized", 16)
    for i in range(8):
        x, y = 1.7 * np.cos(i * np.pi / 4), 1.7 * np.sin(i * np.pi / 4)
        s.box((x - 0.35, y - 0.35, 31.2), (x + 0.35, y + 0.35, 31.6), "dark")
        s.box((x - 0.28, y - 0.28, 31.1), (x + 0.28, y + 0.28, 31.21), lamp)
    return s.mesh("light mast")


def truck() -> bpy.types.Mesh:
    """Return a terminal tractor with an empty 40-foot chassis, heading to +x."""
    s = Shape()
    s.box((6.6, -1.2, 0.9), (10.6, 1.2, 1.3), "dark")
    s.box((8.3, -1.2, 1.3), (10.3, 0.4, 3.2), "crane")
    s.box((8.6, -1.22, 2.1), (10.35, 0.42, 2.95), "window")
    s.box((8.4, 0.5, 1.3), (10.4, 1.2, 1.9), "crane")
    for y in (-0.5, 0.5):
        s.box((-6.2, y - 0.12, 1.1), (7.5, y + 0.12, 1.4), "dark")
    for x in (-6.0, -2, 2, 6.0):
        s.box((x - 0.15, -1.22, 1.25), (x + 0.15, 1.22, 1.45), "red")
    for x in (-5.2, -3.9, 7.3, 9.8):
        for y in (-1.0, 1.0):
            s.tube((x, y - 0.22, 0.5), (x, y + 0.22, 0.5), (0.5, 0.5), "rubber", 14)
    return s.mesh("truck")


def ship(
    length: float, beam: float, wide_deck: bool
) -> tuple[bpy.types.Mesh, Callable[[float], float]]:
    """Return the hull and house of a container ship, bow to +x, waterline at z = 0, deck at z = 13.

    Also returns a function that gives half the width of the deck at x, which is that of the beam
    everywhere with `wide_deck`.
    """
    s = Shape()
    stations = np.linspace(-length / 2, length / 2, 41)
    levels = np.array((-2.0, 0.0, 1.6, 1.9, 7.0, 13.0))
    t = stations / (length / 2)
    rows = []
    for z in levels:
        flare = 0.55 + 0.4 * np.clip(z, 0, 13) / 13
        bow = np.clip((1 - t) / (1.15 - 0.85 * flare), 0, 1) ** 0.6
        stern = 0.6 + 0.4 * np.clip((t + 1) / 0.12, 0, 1)
        rows.append(np.clip(bow * stern * beam / 2, 0.15, None))
    for face in (-1, 1):
        for j, band in enumerate(("boot", "boot", "white", "hull", "hull")):
            points = [
                (x, face * rows[j + k][i], levels[j + k])
                for i, x in enumerate(stations)
                for k in (0, 1)
            ]
            faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(40)]
            s.add(points, [f[::-1] for f in faces] if face > 0 else faces, band)
    s.add(
        [(x, f * w, 13.0) for f in (-1, 1) for x, w in zip(stations, rows[-1], strict=True)],
        [(i, i + 1, 42 + i, 41 + i) for i in range(40)],
        "boot",
    )
    s.box((-length / 2 - 0.1, -beam / 2 * 0.6, 0), (-length / 2, beam / 2 * 0.6, 13), "hull")
    house = -0.22 * length
    s.box((house - 7, -beam / 2 + 1, 13), (house + 7, beam / 2 - 1, 42), "white")
    s.box((house - 4, -beam / 2 - 2, 42), (house + 8, beam / 2 + 2, 45.5), "white")
    s.box((house - 3.9, -beam / 2 - 2.1, 43.4), (house + 8.1, beam / 2 + 2.1, 44.8), "window")
    for z in range(15, 41, 3):
        for y in np.arange(-beam / 2 + 3, beam / 2 - 3, 2.6):
            s.box((house - 7.1, y, z), (house + 7.1, y + 0.9, z + 1.0), "window")
        for x in np.arange(house - 5.5, house + 5, 2.6):
            s.box((x, -beam / 2 + 0.9, z), (x + 0.9, beam / 2 - 0.9, z + 1.0), "window")
    s.box((house - 18, -5, 13), (house - 10, 5, 47), "hull")
    s.box((house - 18.2, -5.2, 41), (house - 9.8, 5.2, 43), "white")
    s.beam((house + 2, 0, 45), (house + 2, 0, 58), 0.7, 0.7, "white")
    s.beam((house + 2, -4, 52), (house + 2, 4, 52), 0.4, 0.4, "white")
    s.beam((0.46 * length, 0, 13), (0.46 * length, 0, 27), 0.6, 0.6, "white")

    def half_deck(x: float) -> float:
        return beam / 2 if wide_deck else float(np.interp(x, stations, rows[-1]))

    for x in np.arange(-length / 2, 0.42 * length, 3.0):  # railing posts
        edge = half_deck(x) - 0.3
        for y in (-edge, edge):
            s.beam((x, y, 13), (x, y, 14.1), 0.06, 0.06, "white")
    return s.mesh("ship"), half_deck


def warehouse(length: float, depth: float, height: float) -> bpy.types.Mesh:
    """Return a gabled warehouse along x, with its front at y = 0."""
    s = Shape()
    s.box((-length / 2, 0, 0), (length / 2, depth, height), "cladding")
    ridge = height + 0.12 * depth
    a, b = -length / 2 - 0.5, length / 2 + 0.5
    ends = [
        (a, -0.6, height),
        (b, -0.6, height),
        (a, depth / 2, ridge),
        (b, depth / 2, ridge),
        (a, depth + 0.6, height),
        (b, depth + 0.6, height),
    ]
    s.add(ends, [(0, 1, 3, 2), (2, 3, 5, 4), (0, 2, 4), (1, 5, 3)], "galvanized")
    for x in np.arange(a + 5, b - 7, 11.0):
        s.box((x, -0.12, 0), (x + 5, 0.02, 5.2), "dark" if int(x) % 3 else "white")
        s.box((x - 0.2, -0.16, 0), (x, 0.02, 5.4), "yellow")
        s.box((x + 0.5, -0.6, 5.6), (x + 4.5, -0.4, 5.8), "led")
    s.box((a + 1, -0.05, height - 2.4), (b - 1, 0.02, height - 1.2), "window")
    return s.mesh("warehouse")


def bollard() -> bpy.types.Mesh:
    """Return a mooring bollard for the quay's edge."""
    s = Shape()
    s.tube((0, 0, 0), (0, 0, 0.08), (0.5, 0.5), "dark", 16)
    s.tube((0, 0, 0.08), (0, 0, 0.55), (0.26, 0.24), "yellow", 16)
    s.tube((0, 0, 0.55), (0, 0, 0.75), (0.42, 0.34), "yellow", 16)
    return s.mesh("bollard")


def tower(height: float) -> bpy.types.Mesh:
    """Return a harbour light for the end of a breakwater."""
    s = Shape()
    s.tube((0, 0, 0), (0, 0, height), (1.6, 1.1), "white", 24)
    s.tube((0, 0, 0.45 * height), (0, 0, 0.65 * height), (1.41, 1.31), "red", 24)
    s.tube((0, 0, height), (0, 0, height + 0.3), (1.9, 1.9), "dark", 24)
    s.tube((0, 0, height + 0.3), (0, 0, height + 2), (0.8, 0.8), "beacon", 16)
    s.tube((0, 0, height + 2), (0, 0, height + 2.8), (1.0, 0.1), "red", 16)
    return s.mesh("tower")


def tank(radius: float, height: float) -> bpy.types.Mesh:
    """Return a storage tank with a low conical roof."""
    s = Shape()
    s.tube((0, 0, 0), (0, 0, height), (radius, radius), "white", 48)
    s.tube((0, 0, height), (0, 0, height + 0.1 * radius), (radius, 0.1), "galvanized", 48)
    return s.mesh("tank")

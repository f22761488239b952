"""Layout of the port.

x runs along the quay, whose edge is at y = 0. Water is at y < 0, and the paving at z = 0.
"""

from dataclasses import dataclass, field

import bpy
import numpy as np

from panoramas import models, places
from panoramas.shapes import Shape, place
from panoramas.sky import Clouds

SEA_M = -3.5
QUAY_RAIL_M = 4.0  # distance of the waterside crane rail from the edge
PALETTE = (  # linear albedo of the containers in the yard
    (0.14, 0.030, 0.022), (0.095, 0.02, 0.03), (0.15, 0.05, 0.025), (0.02, 0.075, 0.20),
    (0.014, 0.03, 0.075), (0.07, 0.22, 0.36), (0.025, 0.17, 0.18), (0.03, 0.13, 0.07),
    (0.05, 0.19, 0.07), (0.42, 0.13, 0.02), (0.50, 0.28, 0.03), (0.50, 0.46, 0.36),
    (0.34, 0.36, 0.36), (0.17, 0.18, 0.19), (0.55, 0.55, 0.53), (0.30, 0.03, 0.12),
)  # fmt: skip
CRANE_COLORS = ((0.03, 0.09, 0.28), (0.42, 0.06, 0.04), (0.50, 0.50, 0.48), (0.55, 0.20, 0.02))


@dataclass(frozen=True)
class Variant:
    """One panorama.

    Attributes:
        name: Name of the file.
        kind: Kinds in index.json.
        seed: Seed of the layout.
        eye: Position of the camera in metres.
        sun_deg: Elevation and azimuth of the sun in degrees, azimuth counter-clockwise from +x.
        clouds: The cloud layer.
        air: Air density of Blender's Nishita sky, 1 for a clear day.
        dust: Dust density of Blender's Nishita sky, 1 for a clear day.
        sky_level: Mean luminance of the sky; lamps are relative to it.
        haze_km: Distance at which haze hides 63 %.
        lamps: Irradiance below a light mast, 0 by day.
        lamp: Material of the lamps.
        wet: Share of wet ground.
        swell: Height of the waves, relative to normal.
        cranes: x and raised boom of each quay crane.
        ship_m: x of the middle of the ship at the quay, or None.
        end_m: x of the end of the quay.
        place: Place inside the port that is built around the eye, one of places.BUILDERS, or "".
        wide_deck: The ship's load and railing stand as if its deck were equally wide everywhere.
            Panoramas that were rendered so keep this geometry for their container maps.
    """

    name: str
    kind: tuple[str, ...]
    seed: int
    eye: tuple[float, float, float]
    sun_deg: tuple[float, float]
    clouds: Clouds = field(default_factory=Clouds)
    air: float = 1.0
    dust: float = 1.0
    sky_level: float = 0.3
    haze_km: float = 9.0
    lamps: float = 0.0
    lamp: str = "led"
    wet: float = 0.0
    swell: float = 1.0
    cranes: tuple[tuple[float, bool], ...] = ((-75.0, False), (62.0, False), (150.0, True))
    ship_m: float | None = 40.0
    end_m: float = 2500.0
    place: str = ""
    wide_deck: bool = False


class Builder:
    """Builder of a variant's port in the current Blender scene."""

    def __init__(self, variant: Variant) -> None:
        self.v = variant
        self.rng = np.random.default_rng(variant.seed)
        self.containers = 0
        self.truck = models.truck()
        painter = np.random.default_rng(1)  # separate, so that liveries do not affect the layout
        self.boxes = {
            feet: [models.container(feet, painted, painter) for painted in (0, 0, 1, 1, 1, 1)]
            for feet in (20, 40)
        }

    def build(self) -> None:
        """Create everything; the materials must already exist."""
        self._ground()
        self._quay()
        self._cranes()
        if self.v.ship_m is not None:
            self._ship(self.v.ship_m, -1.8)
        self._yard()
        self._halls()
        self._masts()
        self._traffic()
        self._far()
        if self.v.place:
            places.BUILDERS[self.v.place](self)

    def _free(self, x: float, y: float, radius: float) -> bool:
        ex, ey, _ = self.v.eye
        x0, y0, x1, y1 = places.CLEAR.get(self.v.place, (0.0, 0.0, 0.0, 0.0))
        inside = x0 < x < x1 and y0 < y < y1
        return x < self.v.end_m - 8 and not inside and np.hypot(x - ex, y - ey) > radius

    def color(self) -> int:
        """Draw a container's colour, as an index into PALETTE."""
        return int(self.rng.integers(len(PALETTE)))

    def box(
        self,
        feet: int,
        position: tuple[float, float, float],
        color: int,
        turn: float,
        has_room: bool = True,
    ) -> None:
        """Place a container, or only consume its random numbers so that the others stay in
        place."""
        mesh = self.boxes[feet][int(self.rng.integers(6))]
        tone = self.rng.uniform(0.75, 1.15)
        if has_room:
            self.containers += 1
            color = tuple(tone * c for c in PALETTE[color])
            place(mesh, position, turn, color).pass_index = self.containers

    def _ground(self) -> None:
        s, end = Shape(), self.v.end_m
        s.box((-9000, 0.4, -9), (end, 48, 0), "concrete")
        s.box((-9000, 48, -9), (end, 9000, 0), "asphalt")
        s.box((-9000, 0, -9), (end, 0.4, 0.22), "galvanized")  # coping
        if end < 2000:
            s.box((end, 0, -9), (end + 0.4, 9000, 0.22), "galvanized")
        for y in (QUAY_RAIL_M, QUAY_RAIL_M + 30):
            s.box((-900, y - 0.25, 0), (end - 3, y + 0.25, 0.006), "dark")
            s.box((-900, y - 0.05, 0), (end - 3, y + 0.05, 0.04), "steel")
        for y in (8.5, 12.5, 16.5, 20.5, 24.5, 28.5):
            s.box((-600, y - 0.08, 0), (end - 6, y + 0.08, 0.004), "white")
        for x in np.arange(-600, min(end, 600), 14.0):
            s.box((x, 42.4, 0), (x + 6, 42.6, 0.004), "yellow")
        place(s.mesh("ground"), (0, 0, 0))
        sea = Shape()
        sea.add(
            [(-3e4, -3e4, SEA_M), (3e4, -3e4, SEA_M), (3e4, 3e4, SEA_M), (-3e4, 3e4, SEA_M)],
            [(0, 1, 2, 3)],
            "water",
        )
        place(sea.mesh("sea"), (0, 0, 0))

    def _quay(self) -> None:
        bollard = models.bollard()
        fender = Shape()
        fender.box((-0.9, -1.3, -3), (0.9, -0.4, -0.2), "rubber")
        fender.box((-1.1, -1.5, -3.2), (1.1, -1.3, 0.1), "dark")
        fenders = fender.mesh("fender")
        for x in np.arange(-420, min(self.v.end_m - 4, 420), 18.0):
            place(bollard, (x, 1.2, 0))
            place(fenders, (x + 9, 0, 0))
        if self.v.end_m < 2000:
            for y in np.arange(6, 120, 18.0):
                place(bollard, (self.v.end_m - 1.2, y, 0))

    def _cranes(self) -> None:
        for i, (x, up) in enumerate(self.v.cranes):
            trolley, hoist = (26.0, 12.0) if up else ((-22.0, 20.0), (15.0, 7.0))[i % 2]
            color = CRANE_COLORS[(self.v.seed + i // 2) % 4]
            place(models.quay_crane(up, trolley, hoist), (x, QUAY_RAIL_M, 0), 0, color)
            for lx in (-9, 9):
                for ly in (-2.0, 32.0):
                    self.light((x + lx, QUAY_RAIL_M + ly, 14.3), 0.25)
        for k in range(12):
            block, row = self.rng.integers(-3, 3), self.rng.integers(0, 6)
            x, y = block * 172 + self.rng.uniform(20, 130), 56.0 + row * 30
            if self._free(x, y + 12, 24):
                color = CRANE_COLORS[(self.v.seed + 1 + k % 2) % 4]
                mesh = models.yard_crane(self.rng.uniform(4, 19))
                place(mesh, (x, y, 0), 0, color)
                self.light((x, y + 3, 19), 0.12)

    def _ship(self, x: float, y: float, turn: float = 0.0) -> None:
        length, beam = 290.0, 40.0
        mesh, half_deck = models.ship(length, beam, self.v.wide_deck)
        color = ((0.02, 0.03, 0.07), (0.16, 0.02, 0.02), (0.02, 0.08, 0.06))[self.v.seed % 3]
        place(mesh, (x, y - beam / 2, SEA_M), turn, color)
        if turn:  # the distant ship is empty
            return
        first = x - length / 2 + 8
        for bay in range(20):
            bx = first + 13.6 * bay
            if abs(bx - (x - 0.22 * length) + 4) < 20 or bx > x + 0.40 * length:
                continue
            tall = int(self.rng.integers(3, 8))
            deck = min(half_deck(bx + end - x) for end in (-6.1, 6.1))
            rows = 15 if bx < x + 0.3 * length else 11
            for row in range(rows):
                aside = (row - (rows - 1) / 2) * 2.5
                ry = y - beam / 2 + aside
                color_run = self.color()
                levels = max(tall - int(self.rng.integers(0, 3)), 1)
                for level in range(levels):
                    if self.rng.random() < 0.4:
                        color_run = self.color()
                    z = SEA_M + 14.6 + level * models.HEIGHT
                    self.box(40, (bx, ry, z), color_run, 0.0, abs(aside) + 1.25 < deck)
        for bay in range(8):
            self.light((first + 34 * bay, y - 4, SEA_M + 34), 0.12)

    def _yard(self) -> None:
        for line in range(6):
            for block in range(-3, 3):
                fill = self.rng.uniform(1.6, 4.2)
                reefer = self.rng.random() < 0.2
                for bay in range(11):
                    x = block * 172 + 14 + 12.9 * bay
                    twenty = self.rng.random() < 0.3
                    for row in range(6):
                        y = 59.0 + 30 * line + 2.72 * row
                        if not self._free(x, y, 9.0):
                            continue
                        levels = int(np.clip(round(self.rng.normal(fill, 1.1)), 0, 5))
                        color = 14 if reefer else self.color()
                        for level in range(levels):
                            if self.rng.random() < 0.5 and not reefer:
                                color = self.color()
                            turn = 180.0 * int(self.rng.random() < 0.5)
                            z = level * models.HEIGHT
                            slide = self.rng.normal(0, 0.03)
                            if twenty:
                                self.box(20, (x - 3.1, y + slide, z), color, turn)
                                self.box(20, (x + 3.1, y + slide, z), color, turn)
                            else:
                                self.box(40, (x, y + slide, z), color, turn)

    def _halls(self) -> None:
        for k in range(5):
            x = -420 + 190 * k + self.rng.uniform(-10, 10)
            if x + 60 < self.v.end_m:
                mesh = models.warehouse(self.rng.uniform(70, 120), 48, self.rng.uniform(10, 14))
                tint = self.rng.uniform(0.25, 0.55) * np.array((1.0, 1.0, 0.96))
                place(mesh, (x, 262, 0), 0, tuple(tint))
        for k in range(9):
            x, y = -1300 + 95 * k, 520 + 60 * (k % 2)
            place(models.tank(self.rng.uniform(16, 30), self.rng.uniform(14, 22)), (x, y, 0))

    def _masts(self) -> None:
        mesh = models.light_mast(self.v.lamp)
        for line in range(5):
            for k in range(-4, 5):
                x, y = 86.0 * k + 4, 52.0 + 60 * line
                if self._free(x, y, 12):
                    place(mesh, (x, y, 0))
                    self.light((x, y, 30.5), 1.0)

    def light(self, where: tuple[float, float, float], share: float) -> None:
        """Add a spot lamp that shines down, by night; share is relative to a mast's lamps."""
        if not self.v.lamps:
            return
        lamp = bpy.data.lights.new("lamp", "SPOT")
        # a spot lamp of P watts has the intensity P / (4 pi); those of a mast hang at 30.5 m
        lamp.energy = share * self.v.lamps * 4 * np.pi * 30.5**2
        lamp.color = (1.0, 0.93, 0.82) if self.v.lamp == "led" else (1.0, 0.52, 0.16)
        lamp.spot_size, lamp.spot_blend = np.radians(165), 0.6
        lamp.shadow_soft_size = 0.6
        thing = bpy.data.objects.new("lamp", lamp)
        thing.location = where
        bpy.context.scene.collection.objects.link(thing)

    def _traffic(self) -> None:
        for _ in range(16):
            x = self.rng.uniform(-220, min(220, self.v.end_m - 30))
            y = float(self.rng.choice((10.5, 14.5, 18.5, 22.5, 26.5, 44.5, 79.5, 109.5)))
            turn = 0.0 if y < 20 else 180.0
            if not self._free(x, y, 17):
                continue
            tint = ((0.6, 0.6, 0.58), (0.55, 0.28, 0.03), (0.4, 0.05, 0.03))[self.rng.integers(3)]
            place(self.truck, (x, y, 0), turn, tint)
            if self.rng.random() < 0.65:
                self.box(40, (x, y, 1.45), self.color(), turn)
        for _ in range(14):  # containers on the apron
            x, y = self.rng.uniform(-200, min(200, self.v.end_m - 20)), self.rng.uniform(36.5, 40)
            if self._free(x, y, 14):
                self.box(40, (x, y, 0), self.color(), 0.0)

    def _far(self) -> None:
        s = Shape()
        turns = np.radians(np.arange(0, 361, 1.0))
        waves = [(self.rng.integers(2, 60), self.rng.uniform(0, 6.3)) for _ in range(24)]
        relief = sum(np.sin(k * turns + p) / k**0.8 for k, p in waves)
        relief = (relief - relief.min()) / (relief.max() - relief.min())
        for radius, height in ((5200.0, 110.0), (8800.0, 320.0)):
            land = np.clip(np.sin(turns) + 0.55, 0.02, 1.0)  # low towards the sea
            tops = height * land * (0.25 + 0.75 * np.roll(relief, int(radius) % 97))
            outer = [(radius * np.cos(t), radius * np.sin(t)) for t in turns]
            points = [
                (x * f, y * f, z)
                for (x, y), top in zip(outer, tops, strict=True)
                for f, z in ((1.0, SEA_M - 1), (1.1, 0.75 * top), (1.22, top))
            ]
            faces = [
                (3 * i + k, 3 * i + 1 + k, 3 * i + 4 + k, 3 * i + 3 + k)
                for i in range(360)
                for k in (0, 1)
            ]
            s.add(points, faces, "hills")
        for k in range(140):  # a town along the shore
            turn = self.rng.normal(2.4, 0.5)
            r, tall = self.rng.uniform(3000, 4400), self.rng.gamma(2.0, 14.0) + 8
            x, y, w = r * np.cos(turn), r * np.sin(turn), self.rng.uniform(9, 26)
            s.box((x - w, y - w, -4), (x + w, y + w, tall), "city")
            if self.v.lamps and k % 2:
                s.box(
                    (x - w - 1, y - w - 1, 0.4 * tall), (x + w + 1, y + w + 1, 0.43 * tall), "led"
                )
        s.box((-1400, -640, -8), (260, -622, -0.6), "rock")  # breakwater with its light
        place(s.mesh("far"), (0, 0, 0))
        place(models.tower(17), (250, -631, -0.6))
        place(models.tower(14), (620, -560, SEA_M))
        self._ship(900.0, -1500.0, 205.0)
        across = [c for c in CRANE_COLORS if c != CRANE_COLORS[self.v.seed % 4]]
        for k in range(6):  # another terminal across the basin
            mesh = models.quay_crane(k % 3 == 1, -10.0, 20.0)
            place(mesh, (-1500 + 95 * k, -1000, 0.5), 180, across[k % 3])
        opposite = Shape()
        opposite.box((-2600, -2600, -8), (-800, -990, 0.5), "concrete")
        place(opposite.mesh("opposite quay"), (0, 0, 0))
        for _ in range(160):
            x, y = self.rng.uniform(-1900, -820), -1000 - self.rng.uniform(60, 160)
            for level in range(int(self.rng.integers(1, 5))):
                z = 0.5 + level * models.HEIGHT
                self.box(40, (x, y, z), self.color(), 0.0)

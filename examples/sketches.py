"""Sketches of the keys that are lengths and angles, for docs/configuration.md: docs/sketches/*.svg.

python examples/sketches.py

Positions are computed with the functions of fastgen, so the sketches agree with them.
"""

import math
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.camera.projection import view_of
from fastgen.config.cameras import direction_from, face_frame
from fastgen.scene import Camera
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.faces import FACE_AXES

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "sketches"
KIND = "20"
AZIMUTH_DEG, ELEVATION_DEG, ROLL_DEG, FOCAL_MM, SENSOR_MM = 30.0, 25.0, 10.0, 28.0, 36.0
"""The example that the sketches of cameras show."""

_INK, _FAINT, _FILL, _MARK = "#222222", "#8a8a8a", "#dfe8f1", "#b3261e"

Point = ArrayLike
"""x and y in pixels, or x, y and z in mm."""


class Sketch:
    """An SVG image on white, which is legible on light and dark pages."""

    def __init__(self, width: int, height: int, title: str) -> None:
        self.lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'font-family="Helvetica, Arial, sans-serif" font-size="15" fill="{_INK}">',
            f"<title>{escape(title)}</title>",
            f'<rect width="{width}" height="{height}" rx="8" fill="#ffffff"/>',
            '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" '
            'markerHeight="8" orient="auto-start-reverse"><path d="M0 1 L10 5 L0 9 z" '
            f'fill="{_MARK}"/></marker></defs>',
        ]

    def shape(
        self, points: ArrayLike, fill: str = "none", name: str = "", dashed: bool = False
    ) -> None:
        """Add a closed polygon."""
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in np.asarray(points, float).tolist())
        self._add("polygon", f'points="{places}" fill="{fill}" stroke="{_INK}"', name, dashed)

    def line(self, points: ArrayLike, color: str = _INK, dashed: bool = False) -> None:
        """Add a line through points."""
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in np.asarray(points, float).tolist())
        self._add("polyline", f'points="{places}" fill="none" stroke="{color}"', "", dashed)

    def arrow(self, a: Point, b: Point, both: bool = True) -> None:
        """Add the arrow of a dimension."""
        (x0, y0), (x1, y1) = np.asarray([a, b], float).tolist()
        start = ' marker-start="url(#tip)"' if both else ""
        place = f'x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"'
        self._add("line", f'{place} stroke="{_MARK}" marker-end="url(#tip)"{start}')

    def arc(self, center: Point, radius: float, start_deg: float, end_deg: float) -> None:
        """Add an arrow along a circle; angles are counter-clockwise from the right."""
        turns = np.deg2rad(np.linspace(start_deg, end_deg, 24))
        places = np.asarray(center) + radius * np.stack([np.cos(turns), -np.sin(turns)], axis=1)
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places.tolist())
        self._add(
            "polyline", f'points="{path}" fill="none" stroke="{_MARK}" marker-end="url(#tip)"'
        )

    def dot(self, at: Point, name: str, color: str = _INK) -> None:
        """Add a point."""
        x, y = np.asarray(at, float).tolist()
        self._add("circle", f'cx="{x:.2f}" cy="{y:.2f}" r="4" fill="{color}" stroke="none"', name)

    def text(self, at: Point, words: str, side: str = "start", color: str = _INK) -> None:
        """Write words that begin, end or have their middle at a point."""
        x, y = np.asarray(at, float).tolist()
        weight = ' font-weight="bold"' if color == _MARK else ""
        self.lines.append(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{side}" fill="{color}"{weight}>'
            f"{escape(words)}</text>"
        )

    def _add(self, kind: str, rest: str, name: str = "", dashed: bool = False) -> None:
        known = f' id="{name}"' if name else ""
        dashes = ' stroke-dasharray="5 4"' if dashed else ""
        self.lines.append(f'<{kind}{known} {rest} stroke-width="1.5"{dashes}/>')

    def svg(self) -> str:
        """Return the text of the file."""
        return "\n".join([*self.lines, "</svg>", ""])


def faces() -> Sketch:
    """Return a sketch of the container's frame and the names of its faces."""
    sketch = Sketch(700, 370, "Axes of the container and names of its faces")
    length, width, height = KINDS[KIND].size_mm

    def seen(points: Point) -> NDArray[np.float64]:
        x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
        return np.stack([340 + 0.058 * x + 0.034 * y, 245 - 0.062 * z - 0.03 * y], axis=-1)

    low, high = (-length / 2, -width / 2, 0.0), (length / 2, width / 2, height)
    corners = np.array([[(x, y, z) for z in (low[2], high[2])]
                        for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]),
                                     (low[0], high[1]))])  # fmt: skip
    front = [corners[0][0], corners[1][0], corners[1][1], corners[0][1]]
    door = [corners[1][0], corners[2][0], corners[2][1], corners[1][1]]
    roof = [corners[0][1], corners[1][1], corners[2][1], corners[3][1]]
    for face, fill in ((front, _FILL), (door, "#c9d8e8"), (roof, "#eef3f8")):
        sketch.shape(seen(face), fill)
    for a, b in ((0, 3), (3, 2)):
        sketch.line(seen([corners[a][0], corners[b][0]]), _FAINT, dashed=True)
    sketch.line(seen(corners[3]), _FAINT, dashed=True)
    for name, face in (("front", front), ("door", door), ("roof", roof)):
        axes = FACE_AXES[name]
        middle = np.mean(face, axis=0)
        sketch.text(seen(middle) + (0, 24), name, "middle")
        for way, axis in (("right", axes.right), ("up", axes.up)):
            start, end = seen(middle), seen(middle + 700 * np.array(axis))
            sketch.arrow(start, end, both=False)
            sketch.text(end + (4, -4), way, color=_MARK)
    for name, words, at in (
        ("back", "back (+y)", (580, 50)),
        ("no_door", "no_door (-x)", (14, 120)),
        ("underside", "underside (-z)", (300, 350)),
    ):
        sketch.text(at, words, color="#555555")
        middle = np.array(FACE_AXES[name].out) * (length / 2, width / 2, height / 2)
        middle += (0, 0, height / 2)
        start = np.array(at) + ((70, 6) if name != "underside" else (80, -16))
        sketch.line([start, seen(middle)], _FAINT, dashed=True)
    origin = np.array([60.0, 320.0])
    for name, direction in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1))):
        end = origin + seen(1000 * np.array(direction)) - seen((0, 0, 0))
        sketch.arrow(origin, end, both=False)
        sketch.text(end + (5, 4), name, color=_MARK)
    sketch.text((20, 30), "front (-y), door (+x), roof (+z); grey: hidden faces")
    return sketch


def _top(sketch: Sketch) -> None:
    """Draw azimuth, distance and aim_right from above."""
    length, width, _ = KINDS[KIND].size_mm
    frame = face_frame("front", KIND)

    def seen(points: Point) -> NDArray[np.float64]:
        x, y = np.asarray(points, float)[..., :2].T
        return np.stack([165 + 0.042 * x, 110 - 0.042 * y], axis=-1)

    target = frame.middle_mm
    camera = target + 4600 * direction_from(frame, AZIMUTH_DEG, 0.0)
    corners = [(x, y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sketch.text((20, 30), "From above, camera at the front")
    sketch.shape(seen(np.array(corners) * (length / 2, width / 2)), _FILL)
    sketch.text(seen((0, 0)) + (0, 5), "container", "middle")
    for share in (-1, 0, 1):
        at = seen(target + share * frame.half_mm[0] * frame.right)
        sketch.line([at - (0, 5), at + (0, 5)])
        sketch.text(at + (-14 * share, -10), f"{share:g}", "middle", _MARK)
    sketch.text((20, 182), "aim_right", color=_MARK)
    sketch.line([seen(target), seen(target + 4200 * frame.outward)], _FAINT, dashed=True)
    sketch.arrow(seen(target), seen(camera))
    sketch.text(seen(camera) + (-16, -52), "distance_mm", color=_MARK)
    sketch.arc(seen(target), 108, -90, -90 + AZIMUTH_DEG)
    sketch.text((150, 300), f"azimuth_deg {AZIMUTH_DEG:g}", "end", _MARK)
    sketch.dot(seen(target), "top-target")
    sketch.dot(seen(camera), "top-camera", _MARK)
    sketch.text(seen(camera) + (8, 14), "camera")


def _side(sketch: Sketch) -> None:
    """Draw elevation and aim_up from the door's side: the front is at the left."""
    _, width, height = KINDS[KIND].size_mm
    frame = face_frame("front", KIND)

    def seen(points: Point) -> NDArray[np.float64]:
        y, z = np.asarray(points, float)[..., -2:].T
        return np.stack([620 + 0.042 * y, 260 - 0.042 * z], axis=-1)

    target = frame.middle_mm
    camera = target + 4600 * direction_from(frame, 0.0, ELEVATION_DEG)
    corners = [(-width / 2, 0), (width / 2, 0), (width / 2, height), (-width / 2, height)]
    sketch.text((375, 30), "From the side")
    sketch.shape(seen(corners), _FILL)
    for share in (-1, 0, 1):
        at = seen(target + share * frame.half_mm[1] * frame.up)
        sketch.line([at - (5, 0), at + (5, 0)])
        sketch.text(at + (10, 5 + 14 * share), f"{share:g}", color=_MARK)
    sketch.text((575, 285), "aim_up", color=_MARK)
    sketch.line([seen(target), seen(target + 4200 * frame.outward)], _FAINT, dashed=True)
    sketch.arrow(seen(target), seen(camera))
    sketch.arc(seen(target), 120, 180, 180 - ELEVATION_DEG)
    sketch.text((375, 232), f"elevation_deg {ELEVATION_DEG:g}", color=_MARK)
    sketch.dot(seen(target), "side-target")
    sketch.dot(seen(camera), "side-camera", _MARK)
    sketch.text(seen(camera) + (-8, -12), "camera")


def _roll(sketch: Sketch) -> None:
    """Draw the door in two images, without and with roll."""
    sketch.text((20, 370), "Image, camera at the door")
    _, width, height = KINDS[KIND].size_mm
    middle = face_frame("door", KIND).middle_mm
    for roll, left in ((0.0, 20.0), (ROLL_DEG, 180.0)):
        size = (145, 145)
        position = middle + np.array([5500.0, 0.0, 0.0])
        camera = Camera("", tuple(position.tolist()), tuple(middle.tolist()), 50.0, roll_deg=roll)
        signs = ((0, -1, 1), (0, 1, 1), (0, 1, -1), (0, -1, -1))
        corners = [middle + np.array(sign) * (0, width / 2, height / 2) for sign in signs]
        pixels, _ = view_of(camera, size).project(np.array(corners))
        at = np.array([left, 385])
        sketch.shape(at + np.array([(0, 0), (size[0], 0), size, (0, size[1])]))
        sketch.shape(at + pixels, _FILL, f"door-{roll:g}")
        sketch.text(at + (72, 165), f"roll_deg {roll:g}", "middle", _MARK)


def _lens(sketch: Sketch) -> None:
    """Draw the pinhole of a camera with its sensor and field of view."""
    half = math.atan(SENSOR_MM / (2 * FOCAL_MM))
    lens = np.array([480.0, 460.0])
    scale = 2.6
    sketch.text((375, 370), "Focal length and field of view")
    sensor = lens - (FOCAL_MM * scale, 0)
    edges = [(0, -SENSOR_MM * scale / 2), (0, SENSOR_MM * scale / 2)]
    sketch.line([sensor + edge for edge in edges])
    for sign in (-1, 1):
        away = np.array([math.cos(half), sign * math.sin(half)])
        sketch.line([sensor + (0, -sign * SENSOR_MM * scale / 2), lens + 130 * away], _FAINT)
    sketch.dot(lens, "lens")
    sketch.arrow(sensor + (0, 62), lens + (0, 62))
    sketch.text((sensor + lens) / 2 + (0, 82), f"focal_mm {FOCAL_MM:g}", "middle", _MARK)
    sketch.arrow(sensor + edges[0] - (12, 0), sensor + edges[1] - (12, 0))
    sketch.text((375, 396), f"sensor_width_mm {SENSOR_MM:g}", color=_MARK)
    sketch.arc(lens, 62, -math.degrees(half), math.degrees(half))
    sketch.text(lens + (72, 5), f"fov_deg {math.degrees(2 * half):.1f}", color=_MARK)


def camera() -> Sketch:
    """Return a sketch of a camera's keys."""
    sketch = Sketch(700, 570, "Azimuth, elevation, roll, aim, distance and focal length")
    for draw in (_top, _side, _roll, _lens):
        draw(sketch)
    return sketch


def _wave(left: float, right: float, y: float, depth: float) -> list[tuple[float, float]]:
    """Return a section through a sheet that is pushed down by a cosine-shaped bowl."""
    x = np.linspace(left, right, 60)
    across = np.abs((x - (left + right) / 2) / ((right - left) / 2 - 30))
    bowl = np.where(across < 1, 0.5 + 0.5 * np.cos(np.pi * np.minimum(across, 1)), 0)
    return list(zip(x.tolist(), (y + depth * bowl).tolist(), strict=True))


def damage() -> Sketch:
    """Return a sketch of the sizes of damages."""
    sketch = Sketch(700, 640, "Sizes of axis, concave, dented and perforation damages")
    sketch.text((20, 30), "concave: wall, and section")
    sketch.shape([(30, 60), (310, 60), (310, 210), (30, 210)], _FILL)
    oval = [(170 + 105 * math.cos(t), 118 + 46 * math.sin(t)) for t in np.linspace(0, 6.28, 40)]
    sketch.shape(oval, "#c9d8e8")
    sketch.arrow((65, 198), (275, 198))
    sketch.text((150, 190), "length_mm", "middle", _MARK)
    sketch.arrow((292, 72), (292, 164))
    sketch.text((304, 184), "width_mm", "end", _MARK)
    sketch.line(_wave(30, 310, 240, 45))
    sketch.arrow((170, 240), (170, 285))
    sketch.line([(30, 240), (310, 240)], _FAINT, dashed=True)
    sketch.text((170, 304), "depth_mm", "middle", _MARK)

    sketch.text((375, 30), "dented: fold along a path")
    sketch.shape([(385, 60), (665, 60), (665, 285), (385, 285)], _FILL)
    x = np.linspace(410, 640, 80)
    y = 165 - 24 * np.sin((x - 410) / 100 * 2 * np.pi)
    path = np.stack([x, y], axis=1)
    sketch.shape([*(path - (0, 34)), *(path + (0, 34))[::-1]], "#c9d8e8")
    sketch.line(path)
    sketch.arrow((410, 262), (640, 262))
    sketch.text((525, 280), "length_mm", "middle", _MARK)
    sketch.arrow((435, 92), (535, 92))
    sketch.text((485, 84), "wavelength_mm", "middle", _MARK)
    sketch.arrow(path[-1] - (0, 34), path[-1] + (0, 34))
    sketch.text((660, 98), "width_mm", "end", _MARK)
    sketch.line([(425, 165), (600, 165)], _FAINT, dashed=True)
    sketch.arrow((585, 165), (585, 189))
    sketch.text((520, 245), "amplitude_mm", "middle", _MARK)

    sketch.text((20, 340), "perforation: hole and rim, and section")
    sketch.shape([(30, 360), (310, 360), (310, 540), (30, 540)], _FILL)
    for radius, fill in ((72, "#c9d8e8"), (42, "#555555")):
        turns = np.linspace(0, 2 * np.pi, 60)
        lobes = radius * (1 + 0.12 * np.cos(5 * turns))
        star = np.stack([170 + lobes * np.cos(turns), 450 + lobes * np.sin(turns)], axis=1)
        sketch.shape(star, fill)
    sketch.arrow((128, 450), (212, 450))
    sketch.text((40, 382), "diameter_mm", color=_MARK)
    sketch.line([(90, 388), (150, 448)], _FAINT)
    sketch.arrow((215, 480), (242, 494))
    sketch.text((250, 520), "rim_mm", "middle", _MARK)
    sketch.line([(30, 570), (98, 570), (128, 600)])
    sketch.line([(310, 570), (242, 570), (212, 600)])
    sketch.line([(98, 570), (242, 570)], _FAINT, dashed=True)
    sketch.arrow((170, 570), (170, 600))
    sketch.text((170, 622), "depth_mm", "middle", _MARK)

    sketch.text((375, 340), "axis: edge that is pushed in")
    top, near, far = 385, 440, 600
    sketch.shape([(430, top), (690, top), (640, near), (380, near)], "#eef3f8")
    bent = [(380, near), (430, near), (510, near + 38), (590, near), (640, near)]
    sketch.shape([*bent, (640, far), (380, far)], _FILL)
    sketch.line([(430, near), (590, near)], _FAINT, dashed=True)
    sketch.arrow((430, near - 12), (590, near - 12))
    sketch.text((510, near - 20), "length_mm", "middle", _MARK)
    sketch.arrow((510, near), (510, near + 38))
    sketch.text((510, near + 58), "depth_mm", "middle", _MARK)
    sketch.arrow((610, near), (610, near + 110))
    sketch.text((604, near + 100), "reach_mm", "end", _MARK)
    sketch.line([(430, near + 110), (630, near + 110)], _FAINT, dashed=True)
    return sketch


def decals() -> Sketch:
    """Return a sketch of the sizes of markers and texts, and of sheet coordinates."""
    sketch = Sketch(700, 330, "Sheet coordinates, sizes of markers and texts")
    left, bottom, right, top = 40, 290, 660, 50
    sketch.shape([(left, top), (right, top), (right, bottom), (left, bottom)], _FILL)
    sketch.arrow((left, bottom), (left + 60, bottom), both=False)
    sketch.arrow((left, bottom), (left, bottom - 60), both=False)
    sketch.text((left + 66, bottom - 6), "right", color=_MARK)
    sketch.text((left + 6, bottom - 62), "up", color=_MARK)
    sketch.text(
        (20, 30), "A face from outside. center_mm counts from the lower left corner of its sheet."
    )
    for x, turn in ((220, 0.0), (347, 8.0)):
        turns = np.deg2rad(turn) + np.arange(4) * np.pi / 2
        diamond = np.stack([x + 56 * np.cos(turns), 200 - 56 * np.sin(turns)], axis=1)
        sketch.shape(diamond, "#f4c9a0")
    sketch.dot((220, 200), "center")
    sketch.line([(220, 200), (220, bottom)], _FAINT, dashed=True)
    sketch.line([(220, 200), (left, 200)], _FAINT, dashed=True)
    sketch.text((118, 194), "center_mm", "middle", _MARK)
    sketch.arrow((172, 192), (212, 152))
    sketch.text((190, 140), "marker_side_mm", "middle", _MARK)
    sketch.arrow((276, 200), (291, 200))
    sketch.text((300, 278), "marker_gap_mm", "middle", _MARK)
    sketch.line([(284, 262), (284, 206)], _FAINT)
    sketch.line([(347, 200), (347, 120)], _FAINT, dashed=True)
    tip = np.array([347, 200]) + 78 * np.array(
        [-math.sin(math.radians(8)), -math.cos(math.radians(8))]
    )
    sketch.line([(347, 200), tip], _FAINT, dashed=True)
    sketch.text((350, 112), "marker_tilt_deg 8", "middle", _MARK)
    sketch.lines.append('<text x="490" y="130" font-size="40" font-weight="bold">ABCU</text>')
    sketch.line([(466, 101), (488, 101)], _FAINT)
    sketch.line([(466, 130), (488, 130)], _FAINT)
    sketch.arrow((472, 101), (472, 130))
    sketch.text((490, 152), "cap_mm", color=_MARK)
    return sketch


SKETCHES = {"faces": faces, "camera": camera, "damage": damage, "decals": decals}


def main() -> None:
    """Write the sketches."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, draw in SKETCHES.items():
        (FOLDER / f"{name}.svg").write_text(draw().svg(), encoding="utf-8")


if __name__ == "__main__":
    main()

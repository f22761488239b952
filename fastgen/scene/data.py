"""Scene: everything that decides an image, as plain frozen data, without GL.

Lengths are millimetres and angles degrees. The container frame is the world frame: right-handed,
z up, origin at the centre of the footprint, z = 0 at the bottom of the castings, +x at the door.
Colours are linear Rec.709 albedo in 0..1. Decals are placed in the sheet coordinates of their
face: origin at the lower left corner of the face's chart seen from outside, x to the right, y up,
measured along the unfolded sheet.
"""

import json
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import WallProfiles
from fastgen.scene.limits import GAP_LIMITS_MM
from fastgen.scene.optics import WHOLE, Lens, Sensor, Weather
from fastgen.validation import UNIT, bounds, from_plain, to_plain

Color = tuple[float, float, float]

REC_709 = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of a linear colour is its product with this; ITU-R BT.709-6, section 3.2."""

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]

_REACH = bounds(0.0, 1e6, "mm")
_SCALE = bounds(1.0, 1e6, "mm")
_LENGTH = bounds(1e-3, 1e6, "mm")


@dataclass(frozen=True)
class Paint:
    """Base coat. albedo: linear colour; roughness: GGX perceptual roughness of sound paint."""

    name: str
    albedo: Color = field(metadata=UNIT)
    roughness: float = field(metadata=UNIT)
    tone_variation: float = field(metadata=UNIT)


@dataclass(frozen=True)
class Ageing:
    """Darkening toward the corners of each panel. strength 0..1; reach in mm from a corner."""

    strength: float = field(metadata=UNIT)
    reach_mm: float = field(metadata=_REACH)


@dataclass(frozen=True)
class Dirt:
    """Light grey deposit along edges. strength 0..1; reach in mm from an edge."""

    strength: float = field(metadata=UNIT)
    reach_mm: float = field(metadata=_REACH)
    albedo: Color = field(metadata=UNIT)


@dataclass(frozen=True)
class Rust:
    """Ochre corrosion that breaks the paint. coverage: fraction of the sheet; scale in mm."""

    coverage: float = field(metadata=UNIT)
    scale_mm: float = field(metadata=_SCALE)
    albedo: Color = field(metadata=UNIT)
    roughness: float = field(metadata=UNIT)


@dataclass(frozen=True)
class Scratches:
    """Fine bright lines down to primer or steel. coverage: fraction of the sheet."""

    coverage: float = field(metadata=UNIT)


@dataclass(frozen=True)
class Wear:
    """Worn reflection: how much noise spreads the roughness of exposed paint, 0..1. Scratches and
    dirt share the noise tile whose scale_mm stands here."""

    strength: float = field(metadata=UNIT)
    scale_mm: float = field(metadata=_SCALE)


@dataclass(frozen=True)
class Surface:
    """All material layers of one container. noise_offset_mm moves the noise about."""

    paint: Paint
    ageing: Ageing
    dirt: Dirt
    rust: Rust
    scratches: Scratches
    wear: Wear
    noise_offset_mm: Vec2


@dataclass(frozen=True)
class Decal:
    """One thing printed or stuck on the sheet.

    kind: marker, text, sticker or emblem. class_name: label class, or '' for things without one.
    face: chart it lies on. center_mm: centre in sheet coordinates. size_mm: width and height of
    the drawn rectangle before rotation (a marker's is the square around the standing diamond; a
    text's is the tight box around its ink). art: marker, sticker or emblem name, or 'stripes' for
    the bands of high cubes. albedo: of the ink of texts, emblems and stripes.
    lines: text, one string a line; vertical text has one glyph below the other, columns from left
    to right. cap_mm: height of the capitals. wear 0..1: how much of the print has gone.
    """

    kind: str
    class_name: str
    face: str
    center_mm: Vec2
    size_mm: Vec2 = field(metadata=_LENGTH)
    rotation_deg: float = 0.0
    art: str = ""
    lines: tuple[str, ...] = ()
    font: str = ""
    vertical: bool = False
    cap_mm: float = 0.0
    albedo: Color = field(default=(0.8, 0.8, 0.8), metadata=UNIT)
    wear: float = field(default=0.0, metadata=UNIT)

    @property
    def text(self) -> str:
        """The whole text, lines joined by one space; '' for markers and stickers."""
        return " ".join(self.lines)

    @property
    def turn(self) -> NDArray[np.float64]:
        """From the decal's axes to its sheet's, float64 [2, 2]: columns are its right and up."""
        angle = np.deg2rad(self.rotation_deg)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@dataclass(frozen=True)
class Damage:
    """One damage: a displacement field, see fastgen/damage.py for its formula.

    kind: one of classes.DAMAGE_CLASSES. face: what it was done to, for people. origin_mm: rest
    point in the container frame. along, across, inward: orthonormal axes of the field; positive
    depth_mm moves the sheet along `inward`. size_mm: full length along and full width across; for
    a perforation both are the mean diameter, for an axis the width is twice the reach from the
    edge. shape: dented (crease half width mm, share of sink 0..1, amplitude mm, wavelength mm,
    phase rad, stretch length mm); perforation (rim width mm, then share and phase of 5 outline
    harmonics); else empty.
    """

    kind: str
    face: str
    origin_mm: Vec3
    along: Vec3
    across: Vec3
    inward: Vec3
    size_mm: Vec2 = field(metadata=_LENGTH)
    depth_mm: float
    shape: tuple[float, ...] = ()


@dataclass(frozen=True)
class Container:
    """Which box: kind is 20, 40, 40HC or 45HC; profiles are its corrugations."""

    kind: str
    profiles: WallProfiles


@dataclass(frozen=True)
class Spreader:
    """The crane's spreader that the container hangs on, where one is present.

    albedo: of its paint. flippers_down: whether the gather guides of the front and of the back
    side hang beside the container. gap_mm: from the upper castings to the spreader.
    """

    present: bool = False
    albedo: Color = field(default=(0.6, 0.35, 0.02), metadata=UNIT)
    flippers_down: tuple[bool, bool] = (True, True)
    gap_mm: float = field(default=15.0, metadata=bounds(*GAP_LIMITS_MM, "mm"))


@dataclass(frozen=True)
class EnvironmentView:
    """Which HDRI lights the scene, turned about the vertical by yaw_deg (counter-clockwise)."""

    name: str
    yaw_deg: float


@dataclass(frozen=True)
class Camera:
    """A camera. The sensor's width spans the image's width, whatever its aspect ratio.

    exposure_ev: deviation from the metered exposure, in stops. roll_deg turns the image clockwise.
    lens: how it distorts, None for a pinhole. sensor: what it does to the image, None for nothing.
    """

    name: str
    position_mm: Vec3
    target_mm: Vec3
    focal_mm: float = field(metadata=_LENGTH)
    roll_deg: float = 0.0
    sensor_width_mm: float = field(default=36.0, metadata=_LENGTH)
    exposure_ev: float = field(default=0.0, metadata=bounds(-30.0, 30.0, "stops"))
    lens: Lens | None = None
    sensor: Sensor | None = None


@dataclass(frozen=True)
class Scene:
    """One container with all that is on it, its light and its cameras."""

    seed: int = field(metadata=WHOLE)
    index: int = field(metadata=WHOLE)
    container: Container
    surface: Surface
    environment: EnvironmentView
    cameras: tuple[Camera, ...]
    decals: tuple[Decal, ...] = ()
    damages: tuple[Damage, ...] = ()
    spreader: Spreader = field(default_factory=Spreader)
    weather: Weather = field(default_factory=Weather)

    def camera(self, name: str) -> Camera:
        """The camera of that name. Raises KeyError naming those that exist."""
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise KeyError(f"no camera {name!r}; this scene has {[c.name for c in self.cameras]}")

    def to_json(self) -> str:
        """The scene as JSON text; `from_json` gives back an equal scene."""
        return json.dumps(to_plain(self), indent=1)

    @staticmethod
    def from_json(text: str) -> "Scene":
        """A scene from `to_json`'s text, or from that of a dataset's scene file.

        Raises ConfigError naming a field that does not fit.
        """
        try:
            data = json.loads(text)
        except (ValueError, TypeError) as error:
            raise ConfigError(f"scene: is no JSON ({error})") from None
        if isinstance(data, dict) and "scene" in data:  # a scene file of a dataset
            data = data["scene"]
        return from_plain(Scene, data, "scene")

"""Scene: everything that determines an image, as plain frozen data without OpenGL.

Lengths are in millimetres and angles in degrees. The container frame is the world frame: right-
handed, z up, origin at the centre of the footprint, z = 0 at the bottom of the castings, +x toward
the door. Colors are linear Rec. 709 albedo in 0..1.
"""

import json
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import MaxLen

from fastgen.classes import ALL_DAMAGE_CLASSES
from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import KINDS, WallProfiles
from fastgen.scene.decal import Decal
from fastgen.scene.limits import (
    GAP_LIMITS_MM,
    GROUNDS,
    HASPS,
    ILLUMINANCE_LIMITS_LX,
    LONGEST_JSON,
    LOWEST_GROUND_MM,
    MAX_DAMAGES,
    MAX_DECALS,
    MAX_LAMPS,
    MAX_NEIGHBOURS,
    MAX_PROPS,
    OVERCAST_LX,
    WHOLE,
    Degrees,
    Length,
    Millimetres,
    Number,
)
from fastgen.scene.optics import ASPECT_LIMITS, PRINCIPAL_LIMITS, Lamp, Lens, Sensor, Weather
from fastgen.scene.surface import Color, Surface, Vec2
from fastgen.scene.tables import scene_table
from fastgen.validation import (
    Bounds,
    Flag,
    OneOf,
    Share,
    check_fields,
    from_plain,
    to_plain,
)

REC_709 = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear red, green and blue in the luminance; ITU-R BT.709-6, section 3.2."""

Vec3 = tuple[Number, Number, Number]

_Shift = Annotated[float, Bounds(*PRINCIPAL_LIMITS)]


@dataclass(frozen=True)
class Damage:
    """One damage, see damage_kinds.py; geometry/damage_law.py has the formula of its displacement.

    Attributes:
        kind: One of classes.ALL_DAMAGE_CLASSES.
        face: Damaged face, for information only.
        origin_mm: Origin of the field in the undamaged container.
        along: First of three orthonormal axes of the field, in the container frame.
        across: Second axis.
        inward: Third axis. A positive `depth_mm` moves the sheet in its direction.
        size_mm: Full length along and full width across. For a star both are the mean diameter;
            for an axis damage the width is twice the reach from the edge.
        depth_mm: Nominal depth: the largest displacement, if the form had no rounded folds.
        shape: Further parameters, those of its form in damage_kinds.py in this order.
        form: Name of one of the forms of the kind.
        paint_loss: Share of the worst places that is bare of paint, 0..1.
        fresh: Share of the bare places that has not rusted yet, 0..1.
        bare_albedo: Linear color of the fresh share: steel, primer, or paint of what scraped it.
    """

    kind: Annotated[str, OneOf(ALL_DAMAGE_CLASSES)]
    face: str
    origin_mm: Vec3
    along: Vec3
    across: Vec3
    inward: Vec3
    size_mm: tuple[Length, Length]
    depth_mm: Millimetres
    shape: tuple[Number, ...] = ()
    form: str = "plain"
    paint_loss: Share = 1.0
    fresh: Share = 0.0
    bare_albedo: Color = (0.42, 0.41, 0.39)


@dataclass(frozen=True)
class Container:
    """Container kind (20, 40, 40HC or 45HC) and the corrugation of its walls.

    Attributes:
        kind: Key of KINDS.
        profiles: Corrugation of the walls.
        present: False for a scene that shows only the panorama and the ground. Cameras are placed
            as if the container was there. Such a scene has no decals, damages, seals or spreader.
    """

    kind: Annotated[str, OneOf(tuple(KINDS))]
    profiles: WallProfiles
    present: Flag = True


@dataclass(frozen=True)
class Spreader:
    """Spreader of the crane that holds the container.

    Attributes:
        present: Whether there is one.
        albedo: Linear color of its paint.
        flippers_down: Whether the gather guides of the front and of the back are lowered beside
            the container.
        gap_mm: Distance between the upper castings and the spreader.
    """

    present: Flag = False
    albedo: Color = (0.6, 0.35, 0.02)
    flippers_down: tuple[Flag, Flag] = (True, True)
    gap_mm: Annotated[float, Bounds(*GAP_LIMITS_MM, "mm")] = 15.0


@dataclass(frozen=True)
class Seal:
    """A seal at a hasp of the door gear. A hasp without a seal has none of these.

    Attributes:
        kind: 'bolt' for a steel pin between a head and a barrel, 'cable' for a body with a steel
            cable.
        hasp: Hasp that it is at, 0 to 3: the locking bar that the hasp's handle turns, from left to
            right as seen from outside.
        state: 'locked'; or 'hanging' for one that does not secure the hasp: a bolt without its
            barrel, or a cable with a free end.
        albedo: Linear color of the plastic around head and barrel, or of the body.
    """

    kind: Annotated[str, OneOf(("bolt", "cable"))]
    hasp: Annotated[int, Bounds(0, HASPS - 1)]
    state: Annotated[str, OneOf(("locked", "hanging"))] = "locked"
    albedo: Color = (0.8, 0.5, 0.02)


@dataclass(frozen=True)
class Pose:
    """Position of a body's frame in the world, and its counter-clockwise turn about z."""

    position_mm: Vec3 = (0.0, 0.0, 0.0)
    yaw_deg: Degrees = 0.0


@dataclass(frozen=True)
class Neighbour:
    """Another container of a scene, in a frame of its own that `pose` places in the world."""

    pose: Pose
    container: Container
    surface: Surface
    decals: Annotated[tuple[Decal, ...], MaxLen(MAX_DECALS)] = ()
    damages: Annotated[tuple[Damage, ...], MaxLen(MAX_DAMAGES)] = ()
    seals: Annotated[tuple[Seal, ...], MaxLen(HASPS)] = ()


@dataclass(frozen=True)
class Prop:
    """A box or a cylinder below the containers, such as a beam or a wheel of a trailer.

    Attributes:
        shape: 'box', or 'cylinder' with its axis along its own y axis.
        pose: Its centre, and its turn about z.
        size_mm: Size along its own x, y and z axes. A cylinder's x and z are its diameter.
        albedo: Linear color.
        roughness: Perceptual GGX roughness.
    """

    shape: Annotated[str, OneOf(("box", "cylinder"))]
    pose: Pose
    size_mm: tuple[Length, Length, Length]
    albedo: Color
    roughness: Share = 0.7


@dataclass(frozen=True)
class Ground:
    """Level plane below the containers, which blends into the ground of the HDRI.

    Attributes:
        kind: 'asphalt', 'concrete' or 'paving'.
        height_mm: Height of the plane in the world, at most 0.
        albedo: Mean linear color of the dry ground.
        wetness: Wetness; puddles cover low places first.
        wear: Strength of stains, cracks and patches.
        line_albedo: Linear color of the painted lines.
        lines: Remaining share of the paint of the lines; 0 for no lines.
        line_yaw_deg: Direction of the lines.
        line_spacing_mm: Distance between parallel lines.
        reach_mm: Horizontal distance from the origin at which the HDRI has replaced the plane.
        noise_offset_mm: Shift of the noise of stains, cracks and puddles.
    """

    kind: Annotated[str, OneOf(GROUNDS)]
    height_mm: Annotated[float, Bounds(LOWEST_GROUND_MM, 0.0, "mm")] = 0.0
    albedo: Color = (0.1, 0.1, 0.1)
    wetness: Share = 0.0
    wear: Share = 0.5
    line_albedo: Color = (0.6, 0.6, 0.58)
    lines: Share = 0.0
    line_yaw_deg: Degrees = 0.0
    line_spacing_mm: Length = 3500.0
    reach_mm: Length = 40000.0
    noise_offset_mm: Vec2 = (0.0, 0.0)


@dataclass(frozen=True)
class EnvironmentView:
    """HDRI that lights the scene.

    Attributes:
        name: Name of its file without extension.
        yaw_deg: Counter-clockwise rotation about the vertical.
        illuminance_lx: Light on level ground under an open sky; cameras with a meter and
            lamps use it.
        lamps: Floodlights beside the environment.
    """

    name: str
    yaw_deg: Degrees
    illuminance_lx: Annotated[float, Bounds(*ILLUMINANCE_LIMITS_LX, "lx")] = OVERCAST_LX
    lamps: Annotated[tuple[Lamp, ...], MaxLen(MAX_LAMPS)] = ()


@dataclass(frozen=True)
class Camera:
    """Camera with its pose. The sensor width spans the image width at any aspect ratio.

    Attributes:
        name: Name in the rig.
        position_mm: Position in the container frame.
        target_mm: Point that it looks at.
        focal_mm: Focal length.
        roll_deg: Clockwise rotation of the image.
        sensor_width_mm: Width of the sensor.
        exposure_ev: Deviation from the metered exposure, in stops.
        lens: Distortion, None for a pinhole.
        sensor: Effects of the sensor on the image, None for none.
        pixel_aspect: Focal length down the image relative to that across it.
        principal_point: Place where the optical axis meets the image: distance to the right and
            down from its centre, as shares of its width.
    """

    name: str
    position_mm: Vec3
    target_mm: Vec3
    focal_mm: Length
    roll_deg: Degrees = 0.0
    sensor_width_mm: Length = 36.0
    exposure_ev: Annotated[float, Bounds(-30.0, 30.0, "stops")] = 0.0
    lens: Lens | None = None
    sensor: Sensor | None = None
    pixel_aspect: Annotated[float, Bounds(*ASPECT_LIMITS)] = 1.0
    principal_point: tuple[_Shift, _Shift] = (0.0, 0.0)


@dataclass(frozen=True)
class Scene:
    """One container with its markings, damage, seals, spreader, light, weather and cameras.

    Attributes:
        seed: Seed of the sequence that the scene belongs to.
        index: Number of the scene in its sequence.
        neighbours: Further containers. The boxes around containers may not overlap.
        ground: Plane below all containers; None to see only the HDRI.
        props: Boxes and cylinders on the ground, below the containers. They need a ground.
    """

    seed: Annotated[int, WHOLE]
    index: Annotated[int, WHOLE]
    container: Container
    surface: Surface
    environment: EnvironmentView
    cameras: tuple[Camera, ...]
    decals: Annotated[tuple[Decal, ...], MaxLen(MAX_DECALS)] = ()
    damages: Annotated[tuple[Damage, ...], MaxLen(MAX_DAMAGES)] = ()
    seals: Annotated[tuple[Seal, ...], MaxLen(HASPS)] = ()
    spreader: Spreader = field(default_factory=Spreader)
    neighbours: Annotated[tuple[Neighbour, ...], MaxLen(MAX_NEIGHBOURS)] = ()
    ground: Ground | None = None
    props: Annotated[tuple[Prop, ...], MaxLen(MAX_PROPS)] = ()
    weather: Weather = field(default_factory=Weather)

    def camera(self, name: str) -> Camera:
        """Return the camera called `name`.

        Raises:
            KeyError: if there is none; the message lists the names.
        """
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise KeyError(f"no camera {name!r}; this scene has {[c.name for c in self.cameras]}")

    def undamaged(self) -> "Scene":
        """Return the same scene with no damage on any container.

        Images of both scenes from the same camera differ only in the damages: their shape, bare or
        rusty places, scratches, light and shadows. Decals and seals stay, including repairs and the
        streaks of rust below damages.
        """
        whole = tuple(replace(each, damages=()) for each in self.neighbours)
        return replace(self, damages=(), neighbours=whole)

    def _repr_html_(self) -> str:
        """Return a table of the parts of the scene, for notebooks."""
        return scene_table(self)

    def to_json(self) -> str:
        """Return the scene as JSON text, which `from_json` reads back to an equal scene.

        Raises:
            ConfigError: naming a field whose value does not fit its type.
        """
        try:
            return json.dumps(to_plain(self), indent=1)
        except (TypeError, ValueError, RecursionError):  # not JSON's types, such as NumPy's
            return json.dumps(to_plain(check_fields(self, Scene, "scene")), indent=1)

    @staticmethod
    def from_json(text: str | bytes) -> "Scene":
        """Return the scene in the text of `to_json` or of a dataset's scene file.

        Args:
            text: JSON of at most LONGEST_JSON characters.

        Raises:
            ConfigError: naming the field that is missing or does not fit.
        """
        if len(text) > LONGEST_JSON:
            raise ConfigError(f"scene: has {len(text):,} characters; give at most {LONGEST_JSON:,}")
        try:
            data = json.loads(text)
        except (ValueError, TypeError, RecursionError) as error:
            raise ConfigError(f"scene: is no JSON ({error})") from None
        if isinstance(data, dict) and "scene" in data:
            data = data["scene"]
        return from_plain(Scene, data, "scene")

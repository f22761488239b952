"""Config: all parameters of the distributions that scenes are drawn from.

A preset is a Config, see presets.py; a YAML or JSON file changes single values of it. Ranges are
drawn from uniformly unless documented otherwise. Lengths are millimetres and angles degrees. Colors
are sRGB hex codes, because people pick them on screens; scenes hold linear albedo.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from annotated_types import MinLen

from fastgen.config.calibration import with_focal_lengths
from fastgen.config.cameras import CameraConfig, check_above_ground, check_room, seafront_rig
from fastgen.config.damage import DamageConfig
from fastgen.config.fields import HexColors, Weight
from fastgen.config.lamps import LampsConfig
from fastgen.config.markings import MarkingsConfig
from fastgen.config.presets import DEFAULT_PRESET, preset_named
from fastgen.config.sensor import SensorConfig, WeatherConfig
from fastgen.config.surface import SurfaceConfig
from fastgen.config.surroundings import GroundConfig, PlacementConfig
from fastgen.config.yaml_values import loaded_file
from fastgen.errors import ConfigError, shown
from fastgen.scene.container_kinds import KINDS, WallProfiles
from fastgen.scene.limits import GAP_LIMITS_MM, ILLUMINANCE_LIMITS_LX
from fastgen.validation import (
    Bounds,
    Matching,
    OneOf,
    Range,
    Share,
    check_weights,
    from_plain,
    to_plain,
)

PRESET_KEY = "preset"
"""Key of a file or mapping that names the preset to start from."""

_CameraName = Annotated[
    str,
    Matching(
        "[A-Za-z0-9_-]{1,64}",
        "is not a camera name; it is used in file names, so give up to 64 letters, digits, - and _",
    ),
]

_FUNCTION = Matching(
    r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*:[A-Za-z_]\w*|",
    "is not a function; write package.module:function",
)


@dataclass(frozen=True)
class ContainerConfig:
    """Container kinds and their corrugation.

    Attributes:
        kinds: Relative frequency of each kind.
        depth_scale: Factors of the corrugation depth; all are equally likely. This is a list and
            not a range because each factor needs a mesh of its own. Depths that do not fit the
            frame are refused.
        absent: Share of scenes without a container. They show only the panorama and the ground,
            without a spreader, and have no labels.
    """

    kinds: dict[Annotated[str, OneOf(tuple(KINDS))], Weight] = field(
        default_factory=lambda: {"20": 0.3, "40": 0.25, "40HC": 0.35, "45HC": 0.1}
    )
    profiles: WallProfiles = field(default_factory=WallProfiles)
    depth_scale: Annotated[tuple[Annotated[float, Bounds(0.2, 3.0)], ...], MinLen(1)] = (0.95, 1.06)
    absent: Share = 0.0

    def __post_init__(self) -> None:
        """Refuse kinds without any weight, and depths that do not fit the frame."""
        check_weights("kinds", self.kinds.values())
        for i, scale in enumerate(self.depth_scale):
            try:
                self.profiles.deepened(scale)
            except ConfigError as error:
                raise ConfigError(f"depth_scale[{i}]: {error}") from None


@dataclass(frozen=True)
class EnvironmentConfig:
    """The panorama and its light.

    Attributes:
        names: HDRIs to draw from, all equally likely, by file name without extension; assets/hdri
            has the bundled ones. If the list is empty, all HDRIs of --hdri are used. Without
            --hdri these are the bundled ones except interiors, ports more often than others.
        weights: Relative frequency of HDRIs, by name. 0 excludes one, even if names lists it; some
            presets exclude HDRIs. HDRIs that are not listed keep their default frequency. Names of
            HDRIs that are not available have no effect.
        yaw_deg: Rotation of the environment about the vertical.
        illuminance_lx: Light on level ground under the sky of an HDRI, by its name, for cameras
            with a meter (sensor.meter). Bundled HDRIs that are not listed have the estimates of
            assets/hdri/index.json, and other HDRIs 10,000 lx, which is an overcast day. Names of
            HDRIs that are not available have no effect.
        lamps: Floodlights in dark scenes.
    """

    names: tuple[str, ...] = ()
    weights: dict[str, Weight] = field(default_factory=dict)
    yaw_deg: Annotated[Range, Bounds(-360.0, 360.0, "degrees")] = Range(0, 360)
    illuminance_lx: dict[str, Annotated[float, Bounds(*ILLUMINANCE_LIMITS_LX, "lx")]] = field(
        default_factory=dict
    )
    lamps: LampsConfig = field(default_factory=LampsConfig)


@dataclass(frozen=True)
class SplitConfig:
    """Shares of the scenes in each split. They are normalised to a sum of 1.

    Attributes:
        train: Share of the training split.
        val: Share of the validation split.
        test: Share of the test split.
    """

    train: Share = 0.7
    val: Share = 0.15
    test: Share = 0.15


@dataclass(frozen=True)
class SpreaderConfig:
    """Spreader of the crane that holds the container.

    Attributes:
        probability: Probability of a spreader; without one the container floats.
        colors: Colors of its paint; all are equally likely.
        flippers_down: Probability, for each side, that the gather guides are lowered.
        gap_mm: Distance from the castings to the spreader, rounded to 10 mm within the range.
    """

    probability: Share = 0.9
    colors: HexColors = ("#d9a514", "#e0b428", "#c9661b", "#b8321f", "#a8541c", "#8f9396")
    flippers_down: Share = 0.6
    gap_mm: Annotated[Range, Bounds(*GAP_LIMITS_MM, "mm")] = Range(10, 30)


@dataclass(frozen=True)
class SealsConfig:
    """Bolt and cable seals at the hasps of the door.

    Attributes:
        probability: Probability that a container carries seals.
        second: Probability that a container with seals has two, at different hasps.
        hanging: Share of the seals that hang open.
        kinds: Relative frequency of each kind.
        colors: Colors of the plastic; all are equally likely.
    """

    probability: Share = 0.0
    second: Share = 0.25
    hanging: Share = 0.15
    kinds: dict[Annotated[str, OneOf(("bolt", "cable"))], Weight] = field(
        default_factory=lambda: {"bolt": 0.7, "cable": 0.3}
    )
    colors: HexColors = ("#e3b013", "#e9e9e4", "#1f7a3d", "#c02a22", "#1f4fa0", "#d8661c")

    def __post_init__(self) -> None:
        """Refuse kinds without any weight."""
        check_weights("kinds", self.kinds.values())


@dataclass(frozen=True)
class LabelConfig:
    """Treatment of objects that are hard to see.

    Attributes:
        min_visible_px: Objects with fewer visible pixels are marked as ignored. Formats with ignore
            regions list them as such; other formats leave them out.
        min_visible_fraction: Objects with a smaller visible fraction are ignored as well. The
            fraction is relative to their pixels if nothing hid them, or to the pixels of the image
            if these are fewer. In fog, pixels beyond the visibility count as hidden for both.
        min_text_px: Height below which a text is not a legible crop.
        background: Containers of the panorama, which are known in the bundled ports. "ignore" marks
            them as ignored, "label" labels them as containers, "none" leaves them out, as the paper
            does.
    """

    min_visible_px: Annotated[int, Bounds(1, 1e6, "pixels")] = 12
    min_visible_fraction: Share = 0.05
    min_text_px: Annotated[float, Bounds(1.0, 1e4, "pixels")] = 10.0
    background: Annotated[str, OneOf(("ignore", "label", "none"))] = "none"


@dataclass(frozen=True)
class Config:
    """All parameters of a distribution of scenes and of the labels made from them.

    Attributes:
        cameras: Rig of cameras by name. A file that has this key gives the whole rig; a camera with
            the name of one of the preset's inherits what the file leaves out.
        postprocess: Function that changes every finished sample, as package.module:function; empty
            for none. It takes the sample and a NumPy random generator, and returns a Sample.
    """

    container: ContainerConfig = field(default_factory=ContainerConfig)
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)
    markings: MarkingsConfig = field(default_factory=MarkingsConfig)
    damage: DamageConfig = field(default_factory=DamageConfig)
    spreader: SpreaderConfig = field(default_factory=SpreaderConfig)
    seals: SealsConfig = field(default_factory=SealsConfig)
    placement: PlacementConfig = field(default_factory=PlacementConfig)
    ground: GroundConfig = field(default_factory=GroundConfig)
    environment: EnvironmentConfig = field(default_factory=EnvironmentConfig)
    cameras: Annotated[dict[_CameraName, CameraConfig], MinLen(1)] = field(
        default_factory=seafront_rig
    )
    sensor: SensorConfig = field(default_factory=SensorConfig)
    weather: WeatherConfig = field(default_factory=WeatherConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)
    split: SplitConfig = field(default_factory=SplitConfig)
    postprocess: Annotated[str, _FUNCTION] = ""

    def __post_init__(self) -> None:
        """Refuse splits without shares, camera names that differ only in case, and lone twins."""
        if self.split.train + self.split.val + self.split.test <= 0:
            raise ConfigError("split: all shares are 0; give at least one above 0")
        taken: dict[str, str] = {}
        for name in self.cameras:
            alike = taken.setdefault(name.casefold(), name)
            if alike != name:
                raise ConfigError(
                    f"cameras.{name}: its files would be those of {alike} on disks that ignore "
                    "case; rename one"
                )
        others = {kind for kind, weight in self.container.kinds.items() if weight > 0} - {"20"}
        if self.placement.chosen == {"twin"} and others:
            raise ConfigError(
                "placement.arrangements: only twin has a weight, and twins are 20-foot containers; "
                f"give another arrangement a weight, or take {', '.join(sorted(others))} out of "
                "container.kinds"
            )

    @staticmethod
    def preset(name: str = DEFAULT_PRESET) -> "Config":
        """Return a configuration to start from.

        Args:
            name: Name of a preset of fastgen or of an installed package, or the path of a file for
                `load`, which ends in .yaml, .yml or .json.

        Raises:
            ConfigError: for an unknown name, suggesting the nearest one, or an unusable file.
        """
        return _start(name, Path(), ())

    @staticmethod
    def checked(config: Any) -> "Config":
        """Return a validated copy of a Config made in Python, or the preset for None.

        Args:
            config: A Config, whose values may be of other types or out of range, or None.

        Raises:
            ConfigError: naming the field that does not fit.
        """
        if config is None:
            return Config.preset()
        if not isinstance(config, Config):
            raise ConfigError(
                f"config: {type(config).__name__} is not a Config; use Config.preset, Config.load "
                "or Config.from_values"
            )
        return _with_room(from_plain(Config, config))

    @staticmethod
    def from_values(data: Any, base: "Config | None" = None) -> "Config":
        """Return `base` with the values that `data` changes.

        Args:
            data: Mapping of plain values, as in a file; see `load`.
            base: Values of everything that `data` leaves out. None stands for the preset that
                `data` names with the key `preset`, or else for seafront.

        Raises:
            ConfigError: naming the key or value that does not fit.
        """
        return _merged(data, base, Path(), ())

    @staticmethod
    def load(path: str | Path, base: "Config | None" = None) -> "Config":
        """Return `base` with the values that a file changes.

        A mapping such as `cameras` or `surface.colors` is replaced as a whole, so that a port can
        describe its own rig. A camera with the name of one of the base's inherits from it what the
        file leaves out.

        Args:
            path: YAML or JSON file of at most yaml_values.LONGEST_FILE bytes.
            base: Values of everything that the file leaves out. None stands for the preset that
                the file names with the key `preset`, or else for seafront.

        Raises:
            ConfigError: naming the file and the key or value that does not fit.
        """
        return _from_file(Path(path) if isinstance(path, str) else path, base, ())

    @property
    def classes(self) -> dict[str, tuple[str, ...]]:
        """Class names in label order by name of the task whose list the configuration decides."""
        return {
            "damage": self.damage.segmentation_classes,
            "imdg": self.markings.detection_classes,
        }

    def to_plain(self) -> dict[str, Any]:
        """Return the configuration as plain values, ready for JSON or YAML."""
        plain: dict[str, Any] = to_plain(self)
        return plain


def _with_room(config: Config) -> Config:
    """Return `config` if no camera can be too close to a container."""
    kinds = [kind for kind, weight in config.container.kinds.items() if weight > 0]
    for name, rig in config.cameras.items():
        check_room(name, rig, kinds, config.damage.bulge_mm)
        check_above_ground(name, rig, config.placement.grounded, config.damage.bulge_mm)
    return config


def _start(name: Any, folder: Path, seen: tuple[Path, ...]) -> Config:
    """Return the preset called `name`, or the configuration in the file with this path.

    Args:
        name: Name or path, the latter relative to `folder`.
        folder: Folder of the file that names it.
        seen: Files that start from this one.
    """
    if isinstance(name, str) and name.lower().endswith((".yaml", ".yml", ".json")):
        return _from_file(folder / name, None, seen)
    preset = preset_named(name)
    try:
        return _merged(preset.values, Config(), Path(), seen)
    except ConfigError as error:  # of another package
        raise ConfigError(f"preset {name}: {error}") from None


def _from_file(path: Path, base: Config | None, seen: tuple[Path, ...]) -> Config:
    data = loaded_file(path)
    if not isinstance(data, Mapping | None):
        raise ConfigError(
            f"{path}: holds {shown(data)}; give keys with their values, as in "
            "damage: {probability: 0.5}"
        )
    try:
        place = path.resolve()
        if place in seen:
            raise ConfigError("preset: the file starts from itself; name another preset")
        return _merged({} if data is None else data, base, path.parent, (*seen, place))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _merged(data: Any, base: Config | None, folder: Path, seen: tuple[Path, ...]) -> Config:
    """Return `base`, or the preset that `data` names, with the values that `data` changes.

    Paths in `data` are relative to `folder`.
    """
    if not isinstance(base, Config | None):
        raise ConfigError(f"base: {base!r} is not a Config; take one from Config.preset")
    if isinstance(data, Mapping) and PRESET_KEY in data:
        if base is not None:
            raise ConfigError(
                f"{PRESET_KEY}: is allowed only in the first configuration; remove this key, or "
                "remove the other one (--preset, an earlier --config, base)"
            )
        base = _start(data[PRESET_KEY], folder, seen)
        data = {key: value for key, value in data.items() if key != PRESET_KEY}
    if base is None:
        base = Config.preset()
    if isinstance(data, Mapping) and isinstance(data.get("cameras"), Mapping):
        data = {**data, "cameras": with_focal_lengths(data["cameras"], base.cameras, folder)}
    return _with_room(from_plain(Config, data, base=base, folder=folder))

"""Config: every parameter of the distributions that scenes are drawn from, validated, with units.

A preset is a Config made here; a YAML or JSON file changes single values of it. Ranges are drawn
uniformly unless their docstring says otherwise. Lengths are millimetres, angles degrees, colours
sRGB hex in files (people pick them on screens) and linear albedo in scenes.
"""

import re
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from fastgen import srgb
from fastgen.config.cameras import CameraConfig, check_room, seafront_rig
from fastgen.config.damage import DamageConfig
from fastgen.config.markings import MarkingsConfig
from fastgen.config.sensor import SensorConfig, WeatherConfig
from fastgen.config.yaml_values import loaded
from fastgen.errors import ConfigError
from fastgen.scene.container_kinds import KINDS, WallProfiles
from fastgen.scene.limits import GAP_LIMITS_MM, MIN_ROUGHNESS
from fastgen.validation import UNIT, Range, bounds, check_known, from_plain, to_plain

REACH = bounds(1.0, 1e6, "mm")
"""What falls off over a reach is divided by it."""

ROUGHNESS = bounds(MIN_ROUGHNESS, 1.0)


@dataclass(frozen=True)
class SurfaceConfig:
    """Paint and its ageing, SeaFront paper, section 3.2; one block of ranges per layer of Fig. 5.

    colors: of sound paint, by a name of your own, each as likely as any other.
    roughness: of sound paint; GGX, perceptual.
    tone_variation: how much the paint's tone varies over a side.
    ageing_strength: of the darkening toward the corners of each panel.
    ageing_reach_mm: how far from a corner it reaches.
    dirt_strength: of the deposit along edges.
    dirt_reach_mm: how far from an edge it reaches.
    dirt_color: of that deposit.
    rust_coverage: share of the sheet that is rusty, its runs not counted; squared in the draw, so
        that low ones prevail.
    rust_scale_mm: size of the patches.
    rust_colors: each as likely as any other.
    rust_roughness: GGX, perceptual.
    scratch_coverage: share of the sheet under fine bright scratches; above 0.1 no more is seen.
    wear_strength: how unevenly the paint reflects.
    wear_scale_mm: size of the noise of wear, scratches and dirt.
    """

    colors: dict[str, str] = field(
        default_factory=lambda: {
            "oxide red": "#6b2a22",
            "maroon": "#57202a",
            "rust brown": "#6e3b26",
            "signal blue": "#1f4e84",
            "navy": "#1c2c48",
            "sky blue": "#4a86ad",
            "turquoise": "#24777a",
            "sea green": "#2a6650",
            "leaf green": "#3c7a45",
            "olive": "#5a5d3c",
            "traffic orange": "#c4561f",
            "amber": "#d08a22",
            "cream": "#c9bfa2",
            "light grey": "#a3a6a6",
            "mid grey": "#6d7276",
            "white": "#d2d3ce",
            "magenta": "#9a2b62",
            "charcoal": "#3a3d40",
        }
    )
    roughness: Range = field(default=Range(0.38, 0.62), metadata=ROUGHNESS)
    tone_variation: Range = field(default=Range(0.02, 0.12), metadata=UNIT)
    ageing_strength: Range = field(default=Range(0.1, 0.6), metadata=UNIT)
    ageing_reach_mm: Range = field(default=Range(300, 1100), metadata=REACH)
    dirt_strength: Range = field(default=Range(0.05, 0.55), metadata=UNIT)
    dirt_reach_mm: Range = field(default=Range(60, 320), metadata=REACH)
    dirt_color: str = "#a8a59c"
    rust_coverage: Range = field(default=Range(0.0, 0.12), metadata=UNIT)
    rust_scale_mm: Range = field(default=Range(500, 1400), metadata=bounds(50, 1e5, "mm"))
    rust_colors: tuple[str, ...] = ("#6b3a1c", "#7d4a20", "#5a2f1b", "#8a5425")
    rust_roughness: Range = field(default=Range(0.8, 0.95), metadata=ROUGHNESS)
    scratch_coverage: Range = field(default=Range(0.0, 0.003), metadata=UNIT)
    wear_strength: Range = field(default=Range(0.1, 0.6), metadata=UNIT)
    wear_scale_mm: Range = field(default=Range(700, 2500), metadata=bounds(50, 1e5, "mm"))

    def __post_init__(self) -> None:
        """Refuse what are no colors."""
        for name, color in self.colors.items():
            linear_color(color, f"colors.{name}")
        if not self.colors:
            raise ConfigError("colors: none is given; give at least one, as in {red: '#6b2a22'}")
        _check_colors("rust_colors", self.rust_colors)
        linear_color(self.dirt_color, "dirt_color")


@dataclass(frozen=True)
class ContainerConfig:
    """Which containers come, and how much their corrugation differs from the nominal profile.

    kinds: weight of 20, 40, 40HC and 45HC in the draw.
    depth_scale: factors of the corrugations' depth, each as likely as any other; no range, as every
        one is a mesh of its own. What does not fit the frame then is refused.
    """

    kinds: dict[str, float] = field(
        default_factory=lambda: {"20": 0.3, "40": 0.25, "40HC": 0.35, "45HC": 0.1},
        metadata=bounds(0.0, 1e6),
    )
    profiles: WallProfiles = field(default_factory=WallProfiles)
    depth_scale: tuple[float, ...] = field(default=(0.95, 1.06), metadata=bounds(0.2, 3.0))

    def __post_init__(self) -> None:
        """Hold weights and depths to what can be drawn and built."""
        for kind in self.kinds:
            check_known("kinds", kind, KINDS)
        if sum(self.kinds.values()) <= 0:
            raise ConfigError("kinds: all weights are 0; give at least one above 0")
        if not self.depth_scale:
            raise ConfigError("depth_scale: the list is empty; give at least one, as in [1.0]")
        for i, scale in enumerate(self.depth_scale):
            try:
                self.profiles.deepened(scale)
            except ConfigError as error:
                raise ConfigError(f"depth_scale[{i}]: {error}") from None


@dataclass(frozen=True)
class EnvironmentConfig:
    """The light.

    names: HDRIs to choose from, all alike, by file name without ending; those that are bundled lie
        in assets/hdri. Without names all that --hdri finds come, or of the bundled ones all but the
        interiors, ports more often than others.
    yaw_deg: how the environment is turned about the vertical.
    """

    names: tuple[str, ...] = ()
    yaw_deg: Range = field(default=Range(0, 360), metadata=bounds(-360.0, 360.0, "degrees"))


@dataclass(frozen=True)
class SplitConfig:
    """Fractions of the scenes that go to each part; they are normalised to sum to 1.

    train: to learn from.
    val: to choose by.
    test: to report on.
    """

    train: float = field(default=0.7, metadata=UNIT)
    val: float = field(default=0.15, metadata=UNIT)
    test: float = field(default=0.15, metadata=UNIT)


@dataclass(frozen=True)
class SpreaderConfig:
    """How often a container hangs on a crane's spreader, and what that looks like.

    probability: of a spreader; the container floats without.
    colors: of its paint, each as likely as any other.
    flippers_down: probability of each side that its gather guides are lowered.
    gap_mm: from the castings to the spreader, rounded to 10 mm within the range.
    """

    probability: float = field(default=0.9, metadata=UNIT)
    colors: tuple[str, ...] = ("#d9a514", "#e0b428", "#c9661b", "#b8321f", "#a8541c", "#8f9396")
    flippers_down: float = field(default=0.6, metadata=UNIT)
    gap_mm: Range = field(default=Range(10, 30), metadata=bounds(*GAP_LIMITS_MM, "mm"))

    def __post_init__(self) -> None:
        """Refuse what are no colors."""
        _check_colors("colors", self.colors)


@dataclass(frozen=True)
class LabelConfig:
    """What becomes of objects that are hard to see.

    min_visible_px: objects with fewer visible pixels are marked ignored: formats with ignore
        regions list them as such, others leave them out.
    min_visible_fraction: so are those with a smaller visible part of what they would cover alone.
    min_text_px: height below which a text is no legible crop.
    """

    min_visible_px: int = field(default=12, metadata=bounds(1, 1e6, "pixels"))
    min_visible_fraction: float = field(default=0.05, metadata=UNIT)
    min_text_px: float = field(default=10.0, metadata=bounds(1.0, 1e4, "pixels"))


@dataclass(frozen=True)
class Config:
    """All that decides a distribution of scenes and the labels made from them.

    cameras: the rig, by names of your own. What is given is all of it; a camera named as one of the
        preset's inherits what is left out.
    """

    container: ContainerConfig = field(default_factory=ContainerConfig)
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)
    markings: MarkingsConfig = field(default_factory=MarkingsConfig)
    damage: DamageConfig = field(default_factory=DamageConfig)
    spreader: SpreaderConfig = field(default_factory=SpreaderConfig)
    environment: EnvironmentConfig = field(default_factory=EnvironmentConfig)
    cameras: dict[str, CameraConfig] = field(default_factory=seafront_rig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    weather: WeatherConfig = field(default_factory=WeatherConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)
    split: SplitConfig = field(default_factory=SplitConfig)

    def __post_init__(self) -> None:
        """Hold values to the choices that no single bound can express."""
        if not self.cameras:
            raise ConfigError("cameras: the rig is empty; describe at least one camera")
        taken: dict[str, str] = {}
        for name in self.cameras:
            if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
                raise ConfigError(
                    f"cameras.{name!r}: they name files; use up to 64 letters, digits, - and _"
                )
            alike = taken.setdefault(name.casefold(), name)
            if alike != name:
                raise ConfigError(
                    f"cameras.{name}: its files would be those of {alike} on disks that do not "
                    "tell capitals from small letters; rename one"
                )
        if self.split.train + self.split.val + self.split.test <= 0:
            raise ConfigError("split: all fractions are 0; give at least one above 0")

    @staticmethod
    def preset(name: str = "seafront") -> "Config":
        """A named starting point. Raises ConfigError with the nearest name for an unknown one."""
        check_known("preset", name, tuple(PRESETS))
        return from_plain(Config, PRESETS[name], base=Config())

    @staticmethod
    def checked(config: Any) -> "Config":
        """`config` held to the bounds that files are held to, the preset in place of None.

        Raises ConfigError naming the field that does not fit: Python checks no types.
        """
        if config is None:
            return Config.preset()
        if not isinstance(config, Config):
            raise ConfigError(
                f"config: {type(config).__name__} is no Config; take Config.preset, Config.load "
                "or Config.from_values"
            )
        return Config.from_values(config.to_plain())

    @staticmethod
    def from_values(data: Any, base: "Config | None" = None) -> "Config":
        """Plain values, as a file holds them, over `base` (default: seafront); see `load`."""
        if not isinstance(base, Config | None):
            raise ConfigError(f"base: {base!r} is no Config; take what Config.preset gives")
        made = from_plain(Config, data, base=Config.preset() if base is None else base)
        kinds = [kind for kind, weight in made.container.kinds.items() if weight > 0]
        for name, rig in made.cameras.items():
            check_room(name, rig, kinds, made.damage.bulge_mm)
        return made

    @staticmethod
    def load(path: str | Path, base: "Config | None" = None) -> "Config":
        """Read a YAML or JSON file whose values replace those of `base` (default: seafront).

        A mapping such as `cameras` or `surface.colors` is replaced as a whole, so a port describes
        its own rig; a camera named as one of the base's inherits what the file leaves out.
        Raises ConfigError naming the file and the key or value that does not fit.
        """
        try:
            data = loaded(Path(path).read_text(encoding="utf-8"))
        except (OSError, TypeError) as error:
            words = error.strerror if isinstance(error, OSError) else "give a path"
            raise ConfigError(f"{path}: cannot be read ({words})") from None
        except (yaml.YAMLError, ValueError, RecursionError) as error:  # a date that is none
            raise ConfigError(f"{path}: not a YAML file ({' '.join(str(error).split())})") from None
        if not isinstance(data, Mapping | None):
            raise ConfigError(
                f"{path}: holds {reprlib.repr(data)}; give keys with their values, as in "
                "damage: {probability: 0.5}"
            )
        try:
            return Config.from_values({} if data is None else data, base)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from None

    def to_plain(self) -> dict[str, Any]:
        """The configuration as plain values, ready for JSON or YAML."""
        plain: dict[str, Any] = to_plain(self)
        return plain


PRESETS: dict[str, dict[str, Any]] = {
    "seafront": {},
    # as cameras on cranes deliver: wide lenses, weather, and what electronics do to an image
    "crane": {
        "cameras": {
            "A": {
                "focal_mm": 22.0,
                "lens": {"model": "fisheye", "k1": [-0.035, -0.005], "k2": [0.0, 0.006]},
            },
            "B": {
                "lens": {"k1": [-0.24, -0.16], "k2": [0.03, 0.07], "p1": [-1e-3, 1e-3]},
            },
            "Cl": {"lens": {"k1": [-0.14, -0.06], "p2": [-1e-3, 1e-3]}},
            "Cr": {"lens": {"k1": [-0.14, -0.06], "p2": [-1e-3, 1e-3]}},
        },
        "sensor": {
            "defocus": {"probability": 0.15},
            "motion": {"probability": 0.25},
            "vignetting": [0.0, 0.5],
            "exposure_error_ev": [-0.7, 0.7],
            "white_balance_ev": [-0.15, 0.15],
            "noise": {"probability": 0.9},
            "stamp": {"probability": 0.3},
            "jpeg_quality": [45, 92],
        },
        "weather": {
            "fog_probability": 0.12,
            "rain_probability": 0.15,
            "wet_probability": 0.1,
        },
    },
}


def linear_color(text: str, path: str = "color") -> tuple[float, float, float]:
    """Linear Rec.709 albedo of an sRGB hex color such as '#1f4e84'.

    Raises ConfigError naming `path` when the text is no color.
    """
    digits = text.removeprefix("#")
    if not re.fullmatch(r"[0-9a-fA-F]{6}", digits):
        raise ConfigError(f"{path}: {text!r} is not a color; write it as '#rrggbb'")
    red, green, blue = (srgb.linear(code / 255) for code in bytes.fromhex(digits))
    return red, green, blue


def _check_colors(name: str, colors: tuple[str, ...]) -> None:
    if not colors:
        raise ConfigError(f"{name}: the list is empty; give at least one color")
    for i, color in enumerate(colors):
        linear_color(color, f"{name}[{i}]")

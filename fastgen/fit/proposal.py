"""Proposal of a configuration for a folder of photographs: measure, search, and check."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from fastgen.config.config import Config
from fastgen.config.yaml_values import Dumper
from fastgen.cpus import usable_cpus
from fastgen.errors import AssetError
from fastgen.fit.boxes import BoxHeights, camera_distances
from fastgen.fit.frames import light_class, light_shares, linear_frames
from fastgen.fit.gap import FEWEST, Gap, gap
from fastgen.fit.paints import paint_weights
from fastgen.fit.photographs import Photograph
from fastgen.fit.search import Found, search
from fastgen.fit.space import changes_at
from fastgen.fit.statistics import NAMES, Pixels, measured
from fastgen.generator import Generator
from fastgen.sampling.scene import environment_weights

FEWEST_FOR_WEIGHTS = 5
"""Photographs below which weights of paints and environments stay as in the preset."""

TRIALS_PER_MINUTE = 60
"""Trials of 32 frames that two cores make in a minute. A constant, so that the result of a seed
does not depend on the machine."""

_CHECKED_FROM = 1_000_000
"""First scene of the pictures that the gap is reported for; the search does not see them."""

Array = NDArray[np.float64]
OnStep = Callable[[str, int, int, str], None]
"""Callback with the unit of a stage, the number done, the total, and a remark."""

_Item = TypeVar("_Item")


class Effort(NamedTuple):
    """Amount of rendering and searching.

    Attributes:
        trials: Trials of the search.
        frames: Scenes that the search uses.
        checked: Scenes that the gap before and after is measured on.
        size: (width, height) of the rendered pictures in pixels.
        quality: Quality of the rendered pictures.
    """

    trials: int
    frames: int = 32
    checked: int = 24
    size: tuple[int, int] = (320, 240)
    quality: str = "balanced"


class Proposal(NamedTuple):
    """Result of a fit.

    Attributes:
        values: Changes to the preset, nested as in a configuration file.
        reasons: What was measured, by dotted key of `values`.
        before: Gap of the preset.
        after: Gap of the proposed configuration, on other scenes than the search used.
        notes: What was left as it is, and why.
    """

    values: dict[str, Any]
    reasons: dict[str, str]
    before: Gap
    after: Gap
    notes: list[str]

    def as_yaml(self, head: str) -> str:
        """Return the values as YAML that `Config.load` reads, with the reasons as comments.

        Args:
            head: Lines for the top of the file, without the comment sign.
        """
        lines = [f"# {line}" for line in head.splitlines()]
        lines += [f"# {note}" for note in self.notes]
        return "\n".join([*lines, *_lines(self.values, self.reasons)]) + "\n"


def propose(
    photographs: Sequence[Photograph],
    preset: Config,
    effort: Effort,
    seed: int = 0,
    boxes: BoxHeights | None = None,
    on_step: OnStep = lambda unit, done, total, remark: None,
) -> Proposal:
    """Return the changes to a preset that bring rendered pictures closest to photographs.

    Args:
        photographs: The photographs, scaled to the resolution of the images to be made.
        preset: Configuration to start from.
        effort: Amount of rendering and searching.
        seed: Seed of scenes and optimizer; the same seed gives the same proposal.
        boxes: Heights of containers in photographs, if known.
        on_step: Called at the start of each stage, after each photograph, picture or scene, and
            after each generation of trials.

    Raises:
        AssetError: There are too few photographs.
    """
    if len(photographs) < FEWEST:
        raise AssetError(
            f"photographs: {len(photographs)} are too few to compare; give at least {FEWEST}, or "
            "better 20"
        )
    values: dict[str, Any] = {}
    reasons: dict[str, str] = {}
    notes: list[str] = []
    with ThreadPoolExecutor(usable_cpus()) as workers:
        statistics = workers.map(lambda each: measured(each.pixels), photographs)
        real = np.array(_reported(statistics, "photographs", len(photographs), on_step))
    unit = "pictures of the preset"
    ours = _reported(_pictures(preset, effort, seed), unit, effort.checked, on_step)
    before = gap(real, np.array([measured(each) for each in ours]))

    many = len(photographs) >= FEWEST_FOR_WEIGHTS
    if not many:
        notes.append(
            f"{len(photographs)} photographs are too few for weights of paints and environments; "
            f"they stay as in the preset. {FEWEST_FOR_WEIGHTS} are enough, 20 are better."
        )
    else:
        pixels = [each.pixels for each in photographs]
        values["surface"] = {"color_weights": paint_weights(preset.surface, pixels, ours)}
        reasons["surface.color_weights"] = "share of each paint among coloured pixels"
    if boxes:
        values["cameras"], reasons["cameras"] = camera_distances(preset, boxes)
    base = Config.from_values(values, preset)

    with Generator(base, seed, size=effort.size, quality=effort.quality) as generator:
        rendered = linear_frames(generator, effort.frames)
        frames = _reported(rendered, "scenes for the search", effort.frames, on_step)
        available = generator.environments
    shares = light_shares(base, available) if many else {}
    on_step("trials", 0, effort.trials, "")
    found = search(
        real,
        frames,
        base.sensor,
        shares,
        effort.trials,
        seed,
        lambda done, best: on_step("trials", done, effort.trials, f"smallest gap {best:.3f}"),
    )
    sensor = changes_at(found.point, base.sensor)
    if sensor:
        values["sensor"] = sensor
        reasons |= _sensor_reasons(sensor, real)
    if len(found.shares) > 1:
        _add_environments(values, reasons, base, available, found)
    config = Config.from_values(values, preset)
    unit = "pictures of the proposal"
    fitted = _reported(_pictures(config, effort, seed), unit, effort.checked, on_step)
    after = gap(real, np.array([measured(each) for each in fitted]))
    return Proposal(values, reasons, before, after, notes)


def _reported(items: Iterable[_Item], unit: str, total: int, on_step: OnStep) -> list[_Item]:
    """Return items as a list after reporting each as done."""
    found = []
    on_step(unit, 0, total, "")
    for item in items:
        found.append(item)
        on_step(unit, len(found), total, "")
    return found


def _pictures(config: Config, effort: Effort, seed: int) -> Iterator[Pixels]:
    """Yield pictures as a dataset would have them; cameras take turns."""
    cameras = list(config.cameras)
    with Generator(config, seed, size=effort.size, quality=effort.quality) as generator:
        for k in range(effort.checked):
            yield generator.render(_CHECKED_FROM + k, cameras[k % len(cameras)]).image


def _add_environments(
    values: dict[str, Any],
    reasons: dict[str, str],
    base: Config,
    available: Mapping[str, float],
    found: Found,
) -> None:
    """Add weights of HDRIs that give each class of light its share."""
    old = light_shares(base, available)
    weights = {
        name: float(f"{weight * found.shares[light_class(name)] / old[light_class(name)]:.3g}")
        for name, weight in environment_weights(base, available).items()
        if weight > 0
    }
    values["environment"] = {"weights": weights}
    reasons["environment.weights"] = ", ".join(
        f"{light} {share:.0%} (preset {old[light]:.0%})" for light, share in found.shares.items()
    )


_MEASURED_BY = {
    "exposure_error_ev": ("luminance, 50 %",),
    "white_balance_ev": ("red over green", "blue over green"),
    "response": ("clipped share", "contrast", "saturation, 50 %"),
    "noise": ("noise",),
    "chroma_noise": ("chroma noise",),
    "sharpening": ("overshoot of edges",),
    "defocus": ("edge blur",),
    "vignetting": ("corner light",),
    "jpeg_quality": ("blockiness",),
}
"""Statistics that say most about each key of `sensor`."""


def _sensor_reasons(sensor: Mapping[str, Any], real: Array) -> dict[str, str]:
    """Return the median of the statistics in the photographs that each key answers to."""
    found = {}
    for key in sensor:
        named = {name: real[:, NAMES.index(name)] for name in _MEASURED_BY[key]}
        known = {name: values[np.isfinite(values)] for name, values in named.items()}
        found[f"sensor.{key}"] = "photographs: " + ", ".join(
            f"{name} {np.median(values):.2f}" for name, values in known.items() if len(values)
        )
    return found


def _lines(values: Mapping[str, Any], reasons: Mapping[str, str], path: str = "") -> Iterator[str]:
    """Yield the lines of nested values, each reason above its key."""
    depth = "  " * path.count(".")
    for key, value in values.items():
        where = f"{path}{key}"
        if where in reasons:
            yield f"{depth}# {reasons[where]}"
        name = yaml.dump(key, Dumper=Dumper).split("\n")[0]
        if isinstance(value, Mapping) and value:
            yield f"{depth}{name}:"
            yield from _lines(value, reasons, f"{where}.")
        else:
            text = yaml.dump(value, Dumper=Dumper, default_flow_style=True, width=10_000)
            yield f"{depth}{name}: {text.removesuffix('...' + chr(10)).strip()}"

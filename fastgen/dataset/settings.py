"""Checks of a job before it runs, and its settings as dataset.json stores them."""

import importlib.util
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from fastgen.config.config import Config, SplitConfig
from fastgen.dataset.dataset_json import WITHOUT_KEY, unsealed
from fastgen.dataset.job import COCO_MASKS, LAYOUTS, STEMS, Job
from fastgen.dataset.progress import Progress
from fastgen.dataset.seal import digest
from fastgen.errors import ConfigError, nearest
from fastgen.formats.registry import formats_of
from fastgen.light.container_map import load_container_map
from fastgen.light.environment import load_environment
from fastgen.light.hdri import find_hdris
from fastgen.postprocess import source_hash
from fastgen.sampling.scene import SPLITS
from fastgen.validation import check_known

_MOST = 10**9
"""Limit of counts. Epochs of fastgen.torch also have this many scene indices."""


def settled(job: Job, worker_count: int) -> tuple[Job, dict[str, Any]]:
    """Check a job and complete it.

    Returns:
        The job with its settings_digest, and the settings that decide its samples as JSON values.

    Raises:
        ConfigError: A value is not valid.
        AssetError: An HDRI cannot be read.
    """
    _check(job, worker_count)
    settings = _settings(job)
    return replace(job, settings_digest=digest(unsealed(settings))), settings


def check_count(name: str, value: int) -> None:
    """Raise ConfigError that names `name` unless `value` is in 1 to 10^9."""
    if not 1 <= value <= _MOST:
        raise ConfigError(f"{name}: {value} is out of range; give 1 to {_MOST}")


def parse_split(text: str | None, config: Config) -> Config:
    """Return `config` with the option --split applied.

    Args:
        text: A split that gets all scenes, three fractions "TRAIN,VAL,TEST", or None for no change.
        config: The configuration.

    Raises:
        ConfigError: `text` is neither.
    """
    if text is None:
        return config
    shares = {name: float(name == text) for name in SPLITS}
    if text not in SPLITS:
        parts = text.split(",")
        try:
            values = [float(part) for part in parts]
        except ValueError:
            raise ConfigError(f"split: {text!r} is unknown{nearest(text, SPLITS)}") from None
        if len(values) != 3 or min(values) < 0 or max(values) > 1 or sum(values) <= 0:
            raise ConfigError(
                f"split: {text!r}: give three fractions of 0 to 1, as in 0.7,0.15,0.15"
            )
        shares = dict(zip(SPLITS, values, strict=True))
    plain = config.to_plain()
    return Config.from_values({**plain, "split": asdict(SplitConfig(**shares))})


def _check(job: Job, worker_count: int) -> None:
    check_count("images", job.images)
    check_count("workers", worker_count)
    check_count("shard", job.scenes_per_shard)
    check_known("format", job.layout, LAYOUTS)
    for name in job.cameras:
        check_known("cameras", name, job.config.cameras)
    if len(set(job.cameras)) != len(job.cameras):
        raise ConfigError("cameras: a name occurs twice; give each only once")
    if job.layout == "parquet" and importlib.util.find_spec("pyarrow") is None:
        raise ConfigError("format: parquet needs pyarrow: pip install 'fastgen[parquet]'")
    check_known("stems", job.stems, STEMS)
    check_known("coco_masks", job.coco_masks, COCO_MASKS)
    if not job.tasks:
        raise ConfigError("tasks: no task is named; give at least one")
    for option, names in (("tasks", job.tasks), ("also", job.also)):
        if len(set(names)) != len(names):
            raise ConfigError(f"{option}: a name occurs twice; give each only once")
        for each in formats_of(names, option):
            if job.layout != "seafront" and not each.fits_archives:
                raise ConfigError(
                    f"{option}: {each.name} keeps labels in files that cover all images, which the "
                    f"{job.layout} format does not have; leave it out (the json of each sample has "
                    "all labels), or use the seafront format"
                )
    for each in formats_of(job.formats):
        if each.builds_on and not set(each.builds_on) & set(job.formats):
            needed = ", ".join(each.builds_on)
            raise ConfigError(f"also: {each.name} adds files to other tasks; add one of {needed}")


def _load_all(hdris: Sequence[Path]) -> None:
    """Load the light and the container maps of all HDRIs.

    This reports a broken file now, and fills the cache. The first time takes seconds for each HDRI.
    """
    progress = Progress(len(hdris), unit="HDRIs")
    try:
        for path in hdris:
            load_environment(path)
            load_container_map(path)
            progress.add(1)
    finally:
        progress.close_if_drawn()


def _settings(job: Job) -> dict[str, Any]:
    from fastgen import __version__

    generator = job.generator()  # checks seed and lenses without opening GL
    generator.scene(0)  # some values are refused only by sampling: before anything is written
    if job.render.hdri_dir:
        _load_all(find_hdris(job.render.hdri_dir))
    settings = {
        "version": __version__,
        "format": job.layout,
        "formats": list(job.formats),
        "seed": job.seed,
        "size": list(job.render.size),
        "quality": job.render.quality,
        "cameras": list(job.cameras),
        "environments": generator.environment_record,
        "shard_scenes": job.scenes_per_shard,
        "classes": generator.config.classes,
        "config": generator.config.to_plain(),
    }
    name = generator.config.postprocess
    if name:
        settings["postprocess"] = {"function": name, "sha256": source_hash(name)}
    given = {"stems": job.stems, "coco_masks": job.coco_masks}
    settings |= {key: value for key, value in given.items() if value != WITHOUT_KEY[key]}
    plain: dict[str, Any] = json.loads(json.dumps(settings))
    return plain

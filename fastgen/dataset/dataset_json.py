"""dataset.json: the settings a dataset was made with and, once finished, the hashes of its files.

Shard manifests hold a hash of the same settings, so their run is known without dataset.json.
"""

import json
import re
import reprlib
from collections.abc import Iterator, Mapping
from typing import Any

from fastgen.dataset.job import STEM_PATTERN, Job, manifest_path, shard_of
from fastgen.dataset.manifest_types import Shard, parsed_json, unfit, unfit_finished
from fastgen.dataset.seal import digest, is_sealed
from fastgen.dataset.storage import Storage, UnreadableError
from fastgen.errors import OutputError, shown_name
from fastgen.render.settings import QUALITY

MANIFEST = "dataset.json"

WITHOUT_KEY = {"stems": "short", "coco_masks": "rle"}
"""Values of settings that are stored without their key, because the oldest datasets lack it."""

_words = reprlib.Repr()
_words.maxlist = _words.maxdict = 100  # cameras, formats, HDRIs: the last may be what differs

_MISSING = object()

_SHOWN = 10
"""Number of differing settings that an error message lists with their values."""

_LOOKED_AT = 100
"""Largest number of shard manifests that are read to guess settings."""

_OPTIONS = {
    "format": ("--format",),
    "formats": ("--tasks", "--also"),
    "seed": ("--seed",),
    "size": ("--size",),
    "quality": ("--quality",),
    "cameras": ("--cameras",),
    "environments": ("--hdri",),
    "shard_scenes": ("--shard",),
    "stems": ("--stems",),
    "coco_masks": ("--coco-masks",),
    "config": ("--preset", "--config", "--set"),
    "postprocess": ("--preset", "--config", "--set"),
    "classes": ("--preset", "--config", "--set"),
}
"""Options of `fastgen generate` that determine each setting."""


def unsealed(manifest: Mapping[str, Any]) -> bytes:
    """Return the text of a dataset.json whose run is not finished."""
    return json.dumps(manifest, indent=1).encode()


def existing(storage: Storage, job: Job, settings: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the dataset.json of a dataset that a job with these settings can continue.

    Returns:
        Its content, or None if the place is empty or only shard manifests show that it is the
        job's.

    Raises:
        OutputError: The place holds something else, or a dataset with other settings.
    """
    try:
        text = storage.read(MANIFEST)
        problem = f"{MANIFEST} is damaged"
    except FileNotFoundError:
        text, problem = b"", f"no {MANIFEST}"
    found = parsed(text)
    if found is not None and not any(_unlike(found, settings)):
        return found
    if found is not None and "merged_from" in found:
        raise OutputError(
            f"{job.out}: was merged from other datasets; extend those and merge them again, or "
            "give another folder"
        )
    if found is not None and "digest" in found:
        raise OutputError(_differ_message(job, settings, found))
    # an unfinished dataset.json can be edited unnoticed, so the shards' manifests decide
    manifests = (read_manifest(storage, number) for number in shard_numbers(storage))
    made_with = {manifest["settings"] for manifest in manifests if manifest is not None}
    if made_with == {job.settings_digest}:
        return None
    if found is not None and found.keys() | WITHOUT_KEY.keys() >= settings.keys():
        raise OutputError(_differ_message(job, settings, found))
    if made_with:
        for old in _likely_settings(storage, settings):
            if made_with == {digest(unsealed(old))}:
                raise OutputError(_differ_message(job, settings, old))
        raise OutputError(
            f"{job.out}: {problem}, and its shards were made with other settings; repeat all "
            "options of that run, --shard and --hdri too, to resume, or give another folder"
        )
    if any(not name.startswith(".") for name in storage.names()):
        raise OutputError(
            f"{job.out}: holds something else ({problem}); give an empty or new place"
        )
    return None


def _likely_settings(storage: Storage, settings: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield settings that the run may have had.

    Seed, size, cameras and scenes per shard are as its shards show them. Each quality is tried, and
    all other settings are as given.
    """
    manifests = (read_manifest(storage, shard) for shard in shard_numbers(storage)[:_LOOKED_AT])
    records = [(each["shard"], record) for each in manifests if each for record in each["records"]]
    stems = [(shard, re.fullmatch(STEM_PATTERN, record["stem"])) for shard, record in records]
    images = [(shard, int(stem["scene"]), stem["camera"]) for shard, stem in stems if stem]
    if not images:
        return
    seeds = [int(stem["seed"]) for _, stem in stems if stem and stem["seed"]]
    least = max(scene // (shard + 1) + 1 for shard, scene, _ in images)
    most = min((scene // shard for shard, scene, _ in images if shard), default=least)
    old = {
        **settings,
        "seed": seeds[0] if seeds else settings["seed"],
        "size": records[0][1]["size"],
        "cameras": list(dict.fromkeys(camera for *_, camera in images)),
    }
    for scenes in sorted({settings["shard_scenes"], least, most}):
        for quality in QUALITY:
            yield {**old, "shard_scenes": scenes, "quality": quality}


def shard_numbers(storage: Storage) -> list[int]:
    """Return the numbers of all shards that have a manifest, even a damaged one."""
    numbers = (shard_of(f"shards/{name}") for name in storage.names("shards"))
    return sorted(number for number in numbers if number is not None)


def read_manifest(storage: Storage, shard: int) -> dict[str, Any] | None:
    """Return a shard's manifest, or None if it has to be made again.

    None means missing, unreadable, changed, of another shard, or not in fastgen's format.
    """
    try:
        return shard_manifest(storage.read(manifest_path(shard)), shard)
    except (FileNotFoundError, UnreadableError):
        return None


def shard_manifest(text: bytes, shard: int) -> dict[str, Any] | None:
    """Return the content of a shard's manifest, or None as `read_manifest` does."""
    if not is_sealed(text) or unfit(text, Shard):
        return None
    manifest: dict[str, Any] = parsed_json(text)
    return manifest if manifest["shard"] == shard else None


def parsed(text: bytes) -> dict[str, Any] | None:
    """Return the content of a dataset.json, or None if it is damaged.

    A finished dataset has the key "digest".
    """
    try:
        content = parsed_json(text)
    except ValueError:
        return None
    if not isinstance(content, dict):
        return None
    damaged = "digest" in content and (not is_sealed(text) or unfit_finished(text))
    return None if damaged else content


def without_manifest(storage: Storage, out: str) -> OutputError:
    """Return the error for a place without a readable dataset.json."""
    again, other = "run generate again with the same settings", "give a dataset's folder"
    what = again if shard_numbers(storage) else other
    return OutputError(f"{out}: no readable {MANIFEST}; {what}")


def _same(old: Any, new: Any) -> bool:
    """Compare settings, including the order of keys, which decides what sampling draws."""
    return json.dumps(old) == json.dumps(new)


def _differ_message(job: Job, settings: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    unlike = [*_unlike(found, settings)]
    shown = [f"{name} was {before}, is now {now}" for name, before, now in unlike[:_SHOWN]]
    if len(unlike) > _SHOWN:
        shown.append(f"and {len(unlike) - _SHOWN} more")
    if "version" in found and not _same(found["version"], settings["version"]):
        how = f"install fastgen {shown_name(found['version'])} to resume"
    else:
        options = dict.fromkeys(each for name, *_ in unlike for each in _options(name))
        how = f"to resume, repeat the old {', '.join(options)}"
    return (
        f"{job.out}: was made with other settings ({'; '.join(shown)}); "
        f"{how}, or give another folder"
    )


def _unlike(
    found: Mapping[str, Any], settings: Mapping[str, Any]
) -> Iterator[tuple[str, str, str]]:
    """Yield name, old and new value of each setting of a dataset.json that differs."""
    for key in {**settings, **WITHOUT_KEY}:
        old, new = (each.get(key, WITHOUT_KEY.get(key, _MISSING)) for each in (found, settings))
        yield from _differences(key, old, new)


def _options(name: str) -> tuple[str, ...]:
    """Return the options that determine a setting."""
    if name.startswith("config.split"):
        return "--split", "--config", "--set"
    return _OPTIONS.get(name.split(".")[0], ())


def _in_words(value: Any) -> str:
    """Return a setting as short text; files in it are named by a hash of their content."""
    if value is _MISSING:
        return "missing"
    if isinstance(value, str) and value.startswith("data:"):
        return f"a file with the content {digest(value.encode())[:8]}"
    return _words.repr(value)


def _differences(name: str, old: Any, new: Any) -> Iterator[tuple[str, str, str]]:
    """Yield name, old and new value of each setting that differs."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            both = (each.get(key, _MISSING) for each in (old, new))
            yield from _differences(f"{name}.{key}", *both)
        if old.keys() != new.keys():
            return
        old, new = list(old), list(new)  # their order decides what sampling draws
    if old is _MISSING or new is _MISSING or not _same(old, new):
        before, now = (_in_words(each) for each in (old, new))
        yield name, before, now

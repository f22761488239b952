"""dataset.json: what a dataset was made with, and once it is finished the hashes of all of it.

Shards' manifests bear a hash of these settings too, so they can tell whose they are without it.
"""

import json
import reprlib
from collections.abc import Iterator, Mapping
from typing import Any

from fastgen.dataset.seal import is_sealed
from fastgen.dataset.shards import Job, manifest_path, shard_of
from fastgen.dataset.storage import Folder, Remote
from fastgen.errors import OutputError

MANIFEST = "dataset.json"

_words = reprlib.Repr()
_words.maxlist = _words.maxdict = 100  # cameras, formats, HDRIs: what differs may be the last

_MISSING = object()

_SHOWN = 4
"""Of settings that differ, so many are told with their values."""

_OPTIONS = {
    "format": ("--format",),
    "formats": ("--also",),
    "seed": ("--seed",),
    "size": ("--size",),
    "quality": ("--quality",),
    "cameras": ("--cameras",),
    "environments": ("--hdri",),
    "shard_scenes": ("--shard",),
    "config": ("--preset", "--config"),
}
"""Which options of `fastgen generate` a setting comes from."""


def unsealed(manifest: Mapping[str, Any]) -> bytes:
    """dataset.json of a run that is not finished."""
    return json.dumps(manifest, indent=1).encode()


def known(storage: Folder | Remote, job: Job, settings: Mapping[str, Any]) -> dict[str, Any] | None:
    """What dataset.json says of a dataset that a job with `settings` goes on with; None where it
    says nothing to go by, and the place is empty or its shards say that they are the job's.

    Raises OutputError where the place holds something else, or was made otherwise.
    """
    try:
        text = storage.read(MANIFEST)
        lack = f"{MANIFEST} is damaged"
    except FileNotFoundError:
        text, lack = b"", f"no {MANIFEST}"
    told = told_by(text)
    if told is not None and _same({key: told.get(key) for key in settings}, settings):
        return told
    if told is not None and "digest" in told:
        raise OutputError(_otherwise(job, settings, told))
    # neither a finished dataset's nor this job's: the shards know better than what may be edited
    manifests = (read_manifest(storage, number) for number in shard_numbers(storage))
    made_with = {manifest["settings"] for manifest in manifests if manifest is not None}
    if made_with == {job.settings_digest}:
        return None
    if told is not None and told.keys() >= settings.keys():
        raise OutputError(_otherwise(job, settings, told))
    if made_with:
        raise OutputError(
            f"{job.out}: {lack}, and its shards were made with other settings; "
            "repeat them, --hdri too, to resume, or give another folder"
        )
    if any(not name.startswith(".") for name in storage.names()):
        raise OutputError(f"{job.out}: holds something else ({lack}); give an empty or new place")
    return None


def shard_numbers(storage: Folder | Remote) -> list[int]:
    """Of the shards that have a manifest, damaged or not."""
    numbers = (shard_of(f"shards/{name}") for name in storage.names("shards"))
    return sorted(number for number in numbers if number is not None)


def read_manifest(storage: Folder | Remote, shard: int) -> dict[str, Any] | None:
    """A shard's manifest, None where it is missing, not as it was written, or another shard's."""
    try:
        text = storage.read(manifest_path(shard))
    except FileNotFoundError:
        return None
    manifest = json.loads(text) if is_sealed(text) else {}
    return manifest if manifest.get("shard") == shard else None


def told_by(text: bytes) -> dict[str, Any] | None:
    """What a dataset.json says, None where it is damaged. A finished one has a "digest"."""
    try:
        told = json.loads(text)
    except (ValueError, RecursionError):
        return None
    whole = isinstance(told, dict) and ("digest" not in told or is_sealed(text))
    return told if whole else None


def without_manifest(storage: Folder | Remote, out: str) -> OutputError:
    """What to say where `out` has no dataset.json that could be read."""
    again, other = "run generate again with the same settings", "give a dataset's folder"
    what = again if shard_numbers(storage) else other
    return OutputError(f"{out}: no readable {MANIFEST}; {what}")


def _same(old: Any, new: Any) -> bool:
    """Whether two settings are the same in the same order, which decides what is drawn."""
    return json.dumps(old) == json.dumps(new)


def _otherwise(job: Job, settings: Mapping[str, Any], told: Mapping[str, Any]) -> str:
    """In words, what of a dataset differs from what the job asks for."""
    old = {key: told.get(key, _MISSING) for key in settings}
    unlike = [each for key in settings for each in _differences(key, old[key], settings[key])]
    shown = [f"{name} was {before}, is now {now}" for name, before, now in unlike[:_SHOWN]]
    if len(unlike) > _SHOWN:
        shown.append(f"and {len(unlike) - _SHOWN} more")
    if "version" in told and not _same(told["version"], settings["version"]):
        how = f"install fastgen {told['version']} to resume"
    else:
        options = dict.fromkeys(each for name, *_ in unlike for each in _options(name))
        how = f"repeat them by {', '.join(options)} to resume"
    return (
        f"{job.out}: was made with other settings ({'; '.join(shown)}); "
        f"{how}, or give another folder"
    )


def _options(name: str) -> tuple[str, ...]:
    """The options that a setting may come from."""
    if name.startswith("config.split"):
        return "--split", "--config"
    return _OPTIONS.get(name.split(".")[0], ())


def _differences(name: str, old: Any, new: Any) -> Iterator[tuple[str, str, str]]:
    """Settings that differ, by their names, with both of their values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            both = (each.get(key, _MISSING) for each in (old, new))
            yield from _differences(f"{name}.{key}", *both)
        if old.keys() != new.keys():
            return
        old, new = list(old), list(new)  # whose order decides what is drawn
    if old is _MISSING or new is _MISSING or not _same(old, new):
        before, now = ("missing" if each is _MISSING else _words.repr(each) for each in (old, new))
        yield name, before, now

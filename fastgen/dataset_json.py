"""dataset.json: what a dataset was made with, and once it is finished the hashes of all of it."""

import json
import reprlib
from collections.abc import Mapping
from typing import Any

from fastgen.errors import OutputError
from fastgen.shards import Job, digest, shard_of
from fastgen.storage import Folder, Remote

MANIFEST = "dataset.json"

_words = reprlib.Repr()
_words.maxlist = 100  # all formats, cameras or HDRIs: what differs may be the last


def unsealed(manifest: Mapping[str, Any]) -> bytes:
    """dataset.json of a run that is not finished."""
    return json.dumps(manifest, indent=1).encode()


def sealed(manifest: Mapping[str, Any]) -> bytes:
    """dataset.json with a hash of itself as its last line."""
    text = unsealed(manifest).decode()
    return f'{text[:-2]},\n "digest": "{digest(text.encode())}"\n}}'.encode()


def is_sealed(text: bytes) -> bool:
    """Whether the hash in the last line of dataset.json is that of the rest."""
    head, _, tail = text.rpartition(b',\n "digest": "')
    wanted = digest(head + b"\n}")
    return tail.decode(errors="replace") == f'{wanted}"\n}}'


def known(storage: Folder | Remote, job: Job) -> dict[str, Any] | None:
    """What dataset.json says; None where there is none to go by, and the place is empty or its
    shards say that they are of this job.

    Raises OutputError where the place holds something else, or nothing tells what it holds.
    """
    try:
        text = storage.read(MANIFEST)
        lack = f"{MANIFEST} is damaged"
    except FileNotFoundError:
        text, lack = b"", f"no {MANIFEST}"
    told = _told_by(text)
    if told is not None:
        return told
    present = storage.sizes()
    shards = (path for path in present if shard_of(path) is not None)
    made_with = {_made_with(storage.read(path)) for path in shards} - {None}
    if not made_with <= {job.settings_digest}:
        raise OutputError(
            f"{job.out}: {lack}, and its shards were made with other settings; "
            "repeat them, --hdri too, to resume, or give another folder"
        )
    if not made_with and any(not path.startswith(".") for path in present):
        raise OutputError(f"{job.out}: holds something else ({lack}); give an empty or new place")
    return None


def _told_by(text: bytes) -> dict[str, Any] | None:
    """What a dataset.json says, None where it is damaged."""
    try:
        told = json.loads(text)
    except ValueError:
        return None
    whole = isinstance(told, dict) and ("digest" not in told or is_sealed(text))
    return told if whole else None


def _made_with(manifest: bytes) -> str | None:
    """The settings' digest that a shard's manifest bears, None where it is damaged."""
    try:
        return str(json.loads(manifest)["settings"])
    except (ValueError, KeyError, TypeError):
        return None


def check_alike(
    storage: Folder | Remote, job: Job, settings: Mapping[str, Any], old: Mapping[str, Any]
) -> None:
    """Raise OutputError where a run with `settings` would not go on with what is in the place.

    old: what its dataset.json says.
    """
    for key, value in settings.items():
        if old.get(key) != value:
            them = "them, --hdri too," if key == "environments" else "them"
            raise OutputError(
                f"{job.out}: was made with other settings "
                f"({_difference(key, old.get(key), value)}); "
                f"repeat {them} to resume, or give another folder"
            )
    made = (shard_of(path) for path in storage.sizes())
    beyond = any(shard is not None and shard >= job.shard_count for shard in made)
    if beyond or old.get("images", 0) > job.images:
        raise OutputError(
            f"{job.out}: holds more than {job.images} images; give --images as before or more"
        )


def _difference(name: str, old: Any, new: Any) -> str:
    """The first setting that differs, with both of its values."""
    if isinstance(old, dict) and isinstance(new, dict):
        key = min(key for key in old.keys() | new.keys() if old.get(key) != new.get(key))
        return _difference(f"{name}.{key}", old.get(key), new.get(key))
    said = ["missing" if value is None else _words.repr(value) for value in (old, new)]
    return f"{name} was {said[0]}, is now {said[1]}"

"""`fastgen verify`: check that every file of a dataset is present, unchanged and consistent."""

import contextlib
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import PurePosixPath
from typing import Any

import simplejpeg

from fastgen.dataset.dataset_json import MANIFEST, shard_manifest, without_manifest
from fastgen.dataset.job import ARCHIVE_ENDINGS, manifest_path
from fastgen.dataset.manifest_types import Shard, parsed_json, unfit, unfit_finished
from fastgen.dataset.seal import is_sealed
from fastgen.dataset.storage import Storage, storage_of
from fastgen.errors import FastgenError, OutputError, shown
from fastgen.formats.format import Format, Read, Record
from fastgen.formats.registry import formats_for, unknown_format
from fastgen.sampling.scene import SPLITS
from fastgen.scene import Scene

_AGAIN = "run generate again with the same settings"

_SAMPLE = re.compile(
    rf"(?:{'|'.join(SPLITS)})-\d{{6,}}\.(?:{'|'.join(ARCHIVE_ENDINGS.values())})|"
    r"(?!shards/).+/(?:s\d+_)?\d{6,}(?:_[A-Za-z0-9_-]+)?\.\w+"
)
"""Paths that files of samples have."""


@dataclass(frozen=True)
class Findings:
    """Result of an examination.

    Attributes:
        faults: A line for each fault, which names a file.
        foreign: Paths of files and folders that are not part of the dataset, sorted. Trainers leave
            caches and results beside labels.
        broken: Paths of files that are missing or not as they were written.
        manifest: Content of dataset.json; {} if it was changed. It has no "digest" if the dataset
            is not finished.
    """

    faults: list[str]
    foreign: list[str] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)
    manifest: dict[str, Any] = field(default_factory=dict)


def examine(out: str) -> Findings:
    """Find the faults of the dataset at `out`.

    Raises:
        OutputError: `out` is not a dataset.
    """
    storage = storage_of(out)
    try:
        text = storage.read(MANIFEST)
        manifest = parsed_json(text)
        manifest["format"], manifest["formats"]
    except (OSError, ValueError, KeyError, TypeError):
        raise without_manifest(storage, out) from None
    if "digest" not in manifest:
        unfinished = f"{MANIFEST}: the dataset is not finished; run generate again"
        return Findings([unfinished], manifest=manifest)
    if not is_sealed(text):
        return Findings([f"{MANIFEST}: was changed after it was written; {_AGAIN}"])
    problem = unfit_finished(text)
    if problem:
        return Findings([f"{MANIFEST}: {problem}; {_AGAIN}"])
    unknown = unknown_format(manifest["formats"])
    if unknown is not None:
        words = f"format {shown(unknown)} is unknown; install the package that offers it"
        return Findings([f"{MANIFEST}: {words}"])
    faults = [
        f"scene {each['scene']} is missing: it failed ({each['error']})"
        for each in manifest["failed"]
    ]
    present = dict(storage.sizes())
    present.pop(MANIFEST, None)
    shards = []
    unlisted: set[int] = set()  # shards whose files are not known
    for number, hashed in manifest["shards"].items():
        path, shard = manifest_path(int(number)), None
        if _is_intact(storage, present, path, None, hashed, faults):
            text = storage.read(path)
            shard = shard_manifest(text, int(number))
            if shard is None:
                problem = unfit(text, Shard) or "is another shard's"
                faults.append(f"{path}: {problem}")
        if shard is None:
            unlisted.add(int(number))
        else:
            shards.append(shard)
    broken = {manifest_path(number) for number in unlisted}
    listed = [manifest["files"], *(shard["files"] for shard in shards)]
    for path, (size, hashed) in (entry for files in listed for entry in files.items()):
        if not _is_intact(storage, present, path, size, hashed, faults):
            broken.add(path)
    manifests = (manifest_path(int(number)) for number in manifest["shards"])
    ours = {MANIFEST, *manifests, *(path for files in listed for path in files)}
    if unlisted:  # some of the other files may be theirs
        ours.update(filter(_SAMPLE.fullmatch, present))
    foreign = _foreign(present.keys() - ours, ours)
    if manifest["format"] == "seafront":
        records = [record for shard in shards for record in shard["records"]]
        formats = formats_for(manifest["formats"], manifest.get("classes", {}))
        faults += _contradictions(storage, records, broken, formats)
        if not unlisted:
            faults += _split_contradictions(storage, records, broken, formats)
    return Findings(faults, foreign, broken, manifest)


def _is_intact(
    storage: Storage,
    present: dict[str, int],
    path: str,
    size: int | None,
    hashed: str,
    faults: list[str],
) -> bool:
    """Return whether a file is as it was written, and add a fault if it is not.

    The file is removed from `present`.
    """
    if path not in present:
        faults.append(f"{path}: missing")
        return False
    found = present.pop(path)
    if size is not None and found != size:
        faults.append(f"{path}: changed ({found} bytes, {size} were written)")
        return False
    try:
        same = storage.content_hash(path) == hashed
    except OutputError as error:  # must not hide other faults
        faults.append(str(error))
        return False
    except FileNotFoundError:  # a dangling link
        faults.append(f"{path}: missing")
        return False
    if not same:
        faults.append(f"{path}: changed")
    return same


def _foreign(present: Iterable[str], listed: Collection[str]) -> list[str]:
    """Return the paths that are not part of a dataset, sorted.

    A folder without any listed file is returned instead of its content and ends with a slash.
    """
    ours = {str(folder) for path in listed for folder in PurePosixPath(path).parents}
    found = set()
    for path in present:
        folders = [str(folder) for folder in PurePosixPath(path).parents]
        topmost = next((each for each in reversed(folders) if each not in ours), None)
        found.add(path if topmost is None else f"{topmost}/")
    return sorted(found)


class _Broken(Exception):
    """A file that a check wants to read is already known to be damaged."""


def _contradictions(
    storage: Storage, records: list[Record], broken: set[str], formats: list[Format]
) -> Iterator[str]:
    """Yield a line for each file of a sample that is intact but contradicts its other files."""
    for record in records:
        read = cache(partial(_read_intact, storage, broken))
        for check in (_check_image, _check_scene, *(each.check for each in formats)):
            with contextlib.suppress(_Broken):
                yield from check(record, read)


def _split_contradictions(
    storage: Storage, records: list[Record], broken: set[str], formats: list[Format]
) -> Iterator[str]:
    """Yield a line for each file over a split that contradicts the records of its images."""
    read = partial(_read_intact, storage, broken)
    for split in SPLITS:
        chosen = [record["facts"] for record in records if record["split"] == split]
        for each in formats:
            with contextlib.suppress(_Broken):
                yield from each.check_split(split, [facts[each.name] for facts in chosen], read)


def _read_intact(storage: Storage, broken: set[str], path: str) -> bytes:
    if path in broken:
        raise _Broken(path)
    return storage.read(path)


def _check_image(record: Record, read: Read) -> Iterator[str]:
    path = f"images/{record['split']}/{record['stem']}.jpg"
    width, height = record["size"]
    data = read(path)
    try:
        # before decoding, because the decoder allocates whatever size the file claims
        complete = simplejpeg.decode_jpeg_header(data)[:2] == (height, width)
        # strict: otherwise the missing part of a truncated file becomes grey
        complete = complete and simplejpeg.decode_jpeg(data, strict=True).shape[2] == 3
    except ValueError:
        complete = False
    if not complete:
        yield f"{path}: not a complete JPEG of {width}x{height}"


def _check_scene(record: Record, read: Read) -> Iterator[str]:
    path = f"scenes/{record['split']}/{record['stem']}.json"
    try:
        Scene.from_json(read(path))
    except FastgenError as error:
        yield f"{path}: {error}"

"""A whole dataset: shards handed out to processes, files committed, the rest gathered up.

Which files come is decided by the job alone, so any number of workers makes the same bytes, and
running again on the same place makes only what is missing.
"""

import contextlib
import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from fastgen.config.config import Config, SplitConfig
from fastgen.dataset import workers
from fastgen.dataset.console import say
from fastgen.dataset.contact_sheet import contact_sheet
from fastgen.dataset.dataset_json import MANIFEST, known, read_manifest, shard_numbers, unsealed
from fastgen.dataset.progress import Progress
from fastgen.dataset.seal import digest, seal
from fastgen.dataset.shards import (
    FORMATS,
    MADE_BY,
    Job,
    Maker,
    Strikes,
    Task,
    manifest_path,
    stem_of,
)
from fastgen.dataset.storage import Folder, Remote, storage_of
from fastgen.errors import ConfigError, FastgenError, OutputError
from fastgen.files.images import png
from fastgen.formats import SEAFRONT, Record, formats_of
from fastgen.formats.coco import trained_on
from fastgen.light.environment import load_environment
from fastgen.light.hdri import find_hdris
from fastgen.render.gl import BACKENDS
from fastgen.sampling.scene import SPLITS
from fastgen.validation import check_known, nearest

CONTACT_SHEET = "contact_sheet.png"

_MOST = 10**9
"""Images, and what divides them: epochs of fastgen.torch part the scene numbers there too."""

Runner = Callable[[Job, Iterable[Task], Callable[[str, Any], None]], None]
"""Makes the shards of `tasks`, which come one by one, and reports on the way; see `run_here`."""


def generate(job: Job, worker_count: int, runner: Runner | None = None) -> dict[str, Any]:
    """Make or finish the dataset at job.out; returns what dataset.json says.

    runner: where shards are made; by default in worker_count processes of this machine.
    Raises OutputError when the place holds something else, was made with other settings, cannot be
    written or is another run's; ConfigError for values that cannot be.
    """
    job, settings = _settled(job, worker_count)
    storage = storage_of(job.out)
    if isinstance(storage, Folder):
        _make_folder(storage.root)
    elif storage.lives_here and runner is None:
        raise OutputError(
            f"{job.out}: is the memory of this process, which the workers do not share; "
            "give a folder or a store"
        )
    known(storage, job, settings)  # a lock would be a change to what is not ours
    with storage.locked():
        old = known(storage, job, settings)
        made = _made(job, storage, old or {})
        left = job.images - sum(made.values())
        if left or old is None:  # until the end nothing says that it is finished
            before = _content(storage, MANIFEST)
            storage.write(MANIFEST, [unsealed({**settings, "images": job.images})])
        if left:
            # one by one, for there may be millions
            tasks = (Task(shard) for shard in range(job.shard_count) if shard not in made)
            progress = Progress(job.images, job.images - left)
            if runner is None and old is None:
                _tell_of_idle_workers(job, worker_count)

            def on_report(kind: str, value: Any) -> None:
                if kind == "images":
                    progress.add(value)

            try:
                (runner or run_here(worker_count))(job, tasks, on_report)
            except FastgenError:  # refused, say for a device that is not there
                if not progress.made:
                    _put_back(storage, MANIFEST, before)
                raise
            finally:
                progress.close()
        return _finish(job, storage, settings)


def _content(storage: Folder | Remote, name: str) -> bytes | None:
    try:
        return storage.read(name)
    except FileNotFoundError:
        return None


def _put_back(storage: Folder | Remote, name: str, content: bytes | None) -> None:
    """As `_content` found it; where that cannot be, a run that goes on makes it anyway."""
    with contextlib.suppress(FastgenError, OSError):
        if content is None:
            storage.remove(name)
        else:
            storage.write(name, [content])


def check_goes_on(job: Job, worker_count: int) -> None:
    """See, without a change to the place, that `generate` would go on with what is there.

    Raises what `generate` raises for other settings than those of the dataset and for values that
    cannot be.
    """
    job, settings = _settled(job, worker_count)
    storage = storage_of(job.out)
    _made(job, storage, known(storage, job, settings) or {})


def run_here(worker_count: int, hang_s: float = workers.HANG_S, maker: Any = Maker) -> Runner:
    """A runner with so many processes on this machine."""

    def run(job: Job, tasks: Iterable[Task], on_report: Callable[[str, Any], None]) -> None:
        whole = worker_count >= len(os.sched_getaffinity(0))
        workers.run(
            maker, (job, whole), tasks, worker_count, on_report, Strikes(job), hang_s, whole
        )

    return run


def _tell_of_idle_workers(job: Job, worker_count: int) -> None:
    """Say so where there are fewer shards than workers, and shorter ones would be made sooner."""
    scenes = -(-job.images // len(job.cameras))
    shards, fair = job.shard_count, -(-scenes // worker_count)
    if shards < worker_count and shards < -(-scenes // fair):
        say(
            f"fastgen: no more than {shards} of {worker_count} workers have something to do, with "
            f"{job.shard_scenes} scenes a shard; in another folder, --shard {fair} shares the work"
        )


def check_count(name: str, value: int) -> None:
    """Raise ConfigError that calls it `name` where a run cannot have so many."""
    if not 1 <= value <= _MOST:
        raise ConfigError(f"{name}: {value} is out of range; give 1 to {_MOST}")


def parse_split(text: str | None, config: Config) -> Config:
    """`config` with --split applied: a split's name takes all, 'a,b,c' are the three fractions.

    Raises ConfigError for other text.
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


def _settled(job: Job, worker_count: int) -> tuple[Job, dict[str, Any]]:
    """The job, checked and complete, and the settings that make its samples what they are."""
    job = _checked(job, worker_count)
    settings = _settings(job)
    return replace(job, settings_digest=digest(unsealed(settings))), settings


def _checked(job: Job, worker_count: int) -> Job:
    check_count("images", job.images)
    check_count("workers", worker_count)
    check_count("shard", job.shard_scenes)
    check_known("format", job.fmt, FORMATS)
    for name in job.cameras:
        check_known("cameras", name, job.config.cameras)
    if not job.cameras or len(set(job.cameras)) != len(job.cameras):
        raise ConfigError("cameras: name at least one, and each only once")
    check_known("backend", job.backend, BACKENDS)
    formats_of(job.formats)
    if len(set(job.formats)) != len(job.formats):
        raise ConfigError("also: name each only once")
    if job.fmt == "webdataset" and "bop" in job.formats:
        raise ConfigError(
            "also: bop keeps poses in files over all images, which webdataset has not; "
            "the poses stand in each sample's json, or use the seafront format"
        )
    # in one order, so that who asks for them in another still resumes
    names = dict.fromkeys((*SEAFRONT, *sorted(job.formats)))
    return replace(job, formats=tuple(names))


def _settings(job: Job) -> dict[str, Any]:
    from fastgen import __version__

    generator = job.generator()  # validates seed, size and device without opening GL
    generator.scene(0)  # what only sampling can refuse is refused before anything is written
    for path in find_hdris(job.hdri_dir) if job.hdri_dir else ():
        load_environment(path)  # names a broken file now, and caches the light for the workers
    settings = {
        "version": __version__,
        "format": job.fmt,
        "formats": list(job.formats),
        "seed": job.seed,
        "size": list(job.size),
        "quality": job.quality,
        "cameras": list(job.cameras),
        "environments": generator.environment_record,
        "shard_scenes": job.shard_scenes,
        "config": generator.config.to_plain(),
    }
    plain: dict[str, Any] = json.loads(json.dumps(settings))
    return plain


def _make_folder(root: Path) -> None:
    try:
        root.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        # mkdir says so of a link to nowhere too
        astray = [path for path in (root, *root.parents) if path.is_symlink() and not path.exists()]
        what = f"{root}: is a file; give a folder"
        if astray:
            to = os.readlink(astray[0])
            what = (
                f"{astray[0]}: is a link to {to}, which is not there; make it, or remove the link"
            )
        raise OutputError(what) from None
    except OSError as error:
        raise OutputError(f"{root}: cannot be written ({error.strerror})") from None


def _made(job: Job, storage: Folder | Remote, old: Mapping[str, Any]) -> dict[int, int]:
    """How many images each shard holds that is there with all that is wanted of it, and of which no
    part has gone.

    old: what dataset.json says. Raises OutputError where there are more images than the job's, or
    shards that were made with other settings.
    """
    beyond = "digest" in old and old["images"] > job.images
    present = storage.sizes()
    made = {}
    for shard in shard_numbers(storage):
        manifest = read_manifest(storage, shard)
        if manifest is None:  # made again, or beyond the images a stray, which `verify` names
            continue
        wanted = [stem_of(index, camera) for index, camera in job.wanted(shard)]
        if manifest["settings"] != job.settings_digest:
            raise OutputError(
                f"{job.out}: {manifest_path(shard)} was made with other settings; give another "
                "folder, or remove that file to have its images made again"
            )
        beyond = beyond or not wanted or not set(manifest["images"]) <= set(wanted)
        files = manifest["files"].items()
        whole = all(present.get(path) == size for path, (size, _) in files)
        if whole and manifest["images"] == wanted:
            made[shard] = len(wanted)
    if beyond:
        raise OutputError(
            f"{job.out}: holds more than {job.images} images; give --images as before or more"
        )
    return made


def _finish(job: Job, storage: Folder | Remote, settings: dict[str, Any]) -> dict[str, Any]:
    """Write the files over all samples, and dataset.json, which seals everything, last."""
    shards: dict[str, str] = {}
    makers: list[dict[str, str]] = []
    failed: list[dict[str, Any]] = []
    images: list[tuple[str, str]] = []
    counts = {
        split: Counter({"images": 0, "objects": 0, "damages": 0, "crops": 0}) for split in SPLITS
    }
    for shard in range(job.shard_count):
        data = storage.read(manifest_path(shard))
        shards[str(shard)] = digest(data)
        manifest = json.loads(data)
        made_by = {name: manifest[name] for name in MADE_BY}
        if made_by not in makers:
            makers.append(made_by)
        failed += manifest["failed"]
        for record in manifest["records"]:
            counts[record["split"]].update(_counts(record))
            if job.fmt == "seafront":
                images.append((record["split"], record["stem"]))
    files: dict[str, list[Any]] = {}

    def put(path: str, pieces: Iterable[bytes]) -> None:
        sums = _Sums(pieces)
        storage.write(path, sums)
        files[path] = sums.entry()

    if job.fmt == "seafront":
        for split in SPLITS:
            storage.make_folders([f"images/{split}", f"scenes/{split}"])
            for each in formats_of(job.formats):
                storage.make_folders(each.folders(split))
                for path, content in each.dataset_files(split, _records(job, storage, split)):
                    put(path, [content] if isinstance(content, bytes) else map(str.encode, content))
        if isinstance(storage, Folder) and images:
            put(CONTACT_SHEET, [png(contact_sheet(storage.root, images))])
    result = {
        **settings,
        **makers[0],
        "images": job.images,
        "counts": {split: dict(count) for split, count in counts.items()},
        "failed": failed,
        "files": files,
        "shards": shards,
    }
    storage.write(MANIFEST, [seal(unsealed(result))])
    if len(makers) > 1:
        names = " and by ".join(" ".join(made_by.values()) for made_by in makers)
        say(
            f"fastgen: {job.out} was drawn by {names}: they may round differently; for the same "
            "bytes everywhere make it anew with one of them"
        )
    return result


class _Sums:
    """Passes pieces on, and adds up their size and hash."""

    def __init__(self, pieces: Iterable[bytes]) -> None:
        self._pieces, self._size, self._hash = pieces, 0, hashlib.sha256()

    def __iter__(self) -> Iterator[bytes]:
        for piece in self._pieces:
            self._size += len(piece)
            self._hash.update(piece)
            yield piece

    def entry(self) -> list[Any]:
        return [self._size, self._hash.hexdigest()]


def _records(job: Job, storage: Folder | Remote, split: str) -> Callable[[], Iterator[Record]]:
    def through() -> Iterator[Record]:
        for shard in range(job.shard_count):
            manifest = json.loads(storage.read(manifest_path(shard)))
            yield from (record for record in manifest["records"] if record["split"] == split)

    return through


def _counts(record: Record) -> dict[str, int]:
    facts = record["facts"]
    return {
        "images": 1,
        "objects": len(trained_on(facts["imdg"])),
        "damages": sum(item["category_id"] > 1 for item in trained_on(facts["damage"])),
        "crops": len(facts["text"]),
    }

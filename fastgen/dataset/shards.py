"""A shard: a few scenes in a row, made by one process and committed together.

Its manifest, written last, lists each of its files with size and content hash, and holds the facts
that files over the whole dataset are made from. What has no manifest was never made.
"""

import io
import os
import tarfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

import cv2
import orjson

from fastgen.config.config import Config
from fastgen.dataset.freed_memory import return_freed_memory
from fastgen.dataset.seal import digest, seal
from fastgen.dataset.storage import storage_of
from fastgen.errors import AssetError, ContextError, FastgenError, OutputError
from fastgen.formats import Files, Item, Record, Same, assemble, formats_of
from fastgen.generator import Generator
from fastgen.sampling.scene import SPLITS, split_of

SHARD_SCENES = {"seafront": 4, "webdataset": 64}
"""Scenes that are committed together, by format of the whole."""

_PRELOAD_IMAGES = 1000
"""A run of more meets every light anyway; from the start, its memory does not grow later."""

FORMATS = tuple(SHARD_SCENES)
MADE_BY = ("backend", "renderer")
"""What manifests say of the process that made them."""

_REPORT_S = 0.25
"""Within a shard images are counted to the parent no more often: each report wakes it, on a core in
use."""

_HOLD_IMAGES = 256
"""From the next shard after so many on, freed memory is back with the system, which must clear each
page before it is used again."""

ATTEMPTS = 3
"""A scene that failed so often is given up."""

Report = Callable[[str, Any], None]
"""Tells the parent process: 'at' a scene's index, 'images' made; 'busy' with what precedes them."""


@dataclass(frozen=True)
class Job:
    """What to generate. out: a folder or an fsspec address. images counts images, not scenes; size
    is (width, height). fmt: one of FORMATS; formats: names of what is written of each sample.
    shard_scenes: scenes that are committed together. settings_digest: of all that makes the samples
    what they are, so that shards can tell whose they are; '' before `generate` has filled it in."""

    out: str
    images: int
    config: Config
    seed: int
    size: tuple[int, int]
    cameras: tuple[str, ...]
    hdri_dir: str | None
    backend: str
    device_index: int | None = None
    fmt: str = "seafront"
    formats: tuple[str, ...] = ()
    quality: str = "balanced"
    shard_scenes: int = 4
    settings_digest: str = ""

    @property
    def shard_count(self) -> int:
        """Shards that hold all images."""
        return -(-self.images // (self.shard_scenes * len(self.cameras)))

    def wanted(self, shard: int) -> list[tuple[int, str]]:
        """Scene index and camera of each image of a shard."""
        per_shard = self.shard_scenes * len(self.cameras)
        numbers = range(shard * per_shard, min((shard + 1) * per_shard, self.images))
        count = len(self.cameras)
        return [(number // count, self.cameras[number % count]) for number in numbers]

    def generator(self) -> Generator:
        """What draws it. Raises ConfigError for values that cannot be."""
        return Generator(
            self.config,
            self.seed,
            self.size,
            backend=self.backend,
            hdri_dir=self.hdri_dir,
            quality=self.quality,
            device_index=self.device_index,
        )


@dataclass(frozen=True)
class Task:
    """One shard to make. skip: why scenes that are given up were, by index."""

    shard: int
    skip: dict[int, str] = field(default_factory=dict)


class Strikes:
    """Counts the deaths of processes by the scene that each was at; called for every death."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._deaths: Counter[int] = Counter()

    def __call__(self, task: Task, scene: int | None, ended: str) -> Task:
        """The task to try instead: without a scene that has ended ATTEMPTS processes.

        scene: where the process was, None before the first one. ended: how it died. Raises
        OutputError where processes die again and again before they come to a scene.
        """
        first = self._job.wanted(task.shard)[0][0]
        blamed = first if scene is None else scene
        self._deaths[blamed] += 1
        if self._deaths[blamed] < ATTEMPTS:
            return task
        if scene is None:
            raise OutputError(
                f"worker processes die before they render anything ({ended}); try fastgen doctor, "
                'and in a script call this under `if __name__ == "__main__":`; what is written '
                "stays good"
            )
        reason = f"the process that rendered it died ({ended})"
        return replace(task, skip={**task.skip, scene: reason})


def stem_of(index: int, camera: str) -> str:
    """File name, without its ending, of scene `index` seen by `camera`."""
    return f"{index:06d}_{camera}"


def manifest_path(shard: int) -> str:
    """Where a shard's manifest lies."""
    return f"shards/{shard:06d}.json"


def shard_of(path: str) -> int | None:
    """Which shard's manifest lies at `path`, None where none does."""
    name = path.removeprefix("shards/").removesuffix(".json")
    return int(name) if name.isdecimal() and manifest_path(int(name)) == path else None


class Maker:
    """Makes shards of one job in one process; opens GL when it is made.

    whole_machine: there is a process on every core, so neither the rasterizer nor OpenCV needs
    threads.
    """

    _held = 0
    """Images made since freed memory was returned."""

    def __init__(self, job: Job, whole_machine: bool, report: Report) -> None:
        if whole_machine:
            # llvmpipe reads it at its first context
            os.environ.setdefault("LP_NUM_THREADS", "0")
            cv2.setNumThreads(1)
        self._job = job
        self._report = report
        self._formats = formats_of(job.formats)
        self._storage = storage_of(job.out)
        self._generator = job.generator()
        if job.images > _PRELOAD_IMAGES:
            self._generator.preload(lambda: report("busy", None))
        names = (self._generator.used_backend, self._generator.renderer_name)
        self._made_by = dict(zip(MADE_BY, names, strict=True))

    def __call__(self, task: Task) -> None:
        """Render, encode and commit one shard."""
        if self._held >= _HOLD_IMAGES:
            return_freed_memory()  # of the shards before
            self._held = 0
        made: list[tuple[Files, Record]] = []
        skip = dict(task.skip)
        at, untold, told = None, 0, time.monotonic()
        for index, camera in self._job.wanted(task.shard):
            if index in skip:
                continue
            if index != at:
                self._report("at", index)
                at = index
            sample = self._patiently(index, camera, skip)
            if sample is not None:
                made.append(sample)
            self._held += 1
            untold += 1
            if time.monotonic() - told >= _REPORT_S:
                self._report("images", untold)
                untold, told = 0, time.monotonic()
        if untold:
            self._report("images", untold)
        made = [(files, record) for files, record in made if _index(record) not in skip]
        files = pack(made, task.shard) if self._job.fmt == "webdataset" else _joined(made)
        self._storage.commit(files, f"{task.shard:06d}")
        manifest = {
            "shard": task.shard,
            "settings": self._job.settings_digest,
            **self._made_by,
            "images": [record["stem"] for _, record in made],
            "failed": [{"scene": i, "seed": self._job.seed, "error": skip[i]} for i in skip],
            "files": _entries(files),
            "records": [record for _, record in made],
        }
        self._storage.write(manifest_path(task.shard), [seal(orjson.dumps(manifest))])

    def _patiently(
        self, index: int, camera: str, skip: dict[int, str]
    ) -> tuple[Files, Record] | None:
        """One image; None, and why in `skip`, where it fails again and again."""
        for attempt in range(ATTEMPTS):
            try:
                return self._image(index, camera)
            except (AssetError, ContextError, OutputError, OSError):
                raise  # no light, no driver, a full disk: trying again helps nobody
            except FastgenError as error:  # this scene cannot be; others may
                skip[index] = f"camera {camera}: {error}"
                return None
            except Exception as error:
                if attempt + 1 == ATTEMPTS:
                    traceback.print_exc()
                    skip[index] = f"camera {camera}: {error!r}"
        return None

    def _image(self, index: int, camera: str) -> tuple[Files, Record]:
        job = self._job
        scene = self._generator.scene(index)
        wanted = "normals" in job.formats
        sample = self._generator.render(scene=scene, camera=camera, normals=wanted)
        item = Item(
            sample,
            split_of(job.config, job.seed, index),
            stem_of(index, camera),
            index * len(job.cameras) + job.cameras.index(camera),
            job.config.labels,
        )
        return assemble(item, self._formats)


def pack(made: Sequence[tuple[Files, Record]], shard: int) -> Files:
    """The samples as WebDataset shards, a tar file for each split that occurs.

    A sample's members share its stem; their endings are `jpg`, `json`, and for label files the
    folder's name first, as in `damage.png` and `imdg.txt`.
    """
    packed: Files = {}
    for split in SPLITS:
        buffer = io.BytesIO()
        chosen = [(files, record) for files, record in made if record["split"] == split]
        if not chosen:
            continue
        with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as tar:
            for files, record in chosen:
                names: set[str] = set()
                for path, content in files.items():
                    if isinstance(content, Same):
                        continue
                    member = tarfile.TarInfo(_member(path, record["stem"]))
                    assert member.name not in names, member.name
                    names.add(member.name)
                    member.size = len(content)
                    tar.addfile(member, io.BytesIO(content))
        packed[f"{split}-{shard:06d}.tar"] = buffer.getvalue()
    return packed


def _member(path: str, stem: str) -> str:
    pure = PurePosixPath(path)
    folder, *between = pure.parts[:-1]
    ending = pure.suffix[1:]
    if folder in ("images", "scenes"):
        return f"{stem}.{ending}"
    # kitti has files of one name in folders of different names
    inner = [part for part in between if folder == "kitti" and part not in SPLITS]
    part = pure.stem.removeprefix(stem).strip("_")
    return ".".join(filter(None, (stem, folder, *inner, part, ending)))


def _joined(made: Sequence[tuple[Files, Record]]) -> Files:
    return {path: content for files, _ in made for path, content in files.items()}


def _entries(files: Files) -> dict[str, list[Any]]:
    """Size and content hash of each file; what is the same as another comes after that."""
    found: dict[str, list[Any]] = {}
    for path, content in files.items():
        if isinstance(content, Same):
            found[path] = found[content.path]
        else:
            found[path] = [len(content), digest(content)]
    return found


def _index(record: Record) -> int:
    return int(record["stem"].split("_", 1)[0])

"""Shard: the images of a few consecutive scenes, made by one process and committed together.

A shard's manifest is written last. It lists each file with size and content hash, and holds the
records of its images, from which the files over the whole dataset are made. A shard without a
manifest counts as never made.
"""

import logging
import os
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import cv2
import orjson

from fastgen.dataset.console import LOGGER
from fastgen.dataset.freed_memory import keep_freed_memory, return_freed_memory
from fastgen.dataset.job import Job, Task, manifest_path, scene_and_camera
from fastgen.dataset.seal import digest, seal
from fastgen.dataset.storage import storage_of
from fastgen.errors import AssetError, ContextError, FastgenError, OutputError
from fastgen.formats.archives import Made, tar_files
from fastgen.formats.format import Files, Record, Same, assemble
from fastgen.formats.item import Item
from fastgen.formats.parquet import parquet_files
from fastgen.formats.registry import formats_for
from fastgen.sampling.scene import split_of

MADE_BY = ("backend", "renderer")
"""Keys of a manifest that describe the process that made the shard."""

_REPORT_S = 0.25
"""Shortest time between two reports of images: each report wakes the parent on a busy core."""

_TRIM_IMAGES = 64
"""Freed memory goes back to the system after this many images, because the system must clear each
page before it is used again."""

ATTEMPTS = 3
"""A scene that fails this many times is given up."""

_HOPELESS = 8
"""A process whose first scenes all meet internal errors ends the run after this many."""

Report = Callable[[str, Any], None]
"""Sends a report to the parent process.

Reports are "at" with the index of the scene that comes next, "images" with a number of finished
images, and "busy" during preparations, with words about them or None.
"""


class _Announcer(logging.Handler):
    """Reports what the package logs in a worker, so that the parent can show it."""

    def __init__(self, report: Report) -> None:
        super().__init__()
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        if record.name != LOGGER.name:  # the parent logs reports with this name
            self._report("busy", record.getMessage())


class Strikes:
    """Counts how many processes died at each scene. Call it for every death."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._deaths: Counter[int] = Counter()

    def __call__(self, task: Task, scene: int | None, ended: str) -> Task:
        """Return the task to try next, without a scene that has ended ATTEMPTS processes.

        Args:
            task: The task of the process that died.
            scene: Index of the scene it was at; None before the first.
            ended: How it died, in words.

        Raises:
            OutputError: Processes keep dying before they reach a scene.
        """
        first = self._job.wanted(task.shard)[0][0]
        blamed = first if scene is None else scene
        self._deaths[blamed] += 1
        if self._deaths[blamed] < ATTEMPTS:
            return task
        if scene is None:
            raise OutputError(
                f"worker processes die before they render anything ({ended}); run fastgen doctor; "
                "files written so far stay valid"
            )
        reason = f"the process that rendered it died ({ended})"
        return replace(task, skip={**task.skip, scene: reason})


class Maker:
    """Makes shards of one job in one process. The constructor opens OpenGL.

    Args:
        job: The job, with its settings_digest.
        whole_machine: There is a process on every core, so neither the software rasterizer nor
            OpenCV needs threads.
        report: Receives reports.
    """

    _since_trim = 0
    """Images made since freed memory was returned."""

    _failed: int | None = 0
    """Number of scenes that met internal errors before any image was made; None afterwards."""

    def __init__(self, job: Job, whole_machine: bool, report: Report) -> None:
        if whole_machine:
            # llvmpipe reads this at its first context
            os.environ.setdefault("LP_NUM_THREADS", "0")
            cv2.setNumThreads(1)
            keep_freed_memory()
        LOGGER.handlers = [_Announcer(report)]
        LOGGER.setLevel(logging.INFO)
        self._job = job
        self._report = report
        self._formats = formats_for(job.formats, job.config.classes)
        self._storage = storage_of(job.out)
        self._generator = job.generator()
        names = (self._generator.used_backend, self._generator.renderer_name)
        self._made_by = dict(zip(MADE_BY, names, strict=True))

    def __call__(self, task: Task) -> None:
        """Render, encode and commit one shard."""
        if self._since_trim >= _TRIM_IMAGES:
            return_freed_memory()
            self._since_trim = 0
        made: list[Made] = []
        skip = dict(task.skip)
        at, unreported, reported = None, 0, time.monotonic()
        for index, camera in self._job.wanted(task.shard):
            if index in skip:
                continue
            if index != at:
                self._report("at", index)
                at = index
            sample = self._image_or_skip(index, camera, skip)
            if sample is not None:
                made.append(sample)
            self._since_trim += 1
            unreported += 1
            if time.monotonic() - reported >= _REPORT_S:
                self._report("images", unreported)
                unreported, reported = 0, time.monotonic()
        if unreported:
            self._report("images", unreported)
        made = [(files, record) for files, record in made if _index(record) not in skip]
        files = self._packed(made, task.shard)
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

    def _packed(self, made: Sequence[Made], shard: int) -> Files:
        """Return the files of a shard in the job's layout."""
        match self._job.layout:
            case "webdataset":
                return tar_files(made, shard)
            case "parquet":
                return parquet_files(made, shard, self._formats, self._job.config)
            case _:
                return loose_files(made, self._storage.links)

    def _image_or_skip(
        self, index: int, camera: str, skip: dict[int, str]
    ) -> tuple[Files, Record] | None:
        """Return one image, or None with the reason in `skip` if it fails repeatedly."""
        for attempt in range(ATTEMPTS):
            try:
                image = self._image(index, camera)
                self._failed = None
                return image
            except (AssetError, ContextError, OutputError, OSError):
                raise  # a missing HDRI, no driver, a full disk: another attempt cannot help
            except FastgenError as error:  # this scene cannot be drawn; others may
                skip[index] = f"camera {camera}: {error}"
                return None
            except Exception as error:
                if attempt + 1 == ATTEMPTS:
                    traceback.print_exc()
                    skip[index] = f"camera {camera}: {error!r}"
                    self._count_failure(error)
        return None

    def _count_failure(self, error: Exception) -> None:
        if self._failed is None:
            return
        self._failed += 1
        if self._failed >= _HOPELESS:
            raise OutputError(
                f"the first {self._failed} scenes of a process failed, the last one with "
                f"{error!r}; run fastgen doctor, or mend the package that the traceback names"
            )

    def _image(self, index: int, camera: str) -> tuple[Files, Record]:
        job = self._job
        normals = any(each.needs_normals for each in self._formats)
        sample = self._generator.render(
            scene=self._generator.scene(index), camera=camera, normals=normals
        )
        item = Item(
            sample,
            split_of(job.config, job.seed, index),
            job.stem(index, camera),
            index * len(job.cameras) + job.cameras.index(camera),
            job.config.labels,
            job.coco_masks == "polygon",
        )
        return assemble(item, self._formats, job.layout != "seafront")


def loose_files(made: Sequence[Made], links: bool) -> Files:
    """Return the files of all samples; without `links`, leave out those that are only links."""
    return {
        path: content
        for files, _ in made
        for path, content in files.items()
        if links or not (isinstance(content, Same) and content.link_only)
    }


def _entries(files: Files) -> dict[str, list[Any]]:
    """Return size and content hash of each file. A `Same` comes after the file it refers to."""
    found: dict[str, list[Any]] = {}
    for path, content in files.items():
        if isinstance(content, Same):
            found[path] = found[content.path]
        else:
            found[path] = [len(content), digest(content)]
    return found


def _index(record: Record) -> int:
    return scene_and_camera(record["stem"])[0]

"""Generation of a whole dataset: processes make the shards, then the last files are written.

The job alone decides the content of all files. Any number of workers makes the same bytes, and a
second run on the same place makes only what is missing.
"""

import contextlib
import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from fastgen.cpus import usable_cpus
from fastgen.dataset import workers
from fastgen.dataset.console import LOGGER, hint
from fastgen.dataset.dataset_json import MANIFEST, existing, read_manifest, shard_numbers, unsealed
from fastgen.dataset.finish import finish
from fastgen.dataset.job import Job, Task, manifest_path
from fastgen.dataset.progress import Progress
from fastgen.dataset.settings import settled
from fastgen.dataset.shards import Maker, Strikes
from fastgen.dataset.storage import Folder, Storage, storage_of
from fastgen.errors import FastgenError, OutputError

Runner = Callable[[Job, Iterable[Task], Callable[[str, Any], None]], None]
"""Makes the shards of `tasks`, which it takes one at a time, and calls the function with reports.

See `run_here`; reports are those of `shards.Report`.
"""


def default_workers() -> int:
    """Return the number of CPUs that this process may use, by affinity and quotas of cgroups."""
    return usable_cpus()


def generate(
    job: Job, worker_count: int | None = None, runner: Runner | None = None
) -> dict[str, Any]:
    """Make the dataset at `job.out`, or finish it.

    Worker processes import the main script, so a script calls this under a guard:

    Example:
        if __name__ == "__main__":
            generate(Job("boxes", images=1000, seed=7, render=RenderSettings(quality="draft")))

    Args:
        job: What to make.
        worker_count: Number of processes on this machine; by default one per core.
        runner: Makes the shards in another way, for example `on_ray.run_on_ray`.

    Returns:
        The content of dataset.json.

    Raises:
        ConfigError: A value of the job is not valid.
        OutputError: The place cannot be written, is in use by another run, or holds something
            else or a dataset with other settings.
    """
    workers.end_unguarded_worker()
    worker_count = default_workers() if worker_count is None else worker_count
    job, settings = settled(job, worker_count)
    storage = storage_of(job.out)
    if isinstance(storage, Folder):
        _make_folder(storage.root)
    elif storage.lives_here and runner is None:
        raise OutputError(
            f"{job.out}: is memory of this process, which workers cannot see; "
            "give a folder or an object store"
        )
    existing(storage, job, settings)  # before the lock, which would change a foreign folder
    with storage.locked():
        old = existing(storage, job, settings)
        made = _made(job, storage, old or {})
        left = job.images - sum(made.values())
        if left or old is None:  # until the end, dataset.json must not look finished
            before = _content(storage, MANIFEST)
            storage.write(MANIFEST, [unsealed({**settings, "images": job.images})])
        if left:
            # a generator, for there may be millions of shards
            tasks = (Task(shard) for shard in range(job.shard_count) if shard not in made)
            progress = Progress(job.images, job.images - left)
            progress.note("starting")
            if runner is None and old is None:
                _report_idle_workers(job, worker_count)

            def on_report(kind: str, value: Any) -> None:
                if kind == "images":
                    progress.add(value)
                elif kind == "busy" and value:
                    LOGGER.info(value)
                    progress.note(value)

            try:
                (runner or run_here(worker_count))(job, tasks, on_report)
            except FastgenError:  # for example, the chosen device does not exist
                if not progress.made:
                    _restore(storage, MANIFEST, before)
                raise
            finally:
                progress.close()
        return finish(job, storage, settings, job.shard_count)


def check_resumable(job: Job, worker_count: int) -> None:
    """Check, without changing anything, that `generate` would continue the dataset at `job.out`.

    Raises the errors that `generate` raises for invalid values and for other settings than those
    of the dataset.
    """
    job, settings = settled(job, worker_count)
    storage = storage_of(job.out)
    _made(job, storage, existing(storage, job, settings) or {})


def run_here(
    worker_count: int,
    hang_s: float = workers.HANG_S,
    maker: Callable[..., Callable[[Task], None]] = Maker,
) -> Runner:
    """Return a runner that uses processes of this machine.

    Args:
        worker_count: Number of processes.
        hang_s: Seconds without a report after which a process is replaced.
        maker: Called in each process with the job, whether there is a process on every core, and
            a report function.
    """

    def run(job: Job, tasks: Iterable[Task], on_report: Callable[[str, Any], None]) -> None:
        whole = worker_count >= default_workers()
        setup = partial(maker, job, whole)
        workers.run(setup, tasks, worker_count, on_report, Strikes(job), hang_s)

    return run


def _content(storage: Storage, name: str) -> bytes | None:
    try:
        return storage.read(name)
    except FileNotFoundError:
        return None


def _restore(storage: Storage, name: str, content: bytes | None) -> None:
    """Put back what `_content` returned. Failures do not matter: a later run makes the file."""
    with contextlib.suppress(FastgenError, OSError):
        if content is None:
            storage.remove(name)
        else:
            storage.write(name, [content])


def _report_idle_workers(job: Job, worker_count: int) -> None:
    """Print a hint if there are fewer shards than workers and smaller shards would be faster."""
    scenes = -(-job.images // len(job.cameras))
    shards, fair = job.shard_count, -(-scenes // worker_count)
    if shards < worker_count and shards < -(-scenes // fair):
        hint(
            f"only {shards} of {worker_count} workers have work, because each shard has "
            f"{job.scenes_per_shard} scenes; use --shard {fair} in another folder to share it"
        )


def _make_folder(root: Path) -> None:
    try:
        root.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        # mkdir raises this for a dangling link too
        dangling = [p for p in (root, *root.parents) if p.is_symlink() and not p.exists()]
        what = f"{root}: is a file; give a folder"
        if dangling:
            to = os.readlink(dangling[0])
            what = (
                f"{dangling[0]}: is a link to {to}, which does not exist; make that folder, or "
                "remove the link"
            )
        raise OutputError(what) from None
    except OSError as error:
        raise OutputError(f"{root}: cannot be written ({error.strerror})") from None


def _made(job: Job, storage: Storage, old: Mapping[str, Any]) -> dict[int, int]:
    """Return the number of images of each shard that is complete and has all its files.

    Args:
        job: The job, with its settings_digest.
        storage: The place of the dataset.
        old: Content of dataset.json, or {}.

    Raises:
        OutputError: There are more images than the job's, or shards with other settings.
    """
    too_many = "digest" in old and old["images"] > job.images
    present = storage.sizes()
    made = {}
    for shard in shard_numbers(storage):
        manifest = read_manifest(storage, shard)
        if manifest is None:  # is made again; beyond the job's images, `verify` reports it
            continue
        wanted = [job.stem(index, camera) for index, camera in job.wanted(shard)]
        if manifest["settings"] != job.settings_digest:
            raise OutputError(
                f"{job.out}: {manifest_path(shard)} was made with other settings; give another "
                "folder, or remove that file to have its images made again"
            )
        too_many = too_many or not wanted or not set(manifest["images"]) <= set(wanted)
        files = manifest["files"].items()
        complete = all(present.get(path) == size for path, (size, _) in files)
        if complete and manifest["images"] == wanted:
            made[shard] = len(wanted)
    if too_many:
        raise OutputError(
            f"{job.out}: holds more than {job.images} images; give --images as before or more"
        )
    return made

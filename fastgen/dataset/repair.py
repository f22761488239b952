"""`fastgen verify --repair`: what is damaged or missing made again, and nothing else."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from fastgen.config.config import Config
from fastgen.dataset.dataset_json import MANIFEST
from fastgen.dataset.generate import check_count, check_goes_on, generate
from fastgen.dataset.shards import Job
from fastgen.dataset.storage import storage_of
from fastgen.dataset.verify import examine
from fastgen.errors import OutputError


def repair(
    out: str,
    worker_count: int,
    hdri_dir: str | Path | None = None,
    device_index: int | None = None,
) -> tuple[list[str], list[str]]:
    """Make again every shard with a file that is not as it was written, and scenes that failed, or
    finish what was begun.

    hdri_dir: where the HDRIs are that the dataset was made with, None for the bundled ones.
    device_index: which of EGL's devices draws.
    Returns the faults that were mended and those that are left. Raises OutputError where
    dataset.json does not tell what to make, or the settings that it names cannot be had here;
    ConfigError for a count of workers that cannot be.
    """
    check_count("workers", worker_count)  # also where nothing is to be made
    found = examine(out)
    if not found.manifest:
        raise OutputError(f"{out}: {found.faults[0]}")
    finished = "digest" in found.manifest  # else this may be the rest of a repair
    if finished and not found.broken and not found.manifest["failed"]:
        return [], found.faults
    job = replace(_job(out, found.manifest, hdri_dir), device_index=device_index)
    check_goes_on(job, worker_count)  # before anything is removed
    storage = storage_of(out)
    with storage.locked():
        for path in sorted(found.broken):
            storage.remove(path)  # `generate` makes what is missing, but reads no file's content
    generate(job, worker_count)
    left = examine(out).faults
    return [fault for fault in found.faults if finished and fault not in left], left


def _job(out: str, manifest: dict[str, Any], hdri_dir: str | Path | None) -> Job:
    """The job that made the dataset."""
    try:
        return Job(
            out=out,
            images=manifest["images"],
            config=Config.from_values(manifest["config"]),
            seed=manifest["seed"],
            size=tuple(manifest["size"]),
            cameras=tuple(manifest["cameras"]),
            hdri_dir=None if hdri_dir is None else str(hdri_dir),
            backend=manifest.get("backend", "auto"),
            fmt=manifest["format"],
            formats=tuple(manifest["formats"]),
            quality=manifest["quality"],
            shard_scenes=manifest["shard_scenes"],
        )
    except KeyError as error:
        raise OutputError(
            f"{out}/{MANIFEST}: has no {error}; run generate again with the same settings"
        ) from None

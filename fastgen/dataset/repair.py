"""`fastgen verify --repair`: make damaged and missing files again, and nothing else."""

import json
from pathlib import Path
from typing import Any

from fastgen.config.config import Config
from fastgen.dataset.dataset_json import MANIFEST
from fastgen.dataset.generate import check_resumable, default_workers, generate
from fastgen.dataset.job import Job
from fastgen.dataset.manifest_types import Started, unfit
from fastgen.dataset.settings import check_count
from fastgen.dataset.storage import storage_of
from fastgen.dataset.verify import Findings, examine
from fastgen.errors import OutputError, shown
from fastgen.render.settings import RenderSettings


def repair(
    out: str,
    worker_count: int | None = None,
    hdri_dir: str | Path | None = None,
    device_index: int | None = None,
    run_postprocess: bool = False,
) -> tuple[list[str], Findings]:
    """Make every shard again that has a changed or missing file or a failed scene.

    An unfinished dataset is finished. Files that are not part of the dataset stay as they are.

    Args:
        out: Folder or address of the dataset.
        worker_count: Number of processes; by default one per core.
        hdri_dir: Folder of the HDRIs that the dataset was made with; None for the bundled ones.
        device_index: EGL device to draw with; None takes the first that works.
        run_postprocess: Call the function that `postprocess` in dataset.json names. It may be any
            function of any installed package, so the dataset has to be trusted.

    Returns:
        The faults that were repaired, and the findings that are left.

    Raises:
        OutputError: dataset.json is unusable, or its settings are not available here.
        ConfigError: The number of workers is not valid.
    """
    worker_count = default_workers() if worker_count is None else worker_count
    check_count("workers", worker_count)  # even if there is nothing to make
    found = examine(out)
    if not found.manifest:
        raise OutputError(f"{out}: {found.faults[0]}")
    finished = "digest" in found.manifest  # otherwise this may be the rest of a repair
    if finished and not found.broken and not found.manifest["failed"]:
        return [], found
    if "merged_from" in found.manifest:
        raise OutputError(
            f"{out}: was merged, so its files cannot be made again ({found.faults[0]}); repair the "
            "datasets it was merged from, and merge them again"
        )
    job = _job(out, found.manifest, hdri_dir, device_index)
    function = job.config.postprocess
    if function and not run_postprocess:
        raise OutputError(
            f"{out}: was made with the function {shown(function)}, which a repair would call; give "
            "--run-postprocess if you trust the dataset"
        )
    check_resumable(job, worker_count)  # before anything is removed
    storage = storage_of(out)
    with storage.locked():
        for path in sorted(found.broken):
            storage.remove(path)  # `generate` makes missing files, but does not check content
    generate(job, worker_count)
    left = examine(out)
    return [fault for fault in found.faults if finished and fault not in left.faults], left


def _job(
    out: str, manifest: dict[str, Any], hdri_dir: str | Path | None, device_index: int | None
) -> Job:
    """Return the job that made the dataset."""
    problem = unfit(json.dumps(manifest).encode(), Started)
    if problem:
        raise OutputError(f"{out}/{MANIFEST}: {problem}; run generate again with the same settings")
    return Job(
        out=out,
        images=manifest["images"],
        config=Config.from_values(manifest["config"]),
        seed=manifest["seed"],
        cameras=tuple(manifest["cameras"]),
        render=RenderSettings(
            size=tuple(manifest["size"]),
            quality=manifest["quality"],
            backend=manifest.get("backend", "auto"),
            device_index=device_index,
            hdri_dir=hdri_dir,
        ),
        layout=manifest["format"],
        tasks=tuple(manifest["formats"]),
        shard_scenes=manifest["shard_scenes"],
        stems=manifest.get("stems", "short"),
        coco_masks=manifest.get("coco_masks", "rle"),
    )

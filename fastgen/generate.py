"""A whole dataset: scenes handed out to worker processes, files written, the rest gathered up.

Which files come is decided by (config, seed, index, cameras) alone, so any number of workers makes
the same bytes, and running again on the same folder makes only what is missing.
"""

import json
import multiprocessing
import os
import queue
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fastgen.config import Config, SplitConfig
from fastgen.contact_sheet import write_contact_sheet
from fastgen.environment import find_hdris, load_environment
from fastgen.errors import ConfigError, FastgenError, OutputError
from fastgen.generator import Generator
from fastgen.progress import Progress
from fastgen.records import nearest
from fastgen.sampling import SPLITS, split_of
from fastgen.writers.encode import write
from fastgen.writers.seafront import SeafrontWriter, remove_partial

FORMATS = ("seafront",)
MANIFEST = "dataset.json"
CONTACT_SHEET = "contact_sheet.png"
_POLL_S = 0.5


@dataclass(frozen=True)
class Job:
    """What to generate. images counts images, not scenes; size is (width, height)."""

    out: Path
    images: int
    config: Config
    seed: int
    size: tuple[int, int]
    cameras: tuple[str, ...]
    hdri_dir: str | None
    backend: str


def generate(job: Job, workers: int, fmt: str = "seafront") -> dict[str, Any]:
    """Make or finish the dataset in job.out; returns what dataset.json says.

    Raises OutputError when the folder holds something else, was made with other settings, or a
    worker fails; ConfigError for values that cannot be.
    """
    job = _checked(job, workers, fmt)
    settings = _settings(job, fmt)
    _claim(job.out, settings)
    writer = SeafrontWriter(job.out, job.config.labels, settings["version"])
    remove_partial(job.out)
    per_scene = len(job.cameras)
    scenes = range(-(-job.images // per_scene))
    missing = [i for i in scenes if _missing(job, writer, i)]
    todo = sum(len(_missing(job, writer, i)) for i in missing)
    made_by: dict[str, str] = {}
    if missing:
        progress = Progress(job.images, job.images - todo)
        made_by = _run(job, missing, min(workers, len(missing)), progress, settings["version"])
        progress.close()
    counts = writer.finish()
    old = json.loads((job.out / MANIFEST).read_text(encoding="utf-8"))
    made_by = made_by or {key: old.get(key, "") for key in ("backend", "renderer")}
    manifest = {**settings, **made_by, "counts": counts}
    write(job.out / MANIFEST, json.dumps(manifest, indent=1))
    write_contact_sheet(job.out, job.out / CONTACT_SHEET)
    return manifest


def stem_of(index: int, camera: str) -> str:
    """File name, without its ending, of scene `index` seen by `camera`."""
    return f"{index:06d}_{camera}"


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


def _checked(job: Job, workers: int, fmt: str) -> Job:
    if job.images < 1:
        raise ConfigError(f"images: {job.images} is out of range; give 1 or more")
    if workers < 1:
        raise ConfigError(f"workers: {workers} is out of range; give 1 or more")
    if fmt not in FORMATS:
        raise ConfigError(f"format: {fmt!r} is unknown{nearest(fmt, FORMATS)}")
    for name in job.cameras:
        if name not in job.config.cameras:
            raise ConfigError(f"cameras: {name!r} is unknown{nearest(name, job.config.cameras)}")
    if not job.cameras or len(set(job.cameras)) != len(job.cameras):
        raise ConfigError("cameras: name at least one, and each only once")
    return job


def _settings(job: Job, fmt: str) -> dict[str, Any]:
    from fastgen import __version__

    # validates seed and size without opening GL
    generator = Generator(job.config, job.seed, job.size, hdri_dir=job.hdri_dir)
    names = generator.environments
    generator.scene(0)  # what only sampling can refuse is refused before anything is written
    for path in find_hdris(job.hdri_dir) if job.hdri_dir else ():
        load_environment(path)  # names a broken file now, and caches the light for the workers
    return {
        "version": __version__,
        "format": fmt,
        "seed": job.seed,
        "size": list(job.size),
        "cameras": list(job.cameras),
        "environments": list(names),
        "config": job.config.to_plain(),
    }


def _claim(out: Path, settings: dict[str, Any]) -> None:
    """Make the folder ours, or see that it is and was made alike."""
    path = out / MANIFEST
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            if any(out.iterdir()):
                raise OutputError(
                    f"{out}: holds something else (no {MANIFEST}); give an empty or new folder"
                )
            write(path, json.dumps(settings, indent=1))
            return
        old = json.loads(path.read_text(encoding="utf-8"))
    except FileExistsError:
        raise OutputError(f"{out}: is a file; give a folder") from None
    except OSError as error:
        raise OutputError(f"{out}: cannot be written ({error.strerror})") from None
    except ValueError:
        raise OutputError(f"{path}: is damaged; remove the folder or give another") from None
    for key, value in json.loads(json.dumps(settings)).items():
        if old.get(key) != value:
            raise OutputError(
                f"{out}: was made with another {key}; repeat its settings to resume, "
                f"or give another folder"
            )


def _missing(job: Job, writer: SeafrontWriter, index: int) -> list[str]:
    """Cameras of scene `index` that are wanted and not there yet."""
    first = index * len(job.cameras)
    wanted = job.cameras[: max(0, min(len(job.cameras), job.images - first))]
    split = split_of(job.config, job.seed, index)
    return [name for name in wanted if not writer.has(split, stem_of(index, name))]


def _run(
    job: Job, indices: Sequence[int], workers: int, progress: Progress, version: str
) -> dict[str, str]:
    """Let worker processes render scenes. Returns backend and renderer that made them."""
    # a context made before a fork hangs its children, so processes start afresh
    context = multiprocessing.get_context("spawn")
    tasks: Any = context.Queue()
    results: Any = context.Queue()
    for index in (*indices, *[None] * workers):
        tasks.put(index)
    whole_machine = workers >= len(os.sched_getaffinity(0))
    processes = [
        context.Process(
            target=_work, args=(job, version, tasks, results, whole_machine), daemon=True
        )
        for _ in range(workers)
    ]
    for process in processes:
        process.start()
    made_by: dict[str, str] = {}
    finished = 0
    try:
        while finished < workers:
            try:
                kind, value = results.get(timeout=_POLL_S)
            except queue.Empty:
                dead = [p for p in processes if p.exitcode not in (None, 0)]
                if dead:
                    raise OutputError(
                        f"a worker process died (exit code {dead[0].exitcode}); what is written "
                        f"stays good: run the same command again to go on"
                    ) from None
                continue
            if kind == "images":
                progress.add(value)
            elif kind == "made by":
                made_by = value
            elif kind == "end":
                finished += 1
            else:
                raise OutputError(value)
    finally:
        for process in processes:
            if finished < workers:
                process.terminate()
            process.join()
        for channel in (tasks, results):
            channel.cancel_join_thread()
            channel.close()
    return made_by


def _work(job: Job, version: str, tasks: Any, results: Any, whole_machine: bool) -> None:
    """One worker process: scenes from `tasks` until None, reports to `results`."""
    if whole_machine:
        # one process a core is faster than llvmpipe's threads; it reads this at its first context
        os.environ.setdefault("LP_NUM_THREADS", "0")
    place = "start"
    try:
        writer = SeafrontWriter(job.out, job.config.labels, version)
        with Generator(
            job.config, job.seed, job.size, backend=job.backend, hdri_dir=job.hdri_dir
        ) as generator:
            made_by = {"backend": generator.used_backend, "renderer": generator.renderer_name}
            results.put(("made by", made_by))
            for index in iter(tasks.get, None):
                place = f"scene {index}"
                scene = generator.scene(index)
                split = split_of(job.config, job.seed, index)
                for name in _missing(job, writer, index):
                    place = f"scene {index}, camera {name}"
                    sample = generator.render(scene=scene, camera=name)
                    writer.add(sample, split, stem_of(index, name))
                    results.put(("images", 1))
        results.put(("end", None))
    except KeyboardInterrupt:
        pass
    except (FastgenError, OSError) as error:
        results.put(("failed", f"{place}: {error}"))
    except Exception as error:
        traceback.print_exc()
        results.put(("failed", f"{place}: {error!r} (our mistake: please report it)"))

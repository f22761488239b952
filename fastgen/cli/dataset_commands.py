"""Commands about whole datasets: generate, merge, stats, report and verify."""

import argparse
import json
import shlex
from typing import Any

from fastgen.cli.options import (
    add_config,
    add_device,
    add_hdri,
    add_output,
    add_render,
    add_seed,
    config_of,
    output_file,
    render_settings,
    sentence,
    summarize,
)
from fastgen.dataset.addresses import place_of
from fastgen.dataset.console import say, tell
from fastgen.dataset.finish import CONTACT_SHEET
from fastgen.dataset.generate import generate
from fastgen.dataset.job import COCO_MASKS, LAYOUTS, SHARD_SCENES, STEMS, Job
from fastgen.dataset.merge import merge
from fastgen.dataset.on_ray import run_on_ray
from fastgen.dataset.repair import repair
from fastgen.dataset.settings import parse_split
from fastgen.dataset.stats import report, statistics
from fastgen.dataset.verify import examine
from fastgen.errors import one_line
from fastgen.formats.registry import SEAFRONT, format_names, known_formats

_GENERATE = """\
Generate a labelled dataset, or continue one that was stopped.

Running the same command again on OUT makes only the images that are missing. Raise --images to
extend a dataset. The same options give the same files, with any number of workers."""

_EXAMPLES = """\
examples:
  fastgen generate boxes --images 1000 --seed 7
  fastgen generate boxes --images 5000 --seed 7 --config port.yaml --quality draft --workers 8
  fastgen generate s3://bucket/boxes --images 100000 --format webdataset"""

_MERGE = """\
Merge finished datasets of the same layout, formats and classes into a new one.

OUT appears when it is complete. The datasets do not change. Files are hard links where the file
system allows it. Names of images begin with the seed of their dataset."""

_VERIFY = """\
Check that every file of a dataset is present, unchanged since it was written, and consistent with
the other labels. The exit code is 1 if there are faults. Files that are not part of the dataset,
such as caches of trainers, are listed and stay as they are."""

_RAW = argparse.RawDescriptionHelpFormatter

_OUT = "folder of the dataset, or an address such as s3://bucket/folder"


def add_generate(commands: Any) -> None:
    """Add `fastgen generate`."""
    command = commands.add_parser(
        "generate",
        help="generate a dataset, or continue one",
        description=_GENERATE,
        epilog=_EXAMPLES,
        formatter_class=_RAW,
    )
    command.add_argument("out", type=_place, metavar="OUT", help=_OUT)
    command.add_argument(
        "--images",
        type=int,
        required=True,
        metavar="N",
        help="number of images in the finished dataset, of all cameras together",
    )
    add_seed(command)
    command.add_argument(
        "--cameras",
        metavar="A,B,Cl,Cr",
        help="cameras that photograph each scene; default: all of the configuration",
    )
    command.add_argument(
        "--split",
        metavar="NAME|a,b,c",
        help="put all scenes into train, val or test, or give the fractions of the three, as in "
        "0.7,0.15,0.15; default: as in the configuration",
    )
    add_config(command)
    add_render(command)
    output = command.add_argument_group("output")
    output.add_argument(
        "--format",
        default=LAYOUTS[0],
        metavar="|".join(LAYOUTS),
        help="layout of the dataset: seafront has one folder for each task, webdataset has tar "
        "files, parquet has tables with a row per image and needs fastgen[parquet]; default: "
        "%(default)s",
    )
    output.add_argument(
        "--tasks",
        default=",".join(SEAFRONT),
        metavar=",".join(SEAFRONT),
        help="tasks to write, separated by commas, out of these and those of --also; images and "
        "scene files are always written; default: all of these",
    )
    unpacked = [name for name, each in known_formats().items() if not each.fits_archives]
    output.add_argument(
        "--also",
        default="",
        metavar=",".join(name for name in format_names() if name not in SEAFRONT),
        help="label files to write in addition to --tasks, separated by commas; "
        f"{', '.join(unpacked)} need the seafront format",
    )
    output.add_argument(
        "--stems",
        default=STEMS[0],
        metavar="|".join(STEMS),
        help="names of files: seed has the seed, as in s7_000017_A, so that datasets of different "
        "seeds can be merged; short has only scene and camera, as in 000017_A; default: "
        "%(default)s",
    )
    output.add_argument(
        "--coco-masks",
        default=COCO_MASKS[0],
        metavar="|".join(COCO_MASKS),
        help="masks in COCO files, except those of crowds, which are always rle; default: "
        "%(default)s",
    )
    defaults = ", ".join(f"{count} in {name}" for name, count in SHARD_SCENES.items())
    output.add_argument(
        "--shard",
        type=int,
        metavar="SCENES",
        help="number of scenes that a worker makes and commits together, and that share a "
        f"tar or Parquet file; default: {defaults}",
    )
    machines = command.add_argument_group("machines")
    machines.add_argument(
        "--workers",
        type=int,
        metavar="K",
        help="number of processes; default: one per core, or with --ray one per CPU of the cluster",
    )
    machines.add_argument(
        "--ray",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="render on a Ray cluster: auto or HOST:PORT, or no value to start Ray on this "
        "machine; all nodes must be able to write to OUT",
    )
    add_output(command)
    command.set_defaults(run=_generate, resumes=True)


def add_merge(commands: Any) -> None:
    """Add `fastgen merge`."""
    command = commands.add_parser(
        "merge", help="make one dataset of several", description=_MERGE, formatter_class=_RAW
    )
    command.add_argument(
        "datasets", type=_place, nargs="+", metavar="DATASET", help="folder of a finished dataset"
    )
    command.add_argument("out", type=_place, metavar="OUT", help="new folder")
    add_output(command)
    command.set_defaults(run=_merge)


def add_stats(commands: Any) -> None:
    """Add `fastgen stats`."""
    words = "print how many images and labels a dataset has, by class and split"
    command = commands.add_parser("stats", help=words, description=sentence(words))
    command.add_argument("out", type=_place, metavar="OUT", help=_OUT)
    command.add_argument("--json", action="store_true", help="print the numbers as JSON")
    command.set_defaults(run=_stats)


def add_report(commands: Any) -> None:
    """Add `fastgen report`."""
    words = "write a page of HTML that shows what a dataset holds, with advice"
    command = commands.add_parser("report", help=words, description=sentence(words))
    command.add_argument("out", type=_place, metavar="OUT", help=_OUT)
    command.add_argument(
        "-o",
        dest="file",
        type=output_file,
        metavar="FILE.html",
        help="file to write; default: OUT.report.html, beside the dataset",
    )
    command.set_defaults(run=_report)


def add_verify(commands: Any) -> None:
    """Add `fastgen verify`."""
    command = commands.add_parser(
        "verify", help="check the files of a dataset, or repair them", description=_VERIFY
    )
    command.add_argument("out", type=_place, metavar="OUT", help=_OUT)
    command.add_argument(
        "--repair",
        action="store_true",
        help="make damaged and missing files again; the other options apply to this",
    )
    command.add_argument(
        "--run-postprocess",
        action="store_true",
        help="call the function that postprocess in dataset.json names; only for datasets that you "
        "trust",
    )
    command.add_argument(
        "--workers", type=int, metavar="K", help="number of processes; default: one per core"
    )
    add_hdri(command, ", if the dataset was made with such a folder")
    add_device(command)
    add_output(command)
    command.set_defaults(run=_verify)


def _place(text: str) -> str:
    """Return OUT with ~ expanded and without trailing slashes, which messages would repeat."""
    if not text:
        raise argparse.ArgumentTypeError("is empty; give a folder or an address")
    scheme, colon, path = place_of(text).rpartition("://")
    return scheme + colon + (path.rstrip("/") or path[:1])


def _generate(options: argparse.Namespace) -> int:
    job = Job(
        out=options.out,
        images=options.images,
        config=parse_split(options.split, config_of(options)),
        seed=options.seed,
        cameras=() if options.cameras is None else tuple(options.cameras.split(",")),
        render=render_settings(options),
        layout=options.format,
        tasks=tuple(options.tasks.split(",")) if options.tasks else (),
        also=tuple(options.also.split(",")) if options.also else (),
        shard_scenes=options.shard,
        stems=options.stems,
        coco_masks=options.coco_masks,
    )
    runner = None if options.ray is None else run_on_ray(options.ray or None, options.workers)
    manifest = generate(job, options.workers, runner)
    look = f"; look at {options.out}/{CONTACT_SHEET}" if CONTACT_SHEET in manifest["files"] else ""
    failures = [
        f"scene {each['scene']} of seed {each['seed']} failed: {each['error']}"
        for each in manifest["failed"]
    ]
    result = _result(options.out, manifest)
    lines = (f"{result['images']} images in {options.out}{look}", *failures)
    summarize(options, result, lines)
    if options.quiet:
        for failure in failures:
            say(one_line(f"fastgen: {failure}"))
    return 1 if manifest["failed"] else 0


def _result(out: str, manifest: dict[str, Any]) -> dict[str, Any]:
    """Return what --json prints about a new dataset."""
    total = sum(split["images"] for split in manifest["counts"].values())
    parts = {key: manifest[key] for key in ("counts", "failed")}
    return {"out": out, "images": total, **parts}


def _merge(options: argparse.Namespace) -> int:
    result = _result(options.out, merge(options.datasets, options.out))
    words = f"{result['images']} images of {len(options.datasets)} datasets in {options.out}"
    summarize(options, result, [words])
    return 0


def _stats(options: argparse.Namespace) -> int:
    tell(json.dumps(statistics(options.out)) if options.json else report(options.out))
    return 0


def _report(options: argparse.Namespace) -> int:
    from fastgen.report.page import write_report  # here because few commands need it

    path, advice = write_report(options.out, options.file)
    found = f"{advice} pieces of advice" if advice != 1 else "1 piece of advice"
    tell(f"{path}: {found}; open it in a browser")
    return 0


def _verify(options: argparse.Namespace) -> int:
    repaired: list[str] = []
    if options.repair:
        repaired, found = repair(
            options.out,
            options.workers,
            options.hdri,
            options.device_index,
            options.run_postprocess,
        )
    else:
        found = examine(options.out)
    lines = [f"repaired: {fault}" for fault in repaired] + found.faults
    lines += [f"{path}: not part of the dataset" for path in found.foreign]
    if not found.faults:
        lines.append(f"{options.out}: whole and consistent")
    elif found.broken and not options.repair:
        again = f"fastgen verify {shlex.quote(options.out)} --repair"
        lines.append(f"to make damaged and missing files again: {again}")
    result = {
        "out": options.out,
        "faults": found.faults,
        "foreign": found.foreign,
        "repaired": repaired,
    }
    summarize(options, result, lines)
    return 1 if found.faults else 0

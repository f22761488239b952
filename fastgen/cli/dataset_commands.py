"""Commands about whole datasets: generate, stats, report and verify."""

import argparse
import shlex
from typing import Any

from fastgen.cli.options import (
    add_config,
    add_device,
    add_hdri,
    add_render,
    add_seed,
    config_of,
    output_file,
    render_settings,
)
from fastgen.dataset import stats
from fastgen.dataset.addresses import place_of
from fastgen.dataset.console import tell
from fastgen.dataset.finish import CONTACT_SHEET
from fastgen.dataset.generate import generate
from fastgen.dataset.job import COCO_MASKS, LAYOUTS, SHARD_SCENES, STEMS, Job
from fastgen.dataset.on_ray import run_on_ray
from fastgen.dataset.repair import repair
from fastgen.dataset.settings import parse_split
from fastgen.dataset.verify import examine
from fastgen.formats.registry import SEAFRONT, known_formats

_GENERATE = """\
Generate a labelled dataset, or continue one that was stopped.

Running the same command again on OUT makes only the images that are missing. Raise --images to
extend a dataset. The same options give the same files, with any number of workers."""

_EXAMPLES = """\
examples:
  fastgen generate boxes --images 1000 --seed 7
  fastgen generate boxes --images 5000 --seed 7 --config port.yaml --quality draft --workers 8
  fastgen generate s3://bucket/boxes --images 100000 --format webdataset"""

_VERIFY = """\
Check that every file of a dataset is present, unchanged since it was written, and consistent with
the other labels. The exit code is 1 if there are faults."""

_OUT = "folder of the dataset, or an address such as s3://bucket/folder"


def add_generate(commands: Any) -> None:
    """Add `fastgen generate`."""
    command = commands.add_parser(
        "generate",
        help="generate a dataset, or continue one",
        description=_GENERATE,
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
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
    output.add_argument(
        "--also",
        default="",
        metavar=",".join(sorted(set(known_formats()) - set(SEAFRONT))),
        help="label files to write in addition to --tasks, separated by commas; bop and coco need "
        "the seafront format",
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
    command.set_defaults(run=_generate)


def add_stats(commands: Any) -> None:
    """Add `fastgen stats`."""
    words = "print how many images and labels a dataset has, by class and split"
    command = commands.add_parser("stats", help=words, description=f"{words.capitalize()}.")
    command.add_argument("out", type=_place, metavar="OUT", help=_OUT)
    command.set_defaults(run=_stats)


def add_report(commands: Any) -> None:
    """Add `fastgen report`."""
    words = "write a page of HTML that shows what a dataset holds, with advice"
    command = commands.add_parser("report", help=words, description=f"{words.capitalize()}.")
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
        "--workers", type=int, metavar="K", help="number of processes; default: one per core"
    )
    add_hdri(command, ", if the dataset was made with such a folder")
    add_device(command)
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
    total = sum(split["images"] for split in manifest["counts"].values())
    look = f"; look at {options.out}/{CONTACT_SHEET}" if CONTACT_SHEET in manifest["files"] else ""
    tell(f"{total} images in {options.out}{look}")
    for each in manifest["failed"]:
        tell(f"scene {each['scene']} of seed {each['seed']} failed: {each['error']}")
    return 1 if manifest["failed"] else 0


def _stats(options: argparse.Namespace) -> int:
    tell(stats.report(options.out))
    return 0


def _report(options: argparse.Namespace) -> int:
    from fastgen.report.page import write_report  # here because few commands need it

    path, advice = write_report(options.out, options.file)
    found = f"{advice} pieces of advice" if advice != 1 else "1 piece of advice"
    tell(f"{path}: {found}; open it in a browser")
    return 0


def _verify(options: argparse.Namespace) -> int:
    if options.repair:
        repaired, faults = repair(options.out, options.workers, options.hdri, options.device_index)
        for fault in repaired:
            tell(f"repaired: {fault}")
        hint = ""
    else:
        found = examine(options.out)
        faults = found.faults
        hint = f"fastgen verify {shlex.quote(options.out)} --repair" if found.broken else ""
    tell("\n".join(faults) if faults else f"{options.out}: whole and consistent")
    if hint:
        tell(f"to make damaged and missing files again: {hint}")
    return 1 if faults else 0

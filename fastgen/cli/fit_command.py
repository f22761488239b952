"""`fastgen fit`: propose a configuration for a folder of photographs."""

import argparse
from pathlib import Path
from typing import Any

from fastgen.cli.options import add_seed, output_file
from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.dataset.console import tell
from fastgen.dataset.progress import Progress
from fastgen.errors import ConfigError, OutputError
from fastgen.files.images import check_folder, write

_FIT = """\
Propose a configuration whose pictures resemble photographs in measured statistics: exposure,
response, white balance, saturation, noise, blur, sharpening, JPEG, paints and times of day. Prints
the gap of each cue before and after. Photographs need no labels; 20 are enough."""


def add_fit(commands: Any) -> None:
    """Add `fastgen fit`."""
    command = commands.add_parser(
        "fit",
        help="propose a configuration that resembles your own photographs",
        description=_FIT,
    )
    command.add_argument("photos", type=Path, metavar="PHOTOS", help="folder of photographs")
    command.add_argument(
        "-o",
        dest="file",
        type=output_file,
        default=Path("fitted.yaml"),
        metavar="FILE.yaml",
        help="file to write, for --config with the same --preset; default: %(default)s",
    )
    command.add_argument("--force", action="store_true", help="replace FILE.yaml if it exists")
    command.add_argument(
        "--budget",
        type=float,
        default=4.0,
        metavar="MINUTES",
        help="effort of the search in minutes of a machine with two cores, after a few minutes of "
        "rendering; it sets the number of trials, so the same seed gives the same file on any "
        "machine; default: %(default)g",
    )
    command.add_argument(
        "--longest",
        type=int,
        default=640,
        metavar="PX",
        help="longer side of the images that you will make; larger photographs are scaled down to "
        "it; default: %(default)s",
    )
    add_seed(command)
    command.add_argument(
        "--preset",
        default="gate",
        metavar=f"{'|'.join(PRESETS)}|FILE",
        help="preset or file to start from; `fastgen presets` lists all; default: %(default)s",
    )
    command.set_defaults(run=_fit)


class _Stages:
    """Progress of a fit: a line for each stage, or in a log also one every 15 s."""

    def __init__(self) -> None:
        self._unit = ""
        self._progress: Progress | None = None

    def show(self, unit: str, done: int, total: int, remark: str) -> None:
        """Show how many photographs, pictures, scenes or trials of a stage are done."""
        if self._progress is None or unit != self._unit:
            self.close()
            self._unit, self._progress = unit, Progress(total, unit=unit)
        if done:
            self._progress.add(done - self._progress.made, remark)
        else:
            self._progress.note("starting")

    def close(self) -> None:
        """Draw the last state of the last stage."""
        if self._progress is not None:
            self._progress.close()


def _fit(options: argparse.Namespace) -> int:
    # here because scipy.stats takes a second to import
    from fastgen.fit.boxes import read_box_heights
    from fastgen.fit.gap import FEWEST, table
    from fastgen.fit.photographs import read_photographs
    from fastgen.fit.proposal import TRIALS_PER_MINUTE, Effort, propose
    from fastgen.fit.search import optimizer

    if not 0.1 <= options.budget <= 600:
        raise ConfigError(f"budget: {options.budget:g} is out of range; give 0.1 to 600 minutes")
    if not 64 <= options.longest <= 4096:
        raise ConfigError(f"longest: {options.longest} is out of range; give 64 to 4096 pixels")
    if options.file.exists() and not options.force:
        raise OutputError(f"{options.file}: exists; give another name with -o, or --force")
    if options.file.is_dir():
        raise OutputError(f"{options.file}: is a folder; give a file with -o")
    check_folder(options.file)
    optimizer()  # refuses a missing one before minutes of rendering
    preset = Config.preset(options.preset)
    photographs = read_photographs(options.photos, options.longest, FEWEST)
    boxes = read_box_heights(options.photos, photographs)
    effort = Effort(max(round(TRIALS_PER_MINUTE * options.budget), 12))
    stages = _Stages()
    try:
        proposal = propose(photographs, preset, effort, options.seed, boxes, stages.show)
    finally:
        stages.close()
    head = (
        f"Changes to --preset {options.preset}, fitted to {len(photographs)} photographs.\n"
        f"Mean gap {proposal.before.total:.2f} before and {proposal.after.total:.2f} after, in "
        "spreads of the photographs."
    )
    write(options.file, proposal.as_yaml(head))
    tell(table(proposal.before, proposal.after))
    for note in proposal.notes:
        tell(note)
    tell(f"wrote {options.file}; use it with --preset {options.preset} --config {options.file}")
    return 0

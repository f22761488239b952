"""Options that several commands share, and the objects they describe."""

import argparse
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fastgen.config.assignments import assigned
from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.dataset.addresses import place_of
from fastgen.dataset.console import tell
from fastgen.errors import ConfigError, OutputError, shown
from fastgen.render.gl import BACKENDS
from fastgen.render.settings import QUALITY, RenderSettings
from fastgen.validation import check_known

LOG_LEVELS = ("info", "warning", "error")


def sentence(words: str) -> str:
    """Return the help of a command as a sentence; names such as HTML keep their capitals."""
    return f"{words[0].upper()}{words[1:]}."


def add_config(command: argparse.ArgumentParser) -> None:
    """Add --preset, --config and --set, which `config_of` reads."""
    group = command.add_argument_group("scenes")
    group.add_argument(
        "--preset",
        metavar=f"{'|'.join(PRESETS)}|FILE",
        help="preset or file to start from; `fastgen presets` lists all; default: seafront",
    )
    group.add_argument(
        "--config",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="YAML or JSON file with values that replace those of the preset; `fastgen config` "
        "prints all keys. Of several, each changes the result of those before it",
    )
    group.add_argument(
        "--set",
        dest="assignments",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="single value that replaces that of preset and files, as in damage.probability=0.8; "
        "may be given several times",
    )


def add_seed(command: argparse.ArgumentParser) -> None:
    """Add --seed."""
    command.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="S",
        help="random seed, 0 or more; the same seed gives the same scenes; default: %(default)s",
    )


def add_index(command: argparse.ArgumentParser) -> None:
    """Add --index."""
    command.add_argument(
        "--index", type=int, required=True, metavar="I", help="number of the scene, from 0"
    )


def add_render(command: argparse.ArgumentParser, quality: bool = True) -> None:
    """Add the options that `render_settings` reads; --quality only if `quality`."""
    group = command.add_argument_group("rendering")
    add_size(group)
    if quality:
        group.add_argument(
            "--quality",
            default="balanced",
            metavar="|".join(QUALITY),
            help="speed against image quality: draft is fastest and aliased, fine takes the most "
            "samples per pixel, high adds ray-traced light; default: %(default)s",
        )
    add_hdri(group)
    group.add_argument(
        "--backend",
        default="auto",
        metavar="|".join(BACKENDS),
        help="OpenGL backend; auto takes the first that works; default: %(default)s",
    )
    add_device(group)


def add_size(command: argparse._ActionsContainer) -> None:
    """Add --size, which `size_of` reads."""
    command.add_argument(
        "--size",
        default="640x640",
        metavar="WxH",
        help="width and height of the images in pixels, each 64 to 4096; default: %(default)s",
    )


def add_hdri(command: argparse._ActionsContainer, note: str = "") -> None:
    """Add --hdri. `note` follows the description."""
    command.add_argument(
        "--hdri",
        metavar="DIR",
        help=f"folder of .hdr and .exr panoramas that replace the bundled ones as lights{note}",
    )


def add_output(command: argparse.ArgumentParser) -> None:
    """Add --quiet, --json and --log-level; `main` and `summarize` read them."""
    group = command.add_argument_group("messages")
    group.add_argument("--quiet", action="store_true", help="print nothing but errors")
    group.add_argument(
        "--json",
        action="store_true",
        help="print the result as one line of JSON, even with --quiet",
    )
    group.add_argument(
        "--log-level",
        default="warning",
        metavar="|".join(LOG_LEVELS),
        help="least important messages to print; default: %(default)s",
    )


def log_level(options: argparse.Namespace) -> str:
    """Return the level that the options of `add_output` describe."""
    level: str = getattr(options, "log_level", "warning")
    check_known("log-level", level, LOG_LEVELS)
    return "error" if getattr(options, "quiet", False) else level


def summarize(options: argparse.Namespace, result: dict[str, Any], lines: Iterable[str]) -> None:
    """Print the result of a command as JSON or as lines, as the options of `add_output` say."""
    if options.json:
        tell(json.dumps(result))
    elif not options.quiet:
        for line in lines:
            tell(line)


def add_device(command: argparse._ActionsContainer, note: str = "") -> None:
    """Add --device-index. `note` follows the description."""
    command.add_argument(
        "--device-index",
        type=int,
        metavar="N",
        help=f"EGL device to render on, numbered as by `fastgen doctor`{note}; "
        "default: the first that works",
    )


def output_file(text: str) -> Path:
    """Return the path given with the option -o.

    Raises:
        OutputError: It is an address, or starts with ~ and there is no such user.
    """
    place = place_of(text)
    if "://" in place:
        raise OutputError(f"{text}: is an address; give a file of this machine")
    return Path(place)


def config_of(options: argparse.Namespace) -> Config:
    """Return the configuration that --preset, --config and --set describe."""
    config = None if options.preset is None else Config.preset(options.preset)
    for path in options.config:
        config = Config.load(path, config)
    return assigned(Config.preset() if config is None else config, options.assignments)


def render_settings(options: argparse.Namespace) -> RenderSettings:
    """Return the settings that the options of `add_render` describe."""
    return RenderSettings(
        size=size_of(options),
        quality=getattr(options, "quality", "balanced"),
        backend=options.backend,
        device_index=options.device_index,
        hdri_dir=options.hdri,
    )


def size_of(options: argparse.Namespace) -> tuple[int, int]:
    """Return the width and height that --size gives."""
    text = options.size
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", text)
    if not match:
        raise ConfigError(f"size: {shown(text)} is not a size; write WIDTHxHEIGHT, as in 640x640")
    return int(match[1]), int(match[2])

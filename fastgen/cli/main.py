"""The `fastgen` command."""

import argparse
import contextlib
import os
import re
import shlex
import signal
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import fastgen
from fastgen.cli.stopping import STOPPED
from fastgen.config.commented_yaml import as_yaml
from fastgen.config.config import PRESETS, Config
from fastgen.dataset import stats
from fastgen.dataset.console import drop_unprinted, mend_streams, say, tell
from fastgen.dataset.generate import CONTACT_SHEET, generate, parse_split
from fastgen.dataset.on_ray import run_on_ray
from fastgen.dataset.repair import repair
from fastgen.dataset.shards import FORMATS, SHARD_SCENES, Job
from fastgen.dataset.verify import examine
from fastgen.errors import ConfigError, FastgenError
from fastgen.export import export_glb
from fastgen.files.images import jpeg, png, write
from fastgen.formats import SEAFRONT, known_formats
from fastgen.generator import Generator, find_camera
from fastgen.labels.overlay import DAMAGE_GREYS, ID_GREYS, label_colors, overlay
from fastgen.render import doctor
from fastgen.render.gl import BACKENDS
from fastgen.render.programs import LAYERS
from fastgen.render.settings import QUALITY
from fastgen.validation import check_known

SHOWN_LAYERS = (*LAYERS, "ids", "damage")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code: 0 good, 1 faults found, 2 bad input.

    Stopped by a signal, it is 128 and the signal's number: 130 after Ctrl-C, 143 after SIGTERM.
    """
    mend_streams()
    try:
        return _run(arguments)
    finally:
        drop_unprinted()


def _run(arguments: Sequence[str] | None) -> int:
    try:
        try:
            options = _parser().parse_args(arguments)
            with _stopped_by_sigterm():
                code: int = options.run(options)
        finally:
            tell("", end="")  # what argparse has printed
    except FastgenError as error:
        return _refused(str(error))
    except BrokenPipeError:
        return 128 + signal.SIGPIPE  # whoever read what we print, such as head, has gone
    except OSError as error:
        return _refused(f"{error.filename or 'system'}: {error.strerror or error}")
    except KeyboardInterrupt as stop:
        say(STOPPED)
        return 128 + (signal.SIGTERM if isinstance(stop, _Terminated) else signal.SIGINT)
    return code


class _Terminated(KeyboardInterrupt):
    """SIGTERM came: docker and Slurm stop a run so."""


@contextlib.contextmanager
def _stopped_by_sigterm() -> Iterator[None]:
    """Within, SIGTERM does what Ctrl-C does, so that what was begun is cleared away."""
    if threading.current_thread() is not threading.main_thread():  # which alone hears signals
        yield
        return

    heard = False

    def stop(*_: object) -> None:
        nonlocal heard
        heard = True
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # the second would disturb the clearing
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    except KeyboardInterrupt:
        if heard:  # told here, as compiled code in between lets no other exception through
            raise _Terminated from None
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def _refused(words: str) -> int:
    say(f"fastgen: {' '.join(words.split())}")
    return 2


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as every other bad input does."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"fastgen: {' '.join(message.split())}; see {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="fastgen", description="Exactly labelled synthetic images of shipping containers."
    )
    parser.add_argument("--version", action="version", version=f"fastgen {fastgen.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    make = commands.add_parser("generate", help="make a dataset, or finish one")
    make.add_argument(
        "out", type=_place, metavar="OUT", help="a folder, or an address such as s3://..."
    )
    make.add_argument(
        "--images", type=int, required=True, metavar="N", help="of all cameras together"
    )
    make.add_argument("--cameras", metavar="A,B,Cl,Cr", help="default: all of the rig")
    make.add_argument(
        "--workers", type=int, metavar="K", help="default: one a core, with --ray of the cluster"
    )
    make.add_argument(
        "--ray",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="on a Ray cluster: auto or HOST:PORT; OUT must be seen by all of its nodes",
    )
    make.add_argument(
        "--format", default=FORMATS[0], metavar="|".join(FORMATS), help="default: %(default)s"
    )
    extra = ",".join(sorted(set(known_formats()) - set(SEAFRONT)))
    make.add_argument(
        "--also",
        default="",
        metavar=extra,
        help="further files for each image; bop not with webdataset",
    )
    make.add_argument(
        "--shard",
        type=int,
        metavar="SCENES",
        help="scenes committed together; default: "
        + ", ".join(f"{many} in {name}" for name, many in SHARD_SCENES.items()),
    )
    make.add_argument(
        "--split", metavar="NAME|a,b,c", help="train, val or test for all, or three fractions"
    )
    make.set_defaults(run=_generate)

    config = commands.add_parser("config", help="print every key of a configuration, checked")
    _add_hdri(config)
    config.set_defaults(run=_print_config)

    show = commands.add_parser("show", help="render one image")
    show.add_argument("--index", type=int, required=True, metavar="I", help="of the scene")
    show.add_argument("--camera", help="default: the first of the rig")
    show.add_argument(
        "--layer",
        default="all",
        metavar="|".join(SHOWN_LAYERS),
        help="one layer of the material, unlit, on white; reflection is the roughness as grey; "
        "normals, on grey, are red, green, blue for x, y, z in the container's frame",
    )
    show.add_argument("--overlay", action="store_true", help="draw boxes, names and damage")
    show.add_argument("-o", dest="file", type=Path, required=True, metavar="FILE.png")
    show.set_defaults(run=_show)

    export = commands.add_parser("export", help="write one scene as a GLB file")
    export.add_argument("--index", type=int, required=True, metavar="I", help="of the scene")
    export.add_argument("--camera", help="default: all of the scene")
    export.add_argument(
        "--texel-mm",
        type=float,
        default=4.0,
        metavar="MM",
        help="of the textures; default: %(default)g",
    )
    export.add_argument("-o", dest="file", type=Path, required=True, metavar="FILE.glb")
    export.set_defaults(run=_export)

    for command in (make, show, export):
        command.add_argument(
            "--size",
            default="640x640",
            metavar="WxH",
            help="what the cameras take, each side 64 to 4096; default: %(default)s",
        )
        command.add_argument(
            "--seed", type=int, default=0, metavar="S", help="default: %(default)s"
        )
        _add_hdri(command)
        command.add_argument(
            "--backend", default="auto", metavar="|".join(BACKENDS), help="default: %(default)s"
        )
        _add_device(command)

    for command in (make, config, show, export):
        command.add_argument(
            "--preset", default="seafront", metavar="|".join(PRESETS), help="default: %(default)s"
        )
        command.add_argument(
            "--config", type=Path, metavar="FILE", help="YAML or JSON over the preset"
        )

    for command in (make, show):
        command.add_argument(
            "--quality",
            default="balanced",
            metavar="|".join(QUALITY),
            help="samples a pixel, and rays for the light of high, against speed; default: "
            "%(default)s",
        )

    for name, run, words in (
        ("stats", _stats, "print what a dataset holds"),
        ("verify", _verify, "check that a dataset is whole"),
    ):
        command = commands.add_parser(name, help=words)
        command.add_argument("out", type=_place, metavar="OUT")
        command.set_defaults(run=run)
    command.add_argument(
        "--repair", action="store_true", help="make what is damaged or missing again"
    )
    command.add_argument("--workers", type=int, metavar="K", help="of a repair: default one a core")
    _add_hdri(command)
    _add_device(command, "of a repair: ")
    commands.add_parser("doctor", help="try the OpenGL backends").set_defaults(run=_doctor)
    return parser


def _add_hdri(command: argparse.ArgumentParser) -> None:
    command.add_argument("--hdri", metavar="DIR", help=".hdr and .exr files to light with")


def _add_device(command: argparse.ArgumentParser, what: str = "") -> None:
    command.add_argument(
        "--device-index",
        type=int,
        metavar="N",
        help=f"{what}which of EGL's devices draws, as doctor numbers them; default: one that works",
    )


def _place(text: str) -> str:
    """OUT without slashes at its end, which would double in what is printed."""
    scheme, colon, path = text.rpartition("://")
    place = scheme + colon + (path.rstrip("/") or path[:1])
    if not place:
        raise argparse.ArgumentTypeError("is empty; give a folder or an address")
    return place


def _config(options: argparse.Namespace) -> Config:
    preset = Config.preset(options.preset)
    return Config.load(options.config, preset) if options.config else preset


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match:
        raise ConfigError(f"size: {text!r} is no size; write WIDTHxHEIGHT, as in 640x640")
    return int(match[1]), int(match[2])


def _generate(options: argparse.Namespace) -> int:
    config = parse_split(options.split, _config(options))
    named: str | None = options.cameras
    cameras = tuple(config.cameras) if named is None else tuple(named.split(","))
    shard = options.shard if options.shard is not None else SHARD_SCENES.get(options.format, 1)
    job = Job(
        out=options.out,
        images=options.images,
        config=config,
        seed=options.seed,
        size=_size(options.size),
        cameras=cameras,
        hdri_dir=options.hdri,
        backend=options.backend,
        device_index=options.device_index,
        fmt=options.format,
        quality=options.quality,
        formats=tuple(options.also.split(",")) if options.also else (),
        shard_scenes=shard,
    )
    runner = None if options.ray is None else run_on_ray(options.ray or None, options.workers)
    manifest = generate(job, _workers(options), runner)
    total = sum(split["images"] for split in manifest["counts"].values())
    look = f"; look at {options.out}/{CONTACT_SHEET}" if CONTACT_SHEET in manifest["files"] else ""
    tell(f"{total} images in {options.out}{look}")
    for each in manifest["failed"]:
        tell(f"scene {each['scene']} of seed {each['seed']} failed: {each['error']}")
    return 1 if manifest["failed"] else 0


def _workers(options: argparse.Namespace) -> int:
    given: int | None = options.workers
    return len(os.sched_getaffinity(0)) if given is None else given


def _print_config(options: argparse.Namespace) -> int:
    config = _config(options)
    try:  # lenses and names of HDRIs are held to more than the file
        Generator(config, hdri_dir=options.hdri).scene(0)
    except ConfigError as error:
        raise ConfigError(f"{options.config}: {error}" if options.config else str(error)) from None
    tell(as_yaml(config), end="")
    return 0


def _show(options: argparse.Namespace) -> int:
    layer = options.layer
    check_known("layer", layer, SHOWN_LAYERS)
    encode = {".png": png, ".jpg": jpeg, ".jpeg": jpeg}.get(options.file.suffix.lower())
    if encode is None:
        raise ConfigError(f"{options.file}: give a file name that ends in .png or .jpg")
    drawn = layer if layer in LAYERS else "all"
    with Generator(
        _config(options),
        options.seed,
        _size(options.size),
        backend=options.backend,
        hdri_dir=options.hdri,
        device_index=options.device_index,
        quality=options.quality,
    ) as generator:
        sample = generator.render(index=options.index, camera=options.camera, layer=drawn)
    image = sample.image
    if layer in ("ids", "damage"):
        image = (
            label_colors(sample.ids, ID_GREYS)
            if layer == "ids"
            else label_colors(sample.damage, DAMAGE_GREYS)
        )
    if options.overlay:
        image = overlay(sample, image)
    write(options.file, encode(image))
    return 0


def _export(options: argparse.Namespace) -> int:
    if options.file.suffix.lower() != ".glb":
        raise ConfigError(f"{options.file}: give a file name that ends in .glb")
    with Generator(
        _config(options),
        options.seed,
        _size(options.size),
        backend=options.backend,
        hdri_dir=options.hdri,
        device_index=options.device_index,
    ) as generator:
        scene = generator.scene(options.index)
        cameras = None if options.camera is None else [find_camera(scene, options.camera)]
        export_glb(generator, scene, options.file, cameras, options.texel_mm)
    return 0


def _stats(options: argparse.Namespace) -> int:
    tell(stats.report(options.out))
    return 0


def _verify(options: argparse.Namespace) -> int:
    if options.repair:
        mended, faults = repair(options.out, _workers(options), options.hdri, options.device_index)
        for fault in mended:
            tell(f"mended: {fault}")
        hint = ""
    else:
        found = examine(options.out)
        faults = found.faults
        hint = f"fastgen verify {shlex.quote(options.out)} --repair" if found.broken else ""
    tell("\n".join(faults) if faults else f"{options.out}: whole and consistent")
    if hint:
        tell(f"to make what is damaged or missing again: {hint}")
    return 1 if faults else 0


def _doctor(_: argparse.Namespace) -> int:
    words, works = doctor.report()
    tell(words)
    return 0 if works else 1

"""Commands about single scenes: show and export."""

import argparse
from typing import Any

from fastgen.cli.options import (
    add_config,
    add_index,
    add_render,
    add_seed,
    config_of,
    output_file,
    render_settings,
)
from fastgen.errors import ConfigError
from fastgen.files.images import PICTURE_TYPES, encode_picture, write
from fastgen.generator import Generator, find_camera
from fastgen.preview import PREVIEW_LAYERS, preview


def add_show(commands: Any) -> None:
    """Add `fastgen show`."""
    command = commands.add_parser(
        "show",
        help="render one image to a file",
        description="Render one image to a PNG or JPEG file, also a single material layer or the "
        "labels.",
    )
    add_index(command)
    add_seed(command)
    command.add_argument(
        "--camera", help="name of the camera; default: the first of the configuration"
    )
    command.add_argument(
        "--layer",
        default="all",
        metavar="|".join(PREVIEW_LAYERS),
        help="what to show; default: all, the finished image. A material layer appears without "
        "lighting on white. reflection shows roughness as grey. normals shows x, y, z in the "
        "container's frame as red, green, blue. ids and damage show the label images",
    )
    command.add_argument(
        "--overlay", action="store_true", help="draw boxes, class names and damage outlines"
    )
    command.add_argument(
        "-o",
        dest="file",
        type=output_file,
        required=True,
        metavar="FILE.png",
        help="file to write, .png or .jpg",
    )
    add_config(command)
    add_render(command)
    command.set_defaults(run=_show)


def add_export(commands: Any) -> None:
    """Add `fastgen export`."""
    command = commands.add_parser(
        "export",
        help="write one scene as a GLB file for Blender and other programs, or for Rerun",
        description="Write one scene as a GLB file for Blender and other programs: containers, "
        "spreader and ground with baked textures, what stands on the ground, cameras, and the name "
        "of the environment. A file that ends in .rrd is a recording for the Rerun viewer. It also "
        "has images, depth and boxes, and needs fastgen[rerun].",
    )
    add_index(command)
    add_seed(command)
    command.add_argument("--camera", help="name of the only camera to write; default: all")
    command.add_argument(
        "--texel-mm",
        type=float,
        default=4.0,
        metavar="MM",
        help="width of a texel of the textures in millimetres; default: %(default)g",
    )
    command.add_argument(
        "-o",
        dest="file",
        type=output_file,
        required=True,
        metavar="FILE.glb",
        help="file to write, .glb or .rrd",
    )
    add_config(command)
    add_render(command, quality=False)
    command.set_defaults(run=_export)


def _show(options: argparse.Namespace) -> int:
    suffix = options.file.suffix.lower()
    if suffix not in PICTURE_TYPES:
        raise ConfigError(f"{options.file}: give a file name that ends in .png or .jpg")
    with Generator.of(config_of(options), options.seed, render_settings(options)) as generator:
        picture = preview(generator, options.index, options.camera, options.layer, options.overlay)
    write(options.file, encode_picture(picture, suffix))
    return 0


def _export(options: argparse.Namespace) -> int:
    # here because trimesh takes a second to import
    if options.file.suffix.lower() == ".glb":
        from fastgen.export import export_glb as write_scene
    elif options.file.suffix.lower() == ".rrd":
        from fastgen.recording import export_rerun as write_scene
    else:
        raise ConfigError(f"{options.file}: give a file name that ends in .glb or .rrd")

    with Generator.of(config_of(options), options.seed, render_settings(options)) as generator:
        scene = generator.scene(options.index)
        cameras = None if options.camera is None else [find_camera(scene, options.camera)]
        write_scene(generator, scene, options.file, cameras, options.texel_mm)
    return 0

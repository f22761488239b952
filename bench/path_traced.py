"""Renders an exported scene with Cycles, Blender's path tracer.

    PYTHON bench/path_traced.py FILE.glb --camera A --hdri FILE.exr --samples 256 -o FILE.exr [...]

PYTHON is a Python 3.11 into which `pip install bpy==4.5.15` was done; it needs nothing of fastgen.
All that decides the image stands in the GLB file and its extras: geometry, textures, camera, image
size, the yaw of the environment. Output is a 32-bit multilayer EXR: scene-linear radiance without
exposure or tone curve, ambient occlusion, and, where --centers is given, depth and object index of
what a single ray through each pixel centre meets instead.
"""

import argparse
import json
import math
import os
import struct
from pathlib import Path
from typing import Any

import bpy

_CENTER_WIDTH_PX = 0.01  # the narrowest filter that Cycles takes: a ray through the pixel centre


def extras(path: Path) -> dict[str, Any]:
    """The JSON part of a GLB file (glTF 2.0, section 4.4)."""
    with path.open("rb") as file:
        file.seek(12)
        (length,) = struct.unpack("<I", file.read(4))
        file.seek(20)
        tree: dict[str, Any] = json.loads(file.read(length))
    return tree


def load(path: Path, camera: str, hdri: Path) -> None:
    """Make the GLB file the current scene, seen by `camera` and lit by `hdri` (equirectangular)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    tree = extras(path)
    node = next(n for n in tree["nodes"] if n["name"] == camera and "camera" in n)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects[camera]
    scene.render.resolution_x, scene.render.resolution_y = node["extras"]["size"]
    scene.render.resolution_percentage = 100
    for item in bpy.data.objects:
        item.pass_index = int(item.type == "MESH")

    world = bpy.data.worlds.new("environment")
    world.use_nodes = True
    scene.world = world
    nodes, links = world.node_tree.nodes, world.node_tree.links
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(str(hdri))
    picture.image.colorspace_settings.name = "Linear Rec.709"
    place = nodes.new("ShaderNodeMapping")
    # radiance(d) = map(Rz(-yaw) d), and the node turns d by its rotation
    yaw_deg = tree["scenes"][0]["extras"]["environment"]["yaw_deg"]
    place.inputs["Rotation"].default_value = (0.0, 0.0, -math.radians(yaw_deg))
    coordinates = nodes.new("ShaderNodeTexCoord")
    links.new(coordinates.outputs["Generated"], place.inputs["Vector"])
    links.new(place.outputs["Vector"], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], nodes["Background"].inputs["Color"])


def render(path: Path, samples: int, seed: int, threads: int, centers: bool) -> None:
    """Path-trace the current scene into an EXR file."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = threads
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1 if centers else samples
    scene.cycles.seed = seed
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    if centers:
        scene.cycles.pixel_filter_type = "GAUSSIAN"
        scene.cycles.filter_width = _CENTER_WIDTH_PX
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_object_index = centers
    layer.use_pass_ambient_occlusion = not centers
    scene.world.light_settings.distance = 10.0
    image = scene.render.image_settings
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--camera", required=True)
    parser.add_argument("--hdri", type=Path, required=True)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--centers", action="store_true")
    parser.add_argument("-o", dest="out", type=Path, required=True)
    options = parser.parse_args()
    os.nice(19)
    load(options.file, options.camera, options.hdri)
    render(options.out, options.samples, options.seed, options.threads, options.centers)


if __name__ == "__main__":
    main()

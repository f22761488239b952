"""Render an exported scene with Cycles, Blender's path tracer.

    PYTHON bench/path_traced.py FILE.glb --camera A --hdri FILE.exr --samples 256 -o FILE.exr [...]

PYTHON is a Python 3.11 with `bpy==4.5.15` installed; it does not need fastgen. The GLB file and its
extras define the image: geometry, textures, camera, image size and yaw of the environment.

Writes a 32-bit multilayer EXR of scene-linear radiance without exposure or tone curve. Each pixel
is the plain mean over its square.

--samples may list several numbers, such as 1,4,16. Each makes one image, and its number replaces
`{samples}` in the name of the output. The CPU seconds of each number are printed as JSON.

--background N renders the whole image with N samples into --whole. The image of -o then covers only
the rectangle around all objects and is empty outside it. Not for cameras with objects behind them.

--centers FILE also writes depth, object index and ambient occlusion at the point that the ray
through each pixel centre hits. The index is 1 for containers and spreader, 2 for ground and props.
"""

import argparse
import json
import math
import os
import struct
import time
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.object_utils import world_to_camera_view

_CENTER_SAMPLES = 16  # for ambient occlusion; depth and index use the first sample
_MARGIN_PX = 4
_CENTER_WIDTH_PX = 0.01  # Cycles' narrowest filter: rays go through the pixel centre
_WIDEST_LIGHT_MAP = 8192  # Blender's limit
_SURROUNDINGS = ("ground", "prop_")


def read_tree(path: Path) -> dict[str, Any]:
    """Return the JSON chunk of a GLB file (glTF 2.0, section 4.4)."""
    with path.open("rb") as file:
        file.seek(12)
        (length,) = struct.unpack("<I", file.read(4))
        file.seek(20)
        tree: dict[str, Any] = json.loads(file.read(length))
    return tree


def load(path: Path, camera: str, hdri: Path) -> None:
    """Load a GLB file as the current scene.

    Args:
        path: The GLB file.
        camera: Name of the camera to render from.
        hdri: Equirectangular environment that lights the scene.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    tree = read_tree(path)
    node = next(n for n in tree["nodes"] if n["name"] == camera and "camera" in n)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects[camera]
    scene.render.resolution_x, scene.render.resolution_y = node["extras"]["size"]
    scene.render.resolution_percentage = 100
    for item in bpy.data.objects:
        if item.type == "MESH":
            item.pass_index = 2 if item.name.startswith(_SURROUNDINGS) else 1

    world = bpy.data.worlds.new("environment")
    world.use_nodes = True
    scene.world = world
    nodes, links = world.node_tree.nodes, world.node_tree.links
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(str(hdri))
    picture.image.colorspace_settings.name = "Linear Rec.709"
    # the automatic map is too coarse for the sun's disc, which then leaves bright specks
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = min(2 * picture.image.size[0], _WIDEST_LIGHT_MAP)
    place = nodes.new("ShaderNodeMapping")
    # radiance(d) = map(Rz(-yaw) d); the node rotates d by its Rotation input
    yaw_deg = tree["scenes"][0]["extras"]["environment"]["yaw_deg"]
    place.inputs["Rotation"].default_value = (0.0, 0.0, -math.radians(yaw_deg))
    coordinates = nodes.new("ShaderNodeTexCoord")
    links.new(coordinates.outputs["Generated"], place.inputs["Vector"])
    links.new(place.outputs["Vector"], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], nodes["Background"].inputs["Color"])


def prepare(seed: int, threads: int, scale: int) -> None:
    """Apply the settings that all images share.

    Args:
        seed: Seed of Cycles' sampling.
        threads: Number of render threads.
        scale: Factor on the file's resolution per side.
    """
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = threads
    scene.render.resolution_percentage = 100 * scale
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.seed = seed
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    scene.world.light_settings.distance = 10.0
    image = scene.render.image_settings
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth = "32"


def frame_objects() -> None:
    """Restrict the following renders to the rectangle around all objects."""
    scene = bpy.context.scene
    graph = bpy.context.evaluated_depsgraph_get()
    seen = []
    for item in (o for o in bpy.data.objects if o.type == "MESH"):
        mesh = item.evaluated_get(graph).to_mesh()
        points = (item.matrix_world @ vertex.co for vertex in mesh.vertices)
        seen += [world_to_camera_view(scene, scene.camera, point) for point in points]
    settings = scene.render
    settings.use_border, settings.use_crop_to_border = True, False
    for axis, pixels in (("x", settings.resolution_x), ("y", settings.resolution_y)):
        places = [getattr(point, axis) for point in seen]
        margin = _MARGIN_PX / pixels
        setattr(settings, f"border_min_{axis}", max(min(places) - margin, 0.0))
        setattr(settings, f"border_max_{axis}", min(max(places) + margin, 1.0))


def look_through_centers() -> None:
    """Make the following renders trace only pixel centres and write what they hit."""
    bpy.context.scene.render.resolution_percentage = 100
    bpy.context.scene.render.use_border = False
    cycles = bpy.context.scene.cycles
    cycles.pixel_filter_type = "GAUSSIAN"
    cycles.filter_width = _CENTER_WIDTH_PX
    layer = bpy.context.scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_object_index = layer.use_pass_ambient_occlusion = True


def render(path: Path, samples: int, denoise: bool) -> float:
    """Path-trace the current scene into an EXR file.

    Args:
        path: The EXR file to write.
        samples: Paths per pixel.
        denoise: Apply Open Image Denoise, guided by albedo and normals as Blender sets it up.

    Returns:
        CPU seconds of all threads.
    """
    scene = bpy.context.scene
    scene.cycles.samples = samples
    scene.cycles.use_denoising = denoise
    if denoise:
        scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.render.filepath = str(path)
    began = time.process_time()
    bpy.ops.render.render(write_still=True)
    return time.process_time() - began


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--camera", required=True)
    parser.add_argument("--hdri", type=Path, required=True)
    parser.add_argument("--samples", default="256")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument(
        "--scale", type=int, default=1, help="factor on the file's resolution per side"
    )
    parser.add_argument("--denoise", action="store_true")
    parser.add_argument("--background", type=int)
    parser.add_argument("--whole", type=Path)
    parser.add_argument("--centers", type=Path)
    parser.add_argument("-o", dest="out", required=True)
    options = parser.parse_args()
    os.nice(19)
    load(options.file, options.camera, options.hdri)
    prepare(options.seed, options.threads, options.scale)
    if options.background:
        render(options.whole, options.background, options.denoise)
        frame_objects()
    counts = [int(word) for word in options.samples.split(",")]
    if len(counts) > 1:  # a first render builds the scene data, so that no timed one does
        render(Path(options.out.replace("{samples}", "0")), 1, options.denoise)
    seconds = {}
    for count in counts:
        path = Path(options.out.replace("{samples}", str(count)))
        seconds[count] = render(path, count, options.denoise)
    if options.centers:
        look_through_centers()
        render(options.centers, _CENTER_SAMPLES, denoise=False)
    print("seconds " + json.dumps(seconds), flush=True)


if __name__ == "__main__":
    main()

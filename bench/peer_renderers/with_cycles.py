"""Cycles through bpy: python with_cycles.py JOB OUT WAY, where WAY is one of WAYS.

The number of samples is part of the job.
"""

import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from measure import Job, Recorder, SceneJob, Shot, object_id, read_job

ID_STEP = 4
"""Distance of two ids in grey levels of 255."""


@dataclass(frozen=True)
class Way:
    """A way to make labelled images.

    Attributes:
        denoise: Add Open Image Denoise to the colour image.
        noise: Noise threshold at which a pixel gets no more samples; 0 for the same number of
            samples in all pixels.
        bounces: Most bounces of light, in all (max) and by kind of surface; Blender's defaults for
            kinds that are not listed.
        masks: Make a binary render for each visible marker, not one flat render of all ids.
    """

    denoise: bool = True
    noise: float = 0.0
    bounces: dict[str, int] = field(default_factory=lambda: {"max": 12})
    masks: bool = False


WAYS = {
    "denoise": Way(),
    # the SeaFront paper
    "masks": Way(denoise=False, masks=True),
    # blenderproc/python/utility/DefaultConfig.py of BlenderProc 2
    "blenderproc": Way(
        noise=0.01, bounces={"max": 3, "diffuse": 3, "glossy": 0, "transmission": 0}
    ),
    # kubric/renderer/blender.py; the threshold and the bounces are Blender's defaults
    "kubric": Way(noise=0.01),
}
"""Ways by name. One flat render of all ids is the fastest way to get labels from Cycles, and also
BlenderProc's own. Kubric reads labels from a Cryptomatte pass of the colour image instead."""


def open_scene(job: Job, scene: SceneJob) -> dict[int, bpy.types.Object]:
    """Load the GLB and its HDR light for Cycles on all cores; return the objects by id."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(scene.glb))
    objects = {object_id(o.name): o for o in bpy.data.objects if o.type == "MESH"}
    settings = bpy.context.scene
    settings.render.engine = "CYCLES"
    settings.render.resolution_x, settings.render.resolution_y = job.size
    settings.render.use_persistent_data = True  # keeps the ray-tracing tree between views
    settings.cycles.device = "CPU"
    settings.cycles.denoiser = "OPENIMAGEDENOISE"
    settings.render.image_settings.file_format = "PNG"
    settings.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    settings.collection.objects.link(settings.camera)
    settings.world = bpy.data.worlds.new("world")
    settings.world.use_nodes = True
    nodes, links = settings.world.node_tree.nodes, settings.world.node_tree.links
    sky = nodes.new("ShaderNodeTexEnvironment")
    sky.image = bpy.data.images.load(str(scene.hdri))
    turn = nodes.new("ShaderNodeMapping")
    turn.inputs["Rotation"].default_value[2] = -np.deg2rad(scene.yaw_deg)
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], sky.inputs["Vector"])
    links.new(sky.outputs["Color"], nodes["Background"].inputs["Color"])
    return objects


def flat_material() -> bpy.types.Material:
    """Return a material that emits the object's own colour and nothing else."""
    material = bpy.data.materials.new("flat")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    emission = nodes.new("ShaderNodeEmission")
    links.new(nodes.new("ShaderNodeObjectInfo").outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], nodes["Material Output"].inputs["Surface"])
    return material


def aim(shot: Shot, width: int) -> None:
    """Place the camera at the shot's pose."""
    camera = bpy.context.scene.camera
    camera.matrix_world = Matrix(shot.pose.tolist())
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.sensor_width = 36.0
    camera.data.lens = shot.focal_px * 36.0 / width
    camera.data.clip_start, camera.data.clip_end = 0.1, 200.0


def shade(job: Job, shot: Shot, way: Way) -> None:
    """Set Cycles up for a colour image."""
    settings = bpy.context.scene
    settings.view_layers[0].material_override = None
    settings.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 1.0
    settings.cycles.samples = job.samples
    settings.cycles.use_adaptive_sampling = way.noise > 0
    settings.cycles.adaptive_threshold = way.noise
    settings.cycles.use_denoising = way.denoise
    for name, most in way.bounces.items():
        setattr(settings.cycles, f"{name}_bounces", most)
    settings.cycles.filter_width = 1.5
    settings.view_settings.view_transform = "Standard"
    settings.view_settings.exposure = float(np.log2(shot.exposure))
    settings.render.image_settings.color_mode = "RGB"


def paint(flat: bpy.types.Material) -> None:
    """Set Cycles up for labels: one ray through each pixel centre, colours unchanged."""
    settings = bpy.context.scene
    settings.view_layers[0].material_override = flat
    settings.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    settings.cycles.samples = 1
    settings.cycles.use_adaptive_sampling = False
    settings.cycles.use_denoising = False
    settings.cycles.max_bounces = 0
    settings.cycles.filter_width = 0.01
    settings.view_settings.view_transform = "Raw"
    settings.view_settings.exposure = 0.0
    settings.render.image_settings.color_mode = "BW"


def draw(folder: Path) -> np.ndarray:
    """Render and return uint8 [H, W, 3], row 0 at the top.

    The image goes through a file, because bpy does not expose the rendered pixels.
    """
    bpy.context.scene.render.filepath = str(folder / "frame.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(bpy.context.scene.render.filepath)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    shape = (height, width, -1)
    bpy.data.images.remove(image)
    shown: np.ndarray = np.rint(pixels.reshape(shape)[::-1, :, :3] * 255).astype(np.uint8)
    return shown


def masks(shot: Shot, objects: dict[int, bpy.types.Object], folder: Path) -> np.ndarray:
    """Return marker ids [H, W], from one binary render per visible marker."""
    ids = np.zeros(0)
    for number in shot.markers:
        for other, item in objects.items():
            item.color = [float(other == number)] * 3 + [1.0]
        mask = draw(folder)[..., 0] > 127
        ids = ids if ids.size else np.zeros(mask.shape, np.uint16)
        ids[mask] = number
    return ids


def all_ids(objects: dict[int, bpy.types.Object], folder: Path) -> np.ndarray:
    """Return ids [H, W] from one render of flat grey levels."""
    for number, item in objects.items():
        item.color = [number * ID_STEP / 255] * 3 + [1.0]
    return np.rint(draw(folder)[..., 0] / ID_STEP)


def main(folder: Path, out: Path, way: Way) -> None:
    """Render every view."""
    job = read_job(folder)
    recorder = Recorder(out, f"Blender {bpy.app.version_string}")
    with tempfile.TemporaryDirectory() as place:
        for scene in job.scenes:
            with recorder.lap("set-up"):
                objects = open_scene(job, scene)
                flat = flat_material()
            # all colours, then all labels, because switching makes Cycles prepare the scene again
            images = {}
            for shot in scene.shots * job.repeats:
                with recorder.lap("colour"):
                    aim(shot, job.size[0])
                    shade(job, shot, way)
                    images[shot.camera] = draw(Path(place))
            for shot in scene.shots * job.repeats:
                with recorder.lap("labels"):
                    aim(shot, job.size[0])
                    paint(flat)
                    if way.masks:
                        ids = masks(shot, objects, Path(place))
                    else:
                        ids = all_ids(objects, Path(place))
                recorder.keep(scene, shot, images[shot.camera], ids)
    recorder.save()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), WAYS[sys.argv[3]])

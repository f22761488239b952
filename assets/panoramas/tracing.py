"""Cycles renders of the current Blender scene from its panoramic camera."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from panoramas import sky

Image = NDArray[np.float32]

OTHER = 65535  # value of obstacles that are no containers, as in container_map.py
_LEVEL_M = 0.5  # what is lower counts as ground: kerbs, tracks and the lowest part of columns

_DOWN_REACH = 1.52  # tangent of the view down: 45 degrees, 11.25 for blending, and a margin


def read_exr(path: Path) -> dict[str, Image]:
    """Return the channels by name, without the prefix of Blender's render layer."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    layer = "ViewLayer."
    return {name.removeprefix(layer): c.pixels.astype(np.float32) for name, c in channels.items()}


def render(
    size: tuple[int, int], samples: int, mist: bool, rows: tuple[float, float] = (0.0, 1.0)
) -> dict[str, Image]:
    """Trace the view of the current camera.

    size is (width, height). Only `rows` are rendered, as shares of the height from the bottom.
    `mist` adds the mist pass, a transparent background and denoising.
    """
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 1.0
    scene.render.border_min_y, scene.render.border_max_y = rows
    scene.render.film_transparent = mist
    scene.view_layers[0].use_pass_mist = mist
    c = scene.cycles
    c.device, c.samples = "CPU", samples
    c.use_adaptive_sampling, c.adaptive_threshold, c.adaptive_min_samples = mist, 0.04, 6
    c.use_denoising, c.denoiser = mist, "OPENIMAGEDENOISE"
    c.denoising_input_passes, c.denoising_prefilter = "RGB_ALBEDO_NORMAL", "FAST"
    c.use_auto_tile = False
    c.max_bounces, c.diffuse_bounces, c.glossy_bounces = 2, 1, 2
    c.caustics_reflective = c.caustics_refractive = False
    c.blur_glossy, c.sample_clamp_indirect = 1.0, 4.0
    c.denoising_quality = "BALANCED"
    c.use_light_tree = True
    return _rendered()


def trace(width: int, samples: int, eye: tuple[float, float, float]) -> dict[str, Image]:
    """Trace the whole panorama from the current camera.

    The part more than 45 degrees below the horizon comes from a view straight down, because
    denoising the rows around a pole leaves spokes.
    """
    above = render((width, width // 2), samples, True, (0.25, 1.0))
    add_camera(eye, down=True)
    below = render((width // 4, width // 4), samples, True)
    joined, lap = {}, width // 32
    blend = np.linspace(1, 0, lap, dtype=np.float32)[:, None]
    around = sky.directions(width // 2)[-(width // 8 + lap) :]
    for name, high in above.items():
        low = seen_below(below[name], around)
        high[-lap:] = blend * high[-lap:] + (1 - blend) * low[:lap]
        joined[name] = np.concatenate([high, low[lap:]])
    return joined


def seen_below(view: Image, toward: NDArray[np.float64]) -> Image:
    """Sample a view straight down [N, N] with the tangent _DOWN_REACH in directions [..., 3]."""
    side = view.shape[0]
    x, y = (toward[..., :2] / (_DOWN_REACH * -toward[..., 2:])).transpose(2, 0, 1)
    column, row = (x + 1) * side / 2 - 0.5, (1 - y) * side / 2 - 0.5
    left, top = (np.clip(np.floor(at), 0, side - 2).astype(int) for at in (column, row))
    right, low = (column - left).astype(np.float32), (row - top).astype(np.float32)
    upper = view[top, left] * (1 - right) + view[top, left + 1] * right
    lower = view[top + 1, left] * (1 - right) + view[top + 1, left + 1] * right
    return upper * (1 - low) + lower * low


def add_camera(eye: tuple[float, float, float], down: bool = False) -> None:
    """Add a panoramic camera with its middle column along +x.

    With `down`, it looks straight down instead, +x to the right and +y up.
    """
    camera = bpy.data.cameras.new("eye")
    camera.clip_start, camera.clip_end = 0.05, 1e5
    thing = bpy.data.objects.new("eye", camera)
    thing.location = eye
    if down:
        camera.angle = 2 * np.arctan(_DOWN_REACH)
    else:
        camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
        thing.rotation_euler = (np.pi / 2, 0.0, -np.pi / 2)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.camera = thing


def container_map(width: int) -> NDArray[np.uint16]:
    """Return the container or other obstacle at each texel centre, uint16 [width / 2, width].

    Numbers count the containers that are seen, from 1, in the order in which they were placed.
    OTHER is anything else above _LEVEL_M, and 0 is ground, water and sky. Containers are the
    objects with a pass index above 0.
    """
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, width // 2
    scene.render.resolution_percentage = 100
    layer = scene.view_layers[0]
    layer.use_pass_object_index = layer.use_pass_position = True
    c = scene.cycles
    c.device, c.samples, c.max_bounces = "CPU", 1, 0
    c.use_adaptive_sampling = c.use_denoising = c.use_auto_tile = False
    c.pixel_filter_type, c.filter_width = "BLACKMAN_HARRIS", 0.01  # rays through texel centres
    planes = _rendered()
    found = np.rint(planes["IndexOB.X"]).astype(np.uint16)
    values, numbers = np.unique(found, return_inverse=True)
    first = 1 if values[0] else 0
    numbers = (numbers.reshape(found.shape) + first).astype(np.uint16)
    return np.where((numbers == 0) & (planes["Position.Z"] > _LEVEL_M), np.uint16(OTHER), numbers)


def _rendered() -> dict[str, Image]:
    """Render the current scene as it is set up, and return the channels by name."""
    scene = bpy.context.scene
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/view.exr"
        bpy.ops.render.render(write_still=True)
        return read_exr(Path(folder) / "view.exr")

"""The scene file of each image: its Scene, its camera in OpenCV's terms, and its Objects."""

from functools import lru_cache
from typing import Any

import orjson

from fastgen.camera.projection import View
from fastgen.formats.item import Item
from fastgen.scene import Scene


def scene_file(item: Item) -> bytes:
    """Return the scene file of one image, as JSON."""
    sample = item.sample
    head = {
        "stem": item.stem,
        "split": item.split,
        "camera": sample.camera.name,
        "size": list(sample.view.size),
        "view": view_values(sample.view),
        "background_known": sample.background is not None,
        "objects": [vars(thing) for thing in sample.objects],
    }
    return orjson.dumps(head)[:-1] + b',"scene":' + _scene_json(sample.scene) + b"}"


def view_values(view: View) -> dict[str, Any]:
    """Return a camera as JSON values in OpenCV's convention: x right, y down, z forward.

    Unlike in OpenCV, the centre of the first pixel is (0.5, 0.5).

    Returns:
        intrinsics: Camera matrix [3][3], in pixels.
        distortion_model: pinhole, fisheye or brown_conrady.
        distortion: OpenCV's distortion coefficients; those of cv2.fisheye for a fisheye, none for a
            pinhole.
        rotation: [3][3], world to camera.
        translation_mm: [3], world to camera.
    """
    lens = view.distortion.lens if view.distortion else None
    return {
        "intrinsics": view.intrinsics.tolist(),
        "distortion_model": lens.model if lens else "pinhole",
        "distortion": list(lens.coefficients) if lens else [],
        "rotation": view.rotation.tolist(),
        "translation_mm": view.translation_mm.tolist(),
    }


@lru_cache(maxsize=2)
def _scene_json(scene: Scene) -> bytes:
    """Return the scene as JSON; the cameras of a scene share it."""
    return orjson.dumps(scene)

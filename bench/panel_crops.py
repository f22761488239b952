"""Square crops of walls with and without damage, and square crops in general."""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from aimed_cameras import Views, aimed
from numpy.typing import NDArray
from real_crops import PanelPair

from fastgen import Config, Generator
from fastgen.errors import ConfigError
from fastgen.sample import Sample
from fastgen.scene import Camera, Scene
from fastgen.scene.check import check_camera

Pixels = NDArray[np.uint8]
"""RGB picture [H, W, 3]."""

PANEL_PX = 80
"""Side of a panel."""

MARGIN = 0.1
"""Total margin of a marker's crop, as a share of its box."""

_DAMAGES = {
    "damage": {
        "probability": 1,
        "count": [2, 5],
        "kinds": ["axis", "concave", "dented", "perforation", "scrape", "rust_through"],
        "faces": ["front", "back", "no_door", "roof"],
        "toward_cameras": 0,
    },
    # few of the walls in photographs of damages have markers
    "markings": {"marked_containers": 0.15},
    "spreader": {"probability": 0},
    "environment": {"weights": dict(Config.preset("gate").environment.weights)},
}

HANGING = Config.from_values(_DAMAGES, base=Config.preset("crane"))
"""Damaged containers that hang in the air, in the light of the preset `gate`."""

STANDING = Config.from_values(
    {**_DAMAGES, "placement": {"neighbours": [0, 1]}}, base=Config.preset("gate")
)
"""Damaged containers on trailers. Panels show the ground and the dark gap below the floor."""

_WALLS = Views((-72, 72), (-20, 30), (-8, 8), (1800, 9000))
_ROOF = Views((-55, 55), (-55, 55), (-8, 8), (1800, 9000))
"""Damages are photographed from many directions, and whole walls along their length. Beyond 62
degrees, the corrugation hides half of the sheet."""

_MIN_AREA_PX, _MIN_VISIBLE = 60, 0.5
_MIN_SIDE_PX = 40.0
_MIN_CONTAINER_SHARE = 0.3
_BLUR_PX = 1.2
_ABOVE_GROUND_MM = 600.0


def panels_of(generator: Generator, scene: Scene, rng: np.random.Generator) -> list[PanelPair]:
    """Render squares around the damages of a scene, each with and without the damages.

    Everything else is equal in both, so only the damage distinguishes them. One camera is aimed at
    each damage; other damages that it sees get a square too. Damages whose camera would be
    in the ground, a truck or a container are left out.

    Returns:
        Pairs of crops [PANEL_PX, PANEL_PX, 3] with the damage class.
    """
    found: list[PanelPair] = []
    whole = scene.undamaged()
    for damage in scene.damages:
        size = min(max(damage.size_mm), 1500.0) * float(rng.uniform(1.6, 6.0))
        faces = [face for face in damage.face.split(".") if face != "underside"]  # two at an edge
        face = faces[int(rng.integers(len(faces)))]
        views = _ROOF if face == "roof" else _WALLS
        camera = aimed(scene, face, np.array(damage.origin_mm), size, rng, views)
        if not _is_free(camera, scene):
            continue
        damaged = generator.render(scene=scene, camera=camera)
        squares = list(_squares(damaged, rng))
        if squares:
            images = damaged.image, generator.render(scene=whole, camera=camera).image
            for box, kind in squares:
                one, other = (square_crop(image, box, PANEL_PX, margin=0.0) for image in images)
                found.append(PanelPair(one, other, kind))
    return found


def _is_free(camera: Camera, scene: Scene) -> bool:
    """Return whether a camera is well above the ground and outside trucks and containers."""
    if scene.ground and camera.position_mm[2] < scene.ground.height_mm + _ABOVE_GROUND_MM:
        return False
    try:
        check_camera(camera, scene)
    except ConfigError:
        return False
    return True


def _squares(sample: Sample, rng: np.random.Generator) -> Iterator[tuple[list[float], str]]:
    """Yield the box x0, y0, x1, y1 of a square around each visible damage, and its class."""
    height, width = sample.damage.shape
    for item in sample.objects:
        if item.class_name not in HANGING.damage.kinds or item.bbox is None:
            continue
        if item.area < _MIN_AREA_PX or item.visible_fraction < _MIN_VISIBLE:
            continue
        x0, y0, x1, y1 = item.bbox
        side = max(x1 - x0, y1 - y0) * float(rng.uniform(1.1, 4.0))
        side = min(max(side, _MIN_SIDE_PX), 0.95 * min(height, width))
        middle = np.array([x0 + x1, y0 + y1]) / 2 + rng.uniform(-0.15, 0.15, 2) * side
        x, y = (middle - side / 2).clip(0, (width - side, height - side)).tolist()
        area = np.s_[int(y) : int(y + side), int(x) : int(x + side)]
        if (sample.ids[area] > 0).mean() >= _MIN_CONTAINER_SHARE:
            yield [x, y, x + side, y + side], item.class_name


def change_of(damaged: Pixels, undamaged: Pixels) -> float:
    """Return how much a damage changes a panel.

    This is the mean change of the 5 % of pixels that change most, in 8-bit levels. Both panels are
    blurred with a sigma of 1.2 pixels, which removes most of the noise.
    """
    blurred = (
        cv2.GaussianBlur(panel.astype(np.float32), (0, 0), _BLUR_PX)
        for panel in (damaged, undamaged)
    )
    change = np.abs(np.subtract(*blurred)).max(axis=2).ravel()
    most = len(change) // 20
    return float(np.partition(change, -most)[-most:].mean())


def square_crop(image: Pixels, box: Sequence[float], side: int, margin: float = MARGIN) -> Pixels:
    """Return the square around a box with a margin, scaled to [side, side, 3]."""
    x0, y0, x1, y1 = box
    half = max(x1 - x0, y1 - y0) * (1 + margin) / 2
    left, top = round((x0 + x1) / 2 - half), round((y0 + y1) / 2 - half)
    size = max(round(2 * half), 1)
    height, width = image.shape[:2]
    pad = max(0, -left, -top, left + size - width, top + size - height)
    if pad:
        image = cv2.copyMakeBorder(image, pad, pad, pad, pad, cv2.BORDER_REPLICATE).astype(np.uint8)
    cut = image[top + pad : top + pad + size, left + pad : left + pad + size]
    way = cv2.INTER_AREA if size > side else cv2.INTER_LINEAR
    return cv2.resize(cut, (side, side), interpolation=way).astype(np.uint8)

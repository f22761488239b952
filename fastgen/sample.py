"""Sample: what one render gives to a writer or a loader, and the Objects that label it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.camera import View
from fastgen.scene import Camera, Scene

Box = tuple[int, int, int, int]
"""(x0, y0, x1, y1) in pixels, x1 and y1 exclusive."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One draw's targets, row 0 at the top.

    image: uint8 [H, W, 3], sRGB. ids: uint16 [H, W], 0 where void. damage: uint16 [H, W],
    class * 100 + instance. depth: float32 [H, W], metres along the optical axis, inf where void.
    """

    image: NDArray[np.uint8]
    ids: NDArray[np.uint16]
    damage: NDArray[np.uint16]
    depth: NDArray[np.float32]


@dataclass(frozen=True)
class Object:
    """One labelled thing in one image.

    id: its value in the id target. instance: 1, 2, ... within its class and scene.
    bbox: tight box of its visible pixels, None where nothing is visible. amodal_bbox: box of the
    whole thing, neither occluded nor cut by the image border, in float pixels; None where part of
    it lies behind the camera. area: visible pixels. visible_fraction: visible pixels over those it
    would cover alone in an unbounded image, 0..1. truncated: the image border cuts it.
    text: what it reads, '' for other things. polygon: projected outline, x0, y0, x1, y1, ... in
    pixels, of the whole thing; empty where part of it lies behind the camera.
    """

    id: int
    class_name: str
    instance: int
    bbox: Box | None
    amodal_bbox: tuple[float, float, float, float] | None
    area: int
    visible_fraction: float
    truncated: bool
    text: str
    polygon: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Sample(Frame):
    """A Frame with its labels, and the scene and camera it was made from."""

    scene: Scene
    camera: Camera
    view: View
    objects: list[Object]

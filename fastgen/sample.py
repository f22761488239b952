"""Sample: what one render gives to a writer or a loader, and the Objects that label it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.frame import Frame
from fastgen.scene import Camera, Scene

Box = tuple[int, int, int, int]
"""(x0, y0, x1, y1) in pixels, x1 and y1 exclusive."""


Keypoint = tuple[float, float, int]
"""x, y in pixels and COCO's flag: 0 outside the image (x = y = 0), 1 hidden, 2 visible."""


@dataclass(frozen=True)
class Object:
    """One labelled thing in one image. Pixel coordinates as in camera.py.

    id: its value in the id target; of a damage, which that does not show, its value in the damage
    target, which no other object has for its id. instance: 1, 2, ... within its class and scene.
    bbox: tight box of its visible pixels, None where nothing is visible. amodal_bbox: exact bounds
    of the whole thing beyond the near plane, neither occluded nor cut by the image border, in float
    pixels; None where nothing of it is. area: visible pixels. visible_fraction: visible pixels over
    those it would cover alone in an unbounded image, 0..1. truncated: some of it is seen and some
    lies beyond the image. occluded: some of it is seen and something hides more of it than a pixel
    or two of its edge. ignored: too little is seen to train on, see LabelConfig.
    text: what it reads, '' for other things. polygon: projected outline, x0, y0, x1, y1, ... of the
    whole thing; empty for the spreader, for damages and where part of it lies behind the camera.
    quad: four corners of a decal in the order upper left, upper right, lower right, lower left as
    it is read (of a marker left, top, right, bottom). reading: 'horizontal', or 'vertical' for
    letters below one another; '' without text. keypoints: the container's casting corners, see
    labels.CASTINGS.
    """

    id: int
    class_name: str
    instance: int
    bbox: Box | None
    amodal_bbox: tuple[float, float, float, float] | None
    area: int
    visible_fraction: float
    truncated: bool
    occluded: bool = False
    ignored: bool = False
    text: str = ""
    polygon: tuple[float, ...] = ()
    quad: tuple[float, ...] = ()
    reading: str = ""
    keypoints: tuple[Keypoint, ...] = ()


@dataclass(frozen=True, eq=False)
class Sample(Frame):
    """A Frame with its labels, and the scene and camera it was made from.

    normals: float32 [H, W, 3], unit normals in view space (x right, y down, z forward) to about a
    hundredth, averaged like colours over the surfaces that a pixel sees, 0 where void; None unless
    asked for.
    """

    scene: Scene
    camera: Camera
    view: View
    objects: list[Object]
    normals: NDArray[np.float32] | None = None

    def __repr__(self) -> str:
        """One line: a notebook shows what its last line gives, and arrays and scene fill pages."""
        width, height = self.view.size
        seen = sum(item.area > 0 for item in self.objects)
        return (
            f"Sample(seed {self.scene.seed}, index {self.scene.index}, camera "
            f"{self.camera.name!r}, {width}x{height}, {seen} of {len(self.objects)} objects seen)"
        )

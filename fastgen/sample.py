"""Sample: the result of one render, with the Objects that label it."""

import base64
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View
from fastgen.classes import ALL_DETECTION_CLASSES
from fastgen.errors import ConfigError
from fastgen.files.images import png
from fastgen.frame import Frame
from fastgen.overlay import Picture, overlay
from fastgen.scene import Camera, Container, Damage, Scene
from fastgen.scene.object_ids import scene_numbers
from fastgen.scene.tables import html_table

Box = tuple[int, int, int, int]
"""(x0, y0, x1, y1) in pixels, x1 and y1 exclusive."""

Keypoint = tuple[float, float, int]
"""x, y in pixels, and the flag of COCO: 0 outside the image (x = y = 0), 1 hidden, 2 visible."""


@dataclass(frozen=True)
class LabelledPart:
    """One part of an identifier in an image.

    Attributes:
        role: 'owner', 'serial', 'check' or 'type'.
        text: Its letters.
        quad: Four corners x0, y0, x1, y1, ... in pixels, clockwise from the upper left corner of
            the letters. The frame around a check digit belongs to it.
    """

    role: str
    text: str
    quad: tuple[float, ...]


@dataclass(frozen=True)
class Object:
    """One labelled object in one image, in the pixel coordinates of camera/projection.py.

    Attributes:
        id: Value in the id target. Damages are not in that target; their id is their value in the
            damage target, which no other object has as its id.
        class_name: Label class.
        instance: Number within its class and scene: 1, 2, ...
        bbox: Tight box of the visible pixels, None if nothing is visible.
        amodal_bbox: Exact bounds of the whole object beyond the near plane, in pixels. They are not
            reduced by occlusion or by the image border. None if the object is behind the near
            plane.
        area: Number of visible pixels.
        visible_fraction: Visible pixels divided by those that the object would have in an unbounded
            image without other objects, 0..1.
        truncated: Whether the object is partly visible and partly outside the image.
        occluded: Whether the object is partly visible and more of it is hidden than a pixel or two
            along its edge.
        ignored: Whether too little is visible for training, see LabelConfig.
        text: Text of the object, '' for objects without text.
        polygon: Points x0, y0, x1, y1, ... along the projected outline of the whole object. Empty
            for the spreader, seals and damages, and for objects that are partly behind the camera.
        quad: Four corners of a decal x0, y0, x1, y1, ..., clockwise from the text's upper left or
            the marker's left corner. They are those of the whole decal, also where it reaches
            beyond its sheet and its polygon ends there. Empty for other objects, and for decals
            that are partly behind the camera.
        reading: 'horizontal', or 'vertical' if the letters are below one another; '' without text.
        parts: Parts of an identifier in reading order; empty for other objects, and for decals that
            are partly behind the camera.
        keypoints: Casting corners of the container in the order of labels.objects.CASTINGS. Of a
            seal, the middle of its barrel or body; of a bolt without a barrel, that of its head.
        container: Number of the container that the object is or belongs to: 0, or k for
            Scene.neighbours[k - 1]; -1 for containers of the panorama.
        face: Face or edge of the container that a damage is on, as in `scene.Damage`; '' for other
            objects.
        severity_mm: Largest displacement by a damage, or length of a hole or mark; 0 for other
            objects.
        background: Whether the object is a container of the panorama around the scene. It has no
            amodal box, polygon or keypoints, and no pixels in the id target; see Sample.background.
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
    parts: tuple[LabelledPart, ...] = ()
    keypoints: tuple[Keypoint, ...] = ()
    container: int = 0
    face: str = ""
    severity_mm: float = 0.0
    background: bool = False


@dataclass(frozen=True, eq=False)
class ContainerView:
    """One container in an image.

    Attributes:
        container: The container.
        damages: Its damages, in its own frame.
        view: Projection of the camera, in the frame of the container.
        damage_values: Values of the container and its damages in the damage target.
    """

    container: Container
    damages: tuple[Damage, ...]
    view: View
    damage_values: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Sample(Frame):
    """Frame with its labels, and the scene and camera that it shows.

    Attributes:
        scene: The scene.
        camera: The camera.
        view: Projection of the camera.
        objects: The labels.
        background: uint16 [H, W], id - BACKGROUND_ID of the panorama's container at a pixel, 0
            elsewhere. None if these containers are not labelled: they are unknown in photographs,
            and LabelConfig.background may switch them off.
        marker_classes: Classes of the marker task in label order, see
            MarkingsConfig.detection_classes. The marks follow where they are not among them,
            because scenes made by hand may have marks.
    """

    scene: Scene
    camera: Camera
    view: View
    objects: list[Object]
    background: NDArray[np.uint16] | None = field(default=None, kw_only=True)
    marker_classes: tuple[str, ...] = field(default=ALL_DETECTION_CLASSES, kw_only=True)

    def container_at(self, number: int) -> ContainerView:
        """Return a container of the scene, as the camera sees it in the container's own frame.

        Args:
            number: Object.container of the container or of what it carries.
        """
        scene, numbers = self.scene, scene_numbers(self.scene)[number]
        values = (numbers.undamaged, *numbers.damages)
        if number == 0:
            return ContainerView(scene.container, scene.damages, self.view, values)
        each = scene.neighbours[number - 1]
        return ContainerView(each.container, each.damages, self.view.in_frame(each.pose), values)

    def container_mask(self, number: int) -> NDArray[np.bool_]:
        """Return the pixels [H, W] that show a container with its decals and damages."""
        if not self.scene.neighbours:
            return np.asarray(self.damage > 0)
        return np.isin(self.damage, self.container_at(number).damage_values)

    def overlay(self, image: NDArray[np.uint8] | None = None) -> Picture:
        """Return the image with boxes, class names and tinted damages, as `fastgen show --overlay`.

        Args:
            image: uint8 sRGB [H, W, 3] to draw on instead.

        Raises:
            ConfigError: `image` does not have the size of the sample.
        """
        base = self.image if image is None else image
        if base.shape != self.image.shape or base.dtype != np.uint8:
            raise ConfigError(
                f"image: has shape {base.shape} and type {base.dtype}; give uint8 of shape "
                f"{self.image.shape}"
            )
        return overlay(base, self.damage, self.objects)

    def _repr_png_(self) -> bytes:
        """Return the image as PNG, which notebooks show."""
        return png(self.image)

    def _repr_html_(self) -> str:
        """Return the image with its labels and a table of the visible objects, for notebooks."""
        source = base64.b64encode(png(self.overlay())).decode()
        rows = [
            (item.class_name, item.instance, item.text, item.bbox, f"{item.visible_fraction:.0%}")
            for item in self.objects
            if item.bbox is not None and not item.background
        ]
        table = html_table(("class", "instance", "text", "box", "visible"), rows)
        return (
            f'<img src="data:image/png;base64,{source}" alt="rendered image with its labels">'
            f"<details><summary>{escape(repr(self))}</summary>{table}</details>"
        )

    def __repr__(self) -> str:
        """Return one line, because notebooks print samples and arrays would fill pages."""
        width, height = self.view.size
        seen = sum(item.area > 0 for item in self.objects)
        return (
            f"Sample(seed {self.scene.seed}, index {self.scene.index}, camera "
            f"{self.camera.name!r}, {width}x{height}, {seen} of {len(self.objects)} objects seen)"
        )

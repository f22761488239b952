"""DrawInputs: what the passes over one image share."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from fastgen.camera.projection import View
from fastgen.geometry.damage_law import corners_mm
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.gpu_mesh import GpuMesh
from fastgen.render.image_targets import ImageTargets
from fastgen.render.regions import (
    Region,
    bands,
    box_corners,
    merged,
    outside,
    region_of,
    within,
)
from fastgen.render.variant import ShaderVariant
from fastgen.render.visibility_buffer import VisibilityBuffer
from fastgen.scene import Camera, Damage
from fastgen.scene.damage_kinds import form_of
from fastgen.scene.faces import CORRUGATED_ALONG_Y, FACE_AXES
from fastgen.scene.limits import MM

_LEAST_FACING = 0.02
"""Cosine between view and outward axis below which a face covers too few pixels to matter."""


_LARGEST_BULGE_MM = 250.0
"""Distance outside a container that damage hardly ever reaches."""


class ImageRequest(NamedTuple):
    """One image for the renderer to draw.

    Attributes:
        prepared: A scene that `check_scene` accepts.
        camera: Any camera outside the containers and above the ground.
        view: Projection of the camera; its size is that of the image.
        layer: "all", or one of LAYERS to see a single material layer unlit.
        radiance: Return exposed linear radiance in `Frame.radiance`, and a black image.
        normals: Return surface normals in `Frame.normals`.
    """

    prepared: PreparedScene
    camera: Camera
    view: View
    layer: str = "all"
    radiance: bool = False
    normals: bool = False


class DrawOptions(NamedTuple):
    """Choices of one image.

    Attributes:
        layer: "all", or one of LAYERS to see a single material layer unlit.
        radiance: Write exposed linear radiance.
        over: Containers are drawn over an image that has its background already.
    """

    layer: str = "all"
    radiance: bool = False
    over: bool = False


@dataclass(frozen=True)
class Regions:
    """Parts of an image in which the passes have work. None stands for the whole image.

    Attributes:
        surfaces: Disjoint rectangles; outside them the image shows only sky. A scene without a
            container has none.
        near_damage: Disjoint rectangles that damages may touch.
        holes: Disjoint rectangles that holes may touch.
        cables: Rectangles, outside all others, that show only the upper parts of a spreader.
    """

    surfaces: Sequence[Region | None]
    near_damage: Sequence[Region | None] = ()
    holes: Sequence[Region | None] = ()
    cables: Sequence[Region | None] = ()

    @property
    def drawn(self) -> list[Region | None]:
        """Disjoint rectangles that geometry may touch."""
        return bands([*self.surfaces, *self.near_damage])

    def within(self, part: Region) -> "Regions":
        """Return the parts of these regions inside one region of the image."""
        every = self.surfaces, self.near_damage, self.holes, self.cables
        return Regions(*(within(each, part) for each in every))


def pixel_mm(mesh: Mesh, view: View) -> float:
    """Return the width in mm of a pixel on the nearest part of a mesh's bounding box."""
    low, high = mesh.bounds_mm
    eye = view.position_m / MM
    away = np.linalg.norm(np.clip(eye, low, high) - eye)
    return float(away) / view.focal_px


def wave_mm(mesh: Mesh, view: View) -> float:
    """Return the largest width in mm of a pixel across the corrugation of walls and roof in view.

    It is that in the middle of each of these faces; 0 if none is in view.
    """
    low, high = mesh.bounds_mm
    eye = view.position_m / MM
    widest = 0.0
    for face in mesh.flats.keys() - {CORRUGATED_ALONG_Y}:
        out, along = (np.array(axis) for axis in (FACE_AXES[face].out, FACE_AXES[face].right))
        toward = eye - (low + high + out * (high - low)) / 2
        away = np.linalg.norm(toward)
        facing = float(toward @ out / away)
        if facing > _LEAST_FACING:
            slant = float(toward @ along / away) / facing
            widest = max(widest, float(away / view.focal_px * np.hypot(1, slant)))
    return widest


def regions_of(
    view: View, prepared: PreparedScene, damages: tuple[Damage, ...], apart: bool
) -> Regions:
    """Return where in an image container with seals, spreader and damages may be seen.

    Args:
        view: Projection of the image.
        prepared: The scene.
        damages: Its damages that the view may show.
        apart: Cables above the container have regions of their own.
    """
    if not prepared.scene.container.present:
        return Regions(())
    touched = [region_of(view, corners_mm(item)) for item in damages]
    torn = [part for part, d in zip(touched, damages, strict=True) if form_of(d).outline]
    boxes = [box_corners(prepared.container.bounds_mm, damages)]
    if prepared.spreader is not None:
        frame, *above = map(box_corners, prepared.spreader.tier_bounds_mm)
        boxes = [np.concatenate([*boxes, frame]), *above]
    surfaces = bands([region_of(view, box) for box in boxes])
    if not apart or prepared.spreader is None:
        return Regions(surfaces, merged(touched), merged(torn))
    # the regions of cables, and so the number of samples, must not depend on damage
    low, high = prepared.container.bounds_mm
    lowest, *_, upper = map(box_corners, prepared.spreader.tier_bounds_mm)
    grown = box_corners((low - _LARGEST_BULGE_MM, high + _LARGEST_BULGE_MM))
    whole = (0, 0, *view.size)
    body = region_of(view, np.concatenate([grown, lowest]))
    thin = outside(within([region_of(view, upper)], whole), within([body, *touched], whole))
    return Regions(outside(within(surfaces, whole), thin), merged(touched), merged(torn), thin)


@dataclass(frozen=True, eq=False)
class DrawInputs:
    """One image to draw, as the passes need it. The uniform blocks are filled already.

    Attributes:
        view: Projection of the camera.
        damages: Damages that this view may show.
        container, seals, spreader: Meshes with the sky visibility of the scene; None for seals and
            spreader where the scene has none.
        regions: Where the passes have work.
        targets: Where the image goes.
        samples: The visibility buffer, with as many samples as the variant says.
        coarse_ground: Shade the ground plane at half the resolution.
        variant: What all shaders of the image have in common.
        lights: Values of the directional lights in the uniform block of the view.
        textures: Textures by sampler name. A pass adds what it writes for later passes.
    """

    view: View
    damages: tuple[Damage, ...]
    container: GpuMesh
    seals: GpuMesh | None
    spreader: GpuMesh | None
    regions: Regions
    targets: ImageTargets
    samples: VisibilityBuffer
    coarse_ground: bool
    variant: ShaderVariant
    textures: dict[str, moderngl.Texture | moderngl.TextureArray]
    lights: dict[str, ArrayLike] = field(default_factory=dict)

    def of_cables(self, samples: VisibilityBuffer) -> "DrawInputs":
        """Return the inputs that draw the regions of the cables with another number of samples."""
        return replace(
            self,
            damages=(),
            regions=Regions(self.regions.cables),
            samples=samples,
            variant=replace(self.variant, samples_per_axis=samples.per_axis, damage="undamaged"),
            textures=dict(self.textures),
        )

    @property
    def eye_mm(self) -> tuple[float, float, float]:
        """Position of the camera in the container's frame."""
        x, y, z = (self.view.position_m / MM).tolist()
        return x, y, z

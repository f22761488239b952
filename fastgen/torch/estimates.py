"""Estimates of the labels of an image from its scene, without rendering."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastgen.camera.projection import View, view_of
from fastgen.config.config import Config
from fastgen.geometry.damage_law import amount_mm, faces, in_hole, is_marked
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.labels.hasp_crops import hasp_points_mm, is_sealed, shown_hasps
from fastgen.labels.visibility import too_little
from fastgen.sampling.visibility_estimates import points_toward
from fastgen.scene import Camera, Damage, Decal, Pose, Scene
from fastgen.scene.boxes import OrientedBox, container_box
from fastgen.scene.limits import MM

_GRID = 12
"""Points per side of the grid on which the covered part of a damage is estimated."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ContainerEstimate:
    """One container of a scene in one image.

    All points are in the frame of the container. Only the outer boxes of other containers hide
    them, not the spreader, vehicles, or other parts of the same container.

    Attributes:
        prepared: The scene with this container alone.
        view: Projection of the camera.
        others: Outer boxes of the other containers.
        config: Configuration whose label rules apply.
    """

    prepared: PreparedScene
    view: View
    others: tuple[OrientedBox, ...]
    config: Config

    def shown(self, points_mm: Array) -> Mask:
        """Return which points [..., 3] the image shows: not behind another container or in fog."""
        return self._projected(points_mm)[2] & ~self._hidden(points_mm)

    def container(self) -> bool:
        """Return whether the container is labelled, from points on its outer box."""
        box = container_box(self._scene.container.kind, Pose())
        points, solid_angles = points_toward(box, self._eye_mm)
        ways = points - self._eye_mm
        cosines = ways @ self.view.rotation[2] / np.linalg.norm(ways, axis=1)
        ahead = cosines > 0
        areas_px = self.view.focals_px.prod() * solid_angles[ahead] / cosines[ahead] ** 3
        return self._labelled(areas_px @ self.shown(points[ahead]), areas_px.sum())

    def damages(self) -> Iterator[Damage]:
        """Yield the damages that are labelled, from points on their planes."""
        for damage in self._scene.damages:
            # only the rim of a bulge shows from behind its face: too little to count
            if faces(damage, tuple(self._eye_mm.tolist())):
                points_mm = _damage_points_mm(damage)
                corners, depth = self.view.project(points_mm[[0, 0, -1, -1], [0, -1, -1, 0]])
                covered = _covered(damage, points_mm, self.config.damage.mask_threshold_mm)
                pixel_share = float(abs(_areas_px(corners))) / covered.size
                visible = covered & self.shown(points_mm)
                if depth.min() > 0 and self._labelled(
                    pixel_share * visible.sum(), pixel_share * covered.sum()
                ):
                    yield damage

    def decals(self) -> Iterator[Decal]:
        """Yield the decals that are labelled, from points along their outlines."""
        decals, outlines = self.prepared.decals.decals, self.prepared.decals.outlines_mm
        pixels, depth, inside = self._projected(outlines)
        # y points down, so an outline that is counter-clockwise on its sheet has a negative area
        wholes = np.where((depth > 0).all(axis=-1), -_areas_px(pixels), 0.0)
        shown = inside & ~self._hidden(outlines)
        shares = shown.sum(axis=-1) / max(outlines.shape[1], 1)
        for decal, share, whole in zip(decals, shares, wholes, strict=True):
            if self._labelled(share * whole, whole):
                yield decal

    def hasps(self) -> Iterator[bool]:
        """Yield True or False, sealed or open, for each hasp of the door that gets a crop."""
        points_mm = hasp_points_mm(self._scene)
        pixels, _, inside = self._projected(points_mm)
        seals = {seal.hasp: seal for seal in self._scene.seals}
        for hasp, _ in shown_hasps(pixels, inside, inside & ~self._hidden(points_mm)):
            yield is_sealed(seals.get(hasp))

    @property
    def _scene(self) -> Scene:
        return self.prepared.scene

    @cached_property
    def _eye_mm(self) -> Array:
        return self.view.position_m / MM

    def _projected(self, points_mm: Array) -> tuple[Array, Array, Mask]:
        """Return pixels [..., 2] and depth [...] of points, and whether they are in the image."""
        pixels, depth = self.view.project(points_mm)
        inside: Mask = (depth > 0) & ((pixels >= 0) & (pixels < self.view.size)).all(axis=-1)
        return pixels, depth, inside

    def _hidden(self, points_mm: Array) -> Mask:
        """Return which points [..., 3] are behind another container or in fog."""
        hidden: Mask = np.zeros(points_mm.shape[:-1], bool)
        for box in self.others:
            hidden |= box.between(self._eye_mm, points_mm)
        visibility_mm = self._scene.weather.visibility_mm
        if visibility_mm:
            hidden |= np.linalg.norm(points_mm - self._eye_mm, axis=-1) > visibility_mm
        return hidden

    def _labelled(self, pixels: float, whole: float) -> bool:
        return not too_little(self.config, self.view.size, pixels, whole)


def container_estimates(
    prepared: PreparedScene, camera: Camera, size: tuple[int, int], config: Config
) -> Iterator[ContainerEstimate]:
    """Yield each container of a scene as a camera sees it, the first container before the others.

    Args:
        prepared: A scene with a container.
        camera: One of its cameras.
        size: (width, height) of the image in pixels.
        config: Configuration whose label rules apply.
    """
    view = view_of(camera, size)
    for member in prepared.members:
        others = tuple(
            other.box.in_frame(member.pose) for other in prepared.members if other is not member
        )
        yield ContainerEstimate(member.prepared, view.in_frame(member.pose), others, config)


def _damage_points_mm(damage: Damage) -> Array:
    """Return a grid of points [_GRID, _GRID, 3] on the plane of a damage."""
    u, v = (half * np.linspace(-1, 1, _GRID) for half in np.array(damage.size_mm) / 2)
    offsets = u[:, None, None] * np.array(damage.along) + v[None, :, None] * np.array(damage.across)
    return np.asarray(np.array(damage.origin_mm) + offsets)


def _covered(damage: Damage, points_mm: Array, threshold_mm: float) -> Mask:
    """Return which points [..., 3] are in the mask of a damage."""
    covered: Mask = np.abs(amount_mm(damage, points_mm)) > threshold_mm
    return covered | in_hole(damage, points_mm) | is_marked(damage, points_mm)


def _areas_px(polygons: Array) -> Array:
    """Return the signed areas [...] of polygons [..., points, 2]."""
    x, y = polygons[..., 0], polygons[..., 1]
    return 0.5 * np.asarray((x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1)).sum(-1))

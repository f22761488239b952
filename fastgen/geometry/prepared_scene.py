"""The geometry of one scene that all its cameras share."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_law import deform
from fastgen.geometry.decal_facets import DecalSurface
from fastgen.geometry.facets import Facets, damage_facets, mesh_facets
from fastgen.geometry.mesh import UNIT_CUBE, UNIT_CUBE_TRIANGLES, Mesh
from fastgen.geometry.seals import SceneSeals, scene_seals
from fastgen.geometry.shape_library import SHAPES, ShapeLibrary, SpreaderShape
from fastgen.geometry.solids import Body
from fastgen.scene import Pose, Scene, Spreader
from fastgen.scene.boxes import OrientedBox, container_box, rotation_of
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.object_ids import Numbers, scene_numbers

CORNER_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)])
"""Corners of a container's outer box, int [8, 3]: -1 or 1 along x and y, 0 or 1 along z."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Member:
    """One container of a scene.

    Attributes:
        number: 0 for Scene.container, k for Scene.neighbours[k - 1].
        pose: Where its frame is in the world.
        prepared: The scene with this container alone, in the frame of the container. The cameras
            stay in the world.
    """

    number: int
    pose: Pose
    prepared: "PreparedScene"

    @cached_property
    def box(self) -> OrientedBox:
        """Outer box of the container in the world."""
        return container_box(self.prepared.scene.container.kind, self.pose)


class PreparedScene:
    """A scene with its meshes and the geometry that labels need, shared by its cameras.

    A Generator makes one for each scene and drops it with the scene. Meshes come from the shape
    library. All members except `scene` are computed on first use and kept, so a camera after the
    first finds them ready. Instances are compared by identity and may be keys of caches.

    Args:
        scene: A checked scene.
        shapes: Library of the meshes.
        numbers: Numbers of the container and what it carries, by default those of the first one.

    Attributes:
        scene: The scene.
        numbers: The numbers.
    """

    def __init__(
        self, scene: Scene, shapes: ShapeLibrary = SHAPES, numbers: Numbers | None = None
    ) -> None:
        self.scene = scene
        self.numbers = scene_numbers(scene)[0] if numbers is None else numbers
        self._shapes = shapes
        self._damage_facets: list[Facets | None] = [None] * len(scene.damages)

    @cached_property
    def members(self) -> tuple["Member", ...]:
        """All containers of the scene, the first one and its neighbours, each in its own frame.

        Only the first one has the spreader.
        """
        scene = self.scene
        found = [Member(0, Pose(), self)]
        numbers = scene_numbers(scene)
        for number, each in enumerate(scene.neighbours, 1):
            turned = scene.environment.yaw_deg - each.pose.yaw_deg
            own = replace(
                scene,
                container=each.container,
                surface=each.surface,
                environment=replace(scene.environment, yaw_deg=turned),
                decals=each.decals,
                damages=each.damages,
                seals=each.seals,
                spreader=Spreader(),
                neighbours=(),
                ground=None,
                props=(),
            )
            found.append(
                Member(number, each.pose, PreparedScene(own, self._shapes, numbers[number]))
            )
        return tuple(found)

    @cached_property
    def present(self) -> tuple["Member", ...]:
        """The containers that the scene shows."""
        return tuple(m for m in self.members if m.prepared.scene.container.present)

    @cached_property
    def others(self) -> tuple[Body | None, ...]:
        """Outer boxes of all other containers in the frame of each member, None without any."""
        found: list[Body | None] = []
        for member in self.members:
            turn, origin = rotation_of(member.pose), np.array(member.pose.position_mm)
            corners = [
                (other.box.corners_mm - origin) @ turn
                for other in self.members
                if other is not member
            ]
            firsts = np.arange(len(corners), dtype=np.uint32) * len(UNIT_CUBE)
            triangles = (UNIT_CUBE_TRIANGLES + firsts[:, None, None]).reshape(-1, 3)
            positions = np.array(corners, np.float32).reshape(-1, 3)
            found.append(Body(positions, triangles.astype(np.uint32)) if corners else None)
        return tuple(found)

    @cached_property
    def container(self) -> Mesh:
        """The container at rest, as it is drawn."""
        box = self.scene.container
        return self._shapes.container(box.kind, box.profiles)

    @cached_property
    def container_outline(self) -> Mesh:
        """The container at rest with as few triangles as possible, for shadows and sky
        visibility."""
        box = self.scene.container
        return self._shapes.container_outline(box.kind, box.profiles)

    @cached_property
    def nominal_outline(self) -> Mesh:
        """A container of this kind with nominal corrugation, for the light on the spreader."""
        return self._shapes.container_outline(self.scene.container.kind)

    @cached_property
    def spreader(self) -> SpreaderShape | None:
        """The spreader at its gap, None if the scene has none."""
        held = self.scene.spreader
        if not held.present:
            return None
        kind = self.scene.container.kind
        return self._shapes.spreader(kind, held.flippers_down, held.gap_mm)

    @cached_property
    def seals(self) -> SceneSeals | None:
        """The seals at the hasps of the damaged door, None if the scene has none."""
        return scene_seals(self.scene)

    @cached_property
    def usual_spreader(self) -> SpreaderShape | None:
        """The spreader at the usual gap, for sky visibility; None if the scene has none.

        A few centimetres hardly change the shade, and each new shape costs a second once.
        """
        held = self.scene.spreader
        if not held.present:
            return None
        return self._shapes.spreader(self.scene.container.kind, held.flippers_down)

    def prepare_shapes(self, lens: bool, damages: bool) -> None:
        """Load the meshes and derive their geometry, so that later scenes find them ready.

        Args:
            lens: Prepare for images with lens distortion.
            damages: Prepare for damaged scenes too.
        """
        self.container.prepare(damages)
        _ = self.container_outline, self.nominal_outline
        if self.spreader is not None:
            _ = self.usual_spreader, self.spreader.facets(lens)
            _ = self.spreader.solid, self.spreader.ray_triangles, self.spreader.tier_bounds_mm

    @cached_property
    def decals(self) -> DecalSurface:
        """The labelled decals on the damaged container."""
        return DecalSurface(self.scene, self.container)

    def damage_facets(self, number: int) -> Facets:
        """Return the triangles that one damage may have moved.

        Args:
            number: Index into Scene.damages.
        """
        facets = self._damage_facets[number]
        if facets is None:
            damage = self.scene.damages[number]
            facets = self._damage_facets[number] = damage_facets(self.scene, self.container, damage)
        return facets

    @cached_property
    def facets(self) -> Facets:
        """All triangles of the container after damage, in the container frame."""
        return replace(mesh_facets(self.container), points_mm=self.points_mm)

    @cached_property
    def corners_mm(self) -> Array:
        """Outer corners float64 [8, 3] of the corner castings after damage, see CORNER_SIGNS."""
        kind = KINDS[self.scene.container.kind]
        rest = CORNER_SIGNS * np.array([kind.length_mm / 2, kind.width_mm / 2, kind.height_mm])
        return deform(self.scene.damages, rest)

    @cached_property
    def points_mm(self) -> Array:
        """All distinct vertices float64 [P, 3] of the container after damage."""
        if not self.scene.damages:
            return self.container.points_mm
        return deform(self.scene.damages, self.container.points_mm)

    @cached_property
    def hull_points_mm(self) -> Array:
        """Vertices float64 [P, 3] after damage that include the corners of the convex hull."""
        if not self.scene.damages:
            return self.container.points_mm[self.container.hull]
        # everything in a box within the damaged corners lies within their convex hull
        corners = self.corners_mm
        least = np.where(CORNER_SIGNS > 0, -np.inf, corners).max(axis=0)
        most = np.where(CORNER_SIGNS > 0, corners, np.inf).min(axis=0)
        moved = self.points_mm
        inside = [(x > a) & (x < b) for x, a, b in zip(moved.T, least, most, strict=True)]
        return moved.compress(~np.logical_and.reduce(inside), axis=0)

    @cached_property
    def rim_points_mm(self) -> Array:
        """Vertices float64 [P, 3] after damage that include the outermost ones of any image.

        Lens distortion curves the edges of the outer box, so that vertices along them count as
        well as its corners. Everything else is behind or between them.
        """
        rim = self.points_mm[self.container.rim]
        return np.concatenate([rim, self.hull_points_mm]) if self.scene.damages else rim

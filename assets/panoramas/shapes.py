"""Construction of Blender meshes from simple parts. Metres, z up."""

from collections.abc import Sequence

import bpy
import numpy as np

Point = Sequence[float]


class Shape:
    """Vertices and faces, with a material name for each face."""

    def __init__(self) -> None:
        self.points: list[tuple[float, float, float]] = []
        self.faces: list[tuple[int, ...]] = []
        self.materials: list[str] = []

    def add(self, points: Sequence[Point], faces: Sequence[Sequence[int]], material: str) -> None:
        """Add faces given by index into `points`, counter-clockwise seen from outside."""
        first = len(self.points)
        self.points += [(float(p[0]), float(p[1]), float(p[2])) for p in points]
        self.faces += [tuple(first + i for i in face) for face in faces]
        self.materials += [material] * len(faces)

    def box(self, low: Point, high: Point, material: str) -> None:
        """Add an axis-aligned box between two opposite corners."""
        corners = [
            (x, y, z)
            for z in (low[2], high[2])
            for y in (low[1], high[1])
            for x in (low[0], high[0])
        ]
        self.add(corners, _BOX, material)

    def beam(self, start: Point, end: Point, width: float, depth: float, material: str) -> None:
        """Add a bar with a rectangular cross-section.

        `width` is horizontal, and `depth` is vertical, or along y for an upright bar.
        """
        a, b = np.array(start, float), np.array(end, float)
        along = (b - a) / np.linalg.norm(b - a)
        up = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.95 else np.array([0.0, 1.0, 0.0])
        side = np.cross(along, up)
        side *= width / 2 / np.linalg.norm(side)
        lift = np.cross(side, along)
        lift *= depth / 2 / np.linalg.norm(lift)
        corners = [p + t * lift + s * side for t in (-1, 1) for p in (a, b) for s in (1, -1)]
        order = [0, 2, 1, 3, 4, 6, 5, 7]
        self.add([corners[i] for i in order], _BOX, material)

    def tube(
        self, start: Point, end: Point, radii: tuple[float, float], material: str, sides: int = 12
    ) -> None:
        """Add a closed round bar that tapers from one radius to the other."""
        a, b = np.array(start, float), np.array(end, float)
        along = (b - a) / np.linalg.norm(b - a)
        helper = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        u = np.cross(along, helper)
        u /= np.linalg.norm(u)
        v = np.cross(along, u)
        turn = 2 * np.pi * np.arange(sides) / sides
        ring = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
        points = [*(a + radii[0] * ring), *(b + radii[1] * ring)]
        faces = [(i, (i + 1) % sides, sides + (i + 1) % sides, sides + i) for i in range(sides)]
        faces += [tuple(range(sides))[::-1], tuple(range(sides, 2 * sides))]
        self.add(points, faces, material)

    def mesh(self, name: str) -> bpy.types.Mesh:
        """Return a Blender mesh with a slot for each material, which must exist in bpy.data."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(self.points, [], self.faces)
        used = sorted(set(self.materials))
        for material in used:
            mesh.materials.append(bpy.data.materials[material])
        slots = np.array([used.index(m) for m in self.materials], np.int32)
        mesh.polygons.foreach_set("material_index", slots)
        mesh.update()
        return mesh


# corners are numbered x + 2 y + 4 z
_BOX = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def place(
    mesh: bpy.types.Mesh,
    position: Point,
    turn_deg: float = 0.0,
    color: Sequence[float] = (0.5, 0.5, 0.5),
) -> bpy.types.Object:
    """Add an object with this mesh to the scene, rotated about the vertical; color is linear
    RGB."""
    thing = bpy.data.objects.new(mesh.name, mesh)
    thing.location = position
    thing.rotation_euler = (0.0, 0.0, np.deg2rad(turn_deg))
    thing.color = (*color, 1.0)
    bpy.context.scene.collection.objects.link(thing)
    return thing

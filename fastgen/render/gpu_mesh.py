"""Meshes on the GPU, each drawn with one indirect call that leaves out faces turned away."""

import weakref
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.door_gear import is_gear
from fastgen.geometry.mesh import Mesh
from fastgen.light.sky_visibility import open_sky
from fastgen.render.clusters import Clusters
from fastgen.render.programs import ZONE_GEAR, ZONE_LEVEL, ZONE_SMALL, ZONE_TURN
from fastgen.render.textures import data_texture
from fastgen.scene.faces import FACE_AXES, FACES

_SLACK_MM = 120.0
"""Frames stand back from the castings' plane (mesh.GROUP_SLACK_MM), and sheets may sag a little."""


def facing_groups(mesh: Mesh, position_mm: Iterable[float]) -> list[str]:
    """Names of the triangle groups that a camera at `position_mm` may see."""
    low, high = mesh.bounds_mm
    x, y, z = position_mm
    ahead = {
        "front": y < low[1] + _SLACK_MM,
        "back": y > high[1] - _SLACK_MM,
        "door": x > high[0] - _SLACK_MM,
        "no_door": x < low[0] + _SLACK_MM,
        "roof": z > high[2] - _SLACK_MM,
        "underside": z < low[2] + _SLACK_MM,
    }
    return [name for name in mesh.groups if ahead.get(name, True)]


_COMMAND = np.dtype(
    [("count", "u4"), ("instances", "u4"), ("first", "u4"), ("vertex", "u4"), ("instance", "u4")]
)
"""DrawElementsIndirectCommand, OpenGL 4.5 core specification, section 10.4."""


class GpuMesh:
    """Vertex and index data of one Mesh. Owned by the renderer, which releases it.

    programs: the geometry program of each of programs.DAMAGE_VARIANTS; that of 'holed' draws what
    shows through holes. first_zone: what the numbers of the mesh's zones begin with in the table of
    zones.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        mesh: Mesh,
        programs: Mapping[str, moderngl.Program],
        first_zone: int = 0,
    ) -> None:
        self.mesh = mesh
        layout = np.dtype([("p", "f4", 3), ("n", "f4", 3), ("a", "f4", 2), ("c", "u4")])
        vertices = np.empty(len(mesh.positions_mm), layout)
        vertices["p"], vertices["n"] = mesh.positions_mm, mesh.normals
        vertices["a"], vertices["c"] = mesh.atlas_mm, mesh.zone + first_zone
        self._vertices = ctx.buffer(vertices.tobytes())
        self._indices = ctx.buffer(np.ascontiguousarray(mesh.triangles, np.uint32).tobytes())
        self._openness = ctx.buffer(open_sky(mesh.normals).tobytes())
        self._shown: weakref.ref[NDArray[np.uint8]] | None = None
        most = len(mesh.groups) + 2 * Clusters.most_runs(mesh)
        self._commands = ctx.buffer(reserve=_COMMAND.itemsize * most)
        names = ("in_position_mm", "in_normal", "in_atlas_mm", "in_zone")
        content = (self._vertices, "3f 3f 2f 1u", *names)
        seen = ("in_cone", "in_light", "in_open_to")
        contents = [content, (self._openness, "3f1 1x 4f1 3u", *seen)]
        self._arrays = {
            damage: ctx.vertex_array(program, contents, self._indices)
            for damage, program in programs.items()
        }

    @cached_property
    def clusters(self) -> Clusters:
        """What of the mesh damages touch, and what may be behind a hole: asked of containers."""
        return Clusters(self.mesh)

    def set_openness(self, values: NDArray[np.uint8]) -> None:
        """Let the next draws have `values`, of sky_probe.SkyProbe; until then all sky is open."""
        if self._shown is None or self._shown() is not values:
            self._openness.write(values)
            self._shown = weakref.ref(values)  # many meshes wait for their turn

    def seen_from(self, position_mm: Iterable[float], bent: Collection[str] = ()) -> list[slice]:
        """Triangles that a camera at `position_mm` may see from outside; bent: faces to count in
        even if turned away."""
        names = {*facing_groups(self.mesh, position_mm), *bent}
        return [triangles for name, triangles in self.mesh.groups.items() if name in names]

    def draw(self, program: str, triangles: Sequence[slice]) -> None:
        """Draw some triangles in one call.

        program: one of programs.DAMAGE_VARIANTS; 'holed' draws insides into the inner view, but for
        what holes tore away.
        """
        if not triangles:
            return
        commands = np.zeros(len(triangles), _COMMAND)
        commands["instances"] = 1
        commands["count"] = [3 * (part.stop - part.start) for part in triangles]
        commands["first"] = [3 * part.start for part in triangles]
        self._commands.write(commands.tobytes())
        self._arrays[program].render_indirect(self._commands, moderngl.TRIANGLES, len(triangles))

    def release(self) -> None:
        """Free all GL objects."""
        buffers = (self._vertices, self._indices, self._openness, self._commands)
        items: list[Any] = [*self._arrays.values(), *buffers]
        for item in items:
            item.release()


def zone_table(ctx: moderngl.Context, meshes: Mapping[int, Mesh]) -> moderngl.Texture:
    """What is known of each zone, as the shader reads it (shaders/zone.glsl).

    meshes: by the number that each one's zones begin with. The caller releases the texture.
    """
    count = max(first + len(mesh.zones) for first, mesh in meshes.items())
    table = np.zeros((2, count, 4), np.float32)
    for first, mesh in meshes.items():
        charts = [mesh.charts[zone.chart] for zone in mesh.zones]
        columns = slice(first, first + len(charts))
        table[0, columns] = [zone.rect_mm for zone in mesh.zones]
        table[1, columns, 0] = [
            chart.material_index
            + ZONE_TURN * zone.quarter_turns
            + ZONE_GEAR * is_gear(chart)
            + ZONE_SMALL * zone.small
            + ZONE_LEVEL * zone.level
            for chart, zone in zip(charts, mesh.zones, strict=True)
        ]
        table[1, columns, 1:] = [
            FACE_AXES[chart.face].out if chart.name.split(".")[0] in FACES else (0, 0, 0)
            for chart in charts
        ]
    return data_texture(ctx, table)

"""Meshes on the GPU, drawn with one indirect call that skips faces turned away from the camera."""

import weakref
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.door_gear import is_gear
from fastgen.geometry.mesh import Chart, Mesh, Zone
from fastgen.geometry.sheet_folds import SheetFolds
from fastgen.light.sky_visibility import open_sky
from fastgen.render.clusters import Clusters
from fastgen.render.rust import Flats, fold_row
from fastgen.render.textures import data_texture
from fastgen.render.zone_codes import (
    SHEET_NUMBERS,
    ZONE_GEAR,
    ZONE_LEVEL,
    ZONE_SHEET,
    ZONE_SMALL,
    ZONE_TURN,
)
from fastgen.scene.faces import FACE_AXES, FACES

_SLACK_MM = 120.0
"""Distance that a camera may be behind the plane of a face's castings and still see the face.

Frames and sheets lie behind that plane, see mesh.GROUP_SLACK_MM."""


def facing_groups(mesh: Mesh, position_mm: Iterable[float]) -> list[str]:
    """Return the triangle groups that a camera may see.

    Args:
        mesh: Mesh of a container, spreader or seals.
        position_mm: Position of the camera in the container frame.

    Returns:
        Names from `mesh.groups`.
    """
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
    """Vertex and index buffers of one mesh. The renderer owns and releases them.

    Attributes:
        mesh: The mesh.

    Args:
        ctx: Current OpenGL context.
        mesh: Mesh to upload.
        programs: Geometry program of each damage variant; 'holed' draws the view through holes.
        first_zone: Number of the mesh's first zone in the zone table.
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
        self._sky_visibility = ctx.buffer(open_sky(mesh.normals).tobytes())
        self._shown: weakref.ref[NDArray[np.uint8]] | None = None
        most = len(mesh.groups) + 2 * Clusters.most_runs(mesh)
        self._commands = ctx.buffer(reserve=_COMMAND.itemsize * most)
        names = ("in_position_mm", "in_normal", "in_atlas_mm", "in_zone")
        content = (self._vertices, "3f 3f 2f 1u", *names)
        seen = ("in_sky_cone", "in_sky_light", "in_visible_directions")
        contents = [content, (self._sky_visibility, "3f1 1x 4f1 3u", *seen)]
        self._arrays = {
            damage: ctx.vertex_array(program, contents, self._indices)
            for damage, program in programs.items()
        }

    @cached_property
    def clusters(self) -> Clusters:
        """Bounding boxes of triangle runs; only containers need them, for damages and holes."""
        return Clusters(self.mesh)

    @cached_property
    def zone_rows(self) -> NDArray[np.float32]:
        """The mesh's columns [3, zones, 4] of the zone table."""
        return zone_rows(self.mesh.charts, self.mesh.zones, self.mesh.flats, self.mesh.folds)

    def set_sky_visibility(self, values: NDArray[np.uint8]) -> None:
        """Set the sky visibility of the vertices; before, every vertex sees the whole sky.

        Args:
            values: uint8 [V, VERTEX_BYTES] in the format of `sky_visibility`.
        """
        if self._shown is None or self._shown() is not values:
            self._sky_visibility.write(values)
            self._shown = weakref.ref(values)  # Does not keep the values of cached meshes alive.

    def seen_from(self, position_mm: Iterable[float], bent: Collection[str] = ()) -> list[slice]:
        """Return the triangles that a camera outside the mesh may see.

        Args:
            position_mm: Position of the camera in the container frame.
            bent: Faces to include even if they are turned away.

        Returns:
            Slices of the mesh's triangles.
        """
        names = {*facing_groups(self.mesh, position_mm), *bent}
        return [triangles for name, triangles in self.mesh.groups.items() if name in names]

    def draw(self, program: str, triangles: Sequence[slice]) -> None:
        """Draw triangles in one call.

        Args:
            program: Damage variant of the geometry program. 'holed' draws the interior into the
                inner view, without the sheet that damages tore away.
            triangles: Slices of the mesh's triangles.
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
        buffers = (self._vertices, self._indices, self._sky_visibility, self._commands)
        items: list[Any] = [*self._arrays.values(), *buffers]
        for item in items:
            item.release()


def zone_rows(
    charts: Sequence[Chart],
    zones: Sequence[Zone],
    flats: Flats | None = None,
    folds: Mapping[str, SheetFolds] | None = None,
) -> NDArray[np.float32]:
    """Return the columns [3, zones, 4] of the zone table for the zones of some charts.

    Args:
        charts: The charts.
        zones: Their zones.
        flats: Outermost flats of each corrugated face, see Mesh.flats; None without any.
        folds: Slopes of the sheets, see Mesh.folds; None without sheets.
    """
    of_zones = [charts[zone.chart] for zone in zones]
    rows = np.zeros((3, len(zones), 4), np.float32)
    rows[0] = [zone.rect_mm for zone in zones]
    rows[1, :, 0] = [
        chart.material_index
        + ZONE_TURN * zone.quarter_turns
        + ZONE_GEAR * is_gear(chart)
        + ZONE_SMALL * zone.small
        + ZONE_LEVEL * zone.level
        + ZONE_SHEET * SHEET_NUMBERS.get(chart.name, 0)
        for chart, zone in zip(of_zones, zones, strict=True)
    ]
    rows[1, :, 1:] = [
        FACE_AXES[chart.face].out if chart.name.split(".")[0] in FACES else (0, 0, 0)
        for chart in of_zones
    ]
    rows[2, :, :3] = [
        fold_row(chart, zone, flats or {}) for chart, zone in zip(of_zones, zones, strict=True)
    ]
    stretch = {name: fold.stretch for name, fold in (folds or {}).items()}
    rows[2, :, 3] = [stretch.get(chart.name, 1.0) for chart in of_zones]
    return rows


def zone_table(ctx: moderngl.Context, rows: Mapping[int, NDArray[np.float32]]) -> moderngl.Texture:
    """Return the table of zones that shaders/zone.glsl reads.

    Args:
        ctx: Current OpenGL context.
        rows: Columns of each mesh, from `zone_rows`, by the number of its first zone.

    Returns:
        Texture with three rows, which the caller releases.
    """
    count = max(first + each.shape[1] for first, each in rows.items())
    table = np.zeros((3, count, 4), np.float32)
    for first, each in rows.items():
        table[:, first : first + each.shape[1]] = each
    return data_texture(ctx, table)

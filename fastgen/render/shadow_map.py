"""Shadow map of a container and its spreader: one tile for each directional light.

Dents are included, holes are not. Williams 1978, Casting Curved Shadows on Curved Surfaces.
shaders/light_visibility.glsl filters the map as Reeves et al. 1987 do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.geometry.damage_law import corners_mm, deform
from fastgen.geometry.mesh import UNIT_CUBE, Mesh
from fastgen.geometry.solids import Body, Solid
from fastgen.light.directional_lights import MAX_LIGHTS, DirectionalLight
from fastgen.light.occluders import map_matrix
from fastgen.render.depth_map import DepthMap, DrawnBody, MapView, Tile
from fastgen.scene import Damage
from fastgen.scene.limits import MM

_EDGE_TEXELS = 1
"""Empty border of a tile. Lookups outside the tile are clamped to it and find no occluder."""

_FIRST_TEXELS = (1536, 512)
"""Size of the tile of the first light at full detail; a texel is at most 10 mm wide."""

_END_TEXELS = (1280, 1280)
_END_TEXEL_MM = 2.5
_END_DEPTH_MM = 450.0
"""The first light has a second, finer tile for the end of the container that it shines on. The tile
reaches _END_DEPTH_MM behind the castings, as far as damage pushes door leaves. At full detail its
texels are _END_TEXEL_MM wide, because a locking bar is 34 mm wide, or up to 3.6 mm if it is full.
"""

_END_BORDER_MM = 60.0
"""Border around the part of the end tile that shading uses; filtered lookups reach less far."""

_OTHERS_TEXELS = (1024, 512)
"""Size of the tile of each other light, whose shadows are fainter."""

_BIAS_MM = 2.0

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EndTile:
    """Second, finer tile of the first light, for the end of the container that it shines on.

    Attributes:
        to_tile: (scale u, scale v, offset u, offset v) from texture coordinates in the first tile
            to texture coordinates in this one.
        inner: Lowest (u, v) and highest (u, v) for lookups; the filter around them stays inside.
        side: 1 or -1, direction of the end along x.
        from_mm: The tile is for points farther than this in that direction.
    """

    to_tile: Array
    inner: Array
    side: float
    from_mm: float


class _Layout(NamedTuple):
    """Layout of the map: its size, the tile of each light and the space for the end tile.

    Texels of the end tile are at least `end_texel_mm` wide.
    """

    size: tuple[int, int]
    lights: tuple[Tile, ...]
    end: Tile
    end_texel_mm: float


def _layout(detail: float) -> _Layout:
    """Return the layout; detail: share of the full number of texels along each axis."""

    def scaled(texels: tuple[int, int], edge: int) -> tuple[int, int]:
        along, across = (round(detail * count) + 2 * edge for count in texels)
        return along, across

    first, others = (scaled(size, _EDGE_TEXELS) for size in (_FIRST_TEXELS, _OTHERS_TEXELS))
    end = scaled(_END_TEXELS, 0)
    left, below = max(end[0], others[0]), first[1]
    height = below + max(end[1], 2 * others[1]) + others[1]
    corners = ((left, below), (left, below + others[1]), (0, height - others[1]))
    return _Layout(
        (max(first[0], left + others[0]), height),
        ((0, 0, *first), *((*corner, *others) for corner in corners)),
        (0, below, *end),
        _END_TEXEL_MM / detail,
    )


_NO_END = EndTile(np.zeros(4), np.array([1.0, 1.0, 0.0, 0.0]), 1.0, 0.0)


class ShadowMap:
    """Depth map of a container and its spreader, as the directional lights see them.

    Owned by the renderer, which releases it. All scenes share one texture, because textures made
    per scene would fragment the memory of the process.

    Args:
        ctx: Current OpenGL context.
        program: Program of occluder.vert.
        detail: Share of the full number of texels along each axis; 0.5 has a quarter of all texels.

    Attributes:
        toward: Unit vectors [S, 3] in the world frame toward the S lights.
        tiles: [S, 4], tile of each light: (u, v) of the centres of its first and last texels, in
            texture coordinates (0..1) of the whole map.
        end: The first light's finer tile for the container's end that it shines on; its bounds are
            empty if there is none.
    """

    def __init__(
        self, ctx: moderngl.Context, program: moderngl.Program, detail: float = 1.0
    ) -> None:
        self._ctx = ctx
        self._program = program
        self._layout = _layout(detail)
        self._shown: tuple[object, ...] = ()
        self.toward = np.zeros((0, 3))
        self._to_map = np.zeros((0, 4, 4))
        self.tiles = np.zeros((0, 4))
        self.end = _NO_END
        self._map = DepthMap(ctx, program, self._layout.size)
        self.depth = self._map.depth
        self.depth.compare_func = "<="
        self.depth.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.depth.repeat_x = self.depth.repeat_y = False

    def cast(
        self,
        container: Mesh,
        spreader: Solid | None,
        toward: Array,
        damages: tuple[Damage, ...] = (),
        outline: Mesh | None = None,
        others: Body | None = None,
    ) -> None:
        """Draw the map unless it already shows the same.

        Args:
            container: Undamaged mesh.
            spreader: Spreader without cables, or None.
            toward: Unit vectors [S, 3] toward the lights in world space, 1 to MAX_LIGHTS.
            damages: Damages of the container.
            outline: The same container with fewer triangles, for charts that no damage touches.
            others: Further bodies that cast shadows on the container.
        """
        shown = (container, outline, spreader, others, tuple(toward.ravel().tolist()), damages)
        if shown == self._shown:
            return
        self._shown = ()  # stays empty if drawing fails
        # under light from below, floor members shade one another
        members = bool(toward[:, 2].min() <= 0)
        body, of_door = _bent(container, outline or container, damages, members)
        bodies: list[Solid] = [body] if spreader is None else [body, spreader]
        low = np.min([body.bounds_mm[0] for body in bodies], axis=0).astype(np.float64)
        high = np.max([body.bounds_mm[1] for body in bodies], axis=0).astype(np.float64)
        tiles = self._layout.lights[: len(toward)]
        to_tiles = np.stack([map_matrix(way, low, high) for way in toward])
        first, size = np.split(np.array(tiles), 2, axis=1)
        to_tiles[:, :2] *= (1 - 2 * _EDGE_TEXELS / size)[..., None]
        side = float(np.sign(toward[0, 0]))
        # the door shades only its own end, which has the end tile or faces away from the light
        plain = _plain(body, of_door) if side and of_door.any() else body
        drawn: dict[Solid, DrawnBody] = {}

        def view(solids: Sequence[Solid], matrix: Array, tile: Tile, thick: bool = True) -> MapView:
            for solid in solids:
                if solid not in drawn:
                    drawn[solid] = DrawnBody(self._ctx, self._program, solid)
            shown = [drawn[solid] for solid in solids]
            return MapView(shown, matrix, tile, shown[:1] if thick else [])

        further = [] if others is None else [others]
        views = [view([plain, *bodies[1:], *further], to_tiles[0], tiles[0])]
        views += [
            view([*bodies, *further], matrix, tile)
            for matrix, tile in zip(to_tiles[1:], tiles[1:], strict=True)
        ]
        self.toward = toward
        self._to_map = _in_map(to_tiles, np.array(tiles), self._layout)
        self.tiles = np.hstack([first + 0.5, first + size - 0.5]) / np.tile(self._layout.size, 2)
        self.end = _NO_END
        if side:
            from_mm = float(np.abs(container.bounds_mm[int(side > 0)][0])) - _END_DEPTH_MM
            # occluders of such a point are farther out, except for the border of filtered lookups
            from_border = from_mm - _END_BORDER_MM
            container_end, *rest = (_beyond(body, side, from_border) for body in bodies)
            # deep damage may leave no triangle
            ends = [end for end in (container_end, *rest) if len(end.triangles)]
            if ends:
                self.end, matrix, tile = _end_tile(
                    to_tiles[0], self._to_map[0], ends, side, from_mm, self._layout
                )
                views.append(view([*ends, *further], matrix, tile, ends[0] is container_end))
        self._map.draw(views)
        for item in drawn.values():
            item.release()
        self._shown = shown

    def from_ray(self, eye_m: Array) -> Array:
        """Return the matrices [S, 4, 4] to (u, v, depth) in the tile of each light.

        Multiply them by (point - eye, 1), in world metres.

        Args:
            eye_m: The eye, [3] in world metres.
        """
        matrix = np.tile(np.eye(4), (len(self._to_map), 1, 1))
        matrix[:, :3, :3] = 500 * self._to_map[:, :3, :3]
        matrix[:, :3, 3] = matrix[:, :3, :3] @ eye_m + 0.5 * self._to_map[:, :3, 3] + 0.5
        matrix[:, 2, 3] -= 0.5 * _BIAS_MM * np.linalg.norm(self._to_map[:, 2, :3], axis=-1)
        return matrix

    def release(self) -> None:
        """Free all GL objects."""
        self._map.release()


def _in_map(to_tiles: Array, tiles: NDArray[np.int64], layout: _Layout) -> Array:
    """Return matrices [S, 4, 4] to clip space of `tiles` [S, 4] as matrices to that of the map."""
    first, size = np.split(tiles, 2, axis=1)
    found = to_tiles.copy()
    found[:, :2] *= (size / layout.size)[..., None]
    found[:, :2, 3] += (2 * first + size) / layout.size - 1
    return found


def _end_tile(
    to_first: Array,
    first_to_map: Array,
    ends: Sequence[Body],
    side: float,
    from_mm: float,
    layout: _Layout,
) -> tuple[EndTile, Array, Tile]:
    """Return the end tile, its matrix from mm to clip space and its texels in the map.

    Args:
        to_first: [4, 4], mm to clip space of the first tile.
        first_to_map: [4, 4], mm to clip space of the whole map through the first tile.
        ends: Triangles to draw, see _beyond.
        side: 1 or -1, direction of the end along x.
        from_mm: The tile is for points farther than this in that direction.
        layout: Layout of the map.
    """
    lows, highs = zip(*(_extent(body.positions_mm, body.triangles) for body in ends), strict=True)
    low, high = np.min(lows, axis=0).astype(np.float64), np.max(highs, axis=0).astype(np.float64)
    (low if side > 0 else high)[0] = side * from_mm
    seen = (low + UNIT_CUBE * (high - low)) @ to_first[:2, :3].T + to_first[:2, 3]
    units = np.linalg.norm(to_first[:2, :3], axis=1)  # clip space per mm
    least = seen.min(axis=0) - _END_BORDER_MM * units
    most = seen.max(axis=0) + _END_BORDER_MM * units
    texels = np.ceil((most - least) / units / layout.end_texel_mm)
    width, height = np.minimum(texels, layout.end[2:]).astype(int).tolist()
    tile = (*layout.end[:2], width, height)
    to_tile = to_first.copy()
    to_tile[:2, 3] -= (least + most) / 2
    to_tile[:2] *= (2 / (most - least))[:, None]

    (to_map,) = _in_map(to_tile[None], np.array([tile]), layout)
    units_in_map = np.linalg.norm(to_map[:2, :3], axis=1)
    scale = units_in_map / np.linalg.norm(first_to_map[:2, :3], axis=1)
    offset = to_map[:2, 3] - scale * first_to_map[:2, 3]
    # texture coordinates are 0..1, clip space is -1..1; half of the border is for filtered lookups
    place = np.concatenate([scale, (offset + 1 - scale) / 2])
    border = _END_BORDER_MM / 2 * units_in_map / 2
    first, size = np.split(np.array(tile), 2)
    inner = np.concatenate([first / layout.size + border, (first + size) / layout.size - border])
    return EndTile(place, inner, side, from_mm), to_tile, tile


def _beyond(body: Solid, side: float, from_mm: float) -> Body:
    """Return the triangles of a body that reach farther than from_mm toward `side` along x."""
    a, b, c = (side * body.positions_mm[:, 0] > from_mm)[body.triangles].T
    return Body(body.positions_mm, body.triangles[a | b | c])


def _extent(
    positions_mm: NDArray[np.float32], triangles: NDArray[np.uint32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the lowest and highest coordinates [3] of the corners of triangles."""
    corners = triangles.ravel().astype(np.intp)
    axes = [np.take(axis, corners) for axis in positions_mm.T]  # rows are ten times slower
    return np.stack([axis.min() for axis in axes]), np.stack([axis.max() for axis in axes])


def _bent(
    container: Mesh, outline: Mesh, damages: tuple[Damage, ...], members: bool
) -> tuple[Body, NDArray[np.bool_]]:
    """Return a damaged container and a mask [T] of the triangles of its door.

    Charts that a damage touches keep the triangles of `container`; others use `outline`. members:
    include the cross members of the floor.
    """
    if not damages:
        part = _parts(outline)
        kept = (part != _MEMBER) | members
        return Body(outline.positions_mm, outline.triangles[kept]), part[kept] == _DOOR
    moved = container.positions_mm.copy()
    columns = np.ascontiguousarray(moved.T)  # comparisons along rows are ten times slower
    reached = np.zeros(len(container.charts), bool)
    for damage in damages:
        box = corners_mm(damage)
        low, high = box.min(axis=0), box.max(axis=0)
        near = np.all([(low[i] <= columns[i]) & (columns[i] <= high[i]) for i in range(3)], axis=0)
        rest = container.positions_mm[near].astype(np.float64)
        moved[near] += (deform((damage,), rest) - rest).astype(np.float32)
        reached[container.chart[near]] = True
    bent, rigid = _parts(container), _parts(outline)
    is_bent = reached[container.chart[container.triangles[:, 0]]] & ((bent != _MEMBER) | members)
    is_rigid = ~reached[outline.chart[outline.triangles[:, 0]]] & ((rigid != _MEMBER) | members)
    body = Body(
        np.concatenate([moved, outline.positions_mm]),
        np.concatenate(
            [container.triangles[is_bent], outline.triangles[is_rigid] + np.uint32(len(moved))]
        ),
    )
    return body, np.concatenate([bent[is_bent], rigid[is_rigid]]) == _DOOR


def _plain(container: Body, of_door: NDArray[np.bool_]) -> Body:
    """Return a container whose door is one flat sheet at the deepest point of the damaged door."""
    low, high = _extent(container.positions_mm, container.triangles[of_door])
    sheet = [(low[0], y, z) for y in (low[1], high[1]) for z in (low[2], high[2])]
    first = len(container.positions_mm)
    return Body(
        np.concatenate([container.positions_mm, np.array(sheet, np.float32)]),
        np.concatenate(
            [
                container.triangles[~of_door],
                np.array([[0, 2, 3], [0, 3, 1]], np.uint32) + np.uint32(first),
            ]
        ),
    )


_DOOR, _MEMBER = 1, 2


def _parts(container: Mesh) -> NDArray[np.uint8]:
    """Return for each triangle [T]: _DOOR for leaves and gear, _MEMBER below the floor, else 0."""
    numbers = {"door": _DOOR, "member": _MEMBER}  # charts such as member.3, door.handle.0
    of_chart = [numbers.get(chart.name.split(".")[0], 0) for chart in container.charts]
    return np.array(of_chart, np.uint8)[container.chart[container.triangles[:, 0]]]


def shader_lights(lights: Sequence[DirectionalLight]) -> int:
    """Return the number of lights of the shader variant for `lights`: 0, 1 or MAX_LIGHTS."""
    return len(lights) if len(lights) < 2 else MAX_LIGHTS


def light_values(
    lights: Sequence[DirectionalLight], shadow: ShadowMap | None, eye_m: Array
) -> dict[str, ArrayLike]:
    """Return the members of VIEW_BLOCK that describe directional lights.

    Args:
        lights: The lights of the environment.
        shadow: Shadow map of the lights, None without lights.
        eye_m: Position of the camera in world metres, [3].
    """
    lit = [] if shadow is None else [*zip(shadow.toward, lights, strict=True)]
    end = _NO_END if shadow is None else shadow.end
    return {
        "ray_to_shadow": np.zeros((0, 4, 4)) if shadow is None else shadow.from_ray(eye_m),
        "shadow_tile": np.zeros((0, 4)) if shadow is None else shadow.tiles,
        "shadow_end_transform": end.to_tile,
        "shadow_end_bounds": end.inner,
        "shadow_end_plane": (end.side, MM * end.from_mm - end.side * eye_m[0]),
        "light_direction": np.array([[*toward, each.radius] for toward, each in lit]).reshape(
            -1, 4
        ),
        "light_irradiance": np.array([[*each.light, 0.0] for _, each in lit]).reshape(-1, 4),
        "light_count": len(lit),
    }

"""The shadows of a container and its spreader: a depth map from where each sun stands.

Dents are bent in, holes are not cut out. Williams 1978, Casting Curved Shadows on
Curved Surfaces; filtered as Reeves et al. 1987 do, in shaders/sun.glsl.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.geometry.damage_law import corners_mm, deform
from fastgen.geometry.mesh import UNIT_CUBE, Mesh
from fastgen.light.directional_lights import MOST_SUNS, Sun
from fastgen.light.occluders import Body, Solid, map_matrix
from fastgen.render.depth_map import DepthMap, DrawnBody, MapView, Tile
from fastgen.scene import Damage
from fastgen.scene.limits import MM

_EDGE_TEXELS = 1
"""Nothing is drawn on a sun's tile's edge: it stands for all that lies beyond."""

_FIRST_TEXELS = (1536, 512)
"""Along and across for the first sun, in full detail: of up to 10 mm each way."""

_END_TEXELS = (1280, 1280)
_END_TEXEL_MM = 2.5
_END_DEPTH_MM = 450.0
"""The first sun has another tile for the end that it shines on, to as far behind its castings as
damage pushes leaves: in full detail texels no finer than that, as a locking bar is 34 mm wide, up
to 3.6 mm where the tile is full."""

_END_BORDER_MM = 60.0
"""Around the part of it that is asked for: more than lookups of a filtered shadow reach."""

_OTHERS_TEXELS = (1024, 512)
"""For each of the others: what they throw is fainter."""

_BIAS_MM = 2.0

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EndTile:
    """Where the first sun's map is drawn again, finer, for the end toward `side` along x, 1 or -1:
    for what lies farther than from_mm that way.

    to_tile: (scale u, v, offset u, v) from a place (u, v) in the first tile to that in this one.
    inner: (u, v) of the lowest and of the highest place in it to ask for; lookups around them stay
    in the tile.
    """

    to_tile: Array
    inner: Array
    side: float
    from_mm: float


class _Layout(NamedTuple):
    """Where a map of `size` texels has the tile of each sun, and `end`, the room for the end's,
    whose texels are no finer than end_texel_mm."""

    size: tuple[int, int]
    suns: tuple[Tile, ...]
    end: Tile
    end_texel_mm: float


def _layout(detail: float) -> _Layout:
    """detail: of the full number of texels each way."""

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
    """What each sun meets first of a container and the spreader that holds it, less its cables.

    Owned by the renderer, which releases it. program: of occluder.vert. One texture for all scenes:
    made anew for each, freed ones would stay with the process in pieces. detail: of the full number
    of texels each way, 0.5 for a quarter of them. toward: unit vectors
    [S, 3] to the suns. tiles: [S, 4], where in the texture each has its own part, from the centre
    (u, v) of the first texel to that of the last. end: the first sun's finer part.
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
    ) -> None:
        """Draw the map if it does not show this. container: at rest; damages: done to it. toward:
        unit vectors [S, 3] to the suns in the container's frame, 1 to MOST_SUNS. outline: the same
        container of fewer triangles, for charts that no damage reaches."""
        shown = (container, outline, spreader, tuple(toward.ravel().tolist()), damages)
        if shown == self._shown:
            return
        self._shown = ()  # until it does, whatever happens
        # from below, floor members shade one another
        members = bool(toward[:, 2].min() <= 0)
        body, of_door = _bent(container, outline or container, damages, members)
        bodies: list[Solid] = [body] if spreader is None else [body, spreader]
        low = np.min([body.bounds_mm[0] for body in bodies], axis=0).astype(np.float64)
        high = np.max([body.bounds_mm[1] for body in bodies], axis=0).astype(np.float64)
        tiles = self._layout.suns[: len(toward)]
        to_tiles = np.stack([map_matrix(way, low, high) for way in toward])
        first, size = np.split(np.array(tiles), 2, axis=1)
        to_tiles[:, :2] *= (1 - 2 * _EDGE_TEXELS / size)[..., None]
        side = float(np.sign(toward[0, 0]))
        # the door shades its own end alone, which has a tile of its own or the sun behind it
        plain = _plain(body, of_door) if side and of_door.any() else body
        drawn: dict[Solid, DrawnBody] = {}

        def view(solids: Sequence[Solid], matrix: Array, tile: Tile, thick: bool = True) -> MapView:
            for solid in solids:
                if solid not in drawn:
                    drawn[solid] = DrawnBody(self._ctx, self._program, solid)
            shown = [drawn[solid] for solid in solids]
            return MapView(shown, matrix, tile, shown[:1] if thick else [])

        views = [view([plain, *bodies[1:]], to_tiles[0], tiles[0])]
        views += [
            view(bodies, matrix, tile) for matrix, tile in zip(to_tiles[1:], tiles[1:], strict=True)
        ]
        self.toward = toward
        self._to_map = _in_map(to_tiles, np.array(tiles), self._layout)
        self.tiles = np.hstack([first + 0.5, first + size - 0.5]) / np.tile(self._layout.size, 2)
        self.end = _NO_END
        if side:
            from_mm = float(np.abs(container.bounds_mm[int(side > 0)][0])) - _END_DEPTH_MM
            # what shades a point there stands still farther out, but for lookups around it
            from_border = from_mm - _END_BORDER_MM
            container_end, *others = (_beyond(body, side, from_border) for body in bodies)
            # deep damage may leave none
            ends = [end for end in (container_end, *others) if len(end.triangles)]
            if ends:
                self.end, matrix, tile = _end_tile(
                    to_tiles[0], self._to_map[0], ends, side, from_mm, self._layout
                )
                views.append(view(ends, matrix, tile, ends[0] is container_end))
        self._map.draw(views)
        for item in drawn.values():
            item.release()
        self._shown = shown

    def from_ray(self, eye_m: Array) -> Array:
        """From a vector in metres, from the eye to a point, to (u, v, depth) in the map of each
        sun: [S, 4, 4]."""
        matrix = np.tile(np.eye(4), (len(self._to_map), 1, 1))
        matrix[:, :3, :3] = 500 * self._to_map[:, :3, :3]
        matrix[:, :3, 3] = matrix[:, :3, :3] @ eye_m + 0.5 * self._to_map[:, :3, 3] + 0.5
        matrix[:, 2, 3] -= 0.5 * _BIAS_MM * np.linalg.norm(self._to_map[:, 2, :3], axis=-1)
        return matrix

    def release(self) -> None:
        """Free all GL objects."""
        self._map.release()


def _in_map(to_tiles: Array, tiles: NDArray[np.int64], layout: _Layout) -> Array:
    """Of matrices [S, 4, 4] to clip space of `tiles` [S, 4]: to that of the whole map."""
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
    """The tile of the end toward `side`, and the view of `ends`, as of _beyond, to draw in it.

    to_first: to clip space of the first tile; first_to_map: of the whole map, through it.
    """
    lows, highs = zip(*(_extent(body.positions_mm, body.triangles) for body in ends), strict=True)
    low, high = np.min(lows, axis=0).astype(np.float64), np.max(highs, axis=0).astype(np.float64)
    (low if side > 0 else high)[0] = side * from_mm
    seen = (low + UNIT_CUBE * (high - low)) @ to_first[:2, :3].T + to_first[:2, 3]
    units = np.linalg.norm(to_first[:2, :3], axis=1)  # a millimetre
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
    # places run from 0 to 1, clip space from -1 to 1; half of the border is for lookups
    place = np.concatenate([scale, (offset + 1 - scale) / 2])
    border = _END_BORDER_MM / 2 * units_in_map / 2
    first, size = np.split(np.array(tile), 2)
    inner = np.concatenate([first / layout.size + border, (first + size) / layout.size - border])
    return EndTile(place, inner, side, from_mm), to_tile, tile


def _beyond(body: Solid, side: float, from_mm: float) -> Body:
    """The triangles of a body that reach farther than from_mm toward `side` along x."""
    a, b, c = (side * body.positions_mm[:, 0] > from_mm)[body.triangles].T
    return Body(body.positions_mm, body.triangles[a | b | c])


def _extent(
    positions_mm: NDArray[np.float32], triangles: NDArray[np.uint32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lowest and highest coordinates [3] of triangles' corners."""
    corners = triangles.ravel().astype(np.intp)
    axes = [np.take(axis, corners) for axis in positions_mm.T]  # rows take ten times as long
    return np.stack([axis.min() for axis in axes]), np.stack([axis.max() for axis in axes])


def _bent(
    container: Mesh, outline: Mesh, damages: tuple[Damage, ...], members: bool
) -> tuple[Body, NDArray[np.bool_]]:
    """A container as the damages move it, of its own triangles where they do, else of outline's,
    and which triangles are of its door. members: whether it has its floor's."""
    if not damages:
        part = _parts(outline)
        kept = (part != _MEMBER) | members
        return Body(outline.positions_mm, outline.triangles[kept]), part[kept] == _DOOR
    moved = container.positions_mm.copy()
    columns = np.ascontiguousarray(moved.T)  # comparisons along rows take ten times as long
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
    """A container with one flat sheet for its door, as deep as any of it is, damage included."""
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


@lru_cache(maxsize=32)
def _parts(container: Mesh) -> NDArray[np.uint8]:
    """Of each triangle [T]: _DOOR, of leaves and gear, _MEMBER, below the floor, or 0."""
    numbers = {"door": _DOOR, "member": _MEMBER}  # charts such as member.3, door.handle.0
    of_chart = [numbers.get(chart.name.split(".")[0], 0) for chart in container.charts]
    return np.array(of_chart, np.uint8)[container.chart[container.triangles[:, 0]]]


def shader_suns(suns: Sequence[Sun]) -> int:
    """How many suns the shaders are linked for that shade their light: none, one, or MOST_SUNS."""
    return len(suns) if len(suns) < 2 else MOST_SUNS


def sun_values(suns: Sequence[Sun], shadow: ShadowMap | None, eye_m: Array) -> dict[str, ArrayLike]:
    """Members of VIEW_BLOCK about the suns for a camera at eye_m [3]; shadow: None without any."""
    lit = [] if shadow is None else [*zip(shadow.toward, suns, strict=True)]
    end = _NO_END if shadow is None else shadow.end
    return {
        "ray_to_shadow": np.zeros((0, 4, 4)) if shadow is None else shadow.from_ray(eye_m),
        "sun_tile": np.zeros((0, 4)) if shadow is None else shadow.tiles,
        "to_end_tile": end.to_tile,
        "end_tile": end.inner,
        "end_from": (end.side, MM * end.from_mm - end.side * eye_m[0]),
        "sun_toward": np.array([[*toward, sun.radius] for toward, sun in lit]).reshape(-1, 4),
        "sun_light": np.array([[*sun.light, 0.0] for _, sun in lit]).reshape(-1, 4),
        "sun_count": len(lit),
    }

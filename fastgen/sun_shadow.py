"""The shadows of a container and its spreader: a depth map from where each sun stands.

Dents are bent in, holes are not cut out. Williams 1978, Casting Curved Shadows on
Curved Surfaces; filtered as Reeves et al. 1987 do, in shaders/sun.glsl.
"""

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.damage import corners_mm, deform
from fastgen.mesh import Mesh
from fastgen.occluders import Body, DepthMap, DrawnBody, Solid, Tile, core_of, map_matrix
from fastgen.scene import Damage
from fastgen.sun import MOST_SUNS, Sun

_EDGE_TEXELS = 1
"""Nothing is drawn on a tile's edge: it stands for all that lies beyond."""

FIRST_SIZE = (4096 + 2 * _EDGE_TEXELS, 1024 + 2 * _EDGE_TEXELS)
"""Texels along and across for the first sun: 3.5 mm for the longest container. A locking bar is
34 mm wide."""

OTHERS_SIZE = (FIRST_SIZE[0], 512 + 2 * _EDGE_TEXELS)
"""For all others, side by side: what each of them throws is fainter."""

_BIAS_MM = 2.0

Array = NDArray[np.float64]


class ShadowMap:
    """What each sun meets first of a container and the spreader that holds it, less its cables.

    Owned by the renderer, which releases it. program: of occluder.vert. One texture for all scenes:
    made anew for each, freed ones would stay with the process in pieces. toward: unit vectors
    [S, 3] to the suns. tiles: [S, 4], where in the texture each has its own part, from the centre
    (u, v) of the first texel to that of the last.
    """

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program) -> None:
        self._ctx = ctx
        self._program = program
        self._shown: tuple[object, ...] = ()
        self.toward = np.zeros((0, 3))
        self._to_map = np.zeros((0, 4, 4))
        self.tiles = np.zeros((0, 4))
        size = (FIRST_SIZE[0], FIRST_SIZE[1] + OTHERS_SIZE[1])
        self._map = DepthMap(ctx, program, size)
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
    ) -> None:
        """Draw the map if it does not show this. container: at rest; damages: done to it. toward:
        unit vectors [S, 3] to the suns in the container's frame, 1 to MOST_SUNS."""
        shown = (container, spreader, tuple(toward.ravel().tolist()), damages)
        if shown == self._shown:
            return
        self._shown = shown
        deepest = max((damage.depth_mm for damage in damages), default=0.0)
        bodies = [_bent(container, damages), core_of(container, deepest)]
        if spreader is not None:
            bodies.append(spreader)
        low = np.min([body.bounds_mm[0] for body in bodies], axis=0).astype(np.float64)
        high = np.max([body.bounds_mm[1] for body in bodies], axis=0).astype(np.float64)
        drawn = [DrawnBody(self._ctx, self._program, body) for body in bodies]
        self.toward = toward
        self._to_map = np.stack([map_matrix(way, low, high) for way in toward])
        tiles = _tiles(len(toward))
        first, size = np.split(np.array(tiles), 2, axis=1)
        self._to_map[:, :2] *= (1 - 2 * _EDGE_TEXELS / size)[..., None]
        self._map.draw(drawn, zip(self._to_map, tiles, strict=True))
        whole = np.array(self.depth.size)
        self._to_map[:, :2] *= (size / whole)[..., None]
        self._to_map[:, :2, 3] += (2 * first + size) / whole - 1
        self.tiles = np.hstack([first + 0.5, first + size - 0.5]) / np.tile(whole, 2)
        for body in drawn:
            body.release()

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


def _tiles(suns: int) -> list[Tile]:
    """Each sun's part of the map."""
    along, across = OTHERS_SIZE
    width = along // max(suns - 1, 1)
    others = [(k * width, FIRST_SIZE[1], width, across) for k in range(suns - 1)]
    return [(0, 0, *FIRST_SIZE), *others]


def _bent(container: Mesh, damages: tuple[Damage, ...]) -> Solid:
    """A container as the damages move it."""
    if not damages:
        return container
    positions_mm = container.positions_mm
    moved = positions_mm.copy()
    for damage in damages:
        box = corners_mm(damage)
        near = ((positions_mm >= box.min(axis=0)) & (positions_mm <= box.max(axis=0))).all(axis=1)
        rest = positions_mm[near].astype(np.float64)
        moved[near] += (deform((damage,), rest) - rest).astype(np.float32)
    return Body(moved, container.triangles)


def shader_suns(suns: Sequence[Sun]) -> int:
    """How many suns the shaders are linked for that shade their light: none, one, or MOST_SUNS."""
    return len(suns) if len(suns) < 2 else MOST_SUNS


def sun_values(suns: Sequence[Sun], shadow: ShadowMap | None, eye_m: Array) -> dict[str, ArrayLike]:
    """Members of VIEW_BLOCK about the suns for a camera at eye_m [3]; shadow: None without any."""
    lit = [] if shadow is None else [*zip(shadow.toward, suns, strict=True)]
    return {
        "ray_to_shadow": np.zeros((0, 4, 4)) if shadow is None else shadow.from_ray(eye_m),
        "sun_tile": np.zeros((0, 4)) if shadow is None else shadow.tiles,
        "sun_toward": np.array([[*toward, sun.radius] for toward, sun in lit]).reshape(-1, 4),
        "sun_light": np.array([[*sun.light, 0.0] for _, sun in lit]).reshape(-1, 4),
        "sun_count": len(lit),
    }

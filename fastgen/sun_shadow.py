"""The shadow of a container and its spreader under a sun: one depth map from where it stands.

Dents are bent in, holes are not cut out. Williams 1978, Casting Curved Shadows on
Curved Surfaces; filtered as Reeves et al. 1987 do, in shaders/sun.glsl.
"""

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.damage import corners_mm, deform
from fastgen.mesh import Mesh
from fastgen.occluders import Body, DepthMap, DrawnBody, Solid, core_of, map_matrix
from fastgen.scene import Damage
from fastgen.sun import Sun

MAP_SIZE = (4096, 1024)
"""Texels along and across: 3.5 mm for the longest container. A locking bar is 34 mm wide."""

_BIAS_MM = 2.0

Array = NDArray[np.float64]


class ShadowMap:
    """What a sun meets first of a container and the spreader that holds it, less its cables.

    Owned by the renderer, which releases it. program: of occluder.vert. One texture for all scenes:
    made anew for each, freed ones would stay with the process in pieces.
    """

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program) -> None:
        self._ctx = ctx
        self._program = program
        self._shown: tuple[object, ...] = ()
        self.toward = np.zeros(3)
        self._to_map = np.eye(4)
        self._map = DepthMap(ctx, program, MAP_SIZE)
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
        unit vector [3] to the sun in the container's frame."""
        shown = (container, spreader, *toward, damages)
        if shown == self._shown:
            return
        self._shown = shown
        deepest = max((damage.depth_mm for damage in damages), default=0.0)
        bodies = [_bent(container, damages), core_of(container, deepest)]
        if spreader is not None:
            bodies.append(spreader)
        low = np.min([body.bounds_mm[0] for body in bodies], axis=0)
        high = np.max([body.bounds_mm[1] for body in bodies], axis=0)
        self.toward = toward
        self._to_map = map_matrix(toward, low.astype(np.float64), high.astype(np.float64))
        drawn = [DrawnBody(self._ctx, self._program, body) for body in bodies]
        self._map.draw(drawn, self._to_map)
        for body in drawn:
            body.release()

    def from_ray(self, eye_m: Array) -> Array:
        """From a vector in metres, from the eye to a point, to (u, v, depth) in the map: [4, 4]."""
        matrix = np.eye(4)
        matrix[:3, :3] = 0.5 * self._to_map[:3, :3] * 1000
        matrix[:3, 3] = matrix[:3, :3] @ eye_m + 0.5 * self._to_map[:3, 3] + 0.5
        matrix[2, 3] -= 0.5 * _BIAS_MM * np.linalg.norm(self._to_map[2, :3])
        return matrix

    def release(self) -> None:
        """Free all GL objects."""
        self._map.release()


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


def sun_values(sun: Sun | None, shadow: ShadowMap | None, eye_m: Array) -> dict[str, ArrayLike]:
    """Members of VIEW_BLOCK about the sun for a camera at eye_m [3], zeros without one."""
    if sun is None or shadow is None:
        zero = np.zeros(3)
        none: dict[str, ArrayLike] = {"ray_to_shadow": np.zeros((4, 4)), "sun_radius": 0.0}
        return {**none, "sun_direction": zero, "sun_light": zero}
    return {
        "ray_to_shadow": shadow.from_ray(eye_m),
        "sun_direction": shadow.toward,
        "sun_radius": sun.radius,
        "sun_light": sun.light,
    }

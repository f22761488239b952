"""Ray pass: points of the visible surfaces, and the light that rays find there."""

import ctypes
import math
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from fastgen.light.ray_bodies import RayBodies
from fastgen.light.sky_rays import SkyRays
from fastgen.light.traced_light import Points, traced_light
from fastgen.render.draw_inputs import DrawInputs
from fastgen.render.gl import GLContext
from fastgen.render.gl_enums import GL_COLOR
from fastgen.render.program import Programs
from fastgen.render.regions import Region
from fastgen.scene import Pose
from fastgen.scene.boxes import rotation_of
from fastgen.scene.limits import MM

_NO_SURFACE = (ctypes.c_uint * 4)(0)

_POINTS_PER_AXIS = 400
"""Most points along each axis of a square image: rays cost no more in larger images."""


def point_step(size: tuple[int, int]) -> int:
    """Return the distance in pixels between points along either axis of a (width, height) image."""
    return math.ceil(math.sqrt(size[0] * size[1]) / _POINTS_PER_AXIS)


def points_reach_px(size: tuple[int, int]) -> int:
    """Return the distance in pixels, even, within which all points that light a pixel lie.

    traced_light.glsl filters points up to 1.5 steps away. A point of another surface than the one
    at the middle of its cell is up to two pixels farther away.
    """
    return 2 * point_step(size) + 2


class RayPass:
    """Picks points from the visibility buffer, lights them with rays, and stores that light.

    The textures hold two halves of cells: the surface at the middle pixel of each cell, then
    another surface where a cell sees several. Embree casts the rays on the CPU.

    Reads: the visibility buffer and the material tables. Writes: ray_point_ids,
    ray_point_positions and ray_point_light.
    """

    def __init__(self, gl: GLContext, programs: Programs, size: tuple[int, int]) -> None:
        """Prepare the points of (width, height) = size images."""
        self._ctx = ctx = gl.ctx
        self._programs = programs
        self._size = size
        self._step = step = point_step(size)
        # no point lies beyond the image
        width, height = (-(-(side - step // 2) // step) for side in size)
        self._rows = height
        self._cells = cells = (width, 2 * height)
        self._surface_ids = ctx.texture(cells, 1, dtype="u4")
        self._places, self._normals = (ctx.texture(cells, 4, dtype="f4") for _ in range(2))
        self._target = ctx.framebuffer([self._surface_ids, self._places, self._normals])
        self._light = ctx.texture_array((*cells, 4), 4, dtype="f4")
        for texture in (self._surface_ids, self._places, self._normals, self._light):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._clear_uint = gl.function(
            "glClearBufferuiv", None, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
        )

    def run(
        self, inputs: DrawInputs, pose: Pose, bodies: RayBodies, sky: SkyRays, yaw_deg: float
    ) -> None:
        """Light the visible surfaces, and add the textures of that light to `inputs.textures`.

        Args:
            inputs: The image, with the view in the frame of the container.
            pose: The container's frame in the world.
            bodies: What rays hit, in the world frame.
            sky: The environment as directions of its light.
            yaw_deg: Rotation of the environment about the vertical.
        """
        points = self.read(inputs).turned(rotation_of(pose), pose.position_mm)
        if inputs.view.distortion is not None:
            points = replace(points, place_mm=bodies.settled(points.place_mm, points.normal))
        self._store(points, traced_light(points, bodies, sky, yaw_deg))
        inputs.textures["ray_point_ids"] = self._surface_ids
        inputs.textures["ray_point_positions"] = self._places
        inputs.textures["ray_point_light"] = self._light

    def read(self, inputs: DrawInputs) -> Points:
        """Return the points of the visible surfaces in the frame of the view."""
        self._draw(inputs)
        width, height = self._cells
        ids = np.frombuffer(self._surface_ids.read(alignment=1), np.uint32).reshape(height, width)
        row, column = np.nonzero(ids)
        places, normals = (
            np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[row, column]
            for texture in (self._places, self._normals)
        )
        from_eye, roughness = places[:, :3], places[:, 3]
        away = np.linalg.norm(from_eye, axis=1, keepdims=True)
        place_mm = (np.float32(1 / MM) * from_eye + inputs.view.position_m / MM).astype(np.float32)
        return Points(column, row, place_mm, normals[:, :3], -from_eye / away, roughness)

    def _store(self, points: Points, traced: NDArray[np.float32]) -> None:
        """Write the light of points, float32 [K, 4, 3], to its texture."""
        width, height = self._cells
        held = np.zeros((4, height, width, 4), np.float32)
        held[:, points.row, points.column, :3] = traced.transpose(1, 0, 2)
        self._light.write(held.tobytes())

    def _draw(self, inputs: DrawInputs) -> None:
        damage = inputs.variant.damage
        variant = replace(
            inputs.variant,
            # rays light the points, so the program itself reads no light
            traced=False,
            lights=0,
            lookups=1,
            radiance=False,
            pixel_class="decal" if damage == "undamaged" else "damaged",
        )
        program = self._programs.get(("fullscreen.vert", "ray_points.frag"), variant)
        program["point_rows"] = self._rows
        program["last_pixel"] = tuple(side - 1 for side in self._size)
        self._target.use()
        self._ctx.scissor = None
        self._clear_uint(GL_COLOR, 0, _NO_SURFACE)
        self._ctx.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        program.bind(inputs.textures)
        for region in inputs.regions.drawn:
            x, y, width, height = self._cells_of(region or (0, 0, *self._size))
            for half in (0, self._rows):
                self._ctx.scissor = x, y + half, width, height
                program.draw_vertices(3)
        self._ctx.scissor = None

    def _cells_of(self, region: Region) -> Region:
        """Return the cells whose points lie in a region of the image."""
        (x, width), (y, height) = (
            (first, max(end - first, 0))
            for first, end in (
                (-(-(low - self._step // 2) // self._step) for low in (low, low + length))
                for low, length in zip(region[:2], region[2:], strict=True)
            )
        )
        return x, y, width, height

    def release(self) -> None:
        """Free all GL objects."""
        for item in (self._target, self._surface_ids, self._places, self._normals, self._light):
            item.release()

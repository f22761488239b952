"""Containers and spreaders on the GPU, with what they hide of the sky from each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from fastgen.geometry.container import build_container, container_outline
from fastgen.geometry.damage_law import deform
from fastgen.geometry.divided_mesh import as_drawn
from fastgen.geometry.mesh import Mesh
from fastgen.geometry.spreader import build_spreader
from fastgen.geometry.spreader_parts import CUT_MM
from fastgen.light.environment import Ambient, to_map_frame
from fastgen.light.occluders import Body, without_cables
from fastgen.light.ray_bodies import DistantLight, LitBody, RayBodies
from fastgen.light.sky_visibility import Sky
from fastgen.render.gpu_mesh import GpuMesh, zone_table
from fastgen.render.programs import SPREADER_ZONE
from fastgen.render.recent_cache import Kept
from fastgen.render.sky_visibility_probe import Lit, SkyProbe
from fastgen.render.surface_values import reflectances
from fastgen.scene import Container, Scene


class Shapes:
    """The meshes of scenes. Owned by the renderer, which releases them.

    programs: the geometry program of each of programs.DAMAGE_VARIANTS.
    """

    def __init__(self, ctx: moderngl.Context, programs: Mapping[str, moderngl.Program]) -> None:
        self._ctx = ctx
        self._programs = programs
        self._containers: Kept[GpuMesh] = Kept(16)
        self._spreaders: Kept[GpuMesh] = Kept(64)
        self._zones: Kept[moderngl.Texture] = Kept(128)
        self._probe = SkyProbe(ctx)

    def of(
        self, scene: Scene, bent: bool, light: Ambient
    ) -> tuple[GpuMesh, GpuMesh | None, tuple[Lit, ...]]:
        """Container and spreader of a scene, ready to be drawn, and the light of their vertices;
        bent: whether a lens bends them.

        light: of the scene's environment.
        """
        mesh, spreader = self.container(scene.container), self.spreader(scene, bent)
        usual = _shading_spreader(scene)
        sky = Sky(light, scene.environment.yaw_deg)
        below = self._probe.openness(mesh.mesh, usual, sky)
        mesh.set_openness(below.values)
        if spreader is not None and usual is not None:
            shape = spreader.mesh if bent else usual  # with vertices of its own
            outline = spreader_outline(scene, False) if bent else _shading_spreader(scene, np.inf)
            held = container_outline(scene.container.kind)
            assert outline is not None
            lit = self._probe.openness_of_spreader(
                shape, outline, held, below, sky, reflectances(scene, (mesh.mesh, usual))
            )
            spreader.set_openness(lit.values)
            return mesh, spreader, (below, lit)
        return mesh, spreader, (below,)

    def container(self, container: Container) -> GpuMesh:
        """The mesh of a container at rest."""

        def make() -> GpuMesh:
            mesh = build_container(container.kind, container.profiles)
            return GpuMesh(self._ctx, mesh, self._programs)

        return self._containers.get(container, make)

    def spreader(self, scene: Scene, bent: bool) -> GpuMesh | None:
        """The spreader of a scene, None where it has none."""
        built = spreader_mesh(scene)
        if built is None:
            return None
        mesh = as_drawn(built, bent)
        return self._spreaders.get(
            mesh, lambda: GpuMesh(self._ctx, mesh, self._programs, SPREADER_ZONE)
        )

    def zone_table(self, container: GpuMesh, spreader: GpuMesh | None) -> moderngl.Texture:
        """The zones of both as the material layers read them."""
        meshes = {0: container.mesh}
        if spreader is not None:
            meshes[SPREADER_ZONE] = spreader.mesh
        return self._zones.get(tuple(meshes.values()), lambda: zone_table(self._ctx, meshes))

    def release(self) -> None:
        """Free all GL objects."""
        for kept in (self._containers, self._spreaders, self._zones, self._probe):
            kept.release()


def ray_bodies(
    scene: Scene,
    container: Mesh,
    spreader: Mesh | None,
    lit: Sequence[Lit],
    light: Ambient,
) -> RayBodies:
    """What rays meet of a scene: its damaged container, in the light of the sound one and without
    holes, and its spreader.

    container, spreader: as they are drawn. lit: the light of their vertices, as Shapes.of gives it.
    light: of the scene's environment.
    """
    meshes = (container,) if spreader is None else (container, spreader)
    paints = np.array(reflectances(scene, meshes), np.float32)
    bodies = [
        LitBody(
            mesh.positions_mm,
            mesh.triangles,
            paints[[chart.material_index for chart in mesh.charts]][mesh.chart],
            one.without_suns,
        )
        for mesh, one in zip(meshes, lit, strict=True)
    ]
    if scene.damages:
        moved = deform(scene.damages, bodies[0].positions_mm).astype(np.float32)
        bodies[0] = replace(bodies[0], positions_mm=moved)
    suns = [
        DistantLight(
            to_map_frame(sun.direction, -scene.environment.yaw_deg).astype(np.float32),
            np.array(sun.light, np.float32),
        )
        for sun in light.suns
    ]
    return RayBodies(bodies, suns)


def spreader_mesh(scene: Scene, cut_mm: float = CUT_MM) -> Mesh | None:
    """A scene's spreader as it is built, None where it has none; cut_mm: as of build_spreader."""
    held = scene.spreader
    if not held.present:
        return None
    return build_spreader(scene.container.kind, held.flippers_down, held.gap_mm, cut_mm)


def spreader_outline(scene: Scene, bent: bool) -> Mesh | None:
    """The surface of a scene's spreader as it is drawn, of as few triangles as can be, for labels;
    bent: whether a lens bends what is drawn, which takes small ones."""
    return spreader_mesh(scene, CUT_MM if bent else np.inf)


def shadow_casters(scene: Scene) -> tuple[Mesh, Mesh, Body | None]:
    """A scene's container at rest, the same of as few triangles as can be, and its spreader if it
    has one: damage bends fine triangles only."""
    box = scene.container
    outline = container_outline(box.kind, box.profiles)
    shape = build_container(box.kind, box.profiles) if scene.damages else outline
    spreader = spreader_outline(scene, bent=False)
    return shape, outline, None if spreader is None else without_cables(spreader)


def _shading_spreader(scene: Scene, cut_mm: float = CUT_MM) -> Mesh | None:
    """What hides the sky from the container. At its usual gap, whatever the scene's: a few
    centimetres can hardly be seen in the shade, and every other shape costs a second once."""
    held = scene.spreader
    if not held.present:
        return None
    return build_spreader(scene.container.kind, held.flippers_down, cut_mm=cut_mm)

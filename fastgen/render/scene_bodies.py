"""Bodies of a scene that rays can hit: containers, spreader, ground and props, in their light."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastgen.geometry.damage_law import deform
from fastgen.geometry.prepared_scene import Member
from fastgen.geometry.unit_solids import unit_solid
from fastgen.light import prop_light
from fastgen.light.environment import Ambient, sky_irradiance, to_map_frame
from fastgen.light.ground_light import GroundLight, mean_albedo
from fastgen.light.ray_bodies import DistantLight, LitBody, RayBodies
from fastgen.light.surrounding_change import SurroundingLight
from fastgen.light.surrounding_light import directional_light
from fastgen.render.sky_visibility_probe import LitMesh
from fastgen.scene import Ground, Prop, Scene
from fastgen.scene.boxes import OrientedBox, rotation_of
from fastgen.scene.limits import MM


class LitMember(NamedTuple):
    """A container of a scene in its light.

    Attributes:
        member: The container.
        paints: Diffuse reflectance [M, 3] of each of mesh.MATERIALS.
        lit: Light in the open at the vertices of the container, and of its spreader if it has one.
        light_change: What other containers and the ground change in the light on the container.
    """

    member: Member
    paints: NDArray[np.float32]
    lit: tuple[LitMesh, ...]
    light_change: SurroundingLight | None


def scene_bodies(
    members: Iterable[LitMember],
    scene: Scene,
    lens: bool,
    ambient: Ambient,
    ground: GroundLight | None,
) -> RayBodies:
    """Return what rays can hit, in the world frame.

    Containers are damaged but have no holes, and carry the light of undamaged ones. The ground has
    one colour.

    Args:
        members: The containers that the scene shows.
        scene: The scene.
        lens: Whether the image has lens distortion.
        ambient: Light of its environment.
        ground: Light on its ground; None if it has none.
    """
    members = list(members)
    bodies = [body for each in members for body in _of_member(each, lens)]
    lights = [
        DistantLight(
            to_map_frame(light.direction, -scene.environment.yaw_deg).astype(np.float32),
            np.array(light.light, np.float32),
        )
        for light in ambient.lights
    ]
    if scene.ground is not None and ground is not None:
        bodies.append(_of_ground(scene.ground, ground))
        yaw_deg = scene.environment.yaw_deg
        boxes = [each.member.box for each in members]
        bodies += [
            _of_prop(prop, scene.ground, ground, ambient, yaw_deg, boxes) for prop in scene.props
        ]
    return RayBodies(bodies, lights)


def _of_member(one: LitMember, lens: bool) -> list[LitBody]:
    pose, prepared = one.member.pose, one.member.prepared
    damages, shape = prepared.scene.damages, prepared.spreader
    turn, origin = rotation_of(pose), np.array(pose.position_mm)
    # the light of a spreader is that at its usual gap
    meshes = [prepared.container] if shape is None else [prepared.container, shape.drawn(lens)]
    bodies = []
    for number, (mesh, lit) in enumerate(zip(meshes, one.lit, strict=True)):
        place: NDArray[np.floating] = mesh.positions_mm
        light = lit.without_lights
        if number == 0:
            place = deform(damages, place) if damages else place
            if one.light_change is not None:
                light = one.light_change.vertex_light(lit.values, light, mesh)
        bodies.append(
            LitBody(
                (place @ turn.T + origin).astype(np.float32),
                mesh.triangles,
                one.paints[[chart.material_index for chart in mesh.charts]][mesh.chart],
                light,
            )
        )
    return bodies


def _of_ground(ground: Ground, light: GroundLight) -> LitBody:
    """Return the grid of the light on the ground, whose border is moved out to its reach."""
    rows, columns = light.texels.shape[:2]
    reach = ground.reach_mm
    x, y = (
        (low + step * np.arange(count)) / MM
        for low, step, count in zip(light.low_m, light.step_m, (columns, rows), strict=True)
    )
    for along in (x, y):
        along[0], along[-1] = min(along[0], -reach), max(along[-1], reach)
    place = np.full((rows, columns, 3), ground.height_mm)
    place[..., 0], place[..., 1] = np.meshgrid(x, y)
    corner = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return LitBody(
        place.reshape(-1, 3).astype(np.float32),
        triangles,
        np.broadcast_to(np.array(mean_albedo(ground), np.float32), (rows * columns, 3)),
        light.texels[..., :3].reshape(-1, 3),
    )


def _of_prop(
    prop: Prop,
    ground: Ground,
    light: GroundLight,
    ambient: Ambient,
    yaw_deg: float,
    boxes: Sequence[OrientedBox],
) -> LitBody:
    """Return a prop in the light of the sky and the ground around it.

    The numpy twin of prop_color() in shaders/ground_props.glsl at the vertices. Directional lights
    do not shine on the prop itself, and have sharp shadows on the ground beside it.

    Args:
        prop: The prop.
        ground: The ground.
        light: Light on the ground without directional lights.
        ambient: The environment.
        yaw_deg: Its rotation.
        boxes: Containers that cast shadows on the ground.
    """
    solid, turn = unit_solid(prop.shape), rotation_of(prop.pose)
    corners = solid.corners * np.array(prop.size_mm) / 2
    place = corners @ turn.T + np.array(prop.pose.position_mm)
    normals = solid.normals @ turn.T
    ground_texels = light.at(place[:, :2] * MM + prop_light.AMBIENT_BESIDE_M * normals[:, :2])
    up = 0.5 + 0.5 * normals[:, 2:]
    beside = place + prop_light.SUNLIT_BESIDE_M / MM * normals
    beside[:, 2] = ground.height_mm
    level = np.broadcast_to((0.0, 0.0, 1.0), beside.shape)
    from_ground = ground_texels[:, :3] + directional_light(beside, level, boxes, ambient, yaw_deg)
    from_sky = ground_texels[:, 3:] * sky_irradiance(ambient, normals + (0.0, 0.0, 0.5), yaw_deg)
    found = up * from_sky + (1 - up) * np.array(mean_albedo(ground)) * from_ground
    raised = np.clip((place[:, 2:] - ground.height_mm) * MM / prop_light.OPEN_M, 0.0, 1.0)
    lowest = prop_light.LOWEST_SHARE
    paint = np.array(prop.albedo, np.float32) + np.float32(prop_light.SHEEN)
    return LitBody(
        place.astype(np.float32),
        solid.triangles.astype(np.uint32),
        np.broadcast_to(paint, place.shape),
        (found * (lowest + (1 - lowest) * raised)).astype(np.float32),
    )

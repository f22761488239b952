"""Values of the ground's uniform block: containers as boxes, props, and the look of the plane."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastgen.geometry.container_layout import BESIDE_MM, RING_BOTTOM_MM, Layout
from fastgen.geometry.prepared_scene import Member
from fastgen.light.ground_light import (
    GRID,
    LOW_GAP_M,
    GroundLight,
    damp_threshold,
    mean_albedo,
)
from fastgen.render.blocks import MAX_BOXES
from fastgen.render.constants import CYLINDER, GROUND_FADE_START
from fastgen.render.rust import normal_threshold
from fastgen.scene import Ground, Prop
from fastgen.scene.boxes import OrientedBox, prop_box
from fastgen.scene.limits import MM

_STAINED = 0.045
"""Share of the ground under stains of oil at full wear."""

_NO_GAP_M = 1e6
"""Height of a gap below a box for which the grid of light is fine enough."""

_RAIL_INSET_MM = Layout.frame_recess_mm + BESIDE_MM
"""Distance of the bottom rails from the castings' outer plane. Sills are up to 7 mm deeper."""

_CLEARANCE_MM = 1500.0
"""Width of the ground around the scene that no part of the panorama hides."""


def ground_values(
    ground: Ground,
    members: Sequence[Member],
    props: Sequence[Prop],
    light: GroundLight,
    toward: NDArray[np.float64],
) -> Mapping[str, ArrayLike]:
    """Return the members of GROUND_BLOCK.

    Args:
        ground: The plane.
        members: Containers of the scene that are present.
        props: Props of the scene.
        light: Light on the plane around `members`.
        toward: Unit vector [3] to the first directional light.
    """
    bodies = [_within_rails(member.box) for member in members] + [prop_box(prop) for prop in props]
    rows = np.zeros((3, MAX_BOXES + len(props), 4))
    places = [*range(len(members)), *range(MAX_BOXES, MAX_BOXES + len(props))]
    for place, body in zip(places, bodies, strict=True):
        rows[0, place] = *body.center_mm * MM, body.rotation[0, 0]
        rows[1, place] = *body.half_mm * MM, body.rotation[1, 0]
    for place, member in enumerate(members):
        rows[2, place, :3] = member.prepared.scene.surface.paint.albedo
        gap = (member.box.center_mm[2] - member.box.half_mm[2] - ground.height_mm) * MM
        # below other boxes the grid of light is fine enough, see ground_light.LOW_GAP_M
        rows[2, place, 3] = gap + RING_BOTTOM_MM * MM if gap < LOW_GAP_M else _NO_GAP_M
    for place, prop in enumerate(props, MAX_BOXES):
        rows[2, place] = *prop.albedo, CYLINDER if prop.shape == "cylinder" else 0.0
    turned = np.array([body.axes @ toward for body in bodies]).reshape(-1, 3)
    inverse = np.zeros((len(rows[0]), 4))
    inverse[places, :3] = 1 / np.where(np.abs(turned) < 1e-6, 1e-6, turned)
    scale = 1 / (light.step_m * GRID)
    yaw = np.deg2rad(ground.line_yaw_deg)
    wet = ground.wetness
    return {
        "body_center": rows[0],
        "body_half": rows[1],
        "body_paint": rows[2],
        "body_light": inverse,
        "face_radiance": np.insert(light.face_radiance.reshape(-1, 3), 3, 0.0, axis=1),
        "grid_transform": (*scale, *(0.5 / np.array(GRID) - light.low_m * scale)),
        "ground_albedo": ground.albedo,
        "ground_height_m": ground.height_mm * MM,
        "line_albedo": ground.line_albedo,
        "ground_reach_m": ground.reach_mm * MM,
        "ground_mean_albedo": mean_albedo(ground),
        "line_direction": (np.cos(yaw), np.sin(yaw)),
        "ground_noise_mm": ground.noise_offset_mm,
        "line_spacing_mm": ground.line_spacing_mm,
        "ground_wear": ground.wear,
        # thresholds just outside of 0..1 leave nothing or everything however blurred
        "line_threshold": 1.3 - 1.6 * ground.lines if ground.lines else 9.0,
        "stain_threshold": float(normal_threshold(_STAINED * ground.wear)),
        "damp_threshold": damp_threshold(wet) if wet else 9.0,
        "puddle_threshold": 1.1 - 0.65 * wet**1.5 if wet else 9.0,
        "slab_mm": 4000 + np.mod(abs(ground.noise_offset_mm[0]), 2000.0),
        "box_count": len(members),
        "ground_clear_m": clear_radius_mm(ground, members, props) * MM,
    }


def _within_rails(box: OrientedBox) -> OrientedBox:
    """Return the part of a container's box between its bottom rails, from their lower edge upward.

    Only the castings are below. Light reaches the ground between them.
    """
    raised = np.array([0.0, 0.0, 0.5 * RING_BOTTOM_MM])
    inset = np.array([_RAIL_INSET_MM, _RAIL_INSET_MM, 0.0])
    return replace(box, center_mm=box.center_mm + raised, half_mm=box.half_mm - raised - inset)


def clear_radius_mm(ground: Ground, members: Sequence[Member], props: Sequence[Prop]) -> float:
    """Return the radius around the origin within which no obstacle of a panorama hides the plane.

    It reaches just beyond the containers and props of the scene.
    """
    boxes = [member.box for member in members] + [prop_box(prop) for prop in props]
    corners_mm = np.reshape([box.corners_mm for box in boxes], (-1, 3))
    far = float(np.linalg.norm(corners_mm[:, :2], axis=-1).max(initial=0.0))
    return min(far + _CLEARANCE_MM, GROUND_FADE_START * ground.reach_mm)

"""Shadows on the ground do not depend on the tiles that are drawn without boxes or props."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.ground_plan import GroundDraw
from fastgen.render.passes.ground import GroundPass
from fastgen.scene import Camera, EnvironmentView, Ground, Neighbour, Pose, Prop, Spreader
from fastgen.scene.optics import Lamp, Weather

SIZE = (480, 320)
GROUND = Ground("concrete", -40.0, wear=0.0, reach_mm=40000.0)
PROPS = (
    Prop("box", Pose((-1500.0, 7500.0, 460.0), 20.0), (2500.0, 300.0, 1000.0), (0.1, 0.1, 0.1)),
    Prop("cylinder", Pose((2500.0, -4500.0, 460.0)), (1000.0, 350.0, 1000.0), (0.1, 0.1, 0.1)),
)
CAMERAS = (
    Camera("high", (12000.0, -16000.0, 14000.0), (0.0, 1000.0, 0.0), 24.0),
    Camera("low", (-16000.0, 12000.0, 2500.0), (0.0, 2000.0, 300.0), 24.0),
)
OVERHEAD = "overhead"
"""A lamp straight above the scene, at night."""

LAMPS = ("port_night", "port_blue_hour", "port_aisle_night", "port_rail_dusk", "night")


def scene_of(generator, environment, yaw_deg):
    """Return a scene with a standing container, a lifted one, and props."""
    first = generator.scene(0)
    lifted = Pose((1000.0, 9000.0, 2500.0), 30.0)
    return replace(
        first,
        damages=(),
        spreader=Spreader(),
        weather=Weather(),
        neighbours=(Neighbour(lifted, first.container, first.surface, first.decals),),
        environment=EnvironmentView("night", yaw_deg, lamps=(Lamp(0.0, 90.0, 400.0),))
        if environment == OVERHEAD
        else EnvironmentView(environment, yaw_deg),
        ground=GROUND,
        props=PROPS,
        cameras=CAMERAS,
    )


def with_all_bodies(plan):
    """Return a plan in which each tile of the ground is shaded by all containers and props."""
    seen = np.logical_or.reduce([each.tiles for each in plan.plane])
    masks = plan.masks.copy()
    masks[..., 2] = 2 ** len(PROPS) - 1
    near_bodies = replace(plan.props.variant, props=False)
    return plan._replace(plane=[GroundDraw(near_bodies, seen)], masks=masks)


@pytest.mark.parametrize(
    ("environment", "quality"),
    [
        *((name, "balanced") for name in ("port_noon", "port_golden", OVERHEAD, *LAMPS)),
        *((name, "draft") for name in ("port_noon", "port_night")),
    ],
)
def test_ground_shadows_are_complete_at_borders_of_tiles(
    generators, monkeypatch, environment, quality
):
    generator = generators(Config.preset("gate"), seed=3, size=SIZE, quality=quality)
    plan_of = GroundPass.plan
    # at 250 degrees, the sun of port_noon shines along the standing container
    for yaw_deg in (20.0, 145.0, 250.0):
        scene = scene_of(generator, environment, yaw_deg)
        for camera in CAMERAS:
            view = view_of(camera, SIZE)
            plan = plan_of(generator.gpu.renderer()._ground, PreparedScene(scene), view)
            assert any(not each.variant.boxes for each in plan.plane)
            drawn = generator.render(scene=scene, camera=camera).image.astype(int)
            with monkeypatch.context() as patched:
                patched.setattr(GroundPass, "plan", lambda *given: with_all_bodies(plan_of(*given)))
                whole = generator.render(scene=scene, camera=camera).image.astype(int)
            difference = np.abs(drawn - whole).max(axis=-1)
            assert difference.max() <= 1, (yaw_deg, camera.name, (difference > 1).sum())

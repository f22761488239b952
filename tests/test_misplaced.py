"""Checks of the places of neighbours, props and cameras in a scene."""

from dataclasses import replace

import pytest

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Pose, Prop
from fastgen.scene.check import check_camera, check_scene
from tests.plain import FEW_DECALS

CONFIG = Config.from_values(
    {
        "placement": {"arrangements": {"trailer": 1}, "neighbours": 2, "damaged": 1},
        "damage": {"probability": 1},
        "markings": FEW_DECALS,
    }
)


@pytest.fixture(scope="module")
def trailer():
    """A scene with two neighbours on trailers."""
    scenes = (sample_scene(CONFIG, 3, index, {"sky": 1.0}) for index in range(30))
    return next(s for s in scenes if len(s.neighbours) == 2 and s.neighbours[1].decals)


def with_neighbour(scene, **changes):
    return replace(scene, neighbours=(scene.neighbours[0], replace(scene.neighbours[1], **changes)))


def test_misplaced_neighbours_are_named(trailer):
    at = trailer.neighbours[0].pose
    x, y, _ = trailer.neighbours[1].pose.position_mm
    second = trailer.neighbours[1]
    low = Pose((x, y, trailer.ground.height_mm - 2))
    for pose, words in (
        (Pose((500.0, 0.0, 100.0)), "pose: overlaps the container; move it away"),
        (at, r"pose: overlaps neighbours\[0\]; move it away"),
        (low, "pose.position_mm: height .* is below the ground"),
    ):
        with pytest.raises(ConfigError, match=rf"^scene.neighbours\[1\].{words}"):
            check_scene(with_neighbour(trailer, pose=pose))
    with pytest.raises(ConfigError, match=r"neighbours\[1\].container.present: false"):
        check_scene(with_neighbour(trailer, container=replace(second.container, present=False)))
    above = with_neighbour(trailer, pose=Pose((0.0, 0.0, 4000.0)))
    check_scene(replace(above, spreader=replace(trailer.spreader, present=False), cameras=()))
    with pytest.raises(ConfigError, match=r"neighbours\[1\].pose: is above the container"):
        check_scene(replace(above, spreader=replace(trailer.spreader, present=True)))


def test_what_a_neighbour_carries_is_checked_as_on_the_first_container(trailer):
    decal, damage = trailer.neighbours[1].decals[0], trailer.neighbours[1].damages[0]
    for changes, words in (
        ({"decals": (replace(decal, kind="text", font="comic"),)}, r"decals\[0\].font"),
        ({"damages": (replace(damage, along=(1.0, 1.0, 0.0)),)}, r"damages\[0\].along"),
        ({"decals": (replace(decal, wear=2.0),)}, r"decals\[0\].wear: 2.0 is out of range"),
    ):
        with pytest.raises(ConfigError, match=rf"^scene.neighbours\[1\].{words}"):
            check_scene(with_neighbour(trailer, **changes))


def test_misplaced_props_are_named(trailer):
    low = trailer.ground.height_mm
    grey = (0.1, 0.1, 0.1)
    for prop, words in (
        (Prop("box", Pose((0.0, 0.0, low)), (100.0, 100.0, 100.0), grey), "down to .*, below the"),
        (Prop("box", Pose((0.0, 9e4, 300.0)), (9.0, 9.0, 900.0), grey), "reaches up to 750"),
        (Prop("cylinder", Pose((0.0, 0.0, low / 2)), (9.0, 9.0, 8.0), grey), "9 and 8 differ"),
    ):
        with pytest.raises(ConfigError, match=rf"^scene.props\[0\].*{words}"):
            check_scene(replace(trailer, props=(prop,)))
    with pytest.raises(ConfigError, match=r"^scene.props\[0\]: a prop needs scene.ground"):
        check_scene(replace(trailer, ground=None))


def test_props_in_a_container_below_another_are_named(trailer):
    # the other container is higher, so that the prop is below the highest underside
    high = replace(trailer.neighbours[0], pose=Pose((0.0, 9000.0, 2000.0)))
    prop = Prop("box", Pose((200.0, 300.0, 500.0), 20.0), (900.0, 100.0, 100.0), (0.1, 0.1, 0.1))
    scene = replace(trailer, neighbours=(high,), props=(prop,), cameras=())
    with pytest.raises(ConfigError, match=r"^scene.props\[0\].pose: overlaps the container; move"):
        check_scene(scene)
    aside = replace(prop, pose=Pose((200.0, 9300.0, 500.0)))
    check_scene(replace(scene, props=(aside,)))


@pytest.mark.parametrize(("x", "refused"), [(0.0, True), (290.0, True), (360.0, False)])
def test_cameras_in_props_or_beside_them_are_named(trailer, x, refused):
    low = trailer.ground.height_mm
    prop = Prop("box", Pose((0.0, -9000.0, low + 300.0)), (400.0, 400.0, 500.0), (0.1, 0.1, 0.1))
    scene = replace(trailer, props=(prop,), cameras=())
    camera = replace(trailer.cameras[0], position_mm=(x, -9000.0, low + 300.0))
    if refused:
        with pytest.raises(ConfigError, match=r"^camera.position_mm: .* is inside props\[0\] or "):
            check_camera(camera, scene)
    else:
        check_camera(camera, scene)


def test_cameras_in_neighbours_or_below_the_ground_are_named(trailer):
    x, y, z = trailer.neighbours[0].pose.position_mm
    camera = trailer.cameras[0]
    inside = replace(camera, position_mm=(x, y, z + 1000))
    with pytest.raises(ConfigError, match=r"^camera.position_mm: .* is inside neighbours\[0\]"):
        check_camera(inside, trailer)
    low = replace(camera, position_mm=(0.0, -30000.0, trailer.ground.height_mm + 99))
    with pytest.raises(ConfigError, match=r"cameras\[0\].position_mm: .* not 100 mm above the gr"):
        check_scene(replace(trailer, cameras=(low,)))

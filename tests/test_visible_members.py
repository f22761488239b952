"""Containers that an image does not show are not drawn."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.tiles import Tiles
from fastgen.render.visible_members import visible_members
from fastgen.scene import Camera, Neighbour, Pose, Scene, Spreader
from fastgen.scene.object_ids import scene_numbers

SIZE, FINE = (192, 144), (960, 720)
TOWARD = {
    "front": (0.0, -15000.0, 1300.0),
    "back": (0.0, 27000.0, 1300.0),
    "corner": (9000.0, -9000.0, 6000.0),
    "end": (14000.0, 0.0, 1500.0),
    "beside": (3000.0, -3000.0, 1500.0),
}


@pytest.fixture(scope="module")
def generator():
    config = Config.from_values({"container": {"kinds": {"20": 1}}})
    with Generator(config, seed=3, size=SIZE, quality="draft") as made:
        yield made


@pytest.fixture(scope="module")
def scene(generator) -> Scene:
    """A container behind another one."""
    first: Scene = generator.scene(0)
    behind = Neighbour(Pose((0.0, 12000.0, 0.0), 0.0), first.container, first.surface)
    return replace(first, damages=(), decals=(), spreader=Spreader(), neighbours=(behind,))


def camera(name: str) -> Camera:
    return Camera(name=name, position_mm=TOWARD[name], target_mm=(0.0, 0.0, 1300.0), focal_mm=28.0)


def listed(scene: Scene, name: str, size: tuple[int, int] = FINE) -> list[int]:
    view = view_of(camera(name), size)
    members = visible_members(PreparedScene(scene).present, view, Tiles(view))
    return [member.number for member, _ in members]


@pytest.mark.parametrize("name", TOWARD)
def test_every_container_with_visible_pixels_is_listed(generator, scene, name):
    seen = generator.render(scene=scene, camera=camera(name)).damage
    shown = {
        number
        for number, each in enumerate(scene_numbers(scene))
        if np.isin(seen, [each.undamaged]).any()
    }
    assert shown <= set(listed(scene, name, SIZE))


def test_a_partly_hidden_container_is_drawn_where_it_may_be_visible(generator, scene):
    aside = replace(scene.neighbours[0], pose=Pose((3000.0, 12000.0, 0.0), 0.0))
    partly = replace(scene, neighbours=(aside,))
    view = view_of(camera("front"), FINE)
    (behind, part), _ = visible_members(PreparedScene(partly).present, view, Tiles(view))
    assert behind.number == 1
    rows, columns = np.nonzero(
        np.isin(
            generator.render(scene=partly, camera=camera("front")).damage,
            [scene_numbers(partly)[1].undamaged],
        )
    )
    left, top, width, height = np.array(part) * SIZE[0] / FINE[0]
    assert columns.min() >= left - 1
    assert columns.max() <= left + width
    assert rows.min() >= top - 1
    assert rows.max() <= top + height
    assert width < 0.1 * SIZE[0]


def test_containers_behind_a_nearer_one_are_left_out(scene):
    assert listed(scene, "front") == [0]
    assert listed(scene, "back") == [1]


def test_a_container_with_a_hole_hides_nothing(generator, scene):
    torn = next(
        found.damages
        for found in map(generator.scene, range(200))
        if any(damage.kind == "perforation" for damage in found.damages)
    )
    assert listed(replace(scene, damages=torn), "front") == [1, 0]

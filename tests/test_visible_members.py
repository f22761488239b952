"""Containers that an image does not show are not drawn."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.camera.projection import View, view_of
from fastgen.geometry.prepared_scene import Member, PreparedScene
from fastgen.render.regions import Region
from fastgen.render.tiles import Tiles
from fastgen.render.visible_members import visible_members
from fastgen.scene import Camera, Lens, Neighbour, Pose, Scene, Spreader
from fastgen.scene.boxes import back_to_front
from fastgen.scene.limits import MM
from fastgen.scene.object_ids import scene_numbers
from fastgen.scene.optics import Weather

SIZE, FINE = (192, 144), (960, 720)
CONFIG = Config.from_values({"container": {"kinds": {"20": 1}}})
TOWARD = {
    "front": (0.0, -15000.0, 1300.0),
    "back": (0.0, 27000.0, 1300.0),
    "corner": (9000.0, -9000.0, 6000.0),
    "end": (14000.0, 0.0, 1500.0),
    "beside": (3000.0, -3000.0, 1500.0),
}


@pytest.fixture(scope="module")
def generator(generators):
    return generators(CONFIG, seed=3, size=SIZE, quality="draft")


@pytest.fixture(scope="module")
def scene(generator) -> Scene:
    """A container behind another one."""
    first: Scene = generator.scene(0)
    behind = Neighbour(Pose((0.0, 12000.0, 0.0), 0.0), first.container, first.surface)
    return replace(first, damages=(), decals=(), spreader=Spreader(), neighbours=(behind,))


def camera(name: str) -> Camera:
    return Camera(name=name, position_mm=TOWARD[name], target_mm=(0.0, 0.0, 1300.0), focal_mm=28.0)


BENT = Lens("brown_conrady", (-0.2, 0.05, 0.0, 0.0, 0.0))
VIEWS = {
    "front": camera("front"),
    "corner": camera("corner"),
    "beside": camera("beside"),
    "lens": replace(camera("front"), lens=BENT, roll_deg=8.0),
    "spreader": replace(camera("front"), target_mm=(0.0, 0.0, 3000.0)),
}


@pytest.fixture(scope="module")
def row_of_containers(generator) -> Scene:
    """Containers that are partly hidden, fully hidden or outside the image."""
    first: Scene = generator.scene(0)
    places = ((3000.0, 12000.0), (-2500.0, 6000.0), (0.0, 18000.0), (60000.0, 0.0))
    others = tuple(
        Neighbour(Pose((x, y, 0.0), 0.0), first.container, first.surface) for x, y in places
    )
    return replace(first, spreader=Spreader(), weather=Weather(), neighbours=others)


def listed(scene: Scene, name: str) -> list[int]:
    view = view_of(camera(name), FINE)
    members = visible_members(PreparedScene(scene).present, view, Tiles(view))
    return [member.number for member, _ in members]


def every_member(
    members: Sequence[Member], view: View, tiles: Tiles
) -> list[tuple[Member, Region]]:
    """Return what `visible_members` would return if it left nothing out."""
    order = back_to_front([each.box for each in members], view.position_m / MM)
    return [(members[number], (0, 0, *view.size)) for number in order]


@pytest.fixture(scope="module", params=["draft", "balanced", "high"])
def each_quality(generators, request):
    return generators(CONFIG, seed=3, size=SIZE, quality=request.param)


@pytest.mark.parametrize("name", VIEWS)
def test_images_are_equal_to_those_with_every_container_drawn(
    each_quality, row_of_containers, monkeypatch, name
):
    scene = row_of_containers
    if name == "spreader":
        scene = replace(scene, spreader=Spreader(present=True))
    view = view_of(VIEWS[name], SIZE)
    present = PreparedScene(scene).present
    assert visible_members(present, view, Tiles(view)) != every_member(present, view, Tiles(view))
    drawn = each_quality.render(scene=scene, camera=VIEWS[name], normals=True)
    monkeypatch.setattr("fastgen.render.renderer.visible_members", every_member)
    whole = each_quality.render(scene=scene, camera=VIEWS[name], normals=True)
    for target in ("ids", "damage", "depth", "normals", "image"):
        np.testing.assert_array_equal(
            getattr(drawn, target), getattr(whole, target), err_msg=target
        )


def test_rays_light_surfaces_beside_the_edge_of_a_nearer_container(scene, monkeypatch):
    size = 2048, 1536  # ray points five pixels apart
    aside = replace(scene.neighbours[0], pose=Pose((4000.0, 60000.0, 0.0), 0.0))
    partly = replace(scene, neighbours=(aside,))
    # the region of the container behind begins five pixels from its visible part
    distant = Camera("distant", (0.0, -70000.0, 1300.0), (60.9, 0.0, 1650.0), 28.0)
    with Generator(seed=3, size=size, quality="high") as generator:
        drawn = generator.render(scene=partly, camera=distant).image
        monkeypatch.setattr("fastgen.render.renderer.visible_members", every_member)
        whole = generator.render(scene=partly, camera=distant).image
    np.testing.assert_array_equal(drawn, whole)


def test_a_region_contains_all_visible_pixels_and_few_others(generator, scene, monkeypatch):
    aside = replace(scene.neighbours[0], pose=Pose((3000.0, 12000.0, 0.0), 0.0))
    partly = replace(scene, neighbours=(aside,))
    view = view_of(camera("front"), FINE)
    (behind, part), _ = visible_members(PreparedScene(partly).present, view, Tiles(view))
    assert behind.number == 1
    monkeypatch.setattr("fastgen.render.renderer.visible_members", every_member)
    damage = generator.render(scene=partly, camera=camera("front")).damage
    rows, columns = np.nonzero(damage == scene_numbers(partly)[1].undamaged)
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

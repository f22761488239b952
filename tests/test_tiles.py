"""Tiles of the image: what bodies touch and fill, and what background and ground draw."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.camera.projection import view_of
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.light.directional_lights import DirectionalLight
from fastgen.render.constants import TILE_PX
from fastgen.render.ground_plan import ground_plan
from fastgen.render.tiles import Tiles, bit_masks
from fastgen.scene import Camera, Ground, Neighbour, Pose, Prop, Spreader
from fastgen.scene.boxes import OrientedBox, rotation_of
from fastgen.scene.optics import Lens

SIZE = (330, 200)
LENSES = (
    None,
    Lens("brown_conrady", (-0.28, 0.06, 0.002, -0.003, 0.0)),
    Lens("brown_conrady", (0.15, 0.02, 0.0, 0.0, 0.0)),
    Lens("fisheye", (-0.05, 0.01, 0.0, 0.0)),
)
GROUND = Ground("asphalt", -1200.0, reach_mm=30000.0)
PROPS = (
    Prop("box", Pose((0.0, -2300.0, -950.0), 20.0), (5000.0, 300.0, 500.0), (0.1, 0.1, 0.1)),
    Prop("cylinder", Pose((1500.0, 2100.0, -700.0)), (1000.0, 350.0, 1000.0), (0.1, 0.1, 0.1)),
)
CAMERAS = (
    Camera("side", (9000.0, -8000.0, 4500.0), (1000.0, 0.0, 0.0), 26.0, roll_deg=8.0),
    Camera("low", (-9000.0, 7000.0, 300.0), (0.0, 0.0, 300.0), 24.0),
    Camera("down", (500.0, 6000.0, 9000.0), (500.0, 1500.0, 0.0), 30.0),
    Camera("beside", (2900.0, -1900.0, 500.0), (-2000.0, -1000.0, 0.0), 18.0),
    Camera("bent", (9000.0, 8000.0, 3000.0), (0.0, 0.0, 0.0), 18.0, lens=LENSES[1]),
)


def spread(mask, size=SIZE):
    """Return a mask of tiles [R, C] as a mask of pixels [H, W]."""
    wide = np.repeat(np.repeat(mask, TILE_PX, 0), TILE_PX, 1)
    return wide[: size[1], : size[0]]


def views(rng, count, lens):
    for _ in range(count):
        eye, target = rng.uniform(-9000, 9000, (2, 3))
        yield view_of(Camera("a", tuple(eye), tuple(target), rng.uniform(18, 60), lens=lens), SIZE)


def boxes_of(rng, count):
    return [
        OrientedBox(
            rng.uniform(-6000, 6000, 3),
            rng.uniform(100, 3500, 3),
            rotation_of(Pose((0.0, 0.0, 0.0), rng.uniform(0, 360))),
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize("lens", LENSES)
def test_boxes_touch_and_fill_the_tiles_whose_rays_they_meet(lens):
    rng = np.random.default_rng(1)
    touched_tiles = met_tiles = filled_pixels = beside = 0
    for view in views(rng, 40, lens):
        bodies = boxes_of(rng, 5)
        tiles = Tiles(view)
        eye, rays = view.rays()
        corners = np.stack([body.corners_mm for body in bodies])
        touched = tiles.touched(corners)
        any_met = np.zeros(SIZE[::-1], bool)
        for body, mask in zip(bodies, touched, strict=True):
            enters, leaves = body.crossed(eye, rays)
            met = (enters < leaves) & (leaves > 0)
            any_met |= met
            assert not (met & ~spread(mask)).any()
            rows, columns = np.nonzero(met)
            met_tiles += len(np.unique(rows // TILE_PX * 100 + columns // TILE_PX))
            touched_tiles += mask.sum()
            beside += (view.to_view(body.corners_mm)[:, 2] < 0).any() and met.any()
        filled = spread(tiles.filled(corners).any(axis=0))
        assert any_met[filled].all()
        filled_pixels += filled.sum()
    assert touched_tiles < 1.2 * met_tiles
    assert beside > 5
    assert filled_pixels > 20000


def test_rectangles_cover_each_tile_of_a_set_once():
    rng = np.random.default_rng(2)
    tiles = Tiles(view_of(CAMERAS[0], SIZE))
    fewest = []
    for share in (0.0, 0.1, 0.5, 0.9, 1.0):
        mask = rng.random(tiles.shape) < share
        count = np.zeros(SIZE[::-1], int)
        found = tiles.rectangles(mask)
        for x0, y0, x1, y1 in found:
            assert x0 < x1
            assert y0 < y1
            count[y0:y1, x0:x1] += 1
        np.testing.assert_array_equal(count, spread(mask))
        fewest.append(len(found))
    assert fewest[0] == 0
    assert fewest[-1] == 1


def test_bits_tell_the_bodies_of_each_tile():
    rng = np.random.default_rng(3)
    for count in (1, 31, 64):
        which = rng.random((count, 5, 7)) < 0.4
        words = bit_masks(which)
        for number, row, column in np.ndindex(which.shape):
            word = int(words[row, column, number // 32])
            assert (word >> number % 32) & 1 == which[number, row, column]


@pytest.fixture(scope="module")
def generator(generators):
    config = Config.from_values({"container": {"kinds": {"20": 1}}})
    return generators(config, seed=3, size=SIZE, quality="draft")


@pytest.fixture(scope="module")
def scene(generator):
    first = generator.scene(0)
    beside = Pose((500.0, 6000.0, 0.0), 30.0)
    again = Neighbour(beside, first.container, first.surface, first.decals)
    return replace(
        first, damages=(), spreader=Spreader(), neighbours=(again,), ground=GROUND, props=PROPS
    )


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.name)
@pytest.mark.parametrize("wetness", [0.0, 0.5])
def test_what_is_drawn_is_disjoint_and_leaves_out_only_what_is_hidden(
    generator, scene, camera, wetness
):
    ground = replace(GROUND, wetness=wetness)
    prepared = PreparedScene(replace(scene, ground=ground))
    view = view_of(camera, SIZE)
    lights = [DirectionalLight((0.4, 0.3, 0.866), (1.0, 1.0, 1.0), 0.005)]
    plan = ground_plan(ground, PROPS, prepared.present, view, lights)
    count = sum(each.tiles.astype(int) for each in plan.plane)
    assert count.max() == 1
    drawn = generator.render(scene=prepared.scene, camera=camera)
    body = (drawn.damage > 0) | (drawn.ids > 0)

    eye, rays = view.rays()
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (GROUND.height_mm - eye[2]) / rays[..., 2]
        at = eye + depth[..., None] * rays
    away = np.where(depth > 0, np.hypot(at[..., 0], at[..., 1]), np.inf)
    plane = spread(count > 0)
    assert (plane | body)[away < GROUND.reach_mm].all()
    covered = spread(~plan.sky & (count > 0))
    assert (away[covered] < 0.5 * GROUND.reach_mm).all()
    assert body[spread(~plan.sky & (count == 0) & ~plan.props.tiles)].all()
    assert spread(~plan.sky).mean() > 0.2


def test_a_container_with_a_hole_hides_nothing(generator, scene):
    torn = next(
        found.damages
        for found in map(generator.scene, range(200))
        if any(damage.kind == "perforation" for damage in found.damages)
    )
    view, up = view_of(CAMERAS[0], SIZE), DirectionalLight((0.0, 0.0, 1.0), (1.0, 1.0, 1.0), 0.005)
    hidden = []
    for damages in ((), torn):
        given = PreparedScene(replace(scene, damages=damages, neighbours=(), props=()))
        plan = ground_plan(GROUND, (), given.present, view, [up])
        hidden.append((~plan.sky & (sum(each.tiles for each in plan.plane) == 0)).sum())
    assert hidden[0] > 0
    assert hidden[1] == 0


def test_scenes_with_other_numbers_of_containers_share_the_programs_of_the_ground(scene):
    """A program takes up to 0.7 s to compile, so few variants exist."""
    view, up = view_of(CAMERAS[0], SIZE), DirectionalLight((0.0, 0.0, 1.0), (1.0, 1.0, 1.0), 0.005)
    programs = set()
    for count in range(1, 6):
        others = tuple(
            replace(scene.neighbours[0], pose=Pose((0.0, 4000.0 * k, 0.0))) for k in range(1, count)
        )
        given = PreparedScene(replace(scene, neighbours=others))
        plan = ground_plan(GROUND, PROPS, given.present, view, [up])
        programs |= {each.variant for each in (*plan.plane, plan.props)}
    assert len(programs) <= 3

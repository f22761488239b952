"""Images under the sun and lamps: places where their light must and must not fall."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.classes import CONTAINER_ID, SPREADER_ID
from fastgen.light.environment import load_environment
from fastgen.render.settings import QUALITY, Quality
from fastgen.scene import Camera, Damage, EnvironmentView, Spreader
from fastgen.scene.container_kinds import KINDS
from tests.plain import EVEN_PAINT
from tests.sky_samples import lamps_at_night, one_light
from tests.test_environment import write_exr
from tests.tone_inverse import light_of

GREY = np.full((512, 1024, 3), 0.2, np.float32)
"""A uniform sky to which suns are added."""


@pytest.mark.parametrize(("camera", "x"), [("Cr", 0.75), ("Cl", -0.75)])
def test_pictures_of_an_end_use_its_own_shadow_tile(generators, tmp_path, camera, x):
    """Shadows of bars and ribs have finer edges in that tile, at the same places."""
    toward = np.array([x, -0.6, 0.2])
    write_exr(tmp_path / "low.exr", GREY + one_light(toward / np.linalg.norm(toward), 3e5, 512))
    config = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
    generator = generators(config, 1, (480, 480), "auto", tmp_path)
    scene = generator.scene(0)
    scene = replace(scene, environment=EnvironmentView("low", 0.0), decals=())
    fine = generator.render(scene=scene, camera=camera)
    shadow = generator.gpu.renderer().shadow_map
    shadow.end = replace(shadow.end, inner=np.array([1.0, 1.0, 0.0, 0.0]))
    coarse = generator.render(scene=scene, camera=camera)
    apart = np.abs(fine.image.astype(int) - coarse.image).max(axis=2)[fine.ids > 0]
    assert 0.002 < (apart > 8).mean() < 0.1


def test_no_sunlight_leaks_through_a_wall(tmp_path):
    """Grooves of a wall that faces away from the sun lie centimetres behind the mapped surface."""
    toward = np.array([0.95, 0.25, 0.12])
    write_exr(tmp_path / "behind.exr", GREY + one_light(toward, 3e5, 512))
    with Generator(seed=1, size=(640, 640), hdri_dir=tmp_path) as generator:
        scene = generator.scene(0)
        assert load_environment(tmp_path / "behind.exr").lights
        scene = replace(
            scene, environment=EnvironmentView("behind", 0.0), decals=(), damages=(),
            container=replace(scene.container, kind="20"), spreader=Spreader(),
        )  # fmt: skip
        half_length, _, height = np.array(KINDS["20"].size_mm) / 2
        width = KINDS["20"].size_mm[1]
        camera = Camera("near", (0, -9000, height), (0, 0, height), 45.0)
        sample = generator.render(scene=scene, camera=camera)
    corners = np.array([[x, -width / 2, z] for x in (-0.9, 0.9) for z in (0.3, 1.7)])
    corners *= (half_length, 1.0, height)
    (left, top), (right, bottom) = np.array(
        [f(sample.view.project(corners)[0], axis=0) for f in (np.min, np.max)]
    ).astype(int)
    wall = sample.image[top:bottom, left:right].astype(float).mean(axis=-1)
    assert (sample.ids[top:bottom, left:right] == 1).all()
    assert wall.max() < 2 * np.median(wall)


@pytest.mark.parametrize("side", [-1, 1])
def test_no_sunlight_leaks_along_a_post(generators, tmp_path, side):
    """No part of an end that faces away from a low sun, almost along the axis, is sunlit.

    Flanks of its posts would be, without the thick parts behind them. Both sides have deep dents.
    """
    toward = np.array([-0.982, side * 0.053, 0.183])
    write_exr(tmp_path / "low.exr", GREY + one_light(toward, 3e5, 512))
    length, width, height = KINDS["20"].size_mm
    dents = tuple(
        Damage("concave", "back" if y > 0 else "front", (700.0, y * width / 2, 1300.0),
               (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -y, 0.0), (2000.0, 1500.0), 230.0)
        for y in (-1.0, 1.0)
    )  # fmt: skip
    camera = Camera("end", (length / 2 + 6000, 0, height / 2), (0, 0, height / 2), 50.0)
    config = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
    generator = generators(config, 1, (900, 900), "auto", tmp_path, "draft")
    scene = generator.scene(0)
    assert load_environment(tmp_path / "low.exr").lights
    scene = replace(
        scene, environment=EnvironmentView("low", 0.0), decals=(), damages=dents,
        container=replace(scene.container, kind="20"), spreader=Spreader(),
    )  # fmt: skip
    sample = generator.render(scene=scene, camera=camera)
    end = cv2.erode((sample.ids == CONTAINER_ID).astype(np.uint8), np.ones((9, 9))) > 0
    shade = sample.image[end].astype(float).mean(axis=-1)
    assert end.sum() > 1e5
    assert np.percentile(shade, 99.99) < 2 * np.median(shade)


@pytest.mark.parametrize("quality", ["balanced", "high"])
def test_antialiasing_does_not_move_shadows(quality):
    """Away from edges; a lookup at the wrong place would move shadows by up to half the image."""
    config = Config.from_values(
        {
            "environment": {"names": ["park"]},
            "damage": {"probability": 0},
            "surface": {"rust_coverage": 0.0},
        }
    )
    soft = []
    for name in ("draft", quality):
        with Generator(config, 5, (320, 240), quality=name) as generator:
            sample = generator.render(0, "A")
        soft.append(cv2.GaussianBlur(sample.image.astype(np.float32), (0, 0), 2))
    inside = cv2.erode((sample.ids == 1).astype(np.uint8), np.ones((7, 7))) > 0
    assert inside.sum() > 5000
    apart = np.abs(soft[0] - soft[1]).max(axis=2)[inside]
    assert (apart > 20).mean() < 0.002


@pytest.mark.parametrize("others", [0, 1, 3])
def test_shadow_edges_are_not_jagged(generators, tmp_path, others):
    """A flipper's straight edge casts a straight shadow on the end beam, at 2 mm per pixel.

    Fainter lamps behind the container do not change that.
    """
    toward = np.array([[0.3, -0.75, 0.6], [-0.9, 0.3, 0.1], [-0.9, -0.3, 0.3], [-0.5, 0.8, 0.2]])
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    lights = [one_light(way, 1e5 if k == 0 else 5e3, 512) for k, way in enumerate(toward)]
    write_exr(tmp_path / "flat.exr", sum(lights[: 1 + others], GREY))
    assert len(load_environment(tmp_path / "flat.exr").lights) == 1 + others
    config = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
    half_length, height = KINDS["20"].size_mm[0] / 2, KINDS["20"].size_mm[2]
    target = (half_length - 12.0, -600.0, height + 15 + 260.0)
    place = (target[0] + 6000.0, *target[1:])
    camera = Camera("straight", place, target, 6000 / (2.0 * 400) * 36.0)
    generator = generators(config, 1, (400, 160), "auto", tmp_path)
    scene = replace(
        generator.scene(0),
        environment=EnvironmentView("flat", 0.0),
        decals=(),
        container=replace(generator.scene(0).container, kind="20"),
        spreader=Spreader(True, (0.5, 0.5, 0.5), (False, False), 15.0),
    )
    image = generator.render(scene=scene, camera=camera).image
    strip = image[60:155, 100:180].astype(float).sum(axis=2)
    shade, light = strip[:, :20].mean(axis=1), strip[:, -20:].mean(axis=1)
    assert (light > 1.3 * shade).all()
    # number of shaded columns in each row
    ends = ((light[:, None] - strip) / (light - shade)[:, None]).sum(axis=1)
    rows = np.arange(len(ends))
    apart = ends - np.polyval(np.polyfit(rows, ends, 1), rows)
    assert apart.std() < 0.33


LAMPS = np.array([[0.9, 0.3, 0.3], [0.7, 0.6, 0.2], [0.6, -0.7, 0.4], [0.5, 0.2, 0.8]])
LAMPS /= np.linalg.norm(LAMPS, axis=1, keepdims=True)
LIGHTS = np.array([1.0, 0.6, 0.8, 0.7])[:, None] * np.ones(3)


@pytest.fixture
def by_night(tmp_path, monkeypatch):
    """Generator, and a function that returns the scene under only the named lamps of LAMPS."""
    surface = {**EVEN_PAINT, "colors": {"grey": "#808080"}, "roughness": 0.9}
    config = Config.from_values({"surface": surface, "damage": {"probability": 0}})
    for name in ("0", "1", "2", "3", "012", "0123"):
        on = [int(digit) for digit in name]
        sky = lamps_at_night(LAMPS[on], LIGHTS[on]) - np.float32(0.0199)
        write_exr(tmp_path / f"{name}.exr", sky)
    # one sample per pixel, shaded individually
    monkeypatch.setitem(QUALITY, "draft", Quality(1, 1))
    with Generator(config, 1, (240, 240), "auto", tmp_path, "draft") as generator:
        scene = replace(
            generator.scene(0),
            decals=(),
            spreader=Spreader(True, (0.5, 0.5, 0.5), (True, True), 15.0),
        )
        yield generator, lambda name: replace(scene, environment=EnvironmentView(name, 0.0))


def above_the_spreader(container):
    """Return a camera close to the hoist cables, which extend beyond the shadow map."""
    top = KINDS[container.kind].size_mm[2]
    return Camera("cables", (12000.0, -4000.0, top + 7000.0), (0.0, 0.0, top + 6500.0), 500.0)


@pytest.mark.parametrize("view", ["Cr", "cables"])
def test_light_of_several_lamps_adds_up(by_night, view):
    """The light in an image under all lamps is the sum of the light under each one."""
    generator, scene_under = by_night
    light, inside, edges = {}, np.ones((240, 240), bool), np.zeros((240, 240), bool)
    for name in ("0123", "0", "1", "2", "3"):
        scene = scene_under(name)
        camera = scene.camera("Cr") if view == "Cr" else above_the_spreader(scene.container)
        camera = replace(camera, exposure_ev=-4.0)
        sample = generator.render(scene=scene, camera=camera)
        light[name] = light_of(sample.image).mean(axis=2) / generator.exposure(scene, camera)
        inside &= (sample.ids == (CONTAINER_ID if view == "Cr" else SPREADER_ID)) & (
            sample.image.max(axis=2) < 230
        )
        # pixels that a cable partly covers are not shaded individually
        inside &= sample.cover == 255
        if name != "0123":
            # only the brightest sun's shadow is filtered
            around = [f(light[name], np.ones((3, 3))) for f in (cv2.dilate, cv2.erode)]
            edges |= around[0] - around[1] > 0.1
    if view == "Cr":
        inside &= ~edges
    together, apart = light["0123"][inside], sum(light[name][inside] for name in "0123")
    assert inside.sum() > (5000 if view == "Cr" else 1000)
    assert all((light[name][inside] > 0.02).mean() > 0.1 for name in "0123")
    # 8-bit rounding: the sum of four images has the error of four
    assert np.percentile(np.abs(together - apart), 90) < 0.015 * apart.mean()
    assert abs(together.mean() / apart.mean() - 1) < 0.003


def test_images_do_not_depend_on_the_lamps_of_earlier_images(by_night):
    generator, scene_under = by_night
    camera = above_the_spreader(scene_under("0").container)
    shown = {}
    for name in ("012", "0123", "012", "0", "012"):
        image = generator.render(scene=scene_under(name), camera=camera).image
        np.testing.assert_array_equal(image, shown.setdefault(name, image))

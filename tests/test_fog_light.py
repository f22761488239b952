"""Light below fog against simulated photons, and labels of objects in fog."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.classes import DAMAGE_CLASSES
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.labels.crops import text_crops
from fastgen.light.environment import irradiance_at, load_environment, sky_irradiance
from fastgen.light.fog import has_sun, in_fog, transmitted
from fastgen.light.hdri import bundled_hdris
from fastgen.light.octahedral import sample_octahedral
from fastgen.scene import Camera, EnvironmentView, Ground, Neighbour, Pose, Spreader
from fastgen.scene.optics import Weather

SIZE = (320, 240)


def followed(depth, cosine, count=20_000):
    """Return the shares of photons below a slab: those without a collision, and all.

    The slab scatters as Henyey and Greenstein's phase function with a mean cosine of 0.85.
    """
    rng, g = np.random.default_rng(3), 0.85
    down, below = np.full(count, cosine), np.zeros(count)
    direct = arrived = 0
    straight = True
    while len(down):
        below = below - down * np.log(1 - rng.random(len(down)))
        through = below >= depth
        arrived += through.sum()
        if straight:
            direct, straight = arrived, False
        inside = ~through & (below > 0)
        down, below = down[inside], below[inside]
        part = (1 - g * g) / (1 - g + 2 * g * rng.random(len(down)))
        turn = (1 + g * g - part * part) / (2 * g)
        azimuth = np.cos(2 * np.pi * rng.random(len(down)))
        side = np.sqrt(np.maximum(1 - down**2, 0) * np.maximum(1 - turn**2, 0))
        down = down * turn + side * azimuth
    return direct / count, arrived / count


@pytest.mark.parametrize("cosine", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("depth", [0.2, 1.0, 3.0])
def test_transmitted_light_equals_a_photon_simulation(depth, cosine):
    found, wanted = transmitted(depth, cosine), followed(depth, cosine)
    assert found == (pytest.approx(wanted[0], abs=0.012), pytest.approx(wanted[1], abs=0.1))


def test_only_a_single_light_above_the_horizon_is_a_sun():
    assert transmitted(0.0, 0.3) == pytest.approx((1.0, 1.0))
    suns = {
        name: load_environment(bundled_hdris()[name])
        for name in ("port_noon", "port_overcast", "port_night")
    }
    assert {name: has_sun(light) for name, light in suns.items()} == {
        "port_noon": True,
        "port_overcast": False,
        "port_night": False,
    }
    (sun,) = suns["port_noon"].lights
    low = replace(sun, direction=(1.0, 0.0, -0.01))
    assert not has_sun(replace(suns["port_noon"], lights=(low,)))


@pytest.mark.parametrize("visibility_mm", [60e3, 300e3, 5e6])
def test_light_that_fog_takes_from_the_sun_comes_from_the_sky(visibility_mm):
    clear = load_environment(bundled_hdris()["port_afternoon"])
    foggy = in_fog(clear, visibility_mm)
    (sun,) = clear.lights
    direct, total = transmitted(3.912 * 60e3 / visibility_mm, sun.direction[2])
    lost = np.array(sun.light) * sun.direction[2]
    up, aside, down = np.eye(3)[2], np.eye(3)[0], -np.eye(3)[2]
    assert [each.direction for each in foggy.lights] == [sun.direction] * (direct > 0.01)
    seen, seen_before = irradiance_at(foggy, [up])[0], sky_irradiance(clear, [up], 0.0)[0]
    np.testing.assert_allclose(seen - seen_before, total * lost, rtol=0.02, atol=0.01 * lost.max())
    # a wall faces half of the sky, the underside none of it
    for normal, share in ((up, 1.0), (aside, 0.5), (down, 0.0)):
        before, after = (sky_irradiance(each, [normal], 0.0)[0] for each in (clear, foggy))
        mirrored = [
            sample_octahedral(each.specular[-1], normal[None])[0] for each in (clear, foggy)
        ]
        added = (total - direct) * lost
        near = {"rtol": 0.03, "atol": 0.03 * added.max()}
        np.testing.assert_allclose(after - before, share * added, **near)
        if share != 0.0:  # a rough lobe about the nadir still has a little of the sky
            np.testing.assert_allclose(mirrored[1] - mirrored[0], share * added, rtol=0.1)
    sky = foggy.sky - clear.sky
    assert sky.max() == pytest.approx(added.max(), rel=1e-3)
    assert sky[..., 0].mean() == pytest.approx(added[0] / 2, rel=1e-3)


@pytest.fixture(scope="module")
def generator():
    values = {"damage": {"probability": 1, "count": [3, 4]}, "seals": {"probability": 1}}
    with Generator(Config.from_values(values), seed=6, size=SIZE, quality="draft") as made:
        yield made


@pytest.fixture(scope="module")
def scene(generator):
    first, second = generator.scene(0), generator.scene(1)
    far = Neighbour(Pose((-4000.0, 30_000.0, 0.0)), second.container, second.surface, second.decals)
    return replace(
        first,
        spreader=replace(first.spreader, present=True),
        environment=EnvironmentView("port_afternoon", 0.0),
        ground=Ground("asphalt"),
        neighbours=(far,),
    )


BESIDE = Camera("beside", (0.0, -9000.0, 5000.0), (0.0, 3000.0, 1000.0), 20.0)
DOOR = Camera("door", (11_000.0, -1500.0, 2500.0), (0.0, 0.0, 1500.0), 30.0)
ABOVE = Camera("above", (0.0, 0.0, 20_000.0), (0.0, 1.0, 0.0), 20.0)


def test_shadows_fade_in_fog(generator, scene):
    bare = replace(
        scene, neighbours=(), decals=(), seals=(), damages=(), spreader=Spreader(present=False)
    )
    plane = replace(bare, container=replace(bare.container, present=False))
    shade = []
    for visibility_mm in (0.0, 400e3, 100e3, 30e3):
        weather = Weather(visibility_mm=visibility_mm)
        lit, open_ground = (
            generator.gpu.renderer().render(
                PreparedScene(replace(each, weather=weather)), ABOVE, SIZE, radiance=True
            )
            for each in (bare, plane)
        )
        ground = (lit.damage == 0) & np.isfinite(lit.depth)
        ratio = lit.radiance.sum(axis=2)[ground] / open_ground.radiance.sum(axis=2)[ground]
        shade.append(np.percentile(ratio / np.median(ratio), 2))
    assert shade == sorted(shade)
    assert shade[0] < 0.45
    assert shade[-1] > 0.6


@pytest.mark.parametrize("camera", [BESIDE, DOOR], ids=lambda camera: camera.name)
def test_objects_hidden_by_fog_are_ignored(generator, scene, camera):
    def seen(visibility_mm):
        shown = replace(scene, weather=Weather(visibility_mm=visibility_mm))
        sample = generator.render(scene=shown, camera=camera)
        flags = {each.id: each.ignored for each in sample.objects if each.area}
        _, rays = sample.view.rays()
        places_mm = sample.depth[..., None] / (rays @ sample.view.rotation[2])[..., None] * rays
        near = 1000 * np.linalg.norm(places_mm, axis=-1) <= (visibility_mm or np.inf)
        few = set()
        for each in sample.objects:
            mask = sample.ids == each.id
            if each.class_name in DAMAGE_CLASSES:
                mask = sample.damage == each.id
            if each.class_name == "container":
                damages = [
                    item.id
                    for item in sample.objects
                    if item.class_name in DAMAGE_CLASSES and item.container == each.container
                ]
                mask = np.isin(sample.damage, [101 + each.container, *damages])
            assert mask.sum() == each.area
            left = (near & mask).sum()
            if each.area and (left < 12 or left / each.area * each.visible_fraction < 0.05):
                few.add(each.id)
        return flags, few, {item.id for item, _ in text_crops(sample, 2.0)}

    clear, _, legible = seen(0.0)
    assert legible
    assert sum(not flag for flag in clear.values()) > 5
    found = set()
    for visibility_mm in (2_000.0, 6_000.0, 9_000.0, 10_500.0, 25_000.0, 100_000.0):
        flags, few, crops = seen(visibility_mm)
        hidden = {number for number, flag in flags.items() if flag and not clear[number]}
        assert hidden == {number for number in few if not clear[number]}
        assert crops == legible - few
        found.add((len(hidden), bool(crops)))
    counts = [number for number, _ in found]
    assert min(counts) == 0
    assert len(set(counts)) > 1
    assert {legible for _, legible in found} == {False, True}

"""Light below fog against simulated photons, and labels of objects in fog."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.labels.crops import text_crops
from fastgen.light.environment import irradiance_at, load_environment, sky_irradiance
from fastgen.light.fog import below_fog, transmitted
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
def test_as_many_photons_reach_the_ground_as_the_formula_says(depth, cosine):
    found, wanted = transmitted(depth, cosine), followed(depth, cosine)
    assert found == (pytest.approx(wanted[0], abs=0.012), pytest.approx(wanted[1], abs=0.1))


def test_fog_changes_nothing_without_fog_or_sun():
    assert transmitted(0.0, 0.3) == pytest.approx((1.0, 1.0))
    even = load_environment(bundled_hdris()["port_overcast"])
    assert not even.lights
    assert below_fog(even, 50e3) is even


@pytest.mark.parametrize("visibility_mm", [60e3, 300e3, 5e6])
def test_light_that_fog_takes_from_the_sun_comes_from_the_sky(visibility_mm):
    clear = load_environment(bundled_hdris()["port_afternoon"])
    foggy = below_fog(clear, visibility_mm)
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
    with Generator(Config(), seed=6, size=SIZE, quality="draft") as made:
        yield made


@pytest.fixture(scope="module")
def scene(generator):
    first, second = generator.scene(0), generator.scene(1)
    far = Neighbour(Pose((-4000.0, 30_000.0, 0.0)), second.container, second.surface, second.decals)
    return replace(
        first,
        damages=(),
        spreader=Spreader(),
        environment=EnvironmentView("port_afternoon", 0.0),
        ground=Ground("asphalt"),
        neighbours=(far,),
    )


BESIDE = Camera("beside", (0.0, -9000.0, 5000.0), (0.0, 3000.0, 1000.0), 20.0)
ABOVE = Camera("above", (0.0, 0.0, 20_000.0), (0.0, 1.0, 0.0), 20.0)


def test_shadows_fade_in_fog(generator, scene):
    bare = replace(scene, neighbours=(), decals=(), seals=())
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


def test_objects_of_which_fog_leaves_too_little_are_ignored(generator, scene):
    least_px, least_share = 12, 0.05

    def seen(visibility_mm):
        shown = replace(scene, weather=Weather(visibility_mm=visibility_mm))
        sample = generator.render(scene=shown, camera=BESIDE)
        flags = {each.id: each.ignored for each in sample.objects if each.area}
        _, rays = sample.view.rays()
        places_mm = sample.depth[..., None] / (rays @ sample.view.rotation[2])[..., None] * rays
        near = 1000 * np.linalg.norm(places_mm, axis=-1) <= (visibility_mm or np.inf)
        own = {
            each.id: (sample.damage == 101 + each.container)
            if each.class_name == "container"
            else (sample.ids == each.id)
            for each in sample.objects
        }
        left = {number: (near & mask).sum() for number, mask in own.items()}
        few = {n for n in flags if left[n] < max(least_px, least_share * own[n].sum())}
        return flags, few, {item.id for item, _ in text_crops(sample, 2.0)}

    clear, _, legible = seen(0.0)
    assert legible
    assert sum(not flag for flag in clear.values()) > 5
    for visibility_mm in (2_000.0, 9_000.0, 10_500.0, 25_000.0, 100_000.0):
        flags, few, crops = seen(visibility_mm)
        hidden = {number for number, flag in flags.items() if flag and not clear[number]}
        assert hidden == {number for number in few if not clear[number]}
        assert (len(hidden) > 0) == (visibility_mm < 50_000)
        assert crops == legible - few
        assert bool(crops) == (visibility_mm > 10_000)
    assert not seen(25_000.0)[0][1]  # the first container is in sight, the other one is not

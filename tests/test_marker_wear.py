"""Age of markers in rendered pictures: peeled patches, torn corners, bleaching and tint."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.decals.artwork import marker_prints
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.scene import Decal
from fastgen.scene.check import check_scene
from fastgen.srgb import DECODED

CONFIG = Config.from_values({"damage": {"probability": 0}, "spreader": {"probability": 0}})


def near_view(generator, decal):
    """Return a scene with only `decal`, at the middle of the front, and a camera close to it."""
    scene = generator.scene(0)
    mesh = SHAPES.container(scene.container.kind, scene.container.profiles)
    chart = mesh.charts[mesh.chart_index("front")]
    decal = replace(decal, face="front", center_mm=(chart.rect_mm[2] / 2, chart.rect_mm[3] / 2))
    middle, normal = mesh.sheet_to_surface("front", np.array([decal.center_mm]))
    camera = replace(
        scene.cameras[0],
        position_mm=tuple((middle[0] + 180 * normal[0]).tolist()),
        target_mm=tuple(middle[0].tolist()),
    )
    return replace(scene, decals=(decal,)), camera


def albedo(generator, scene, camera, tone):
    """Return linear albedo [H, W, 3] of decals on grey paint of the albedo `tone`."""
    paint = replace(scene.surface.paint, albedo=(tone,) * 3)
    scene = replace(scene, surface=replace(scene.surface, paint=paint))
    return DECODED[generator.render(scene=scene, camera=camera, layer="decals").image]


def seen(generator, decal):
    """Return linear albedo [H, W, 3] of a decal on grey paint, and its opacity [H, W]."""
    scene, camera = near_view(generator, decal)
    dark, light = (albedo(generator, scene, camera, tone) for tone in (0.02, 0.7))
    without = replace(scene, decals=())
    bare = [albedo(generator, without, camera, tone) for tone in (0.02, 0.7)]
    through = (light - dark).mean(axis=-1) / (bare[1] - bare[0]).mean(axis=-1)
    return light, 1 - np.clip(through, 0, 1)


@pytest.fixture
def generator(generators):
    return generators(CONFIG, seed=4, size=(320, 320), quality="balanced")


MARKER = Decal("marker", "C3.2", "front", (0.0, 0.0), (400.0, 400.0), art="C3.2")


@pytest.mark.parametrize("art", ["C3.2", "C9.1"])
@pytest.mark.parametrize(
    "age", [{"wear": 0.3}, {"wear": 0.6}, {"wear": 1.0}, {"wear": 0.5, "torn": (0.2, 0, 0.25, 0)}]
)
def test_a_worn_marker_is_opaque_or_gone_but_not_translucent(generator, art, age):
    _, fresh = seen(generator, replace(MARKER, art=art))
    _, opacity = seen(generator, replace(MARKER, art=art, **age))
    between = ((opacity > 0.1) & (opacity < 0.9)).astype(np.uint8)
    assert (fresh > 0.5).mean() > 0.25
    # Only the edges of patches are in between: no 5 x 5 pixels are, and few pixels in total.
    assert not cv2.erode(between, np.ones((5, 5))).any()
    assert between.sum() < 0.1 * (fresh > 0.5).sum()


def test_wear_peels_more_and_more(generator):
    covered = [(seen(generator, replace(MARKER, wear=w))[1] > 0.5).sum() for w in (0, 0.6, 1)]
    assert covered[0] >= covered[1] > covered[2]
    assert covered[2] > 0.5 * covered[0]


def test_a_torn_corner_is_missing_and_the_other_corners_stay(generator):
    scene, camera = near_view(generator, MARKER)
    _, whole = seen(generator, MARKER)
    _, torn = seen(generator, replace(MARKER, torn=(0.0, 0.3, 0.0, 0.0)))
    lost = (whole > 0.5) & (torn < 0.5)
    columns = np.flatnonzero((whole > 0.5).any(axis=0))
    at = np.nonzero(lost)[1]
    assert lost.sum() > 100
    assert at.min() > columns[0] + 0.7 * np.ptp(columns)
    assert lost[:, columns[-1] - 3 : columns[-1] + 1].sum() > 0
    kept = generator.render(scene=scene, camera=camera)
    cut = generator.render(
        scene=replace(scene, decals=(replace(scene.decals[0], torn=(0.0, 0.3, 0.0, 0.0)),)),
        camera=camera,
    )
    assert kept.objects == cut.objects


def test_bleaching_takes_the_colour_and_leaves_black(generator):
    def chroma(image):
        return np.ptp(image, axis=-1)

    fresh, inside = seen(generator, MARKER)
    pale, _ = seen(generator, replace(MARKER, fade=0.8))
    red = (inside > 0.95) & (chroma(fresh) > 0.4)
    assert red.sum() > 1000
    assert chroma(pale)[red].mean() < 0.6 * chroma(fresh)[red].mean()
    black, _ = seen(generator, replace(MARKER, art="C9.1"))
    grey, _ = seen(generator, replace(MARKER, art="C9.1", fade=0.8))
    dark = (inside > 0.95) & (black.max(axis=-1) < 0.02)
    assert dark.sum() > 300
    assert grey[dark].mean() < 0.2


def test_the_tint_multiplies_the_artwork(generator):
    fresh, inside = seen(generator, MARKER)
    tinted, _ = seen(generator, replace(MARKER, tint=(1.0, 0.5, 0.25)))
    printed = (inside > 0.99) & (fresh.min(axis=-1) > 0.3)
    ratio = (tinted[printed] / fresh[printed]).mean(axis=0)
    np.testing.assert_allclose(ratio, (1.0, 0.5, 0.25), atol=0.03)


def test_scenes_use_every_print_and_only_prints_of_the_class():
    generator = Generator(seed=12)
    used = {
        (d.class_name, d.art)
        for i in range(130)
        for d in generator.scene(i).decals
        if d.kind == "marker"
    }
    assert used == {(name, art) for name, prints in marker_prints().items() for art in prints}


def test_an_unknown_print_is_refused_by_name():
    scene = Generator(seed=12).scene(0)
    with pytest.raises(ConfigError, match=r"decals\[0\].art: 'C3.2.9' is unknown"):
        check_scene(replace(scene, decals=(replace(MARKER, art="C3.2.9"),)))

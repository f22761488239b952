"""Draft images shade two by two pixels at once, and only where these see one and the same thing."""

import dataclasses

import numpy as np
import pytest

from fastgen import Config, Generator, generator

SIZE = (501, 333)  # neither is a multiple of two
SCENES = {
    "sound": {},
    "damaged": {"damage": {"probability": 1, "count": [3, 5]}},
    "holed": {"damage": {"probability": 1, "count": [2, 3], "kinds": ["perforation"]}},
}


def blocks(values):
    """[H, W, ...] as the pixels of each whole block, [H // 2, W // 2, 4, ...]."""
    height, width = (side // 2 * 2 for side in values.shape[:2])
    four = [values[y:height:2, x:width:2] for y in (0, 1) for x in (0, 1)]
    return np.stack(four, axis=2)


@pytest.fixture
def drawn(monkeypatch):
    """Images of two scenes, shaded in blocks and pixel by pixel."""

    def of(values):
        config = Config.from_values(values)
        samples = []
        for coarse in (True, False):
            quality = generator.QUALITY["draft"]._replace(coarse=coarse)
            monkeypatch.setitem(generator.QUALITY, "draft", quality)
            with Generator(config, seed=4, size=SIZE, quality="draft") as made:
                samples.append(
                    [
                        made.render(index, camera=camera, normals=True)
                        for index in range(2)
                        for camera in ("A", "Cr")
                    ]
                )
        return zip(*samples, strict=True)

    return of


@pytest.mark.parametrize("kind", SCENES)
def test_labels_are_those_of_pixels_shaded_one_by_one(drawn, kind):
    for coarse, single in drawn(SCENES[kind]):
        assert [dataclasses.asdict(o) for o in coarse.objects] == [
            dataclasses.asdict(o) for o in single.objects
        ]
        for name in ("ids", "damage", "depth", "cover", "normals"):
            assert np.array_equal(getattr(coarse, name), getattr(single, name)), name


@pytest.mark.parametrize("kind", SCENES)
def test_a_block_has_one_colour_only_where_its_pixels_see_one_facet(drawn, kind):
    saved = 0.0
    for coarse, single in drawn(SCENES[kind]):
        one, each = blocks(coarse.image), blocks(single.image)
        uniform = (one == one[:, :, :1]).all(axis=(2, 3))
        same = (one == each).all(axis=(2, 3))
        assert (uniform | same).all()
        odd = np.ones(single.ids.shape, bool)
        odd[: SIZE[1] // 2 * 2, : SIZE[0] // 2 * 2] = False
        assert (coarse.image == single.image)[odd].all()

        changed = ~same
        for values in (single.ids, single.damage, single.normals):
            four = blocks(values).reshape(*changed.shape, 4, -1)
            assert (four == four[:, :, :1])[changed].all()
        assert (blocks(single.ids)[changed] != 0).all()
        depth = blocks(single.depth)[changed]
        assert (np.ptp(depth, axis=1) < 0.02 * depth[:, 0]).all()  # nothing hidden in between
        # its colour is that of its pixels: the same layers and light, looked up once
        apart = np.abs(each.mean(axis=2) - one.mean(axis=2)).max(axis=-1)[changed]
        assert np.median(apart) < 3
        assert (apart > 24).mean() < 0.03
        saved += changed.sum() * 3 / (single.ids > 0).sum() / 4
    assert saved > 0.25


def test_the_other_qualities_shade_each_pixel():
    assert [name for name, quality in generator.QUALITY.items() if quality.coarse] == ["draft"]

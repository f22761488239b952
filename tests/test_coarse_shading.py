"""2x2 coarse shading in draft images: pixels share a colour only where they see one facet."""

import dataclasses

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.render import settings

SIZE = (501, 333)  # odd, so blocks at the borders are incomplete
SCENES = {
    "undamaged": {},
    "damaged": {"damage": {"probability": 1, "count": [3, 5]}},
    "holed": {"damage": {"probability": 1, "count": [2, 3], "kinds": ["perforation"]}},
}


def blocks(values):
    """Return `values` [H, W, ...] by complete 2x2 blocks, [H // 2, W // 2, 4, ...]."""
    height, width = (side // 2 * 2 for side in values.shape[:2])
    four = [values[y:height:2, x:width:2] for y in (0, 1) for x in (0, 1)]
    return np.stack(four, axis=2)


@pytest.fixture
def drawn(monkeypatch):
    """Function that renders two scenes with coarse shading and again pixel by pixel."""

    def of(values):
        config = Config.from_values(values)
        samples = []
        for coarse in (True, False):
            quality = settings.QUALITY["draft"]._replace(coarse=coarse)
            monkeypatch.setitem(settings.QUALITY, "draft", quality)
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
def test_labels_equal_those_of_per_pixel_shading(drawn, kind):
    for coarse, single in drawn(SCENES[kind]):
        assert [dataclasses.asdict(o) for o in coarse.objects] == [
            dataclasses.asdict(o) for o in single.objects
        ]
        for name in ("ids", "damage", "depth", "cover", "normals"):
            assert np.array_equal(getattr(coarse, name), getattr(single, name)), name


@pytest.mark.parametrize("kind", SCENES)
def test_pixels_share_a_colour_only_where_they_see_one_facet(drawn, kind):
    shared = pixels = 0
    for coarse, single in drawn(SCENES[kind]):
        one, each = (blocks(sample.image).astype(int) for sample in (coarse, single))
        ids, damage, depth, normals = (
            blocks(values) for values in (single.ids, single.damage, single.depth, single.normals)
        )
        moved = np.abs(one - each).max(axis=-1) > 1  # a difference of 1 is rounding
        for i in range(4):
            partner = np.zeros(moved.shape[:2], bool)
            for j in {0, 1, 2, 3} - {i}:
                alike = (ids[..., i] == ids[..., j]) & (damage[..., i] == damage[..., j])
                alike &= (normals[..., i, :] == normals[..., j, :]).all(axis=-1)
                with np.errstate(invalid="ignore"):  # background depth: inf - inf
                    apart = np.abs(depth[..., i] - depth[..., j])
                alike &= apart < 0.02 * depth[..., i]  # no depth step in between
                partner |= alike & (one[..., i, :] == one[..., j, :]).all(axis=-1)
            assert partner[moved[..., i]].all()
            assert (ids[..., i][moved[..., i]] != 0).all()
        shared += moved.sum()
        pixels += (ids > 0).sum()
        # a shared colour is close to the mean of the pixels, as it has the same layers and light
        changed = moved.any(axis=-1)
        apart = np.abs(each.mean(axis=2) - one.mean(axis=2)).max(axis=-1)[changed]
        # on scraped, rusty walls it reaches 3.0: an eighth of the contrast in a block, as elsewhere
        assert np.median(apart) < 3.5
        assert (apart > 24).mean() < 0.03
    assert shared > 0.25 * pixels


def test_only_draft_quality_uses_coarse_shading():
    assert [name for name, quality in settings.QUALITY.items() if quality.coarse] == ["draft"]

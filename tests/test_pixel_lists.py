"""Pixel lists for shading: one list per pixel, independent of earlier frames and of bands."""

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render import pixel_lists
from fastgen.render.visibility_buffer import VisibilityBuffer

SIZE = (201, 150)
KINDS = {
    "undamaged": {"damage": {"probability": 0}},
    "holed": {"damage": {"probability": 1, "count": [2, 4], "kinds": ["perforation", "concave"]}},
}


def drawn(values, quality, scenes=2):
    """Return, for two cameras of each scene, the frame and how often each pixel is listed."""
    config = Config.from_values({**values, "spreader": {"probability": 1}})
    found = []
    with Generator(config, seed=3, size=SIZE, quality=quality) as generator:
        renderer = generator.gpu.renderer()
        for scene in map(generator.scene, range(scenes)):
            for camera in (scene.camera("A"), scene.camera("Cr")):
                targets = renderer.draw(PreparedScene(scene), camera, SIZE)
                found.append((targets.read(), listed(targets.lists.entries())))
    return found


def listed(lists):
    """Return how often each pixel occurs in the lists, [H, W]."""
    count = np.zeros(SIZE[::-1], int)
    for entries in lists.values():
        np.add.at(count, (entries >> 16, entries & 0xFFFF), 1)
    return count


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_each_pixel_that_sees_an_object_is_in_one_list(kind, quality):
    for frame, count in drawn(KINDS[kind], quality):
        assert count.max() == 1
        assert (count[(frame.ids > 0) | (frame.cover > 0)] == 1).all()
        if quality == "draft":  # a pixel of one sample shows either a surface or the sky
            holes = frame.damage // 100 == 5
            shaded = (frame.ids > 0) | holes | (frame.cover > 0)
            np.testing.assert_array_equal(count == 1, shaded)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_an_image_drawn_in_bands_equals_the_whole(monkeypatch, quality):
    whole = drawn(KINDS["holed"], quality)
    monkeypatch.setattr(pixel_lists, "ROOM", 17 * SIZE[0])  # 16 rows
    for (one, _), (other, _) in zip(whole, drawn(KINDS["holed"], quality), strict=True):
        for name in ("image", "cover", "ids", "damage", "depth"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)


@pytest.mark.parametrize("quality", ["draft", "balanced", "high"])
def test_a_frame_does_not_depend_on_earlier_frames(monkeypatch, quality):
    """Pixels far from damage must not read rest positions that an earlier scene left there."""
    scenes = 1 if quality == "high" else 2
    first = drawn(KINDS["holed"], quality, scenes)
    config = Config.from_values({**KINDS["holed"], "spreader": {"probability": 1}})
    origins = [
        damage.origin_mm
        for index in range(scenes)
        for damage in Generator(config, seed=3, size=SIZE).scene(index).damages
    ]
    begin = VisibilityBuffer.begin
    spoilt = []

    def spoil(targets, damage, *rest):
        targets._make_room(damage, 10**6)  # all rows
        origin = origins[len(spoilt) % len(origins)]
        positions = [t for name, t in targets.textures.items() if name.startswith("rest_")]
        for texture, value in zip(positions, origin, strict=False):
            texture.write(np.full(texture.size[::-1], value, np.float32).tobytes())
            spoilt.append(value)
        begin(targets, damage, *rest)

    monkeypatch.setattr(VisibilityBuffer, "begin", spoil)
    for (one, _), (other, _) in zip(first, drawn(KINDS["holed"], quality, scenes), strict=True):
        for name in ("image", "cover", "ids", "damage", "depth"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    assert spoilt

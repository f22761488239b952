"""Caches of recent values, and what the renderer keeps of past scenes."""

from dataclasses import replace

import pytest

from fastgen import Config
from fastgen.render.recent_cache import ReleasingCache
from fastgen.render.scene_resources import SceneResources


class Item:
    """Object that notes its release."""

    def __init__(self, name, released):
        self.name, self._released = name, released

    def release(self):
        self._released.append(self.name)


@pytest.mark.parametrize("most", [0, 1, 2, 5])
def test_shrinking_releases_the_least_recently_used_values(most):
    released = []
    cache = ReleasingCache(4)
    for name in "abcd":
        cache.get(name, lambda name=name: Item(name, released))
    cache.get("a", lambda: pytest.fail("a is in the cache"))
    cache.shrink(most)
    order = ["b", "c", "d", "a"]
    assert released == order[: max(4 - most, 0)]
    for name in order[4 - most :] if most else []:
        assert cache.get(name, lambda: pytest.fail("it is in the cache")).name == name


def test_tables_of_past_scenes_are_released(generators, monkeypatch):
    alive = set()
    made, released = SceneResources.__init__, SceneResources.release

    def make(self, *arguments):
        made(self, *arguments)
        alive.add(self)

    def release(self):
        released(self)
        alive.discard(self)  # tables from before this test

    monkeypatch.setattr(SceneResources, "__init__", make)
    monkeypatch.setattr(SceneResources, "release", release)
    generator = generators(Config.preset(), seed=2, size=(96, 96), quality="draft")
    scene = generator.scene(0)
    for index in range(6):
        other = replace(scene, index=index, decals=scene.decals[index:])
        generator.render(scene=other, camera="A")
    # two that may take turns, and the scene that is drawn
    assert 1 <= len(alive) <= 3

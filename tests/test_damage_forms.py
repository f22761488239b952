"""Every form of damage, with random parameters over all that a scene may have."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.geometry.damage_law import amount_mm, in_hole, is_marked, reach_mm
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.gl import open_context
from fastgen.render.surface_values import damage_values
from tests.glsl import blocks, run
from tests.random_damages import FORM_NAMES, points_around, random_damage

ONE_DAMAGE = """
#include "damage_law.glsl"
vec4 f(vec4 x) {
    vec3 p = x.xyz;
    int number = int(x.w);
    vec4 changed = vec4(0.0);
#define PICK(i, field) if (i == number) changed.x = field.amount
    EACH_DAMAGE(PICK)
    changed.y = float(number < hole_count && in_hole(number, p));
    changed.z = float(number >= axis_kinked_end && scraped(number, damage_local(number, p)));
    return changed;
}
"""
"""GLSL function of a position and the number of a damage: its displacement, hole and mark there."""


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


@pytest.mark.parametrize(("kind", "form"), FORM_NAMES)
def test_a_damage_changes_nothing_outside_its_reach(kind, form):
    rng = np.random.default_rng(1)
    changed = 0
    for _ in range(300):
        damage = random_damage(rng, kind, form)
        local, points = points_around(rng, damage, 400)
        outside = (np.abs(local) > np.array(reach_mm(damage))).any(axis=1)
        assert 50 < outside.sum() < 350
        here = in_hole(damage, points) | is_marked(damage, points)
        here |= amount_mm(damage, points) != 0
        changed += np.count_nonzero(here[~outside])
        assert not here[outside].any()
    assert changed > 300


def test_the_shaders_change_nothing_outside_the_reach(gl):
    """They move, tear and scrape nothing there."""
    rng = np.random.default_rng(2)
    scene = Generator(Config(), seed=1).scene(0)
    inside = np.zeros(len(FORM_NAMES), int)
    for _ in range(8):
        damages = tuple(random_damage(rng, *name) for name in FORM_NAMES for _ in range(12))
        local, points = zip(*(points_around(rng, each, 100) for each in damages), strict=True)
        number = np.repeat(np.arange(len(damages)), 100)
        drawn = replace(scene, damages=damages)
        kept = blocks(gl, **damage_values(PreparedScene(drawn), damages, 5.0, 0))
        rows = np.column_stack([np.concatenate(points), number])
        changed = (run(gl, ONE_DAMAGE, rows, damage="holed") != 0).any(axis=1)
        del kept
        reach = np.array([reach_mm(each) for each in damages])[number]
        outside = (np.abs(np.concatenate(local)) > reach).any(axis=1)
        assert not changed[outside].any()
        inside += np.bincount(number[changed] // 12, minlength=len(FORM_NAMES))
    assert (inside > 20).all()

"""Every form of damage, with random parameters from the ranges that scenes allow."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.classes import BUNDLED_DAMAGE_CLASSES
from fastgen.config.damage import DamageConfig
from fastgen.errors import ConfigError
from fastgen.geometry.damage_law import (
    amount_mm,
    deform,
    in_hole,
    inward_mm,
    is_marked,
    may_be_seen,
    outward_mm,
    reach_mm,
)
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.labels.damage import severity_mm
from fastgen.render.constants import constants_text
from fastgen.render.gl import open_context
from fastgen.render.surface_values import damage_values
from fastgen.render.variant import ShaderVariant
from fastgen.scene import Damage
from fastgen.scene.damage_kinds import Form, forms_of
from tests.glsl import blocks, run
from tests.random_damages import AXES, FORM_NAMES, FORMS, points_around, random_damage

ONE_DAMAGE = """
#include "damage_law.glsl"
vec4 f(vec4 x) {
    vec3 p = x.xyz;
    int number = int(x.w);
    vec4 changed = vec4(0.0);
#define PICK(i, field) if (i == number) changed.x = field.amount
    EACH_DAMAGE(PICK)
    changed.y = float(number < hole_count && in_hole(number, p));
#define PICK_MARK(i, mark) if (i == number) changed.z = float(mark.here)
    EACH_MARK(PICK_MARK)
    return changed;
}
"""
"""GLSL function of a position and the number of a damage: its displacement, hole and mark there."""


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


def test_the_shaders_loop_over_the_forms_in_their_order():
    """Damages of a form lie between the end of the form before and its own."""
    forms = forms_of(BUNDLED_DAMAGE_CLASSES)
    assert {form.glsl for form in forms} == {form.glsl for form in FORMS.values()}
    text = constants_text("damage", ShaderVariant(kinds=BUNDLED_DAMAGE_CLASSES))
    ends = [f"form_{number}_end" for number in range(len(forms))]
    wanted = list(zip(["0", *ends[:-1]], ends, forms, strict=True))
    for macro, suffix in (("EACH_DAMAGE", "field"), ("EACH_MARK", "mark")):
        (each,) = re.findall(rf"#define {macro}\(USE\) (.*)", text)
        loops = re.findall(rf"EACH_NEAR\((\w+), (\w+), \w+, (\w+)_{suffix}, USE\)", each)
        drawn = [row for row in wanted if (row[2].amount if suffix == "field" else row[2].marked)]
        assert loops == [(start, end, form.glsl) for start, end, form in drawn]
    # loops over holes begin at 0, and marks follow all forms that move the sheet
    order = [0 if form.outline else 2 if form.marked else 1 for form in forms]
    assert order == sorted(order)
    assert order.count(2) == 5


def displacements(damage, low, high, count):
    """Return the displacement [2, N, N] on a grid between local points [2], and u and v [N].

    The first layer is the outermost sheet, the second lies behind all corrugation.
    """
    u, v = (np.linspace(*ends, count) for ends in zip(low, high, strict=True))
    w = np.array([0.0, 60.0])[:, None, None]
    local = np.stack(np.broadcast_arrays(u[:, None], v[None, :], w), axis=-1)
    return amount_mm(damage, local @ np.array(AXES)), u, v


@pytest.mark.parametrize(
    ("kind", "form"),
    [name for name, form in FORMS.items() if not (form.outline or form.marked)],
)
def test_severity_is_the_largest_displacement(kind, form):
    """The largest one is looked for on a grid, and on finer grids around the places found."""
    rng = np.random.default_rng(3)
    differ = 0
    for _ in range(60):
        damage = random_damage(rng, kind, form)
        reach = np.array(reach_mm(damage)[:2])
        middle, most = np.zeros(2), 0.0
        for zoom in (1, 5, 20, 100, 500):
            moved, u, v = displacements(damage, middle - reach / zoom, middle + reach / zoom, 161)
            _, i, j = np.unravel_index(np.abs(moved).argmax(), moved.shape)
            middle, most = np.array([u[i], v[j]]), max(most, float(np.abs(moved).max()))
        assert severity_mm(damage) == pytest.approx(most, rel=0.01, abs=0.02)
        differ += abs(most - abs(damage.depth_mm)) > 0.05 * most
    assert differ > 10 if form in ("buckled", "creased", "kinked", "ribs") else differ == 0


@pytest.mark.parametrize(("kind", "form"), FORM_NAMES)
def test_sheet_that_moves_outward_may_be_seen_from_behind(kind, form):
    rng = np.random.default_rng(4)
    outward = 0
    for _ in range(150):
        damage = random_damage(rng, kind, form)
        reach = np.array(reach_mm(damage)[:2])
        moved, *_ = displacements(damage, -reach, reach, 81)
        low, high = -outward_mm(damage), inward_mm(damage)
        assert low <= moved[0].min() + 1e-6
        assert moved[0].max() - 1e-6 <= high
        front = min(moved[0].min(), (60.0 + moved[1]).min())
        assert low <= front + 1e-6
        seen = may_be_seen(damage, (0.0, 5000.0, 0.0) if kind != "axis" else (0.0, 9e3, 9e3))
        assert seen or front > -1e-6
        outward += front < -1.0
        if low == 0.0:
            assert not seen
    assert outward > 10 or FORMS[kind, form].marked or form == "ribs"


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
    for _ in range(15):
        damages = tuple(random_damage(rng, *name) for name in FORM_NAMES for _ in range(6))
        local, points = zip(*(points_around(rng, each, 100) for each in damages), strict=True)
        number = np.repeat(np.arange(len(damages)), 100)
        drawn = replace(scene, damages=damages)
        kept = blocks(
            gl, **damage_values(PreparedScene(drawn), damages, BUNDLED_DAMAGE_CLASSES, 5.0, 0)
        )
        rows = np.column_stack([np.concatenate(points), number])
        changed = (run(gl, ONE_DAMAGE, rows, None, "holed", BUNDLED_DAMAGE_CLASSES) != 0).any(
            axis=1
        )
        del kept
        reach = np.array([reach_mm(each) for each in damages])[number]
        outside = (np.abs(np.concatenate(local)) > reach).any(axis=1)
        assert not changed[outside].any()
        inside += np.bincount(number[changed] // 6, minlength=len(FORM_NAMES))
    assert (inside > 20).all()


def test_a_form_with_a_hole_must_move_the_sheet():
    def hole(damage, u, v):
        return u

    with pytest.raises(ConfigError, match="a form with an outline, a hole, needs amount"):
        Form("plain", "pit", "pit.glsl", marked=lambda *_: True, outline=hole)


def test_faces_never_bulge_by_less_than_nothing():
    values = {"damage": {"kinds": ["perforation"], "perforation": {"twist": 0.5}}}
    assert Config.from_values(values).damage.bulge_mm == 0
    assert DamageConfig(probability=0.0).bulge_mm == 0


def test_a_concave_damage_moves_points_by_hand_computed_amounts():
    """A concave damage is a bump, checked at its centre, half way out and at its rim."""
    damage = Damage(
        "concave", "front", (0, 0, 0), (1, 0, 0), (0, 0, 1), (0, 1, 0), (2000, 1000), 80.0
    )
    points = np.array([[0, 0, 0], [500, 0, 0], [0, 0, 250], [1000, 0, 0], [0, 300, 0]], float)
    assert amount_mm(damage, points)[:4] == pytest.approx([80, 45, 45, 0])
    assert 0 < amount_mm(damage, points)[4] < 80
    moved = deform((damage,), points)
    np.testing.assert_allclose(moved[0], [0, 80, 0])

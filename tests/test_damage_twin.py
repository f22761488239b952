"""The damage shader compared with its numpy twin; both define the same displacement fields."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.classes import BUNDLED_DAMAGE_CLASSES
from fastgen.damages.fields import FADE_END_MM, FADE_START_MM
from fastgen.geometry.damage_law import (
    amount_mm,
    deform,
    in_hole,
    is_marked,
    local_coordinates,
    reach_mm,
)
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.render.constants import REACH_MARGIN_MM
from fastgen.render.gl import open_context
from fastgen.render.surface_values import damage_values
from fastgen.scene.damage_kinds import form_of
from fastgen.scene.object_ids import mask_values
from tests.glsl import blocks, run

THRESHOLD_MM = 5.0
EDGE_MM = 0.01  # nearer to a border than this, both results are accepted


@pytest.fixture(scope="module")
def gl():
    with open_context() as made:
        yield made


def scenes_with(*kinds):
    """Return three scenes, each with points around its damages out to twice their reach."""
    damage = {"probability": 1.0, "count": [2, 12], "kinds": list(kinds)}
    generator = Generator(Config.from_values({"damage": damage}), seed=3)
    rng = np.random.default_rng(0)
    found = []
    for index in range(3):
        scene = generator.scene(index)
        points = []
        for d in scene.damages:
            local = rng.uniform(0, 2, (1000, 1)) * rng.uniform(-1, 1, (1000, 3))
            local *= np.array(reach_mm(d)) + REACH_MARGIN_MM
            axes = np.array([d.along, d.across, d.inward])
            points.append(np.array(d.origin_mm) + local @ axes)
        found.append((scene, np.concatenate(points).astype(np.float32).astype(np.float64)))
    assert {d.kind for scene, _ in found for d in scene.damages} == set(kinds)
    return found


@pytest.fixture(scope="module")
def damages():
    return scenes_with(*BUNDLED_DAMAGE_CLASSES)


def asked(gl, scene, body, points):
    """Return GLSL `vec4 f(vec4 x)` at points [N, 3] as [N, 4], and the damages in shader order."""
    values = damage_values(
        PreparedScene(scene), scene.damages, BUNDLED_DAMAGE_CLASSES, THRESHOLD_MM, 0
    )
    kept = blocks(gl, **values)
    rows = np.column_stack([points, np.zeros(len(points))])
    out = run(
        gl, f'#include "damage_law.glsl"\n{body}', rows, None, "holed", BUNDLED_DAMAGE_CLASSES
    )
    del kept
    by_origin = {d.origin_mm: d for d in scene.damages}
    ordered = [by_origin[tuple(row[:3])] for row in values["damage_origin"]]
    return out, ordered


def test_points_move_as_in_numpy(gl, damages):
    farthest = []
    for scene, points in damages:
        moved, _ = asked(gl, scene, "vec4 f(vec4 x) { return vec4(deformed(x.xyz), 0.0); }", points)
        wanted = deform(scene.damages, points)
        farthest.append(np.abs(wanted - points).max())
        np.testing.assert_allclose(moved[:, :3], wanted, atol=0.02)
    assert max(farthest) > 10


def test_reach_is_the_same_as_in_numpy(gl, damages):
    body = (
        "vec4 f(vec4 x) { vec4 n = vec4(0.0); for (int i = 0; i < damage_count; ++i)"
        " n.x += within_reach(i, x.xyz) ? exp2(float(i)) : 0.0; return n; }"
    )
    for scene, points in damages:
        out, ordered = asked(gl, scene, body, points)
        for i, damage in enumerate(ordered):
            local = np.abs(np.stack(local_coordinates(damage, points), axis=-1))
            beyond = (local - np.array(reach_mm(damage)) - REACH_MARGIN_MM).max(axis=1)
            sure = np.abs(beyond) > EDGE_MM
            seen = out[:, 0].astype(int) >> i & 1 == 1
            assert (beyond < 0).any()
            assert (beyond > 0).any()
            np.testing.assert_array_equal(seen[sure], (beyond < 0)[sure])


def test_next_near_skips_no_damage_that_reaches_a_point(gl, damages):
    body = (
        "vec4 f(vec4 x) { vec4 n = vec4(0.0); for (int i = 0; i < damage_count; ++i)"
        " if (within_reach(i, x.xyz)) {"
        " n.x += 1.0;"
        " n.y += next_damage_near(i, damage_count, x.xyz) == i ? 0.0 : 1.0; } return n; }"
    )
    for scene, points in damages:
        out, _ = asked(gl, scene, body, points)
        assert out[:, 0].max() >= 1
        assert out[:, 1].max() == 0


def test_holes_are_the_same_as_in_numpy(gl, damages):
    holes = 0
    for scene, points in damages:
        if not any(d.kind == "perforation" for d in scene.damages):
            continue
        body = "vec4 f(vec4 x) { return vec4(float(hole_at(x.xyz)), 0.0, 0.0, 0.0); }"
        out, ordered = asked(gl, scene, body, points)
        wanted = np.full(len(points), -1)
        for i, damage in enumerate(ordered):
            wanted[in_hole(damage, points)] = i
        holes += np.count_nonzero(wanted >= 0)
        assert np.count_nonzero(out[:, 0] != wanted) <= 1  # one point may lie on an outline
    assert holes > 50


def test_a_point_is_marked_with_the_damage_that_moves_it_most(gl, damages):
    body = "vec4 f(vec4 x) { return vec4(float(damage_at(x.xyz).value), 0.0, 0.0, 0.0); }"
    for scene, points in damages:
        out, _ = asked(gl, scene, body, points)
        values = np.array(mask_values(scene.damages))
        amounts = np.abs([amount_mm(d, points) for d in scene.damages])
        most, second = np.sort(np.vstack([amounts, np.zeros_like(amounts[:1])]), axis=0)[[-1, -2]]
        together = np.linalg.norm(deform(scene.damages, points) - points, axis=1)
        moved = (most > THRESHOLD_MM) & (together > THRESHOLD_MM)
        wanted = np.where(moved, values[amounts.argmax(axis=0)], 0)
        sure = (np.abs(most - THRESHOLD_MM) > EDGE_MM) & (most - second > EDGE_MM)
        sure &= np.abs(together - THRESHOLD_MM) > EDGE_MM
        sure |= most == 0
        marks = []
        for damage, value in zip(scene.damages, values, strict=True):
            if form_of(damage).marked:
                marks.append((BUNDLED_DAMAGE_CLASSES.index(damage.kind), damage, value))
        for _, damage, value in sorted(marks, key=lambda mark: -mark[0]):  # later kinds cover
            wanted[(wanted == 0) & is_marked(damage, points)] = value
            sure &= ~near_outline(damage, points)
        assert np.unique(wanted[sure]).size == 1 + len(scene.damages)
        np.testing.assert_array_equal(out[sure, 0], wanted[sure])


def near_outline(damage, points):
    """Return which points [N, 3] are so near the outline of a mark that both answers hold."""
    steps = EDGE_MM * np.vstack([np.eye(3), -np.eye(3)])
    here = is_marked(damage, points)
    return np.any([is_marked(damage, points + step) != here for step in steps], axis=0)


def test_opposite_displacements_leave_no_mask(gl):
    """A bulge on a dent of the same field puts the sheet back where it was."""
    values = {
        "probability": 1.0,
        "count": [1, 1],
        "kinds": ["concave"],
        "concave": {"buckled": 0, "creased": 0},
    }
    scene = Generator(Config.from_values({"damage": values}), seed=4).scene(0)
    (dent,) = scene.damages
    bulge = replace(dent, depth_mm=-dent.depth_mm, origin_mm=tuple(np.add(dent.origin_mm, 1e-3)))
    points = np.array(dent.origin_mm) + np.linspace(-200, 200, 50)[:, None] * np.array(dent.along)
    body = "vec4 f(vec4 x) { return vec4(float(damage_at(x.xyz).value), 0.0, 0.0, 0.0); }"
    alone, _ = asked(gl, scene, body, points)
    both, _ = asked(gl, replace(scene, damages=(dent, bulge)), body, points)
    assert (alone[:, 0] > 0).all()
    assert (both[:, 0] == 0).all()


@pytest.mark.parametrize("column", range(3))
def test_bend_is_the_derivative_of_the_displacement(gl, column):
    """Test `axis` and `concave`; along the folds of dents and torn rims the bend is approximate.

    Points where a `concave` field fades inward are skipped. The bend omits the gradient of the
    fade, which turns neither the damaged sheet nor those across it. Points where the
    displacement is far from linear within a step lie at a crease and are skipped too.
    """
    body = f"vec4 f(vec4 x) {{ return vec4(damage_at(x.xyz).bend[{column}], 0.0); }}"
    step = 0.5 * np.eye(3)[column]
    for scene, points in scenes_with("axis", "concave"):
        fading = np.zeros(len(points), bool)
        for damage in scene.damages:
            if damage.kind == "concave":
                w = np.abs(local_coordinates(damage, points)[2])
                fading |= (w > FADE_START_MM - 1) & (w < FADE_END_MM + 1)
        out, _ = asked(gl, scene, body, points)
        here, after, before = (deform(scene.damages, points + s) for s in (0 * step, step, -step))
        wanted = after - before
        creased = np.abs(after + before - 2 * here).max(axis=1) > 4e-3
        assert creased.mean() < 0.1
        sure = ~fading & ~creased
        assert np.abs(wanted[sure] - 2 * step).max() > 0.02
        np.testing.assert_allclose(out[sure, :3], wanted[sure], rtol=6e-3, atol=6e-3)

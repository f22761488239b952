"""Damaged door gear: what of the mesh it moves, and its place among seals and other damages."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from fastgen import Config, Generator
from fastgen.errors import ConfigError
from fastgen.geometry.container import build_container
from fastgen.geometry.damage_law import amount_mm, deform, faces
from fastgen.scene import Seal
from fastgen.scene.check import check_scene
from fastgen.scene.container_kinds import KINDS
from fastgen.scene.door_gear import bar_stations_mm, hasp_mm


def scenes(count, **gear):
    damage = {"probability": 1, "count": [1, 3], "kinds": ["door_gear"], "door_gear": gear}
    values = {"damage": damage, "seals": {"probability": 1, "second": 1}}
    generator = Generator(Config.from_values(values), seed=8)
    return [generator.scene(index) for index in range(count)]


def moved_by_chart(scene):
    """Return the mesh and the displacement [V] in mm of each of its vertices."""
    mesh = build_container(scene.container.kind, scene.container.profiles)
    rest = mesh.positions_mm.astype(np.float64)
    return mesh, np.linalg.norm(deform(scene.damages, rest) - rest, axis=1)


def bar_at(y):
    """Return the number of the bar at y, independently of the package's own rule."""
    return [-545.0, -130.0, 130.0, 545.0].index(y)


@pytest.mark.parametrize("kind", KINDS)
def test_bars_have_vertices_at_their_stations_only(kind):
    mesh = build_container(kind)
    z = mesh.positions_mm[mesh.chart == mesh.chart_index("door.bar.2"), 2]
    np.testing.assert_allclose(np.unique(z), bar_stations_mm(KINDS[kind].height_mm), atol=1e-3)


def test_a_bent_bar_is_drawn_where_its_field_puts_it():
    """The field is linear between the vertices of the bar, and only bar and brackets move."""
    lengths = set()
    for scene in scenes(25, gasket=0, missing=0, open=0):
        mesh, moved = moved_by_chart(scene)
        names = {mesh.charts[chart].name for chart in mesh.chart[moved > 0]}
        bent = {f"door.bar.{bar_at(damage.origin_mm[1])}" for damage in scene.damages}
        assert bent <= names
        assert {name.split(".")[1] for name in names} <= {"bar", "brackets"}
        for damage in scene.damages:
            own = mesh.chart == mesh.chart_index(f"door.bar.{bar_at(damage.origin_mm[1])}")
            corners = mesh.positions_mm.astype(np.float64)[
                mesh.triangles[own[mesh.triangles[:, 0]]]
            ]
            shares = np.random.default_rng(0).dirichlet((1, 1, 1), len(corners))[..., None]
            drawn = (shares[..., 0] * amount_mm(damage, corners)).sum(axis=1)
            np.testing.assert_allclose(
                amount_mm(damage, (shares * corners).sum(axis=1)), drawn, atol=0.05
            )
            assert amount_mm(damage, corners).min() == pytest.approx(damage.depth_mm, abs=0.05)
            lengths.add(round(damage.size_mm[0], -1))
    assert len(lengths) >= 3


def test_a_missing_bar_takes_its_cams_and_handle_along():
    """All of them are behind the leaf; brackets, keepers, the catch and the leaf stay."""
    seen = set()
    for scene in scenes(12, gasket=0, missing=1):
        mesh, moved = moved_by_chart(scene)
        rest = mesh.positions_mm.astype(np.float64)
        inset = KINDS[scene.container.kind].length_mm / 2 - rest[:, 0]
        for damage in scene.damages:
            bar = bar_at(damage.origin_mm[1])
            seen.add(bar)
            gone = np.zeros(len(rest), bool)
            for part in ("bar", "cams"):
                gone |= mesh.chart == mesh.chart_index(f"door.{part}.{bar}")
            y, z = hasp_mm(bar)
            handle = mesh.chart == mesh.chart_index(f"door.handle.{bar}")
            lever = (np.abs(rest[:, 2] - z) < 14.5) & (inset > 21) & (inset < 35)
            gone |= handle & (lever | (np.abs(rest[:, 1] - y) > 200))
            assert (inset[gone] + moved[gone] > 100).all()
            beside = np.abs(rest[:, 1] - damage.origin_mm[1]) < 30
            assert not moved[~gone & beside].any()
            moved[gone] = 0
        assert not moved.any()
    assert seen == {0, 1, 2, 3}


def test_an_open_handle_swings_about_its_bar():
    for scene in scenes(12, gasket=0, missing=0, open=1):
        mesh, moved = moved_by_chart(scene)
        for damage in scene.damages:
            toward = np.array(damage.along)
            bar_y = float(damage.origin_mm[1] - 150 * toward[1])
            bar = bar_at(round(bar_y))
            away = np.abs(mesh.positions_mm[:, 1] - bar_y)
            own = (mesh.chart == mesh.chart_index(f"door.handle.{bar}")) & (moved > 0.05 * 60)
            expected = away[own] / 300 * abs(damage.depth_mm)
            np.testing.assert_allclose(moved[own], expected, atol=1.0)
            assert away[own].max() == pytest.approx(300, abs=0.1)
            moved[own] = 0
        assert moved.max() < 1.0


@pytest.mark.parametrize("kind", KINDS)
def test_the_lip_of_the_gasket_is_hidden_until_a_damage_moves_it(kind):
    """Rays from all sides toward the middles of its triangles meet another part first."""
    mesh = build_container(kind)
    surface = trimesh.Trimesh(mesh.positions_mm, mesh.triangles, process=False)
    is_lip = mesh.chart[mesh.triangles[:, 0]] == mesh.chart_index("door.lip")
    targets = mesh.positions_mm[mesh.triangles[is_lip]].astype(np.float64).mean(axis=1)
    toward = np.random.default_rng(0).normal(size=(40, 3))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    start = (targets + 20_000.0 * toward[:, None]).reshape(-1, 3)
    first = surface.ray.intersects_first(start, np.repeat(-toward, len(targets), axis=0))
    assert (first >= 0).all()
    assert not is_lip[first].any()


def test_a_hanging_gasket_moves_the_lip_alone_and_hangs_out():
    free = 0
    for scene in scenes(20, gasket=1):
        (damage,) = scene.damages  # there is one lip
        mesh, moved = moved_by_chart(scene)
        lip = mesh.chart == mesh.chart_index("door.lip")
        assert not moved[~lip].any()
        z = mesh.positions_mm[:, 2]
        low, high = z[lip].min(), z[lip].max()
        assert moved[lip].max() > 0.9 * abs(damage.depth_mm)
        (top,) = set(moved[lip & (z == high)].tolist())
        assert top == 0.0
        ends_free = moved[lip & (z == low)].min() > 0.9 * abs(damage.depth_mm)
        assert ends_free == (damage.shape == (-1.0,))
        free += ends_free
        # the farthest point is in front of the leaf, whose face is 58 mm behind the castings
        farthest = deform(scene.damages, mesh.positions_mm[lip].astype(np.float64))[:, 0].max()
        assert farthest > KINDS[scene.container.kind].length_mm / 2 - 58.0
    assert 2 <= free <= 15


def test_only_cameras_before_the_door_face_a_hanging_gasket():
    for scene in scenes(12, gasket=1):
        (damage,) = scene.damages
        before = KINDS[scene.container.kind].length_mm / 2 + 4000.0
        assert faces(damage, (before, 3000.0, 1300.0))
        for side in (-6000.0, 6000.0):
            assert not faces(damage, (0.0, side, 1300.0))


def test_a_second_hanging_gasket_is_refused():
    scene = scenes(1, gasket=1)[0]
    with pytest.raises(ConfigError, match="2 damage the gasket of the door"):
        check_scene(replace(scene, damages=(*scene.damages, *scene.damages)))


def test_a_bar_has_one_damage_and_then_no_seal():
    sealed = 0
    for scene in scenes(60):
        bars = [
            "lip"
            if d.form == "hanging_gasket"
            else int(np.searchsorted([-340, 0, 340], d.origin_mm[1]))
            for d in scene.damages
        ]
        assert len(bars) == len(set(bars)) >= 1
        assert not {seal.hasp for seal in scene.seals} & set(bars)
        sealed += len(scene.seals)
    assert sealed > 20


def test_a_scene_with_a_seal_at_a_missing_bar_is_refused():
    scene = scenes(1, gasket=0, missing=1)[0]
    damage = scene.damages[0]
    seal = Seal("bolt", bar_at(damage.origin_mm[1]))
    with pytest.raises(ConfigError, match=f"seals: one is at hasp {seal.hasp}, but .* locking bar"):
        check_scene(replace(scene, damages=(damage,), seals=(seal,)))
    with pytest.raises(ConfigError, match=f"2 damage the door gear of locking bar {seal.hasp}"):
        check_scene(replace(scene, damages=(damage, damage), seals=()))


def test_only_the_uncovered_door_counts_for_a_missing_bar():
    """Seen at a slant, the moved bar is beside the strip that it uncovers, hidden by the leaf."""
    values = {
        "damage": {
            "probability": 1,
            "count": [1, 1],
            "kinds": ["door_gear"],
            "door_gear": {"gasket": 0, "missing": 1},
        },
        "spreader": {"probability": 0},
    }
    with Generator(Config.from_values(values), seed=8, size=(256, 256), quality="draft") as made:
        scene = made.scene(0)
        x, y, _ = scene.damages[0].origin_mm
        camera = replace(
            scene.cameras[0], name="slant", position_mm=(x + 4000.0, y + 2500.0, 1300.0),
            target_mm=(x, y, 1300.0), focal_mm=35.0, roll_deg=0.0, lens=None,
        )  # fmt: skip
        (item,) = (
            each
            for each in made.render(scene=scene, camera=camera).objects
            if each.class_name == "door_gear"
        )
    assert item.severity_mm == scene.damages[0].size_mm[0]
    assert item.visible_fraction > 0.85
    assert np.abs(np.subtract(item.amodal_bbox, item.bbox)).max() <= 2

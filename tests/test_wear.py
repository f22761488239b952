"""Wear where it happens: rust, streaks of dirt, scrapes, bleaching and repainted patches."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from fastgen import Config
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Spreader
from fastgen.srgb import DECODED
from tests.plain import EVEN_PAINT, NO_REPAIRS

TEXEL_MM = 10.0
PAINT = (0.8, 0.2, 0.2)
FORKS_MM, SPREADER_MM, BETWEEN_MM = (300, 500), (2250, 2350), (1000, 1800)


@pytest.fixture(scope="module")
def bare(generators):
    """Generator, and a scene whose 40-foot container is clean paint without decals."""
    config = Config.from_values(
        {
            "container": {"kinds": {"40": 1}},
            "damage": {"probability": 0},
            "weather": {"wet_probability": 0},
            "surface": {**EVEN_PAINT, "rust_scale_mm": 200},
        }
    )
    generator = generators(config, 3, (64, 64))
    scene = generator.scene(0)
    paint = replace(scene.surface.paint, albedo=PAINT)
    surface = replace(scene.surface, paint=paint)
    return generator, replace(scene, decals=(), spreader=Spreader(), surface=surface)


def worn(scene, **parts):
    """Return the scene with other fields of parts of its surface."""
    changed = {part: replace(getattr(scene.surface, part), **new) for part, new in parts.items()}
    return replace(scene, surface=replace(scene.surface, **changed))


@lru_cache(4)  # tests compare several scenes with one of them
def colors_of(generator, scene):
    return generator.bake(scene, TEXEL_MM).base_color[::-1]


def baked(generator, scene, *faces):
    """Return the linear albedo [H, W, 3] of the sheet of each face; row 0 is the lowest."""
    mesh = PreparedScene(scene).container
    colors = colors_of(generator, scene)
    found = []
    for face in faces:
        chart = mesh.charts[mesh.chart_index(face)]
        x, y, width, height = (np.array(chart.rect_mm) / TEXEL_MM).astype(int)
        found.append(DECODED[colors[y + 1 : y + height - 1, x + 1 : x + width - 1]])
    return found


def changed(generator, scene, face, clean):
    """Return how much the albedo [H, W] of a face differs from that of `clean`."""
    (one,), (other,) = (baked(generator, each, face) for each in (scene, clean))
    return np.abs(one - other).mean(axis=-1)


def rows(band_mm):
    return slice(*(int(limit / TEXEL_MM) for limit in band_mm))


def test_without_wear_the_sheet_is_plain_paint(bare):
    generator, scene = bare
    for sheet in baked(generator, scene, "front", "back", "no_door"):
        np.testing.assert_allclose(sheet, np.broadcast_to(PAINT, sheet.shape), atol=0.01)
        assert len(np.unique(sheet.reshape(-1, 3), axis=0)) == 1


@pytest.mark.parametrize("coverage", [0.04, 0.12])
def test_rust_covers_the_given_share_of_the_sheet(bare, coverage):
    """The mean of three noise offsets. Black rust on white paint is darker than any stain."""
    generator, scene = bare
    rust = {"coverage": coverage, "albedo": (0.0, 0.0, 0.0), "scale_mm": 1400.0}
    rusty = worn(scene, paint={"albedo": (0.94, 0.94, 0.94)}, rust=rust)
    mesh = PreparedScene(rusty).container
    corners = mesh.atlas_mm[mesh.triangles].astype(float)
    charts = [mesh.charts[i] for i in mesh.chart[mesh.triangles[:, 0]]]
    mine = corners[[chart.material == "paint_sheet" for chart in charts]]
    area = np.abs(np.linalg.det(mine[:, 1:] - mine[:, :1]))
    rng = np.random.default_rng(0)
    drawn = mine[rng.choice(len(mine), 100_000, p=area / area.sum())]
    points = np.einsum("nk,nkc->nc", rng.dirichlet((1, 1, 1), len(drawn)), drawn)
    shares = []
    for offset in ((0.0, 0.0), (20000.0, 7000.0), (33000.0, 41000.0)):
        surface = replace(rusty.surface, noise_offset_mm=offset)
        atlas = generator.bake(replace(rusty, surface=surface), 8.0)
        height, width = atlas.base_color.shape[:2]
        u, v = atlas.uv(points).T
        albedo = DECODED[atlas.base_color[(v * height).astype(int), (u * width).astype(int)]]
        shares.append((albedo.mean(axis=1) < 0.1).mean())
    assert np.mean(shares) == pytest.approx(coverage, rel=0.12)


def test_rust_keeps_to_edges_and_to_the_foot_of_walls(bare):
    generator, scene = bare
    rusty = worn(scene, rust={"coverage": 0.05, "albedo": (0.0, 0.0, 0.0)})
    for sheet in baked(generator, rusty, "front", "back"):
        rust = sheet[..., 0] < 0.1 * PAINT[0]
        panel = rust[rows((800, 1700)), 50:-50].mean()
        foot, top = rust[rows((20, 120))].mean(), rust[-12:-2].mean()
        ends = rust[:, 2:10].mean()
        assert foot > 12 * panel
        assert foot > 1.5 * top
        assert top > 4 * panel
        assert ends > 4 * panel


def test_rails_and_castings_are_rustier_than_panels(bare):
    generator, scene = bare
    rusty = worn(scene, rust={"coverage": 0.05, "albedo": (0.0, 0.0, 0.0)})
    mesh = PreparedScene(rusty).container
    colors = generator.bake(rusty, TEXEL_MM)
    height, width = colors.base_color.shape[:2]
    middle = mesh.atlas_mm[mesh.triangles].astype(float).mean(axis=1)
    u, v = colors.uv(middle).T
    rust = colors.base_color[(v * height).astype(int), (u * width).astype(int), 0] < 90
    charts = [mesh.charts[i] for i in mesh.chart[mesh.triangles[:, 0]]]
    (sheet,) = baked(generator, rusty, "front")
    panel = (sheet[rows((800, 1700)), 50:-50, 0] < 0.1 * PAINT[0]).mean()
    for name in ("rail.bottom", "post", "casting"):
        mine = np.array([name in (c.material, *(c.name[: len(name)],)) for c in charts])
        assert mine.sum() > 20
        assert rust[mine].mean() > 6 * panel


def test_dirt_runs_down_from_the_top_in_streaks(bare):
    generator, scene = bare
    dirty = worn(scene, dirt={"strength": 0.0, "streaks": 1.0})
    dirt = changed(generator, dirty, "front", scene)
    top, middle, bottom = dirt[-50:], dirt[90:140], dirt[:50]
    assert top.mean() > 1.5 * middle.mean()
    assert middle.mean() > 1.5 * bottom.mean()
    across = np.corrcoef(dirt[150, :-15], dirt[150, 15:])[0, 1]
    down = np.corrcoef(dirt[150], dirt[165])[0, 1]
    assert down > 0.6
    assert down > across + 0.2


def test_scrapes_lie_at_the_heights_of_forks_and_spreaders_on_outer_flats(bare):
    generator, scene = bare
    scraped = worn(scene, scratches={"scrapes": 0.6})
    flats = PreparedScene(scene).container.flats["front"]
    bare_steel = changed(generator, scraped, "front", scene)
    forks, spreader, between = (
        bare_steel[rows(band)].mean() for band in (FORKS_MM, SPREADER_MM, BETWEEN_MM)
    )
    assert min(forks, spreader) > 0.01
    assert between < 1e-3
    pitch, width = flats[1][0] - flats[0][0], flats[0][1] - flats[0][0]
    x = (np.arange(bare_steel.shape[1]) + 1.5) * TEXEL_MM
    away = np.abs((x - flats[0][0] - width / 2 + pitch / 2) % pitch - pitch / 2)
    outer, inner = away < width / 2, away > pitch / 2 - width / 2
    assert bare_steel[rows(FORKS_MM)][:, inner].max() < 1e-3
    assert bare_steel[rows(FORKS_MM)][:, outer].mean() > 0.03


def test_rust_runs_down_below_scrapes(bare):
    generator, scene = bare
    rust = {"coverage": 0.03, "albedo": (0.0, 0.0, 0.0)}
    scrapes = {"scrapes": 0.6}
    steel = changed(generator, worn(scene, scratches=scrapes), "front", scene)
    both = worn(scene, scratches=scrapes, rust=rust)
    stain = changed(generator, both, "front", worn(scene, rust=rust))
    for scraped, below in ((SPREADER_MM, (1850, 2050)), (FORKS_MM, (20, 150))):
        above, stained = (
            part[rows(band)].mean(axis=0) for part, band in ((steel, scraped), (stain, below))
        )
        assert stained[above > np.quantile(above, 0.9)].mean() > 2 * stained[above < 1e-3].mean()
        assert np.corrcoef(above, stained)[0, 1] > 0.3
    assert stain[rows((1000, 1200))].mean() < 0.2 * stain[rows((1850, 2050))].mean()


def test_bleached_paint_is_lighter_and_greyer_and_uneven(bare):
    generator, scene = bare
    (sheet,) = baked(generator, worn(scene, paint={"bleach": 0.6}), "front")
    mean = sheet.mean(axis=(0, 1))
    assert mean[1] > 1.2 * PAINT[1]
    assert mean[0] / mean[1] < 0.8 * PAINT[0] / PAINT[1]
    assert 0.005 < sheet[..., 1].std() < 0.1


def test_patches_are_paint_beside_all_other_decals():
    scenes = []
    for number in (0, 2):
        # repairs are patches as well; runs and old codes depend on the other decals of their face
        others = {"runs": 0, "identifiers": {"painted_over": 0}, **NO_REPAIRS}
        values = {"markings": {"patches_per_face": [number, number], **others}}
        scenes.append(Config.from_values(values))
    without, with_patches = ([sample(config, index) for index in range(6)] for config in scenes)
    patches = 0
    for one, other in zip(without, with_patches, strict=True):
        added = [decal for decal in other.decals if decal.art == "patch"]
        assert tuple(decal for decal in other.decals if decal.art != "patch") == one.decals
        for patch in added:
            for decal in other.decals:
                if decal is not patch and decal.face == patch.face:
                    apart = np.abs(np.subtract(decal.center_mm, patch.center_mm))
                    reach = (np.array(decal.size_mm) + patch.size_mm) / 2
                    assert (apart > 0.9 * reach).any()
        patches += len(added)
    assert patches > 20


def test_a_patch_has_its_color(bare):
    generator, scene = bare
    values = {"markings": {"patches_per_face": [1, 1]}}
    patch = next(d for d in sample(Config.from_values(values), 0).decals if d.art == "patch")
    size = (400.0, 300.0)
    place = {"face": "front", "center_mm": (3000.0, 1200.0), "size_mm": size}
    patch = replace(patch, albedo=(0.1, 0.3, 0.5), wear=0.0, **place)
    (sheet,) = baked(generator, replace(scene, decals=(patch,)), "front")
    blue = sheet[..., 2] > 0.35
    assert blue.sum() * TEXEL_MM**2 == pytest.approx(np.prod(size), rel=0.05)
    np.testing.assert_allclose(sheet[120, 300], (0.1, 0.3, 0.5), atol=0.01)


def sample(config, index):
    return sample_scene(config, 5, index, {"port_quay_noon": 1.0})

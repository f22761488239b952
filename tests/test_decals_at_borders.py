"""Decals that reach beyond their sheet end at its border, in the image and in every label."""

from dataclasses import replace

import numpy as np
import pytest

from fastgen import Config
from fastgen.decals.glyphs import glyph_tiles
from fastgen.geometry.prepared_scene import PreparedScene
from fastgen.scene import Camera, Decal
from fastgen.scene.faces import FACE_AXES, SHEET_FACES
from tests.plain import EVEN_PAINT, bare

CONFIG = Config.from_values({"surface": EVEN_PAINT, "damage": {"probability": 0}})
SIZE = (480, 480)
SLACK_MM = 3.0


def sheet_of(mesh, face):
    """Return the triangles [T, 3, 3] of a sheet in the container frame."""
    number = mesh.chart_index(face)
    return mesh.positions_mm[mesh.triangles[mesh.chart[mesh.triangles[:, 0]] == number]]


def facing(mesh, face, turn_deg=25.0):
    """Return a camera that sees all of a face, a little from the side."""
    corners = sheet_of(mesh, face).reshape(-1, 3)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    axes = FACE_AXES[face]
    out, right, up = (np.array(axis, float) for axis in (axes.out, axes.right, axes.up))
    turn = np.deg2rad(turn_deg)
    way = np.cos(turn) * out + np.sin(turn) * right + 0.15 * up
    reach = max(np.ptp(corners @ right), np.ptp(corners @ up))
    eye = middle + (way / np.linalg.norm(way)) * 1.6 * reach
    return Camera("near", tuple(eye.tolist()), tuple(middle.tolist()), 36.0)


def overhanging(mesh, face):
    """Return decals of several kinds across each side of a sheet, and one across a corner."""
    *_, width, height = mesh.charts[mesh.chart_index(face)].rect_mm
    font = sorted(glyph_tiles()[1])[0]
    text = Decal("text", "text", face, (0, 0), (1, 1), lines=("HHHHHH",), font=font, cap_mm=300.0)
    text = replace(text, size_mm=text.lettering.size_mm)
    square = Decal("marker", "C3.1", face, (0, 0), (700.0, 700.0), art="C3.1")
    sign = replace(square, kind="sticker", class_name="C9.1", art="no_walking", rotation_deg=20.0)
    lamp = replace(square, kind="triangle", class_name="C8.1", art="elevated_temperature")
    return (
        replace(text, center_mm=(0.4 * width, height - 20.0)),
        replace(text, center_mm=(width, 0.5 * height)),
        replace(square, center_mm=(30.0, 0.3 * height)),
        replace(square, center_mm=(0.7 * width, -100.0)),
        replace(sign, center_mm=(0.75 * width, height)),
        replace(lamp, center_mm=(width, 0.1 * height)),
        replace(sign, center_mm=(100.0, height - 100.0)),
    )


@pytest.fixture(scope="module", params=SHEET_FACES)
def seen(request, generators):
    """Face, mesh, a scene with decals over the borders of its sheet, and the scene's sample."""
    generator = generators(CONFIG, seed=4, size=SIZE, quality="draft")
    plain = bare(generator.scene(0))
    mesh = PreparedScene(plain).container
    face = request.param
    scene = replace(plain, decals=overhanging(mesh, face))
    camera = facing(mesh, face)
    images = [generator.render(scene=s, camera=camera, layer="decals") for s in (scene, plain)]
    return face, mesh, scene, *images


def places_mm(sample):
    """Return the points in the container frame [H, W, 3] that the pixels show, from the depth."""
    origin, rays = sample.view.rays()
    along = rays @ sample.view.rotation[2]
    return origin + 1e3 * (sample.depth / along)[..., None] * rays


def on_sheet(points, mesh, face):
    """Test which points [N, 3] lie in the bounds of a sheet."""
    corners = sheet_of(mesh, face).reshape(-1, 3)
    low, high = corners.min(axis=0) - SLACK_MM, corners.max(axis=0) + SLACK_MM
    return ((points >= low) & (points <= high)).all(axis=-1)


def test_ids_and_ink_are_on_the_sheet_alone(seen):
    face, mesh, _, printed, plain = seen
    points = places_mm(printed)
    labelled = np.isin(printed.ids, [item.id for item in decals_of(printed)])
    changed = (printed.image != plain.image).any(axis=2)
    assert labelled.sum() > 500
    assert changed.sum() > 500
    assert on_sheet(points[labelled], mesh, face).all()
    assert on_sheet(points[changed], mesh, face).all()


def decals_of(sample):
    return [item for item in sample.objects if item.quad]


def test_boxes_polygons_and_fractions_end_at_the_sheet(seen):
    face, mesh, scene, printed, _ = seen
    view = printed.view
    corners, _ = view.project(sheet_of(mesh, face).reshape(-1, 3))
    found = decals_of(printed)
    assert len(found) == len(scene.decals)
    for item, decal in zip(found, scene.decals, strict=True):
        polygon = np.array(item.polygon).reshape(-1, 2)
        assert len(polygon) == 64
        outer = np.array([polygon.min(axis=0), polygon.max(axis=0)])
        # corrugation bends the border of a sheet by a pixel or two
        assert (outer[0] >= corners.min(axis=0) - 2).all()
        assert (outer[1] <= corners.max(axis=0) + 2).all()
        if decal.kind == "text":
            np.testing.assert_allclose(outer, cut_rectangle(mesh, decal, view), atol=1.0)
        boxes = np.array([item.amodal_bbox, item.bbox or item.amodal_bbox]).reshape(2, 2, 2)
        assert (boxes[:, 0] >= outer[0] - 2).all()
        assert (boxes[:, 1] <= outer[1] + 2).all()
        if face in ("front", "back", "roof"):  # nothing hides decals on these sheets
            assert item.visible_fraction > 0.9


def cut_rectangle(mesh, decal, view):
    """Return bounds [2, 2] in pixels of an upright decal's rectangle within its sheet."""
    *_, width, height = mesh.charts[mesh.chart_index(decal.face)].rect_mm
    half = np.array(decal.size_mm) / 2
    low = np.maximum(np.array(decal.center_mm) - half, 0)
    high = np.minimum(np.array(decal.center_mm) + half, (width, height))
    t = np.linspace(0, 1, 200)[:, None]
    edges = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    line = [
        np.array(a) + t * (np.array(b) - np.array(a))
        for a, b in zip(edges, [*edges[1:], edges[0]], strict=True)
    ]
    points, _ = mesh.sheet_to_surface(decal.face, np.concatenate(line))
    pixels, _ = view.project(points)
    return np.array([pixels.min(axis=0), pixels.max(axis=0)])

"""The fast_or_true example: a run on fake Cycles images, and tests of its parts."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from common.intervals import interval
from common.marker_walls import CAMERAS, CONFIG, CROP_PX, ELEMENTS, crops, crowded
from common.traced import display
from fast_or_true import FIRST_TRAINING, SCENE_SEED, SIZE

from fastgen import Generator
from fastgen.sample import Object

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def scenes():
    generator = Generator(CONFIG, SCENE_SEED, SIZE)
    indices = (0, FIRST_TRAINING, FIRST_TRAINING + 1)
    return [crowded(generator.scene(index)) for index in indices]


def run(folder):
    command = [sys.executable, "examples/fast_or_true.py", "--smoke", "--results", str(folder)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_WAIT_POLICY": "PASSIVE"}
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)


def test_it_runs_on_fake_images_and_reports_missing_ones(tmp_path, scenes):
    refused = run(tmp_path)
    assert refused.returncode != 0
    assert "--blender-python" in refused.stderr

    folder = tmp_path / "cache" / "traced"
    folder.mkdir()
    rng = np.random.default_rng(1)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for scene in scenes:
        stem = f"{scene.seed}_{scene.index}"
        (folder / f"{stem}.scene.json").write_text(scene.to_json())
        for camera in CAMERAS:
            pixels = rng.random((*SIZE, 3)).astype(np.float16)
            OpenEXR.File(header, {"RGB": pixels}).write(str(folder / f"{stem}_{camera}.exr"))
            (folder / f"{stem}_{camera}.json").write_text(json.dumps({"core_s": 3.0}))
    done = run(tmp_path)
    assert done.returncode == 0, done.stderr
    made = json.loads((tmp_path / "fast_or_true.json").read_text())
    assert made["core_s_per_image"]["traced"] == 3.0
    assert made["scores"]["traced, 4 images"]["seeds"] == 2
    assert "The same rendering time" in (tmp_path / "fast_or_true.md").read_text()
    for chart in ("", "_elements", "_crops"):
        assert (tmp_path / f"fast_or_true{chart}.png").stat().st_size > 1000


def test_crowded_ends_have_many_markers_without_overlaps(scenes):
    for scene in scenes:
        for face in ("door", "no_door"):
            covered = np.zeros((3000, 3000), np.int32)
            for decal in (d for d in scene.decals if d.face == face):
                # these belong to markers that the crowd replaces
                assert decal.art not in ("marker_holder", "marker_rivets")
                layer = np.zeros_like(covered, np.uint8)
                (x, y), (w, h) = decal.center_mm, np.array(decal.size_mm) / 2
                shape = [(x - w, y), (x, y + h), (x + w, y), (x, y - h)]
                if decal.kind != "marker":
                    shape = [(x - w, y - h), (x - w, y + h), (x + w, y + h), (x + w, y - h)]
                covered += cv2.fillPoly(layer, [np.array(shape).round().astype(np.int32)], 1)
            assert covered.max() == 1
        assert sum(d.kind == "marker" and d.face in ("door", "no_door") for d in scene.decals) > 20


def test_elements_do_not_move_markers_or_cameras(scenes):
    for change in ELEMENTS.values():
        for scene in scenes:
            changed = change(scene)
            assert changed.cameras == scene.cameras
            old, new = (
                [(d.class_name, d.center_mm, d.face) for d in s.decals if d.kind == "marker"]
                for s in (scene, changed)
            )
            assert old == new


def test_a_crop_has_its_box_in_the_middle():
    image = np.zeros((60, 80, 3), np.uint8)
    image[20:40, 30:50] = 255  # 20 pixels of the box fill 20 of the crop's 24: 24 / 1.2
    box = (30.0, 20.0, 50.0, 40.0)
    item = Object(2, "C1.1", 1, (30, 20, 50, 40), box, 400, 1.0, False)
    expected = np.zeros((CROP_PX, CROP_PX, 3), np.uint8)
    expected[2:22, 2:22] = 255
    np.testing.assert_array_equal(crops(image, [item])[0], expected)


def test_greys_below_the_shoulder_are_an_offset_and_the_srgb_curve():
    grey = np.array([0.1, 0.3, 0.6])
    shown = display(np.repeat(grey[None, :, None], 3, axis=2) / 2, exposure=2.0)[0, :, 0]
    expected = 255 * (1.055 * (grey - 0.04) ** (1 / 2.4) - 0.055)
    assert np.abs(shown - expected).max() <= 0.5


def test_interval_is_binomial_if_every_item_is_its_own_scene():
    rng = np.random.default_rng(2)
    right = np.repeat(rng.random((1, 400)) < 0.7, 3, axis=0).astype(float)
    found = interval(right, np.arange(400))
    half = 196 * np.sqrt(0.7 * 0.3 / 400)
    assert found.mean == pytest.approx(100 * right.mean())
    assert (found.high - found.low) / 2 == pytest.approx(half, rel=0.1)


def test_interval_grows_if_all_items_of_a_scene_agree():
    scenes = np.repeat(np.arange(20), 20)
    right = (scenes % 2 == 0).astype(float)[None]
    together, apart = interval(right, scenes), interval(right, np.arange(400))
    assert together.high - together.low > 3 * (apart.high - apart.low)

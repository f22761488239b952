"""Crops of hasps, the format that writes them, and the items of the seal task."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from fastgen.config.config import Config
from fastgen.dataset.generate import generate
from fastgen.dataset.job import Job
from fastgen.dataset.verify import examine
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.geometry.seals import hasp_middle_mm
from fastgen.labels.hasp_crops import LEAST_PX, hasp_crops
from fastgen.render.settings import RenderSettings
from fastgen.scene import Camera, Seal
from fastgen.torch import (
    ContainerDataset,
    class_counts,
    class_names,
    class_weights,
    collate_seal,
)

pytestmark = pytest.mark.usefixtures("no_workers")

SEALS = (Seal("bolt", 0), Seal("cable", 1), Seal("bolt", 2, "hanging"))

CLOSE = {
    "face": "door",
    "focal_mm": 28.0,
    "distance_mm": [1700, 2200],
    "target_shift_mm": [-200, 200],
}


def at_door(scene, hasp, offset_mm, shift_mm=(0.0, 0.0, 0.0)):
    """Return a camera at an offset from a hasp that looks at it, or beside it."""
    middle = hasp_middle_mm(scene.container.kind, hasp)
    place, target = (middle + offset_mm).tolist(), (middle + shift_mm).tolist()
    return Camera("near", tuple(place), tuple(target), 45.0)


def test_crops_show_each_hasp_and_know_if_it_is_sealed():
    plain = {"damage": {"probability": 0}, "spreader": {"probability": 0}}
    with Generator(Config.from_values(plain), seed=5, size=(640, 640)) as generator:
        scene = replace(generator.scene(0), seals=SEALS)
        camera = at_door(scene, 1, (2500.0, 0.0, 0.0), (0.0, 430.0, 70.0))
        sample = generator.render(scene=scene, camera=camera)
        crops = {crop.hasp: crop for crop in hasp_crops(sample)}
        assert {hasp: crop.sealed for hasp, crop in crops.items()} == {
            0: True, 1: True, 2: False, 3: False,
        }  # fmt: skip
        x, y = sample.view.project(hasp_middle_mm(scene.container.kind, 3)[None])[0][0].astype(int)
        height, width = crops[3].pixels.shape[:2]
        assert min(height, width) >= LEAST_PX
        assert height / width == pytest.approx(1, abs=0.2)
        middle = crops[3].pixels[3 + round((height - 6) * 90 / 260), width // 2]
        assert np.abs(middle.astype(int) - sample.image[y, x]).max() < 40
        afar = generator.render(scene=scene, camera=at_door(scene, 1, (9000.0, 0.0, 0.0)))
        assert not list(hasp_crops(afar))
        along = generator.render(scene=scene, camera=at_door(scene, 1, (300.0, 1200.0, 0.0)))
        assert all(crop.hasp != 1 for crop in hasp_crops(along))


def test_the_format_writes_a_folder_per_class(tmp_path):
    config = Config.from_values(
        {
            "seals": {"probability": 0.8},
            "cameras": {"near": CLOSE},
            "container": {"kinds": {"20": 1}},
        }
    )
    render = RenderSettings((512, 512), "draft")
    out = str(tmp_path / "made")
    made_of = Job(out, 8, config=config, seed=3, render=render, also=("seal", "ids"))
    counted = generate(made_of, 1)["counts"]
    made = sorted((tmp_path / "made").glob("seal/*/*/*.png"))
    folders = {path.parent.name for path in made}
    assert folders == {"open", "sealed"}
    assert not examine(out).faults
    for path in made:
        stem, hasp = path.stem.rsplit("_", 1)
        split = path.parent.parent.name
        facts = json.loads((tmp_path / f"made/scenes/{split}/{stem}.json").read_text())
        sealed = {s["hasp"] for s in facts["scene"]["seals"] if s["state"] == "locked"}
        assert (int(hasp) in sealed) == (path.parent.name == "sealed")
        assert {o["id"] for o in facts["objects"] if o["class_name"] == "seal"} == {
            60001 + s["hasp"] for s in facts["scene"]["seals"]
        }
    assert sum(c["hasps_open"] + c["hasps_sealed"] for c in counted.values()) == len(made)


def test_items_of_the_seal_task_are_the_crops_with_their_labels():
    config = Config.from_values({"seals": {"probability": 0.8}, "cameras": {"near": CLOSE}})
    render = RenderSettings((512, 512), "draft")
    data = ContainerDataset("seal", config, seed=3, length=2, render=render)
    items = [data[0], data[1]]
    for position, (crops, target) in enumerate(items):
        found = list(hasp_crops(data.sample(position)))
        assert target["labels"].tolist() == [int(crop.sealed) for crop in found]
        assert target["hasps"].tolist() == [crop.hasp for crop in found]
        for crop, made in zip(crops, found, strict=True):
            assert torch.equal(crop, torch.from_numpy(made.pixels.transpose(2, 0, 1).copy()))
    crops, labels = collate_seal(items)
    assert len(crops) == len(labels) > 0
    assert class_names("seal") == ("open", "sealed")
    data.close()


@pytest.mark.parametrize("preset", ["crane", "gate"])
def test_counts_of_hasps_are_close_to_the_labels_of_rendered_crops(preset):
    values = {"seals": {"probability": 1.0, "second": 0.5}}
    config = Config.from_values(values, base=Config.preset(preset))
    data = ContainerDataset("seal", config, seed=2, render=RenderSettings((640, 640), "draft"))
    real = np.zeros(2, int)
    for position in range(6 * len(data.cameras)):
        real += np.bincount(data[position][1]["labels"].numpy(), minlength=2)
    data.close()
    assert real.min() > 1
    counted = class_counts("seal", config, seed=2, size=(640, 640), scenes=6).numpy()
    assert np.abs(counted - real).max() <= 1
    weights = class_weights("seal", config, seed=2, scenes=6).numpy()
    np.testing.assert_allclose(weights, counted.sum() / (2 * counted), rtol=1e-6)


def test_the_seal_task_needs_a_camera_at_the_door():
    assert ContainerDataset("seal").cameras == ("Cr",)
    side = Config.from_values({"cameras": {"side": {**CLOSE, "face": "front"}}})
    with pytest.raises(ConfigError, match="none of side looks at the door"):
        ContainerDataset("seal", side)

"""Scenes without a container, from sampling to files and training targets."""

import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.export import export_glb
from fastgen.generator import Generator
from fastgen.render.settings import RenderSettings
from fastgen.sampling.scene import without_container
from fastgen.scene import Scene
from tests.plain import FEW_DECALS

pytestmark = pytest.mark.usefixtures("no_workers")

SIZE = (320, 240)
EMPTY = Config.from_values({"container": {"absent": 1.0}})


def test_the_configured_share_of_scenes_has_no_container():
    share, count = 0.3, 300
    values = {"container": {"absent": share}, "markings": FEW_DECALS}
    generator = Generator(Config.from_values(values), seed=4)
    absent = sum(not generator.scene(index).container.present for index in range(count))
    assert abs(absent - share * count) < 4 * math.sqrt(share * (1 - share) * count)


def test_scenes_differ_only_in_the_absence_of_the_container():
    generator = Generator(Config.from_values({"container": {"absent": 0.3}}), seed=4)
    plain = Generator(seed=4)
    found = set()
    for index in range(60):
        scene, usual = generator.scene(index), plain.scene(index)
        found.add(scene.container.present)
        assert scene == (usual if scene.container.present else without_container(usual))
    assert found == {True, False}


@pytest.mark.parametrize("quality", ["draft", "balanced", "high"])
def test_surroundings_are_those_around_the_container(generators, quality):
    generator = generators(None, seed=4, size=SIZE, quality=quality)
    for index, camera in ((0, "A"), (1, "Cr")):
        scene = generator.scene(index)
        with_it = generator.render(scene=scene, camera=camera)
        bare = generator.render(scene=without_container(scene), camera=camera, normals=True)
        sky = with_it.cover == 0
        assert 0.1 < sky.mean() < 0.95
        np.testing.assert_array_equal(bare.image[sky], with_it.image[sky])
        assert np.ptp(bare.image[~sky], axis=0).min() > 0
        assert not bare.objects
        assert not bare.ids.any()
        assert not bare.damage.any()
        assert not bare.cover.any()
        assert np.isinf(bare.depth).all()
        assert bare.normals is not None
        assert not bare.normals.any()
        # the buffers of an empty image do not stay empty
        again = generator.render(scene=scene, camera=camera)
        np.testing.assert_array_equal(again.image, with_it.image)


def test_the_camera_model_takes_an_empty_image():
    values = {"container": {"absent": 1.0}, "weather": {"rain_probability": 1.0}}
    config = Config.from_values(values, Config.preset("crane"))
    with Generator(config, seed=4, size=SIZE) as generator:
        sample = generator.render(2, "A")
    assert np.ptp(sample.image) > 0
    assert not sample.objects


def test_a_scene_file_without_the_key_has_a_container():
    scene = Generator(seed=4).scene(0)
    plain = json.loads(scene.to_json())
    del plain["container"]["present"]
    assert Scene.from_json(json.dumps(plain)) == scene
    bare = without_container(scene)
    assert Scene.from_json(bare.to_json()) == bare


def test_an_absent_container_has_no_parts_and_no_file(tmp_path):
    generator = Generator(seed=4, size=SIZE)
    scene = next(s for s in map(generator.scene, range(9)) if s.spreader.present)
    bare = without_container(scene)
    for part in ("decals", "spreader"):
        wrong = replace(bare, **{part: getattr(scene, part)})
        with pytest.raises(ConfigError, match="damages, seals or a spreader; remove them"):
            generator.render(scene=wrong)
    with pytest.raises(ConfigError, match="has no container to export"):
        export_glb(generator, bare, tmp_path / "a.glb")


@pytest.mark.parametrize("layout", ["seafront", "webdataset"])
def test_files_of_empty_images_are_empty_and_consistent(tmp_path, capsys, layout):
    (tmp_path / "mine.yaml").write_text("container: {absent: 0.5}")
    out = tmp_path / "out"
    also = "voc,kitti,depth,ids,normals" + (",bop" if layout == "seafront" else "")
    arguments = ["--images", "24", "--size", "160x120", "--seed", "4", "--quality", "draft"]
    arguments += ["--config", str(tmp_path / "mine.yaml"), "--format", layout, "--also", also]
    arguments += ["--split", "train"]
    assert main(["generate", str(out), *arguments]) == 0
    assert main(["verify", str(out)]) == 0
    assert main(["stats", str(out)]) == 0
    if layout == "webdataset":
        return
    empty = 0
    for path in sorted((out / "scenes/train").glob("*.json")):
        record = json.loads(path.read_text())
        present = record["scene"]["container"]["present"]
        assert bool(record["objects"]) == present
        empty += not present
        stem = path.stem
        labels = [
            (out / f"{task}/{stem}.txt") for task in ("imdg/labels/train", "damage/yolo/train")
        ]
        labels.append(out / f"kitti/train/label_2/{stem}.txt")
        mask = cv2.imread(str(out / f"damage/masks/train/{stem}.png"), cv2.IMREAD_UNCHANGED)
        if not present:
            assert [label.read_text() for label in labels] == ["", "", ""]
            assert not mask.any()
            assert "<object>" not in (out / f"voc/Annotations/{stem}.xml").read_text()
            assert not list((out / "text/train").glob(f"{stem}_*.png"))
            assert not list((out / "door/train").glob(f"*/{stem}.jpg"))
    assert 0 < empty < 24
    for task in ("imdg", "damage", "container"):
        coco = json.loads((out / f"{task}/coco_train.json").read_text())
        assert len(coco["images"]) == 24
        assert len({each["image_id"] for each in coco["annotations"]}) <= 24 - empty
    truth = json.loads((out / "bop/train/000000/scene_gt.json").read_text())
    assert sum(not each for each in truth.values()) >= empty


def test_training_targets_of_empty_images_are_empty():
    torch_data = pytest.importorskip("fastgen.torch")
    render = RenderSettings(SIZE, "draft")
    for task, form in (("imdg", "yolo"), ("imdg", "detection"), ("damage", "detection")):
        items = torch_data.ItemSettings(form=form)
        data = torch_data.ContainerDataset(task, EMPTY, seed=4, render=render, items=items)
        (batch,) = torch_data.Loader(
            torch_data.ContainerDataset(task, EMPTY, 4, 2, render, items=items), batch_size=2
        )
        target = batch[1] if form == "yolo" else batch[1][0]["boxes"]
        assert len(target) == 0
        assert len(batch[0]) == 2
        data.close()
        assert torch_data.class_counts(task, EMPTY, seed=4, scenes=3).sum() == 0
    data = torch_data.ContainerDataset("text", EMPTY, seed=4, render=render)
    assert data[0][0] == data[0][1]["texts"] == []
    data.close()


def test_the_door_task_refuses_images_without_a_class():
    torch_data = pytest.importorskip("fastgen.torch")
    with pytest.raises(ConfigError, match=r"container.absent: 1 leaves images without a class"):
        torch_data.ContainerDataset("door", EMPTY)
    scenes = torch_data.SceneSettings(curriculum=lambda epoch: {"container": {"absent": 1.0}})
    data = torch_data.ContainerDataset("door", render=RenderSettings(SIZE, "draft"), scenes=scenes)
    with pytest.raises(ConfigError, match="scene 0: has no container"):
        data[0]
    data.close()

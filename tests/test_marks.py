"""Optional marks of the IMDG Code: never drawn without a label, and the same classes everywhere."""

import json
import math
from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from globox import AnnotationSet
from pycocotools.coco import COCO

from fastgen.classes import ALL_DETECTION_CLASSES, DETECTION_CLASSES, MARK_CLASSES
from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.config.presets import PRESETS
from fastgen.decals.artwork import stickers
from fastgen.generator import Generator
from fastgen.geometry.shape_library import SHAPES
from fastgen.labels.objects import labelled_decals
from fastgen.render.settings import RenderSettings
from tests import oracle

pytestmark = pytest.mark.usefixtures("no_workers")

SHARE = 0.7
MARKED = Config.from_values({"markings": {"marks": dict.fromkeys(MARK_CLASSES, SHARE)}})


@pytest.mark.parametrize("preset", PRESETS)
def test_no_preset_draws_a_mark(preset):
    # neighbours would take most of the time
    alone = Config.from_values({"placement": {"neighbours": 0}}, Config.preset(preset))
    generator = Generator(alone, seed=8)
    drawn = {decal.art for index in range(12) for decal in generator.scene(index).decals}
    assert len(drawn) > 15
    assert not drawn & set(MARK_CLASSES)
    assert not stickers().keys() & set(MARK_CLASSES)


def test_marks_that_are_not_named_are_not_drawn():
    config = Config.from_values({"markings": {"marks": {"lithium_battery": 1.0}}})
    generator = Generator(config, seed=8)
    for index in range(20):
        names = {decal.art for decal in generator.scene(index).decals} & set(MARK_CLASSES)
        assert names == {"lithium_battery"}


def test_every_mark_has_its_label_on_the_configured_share_of_containers():
    generator, count, containers = Generator(MARKED, seed=8), 80, Counter()
    for index in range(count):
        marks = [d for d in generator.scene(index).decals if d.art in MARK_CLASSES]
        assert all(decal.class_name == decal.art for decal in marks)
        assert {d.face for d in marks if d.art == "fumigation_warning"} <= {"door"}
        containers.update({decal.art for decal in marks})
    deviation = math.sqrt(SHARE * (1 - SHARE) / count)
    for name in MARK_CLASSES:
        # a full door may have no room for the fumigation warning
        slack = 0.15 if name == "fumigation_warning" else 0.0
        assert SHARE - slack - 4 * deviation < containers[name] / count < SHARE + 4 * deviation


def test_marks_have_at_least_the_size_that_the_code_requires():
    generator = Generator(MARKED, seed=8)
    for decal in (d for index in range(20) for d in generator.scene(index).decals):
        width, height = decal.size_mm
        if decal.art in ("limited_quantity", "environmentally_hazardous"):
            assert width / math.sqrt(2) >= 250  # IMDG Code 3.4.5.5.4, 5.3.2.3.2
        elif decal.art == "elevated_temperature":
            assert min(width, math.hypot(width / 2, height)) >= 250  # sides; 5.3.2.2.1
        elif decal.art == "fumigation_warning":
            assert width >= 400  # 5.5.2.3.2
            assert height >= 300


def test_turning_marks_on_changes_no_marker_and_no_text():
    plain, marked = Generator(seed=8), Generator(MARKED, seed=8)
    for index in range(10):
        a, b = plain.scene(index), marked.scene(index)
        others = [d for d in b.decals if d.class_name not in MARK_CLASSES]
        assert [d for d in a.decals if d.class_name] == [d for d in others if d.class_name]
        assert replace(b, decals=()) == replace(a, decals=())


def test_labels_of_marks_cover_the_pixels_that_they_change(generators):
    generator = generators(MARKED, seed=8, size=(480, 480))
    seen = set()
    for index in range(4):
        scene = replace(generator.scene(index), damages=())
        for camera in ("Cl", "Cr"):
            sample = generator.render(scene=scene, camera=camera, layer="decals")
            for thing in (t for t in sample.objects if t.class_name in MARK_CLASSES and t.area):
                others = tuple(d for d in scene.decals if d is not labelled_decals(scene)[thing.id])
                bare = generator.render(
                    scene=replace(scene, decals=others), camera=camera, layer="decals"
                )
                change = np.abs(sample.image.astype(int) - bare.image).max(axis=2)
                changed = change > 32
                mask = sample.ids == thing.id
                grown = cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
                # pixels whose centre shows a locking bar may show a share of the mark
                assert (changed & ~grown).sum() <= 0.04 * mask.sum()
                assert (changed & mask).sum() > 0.6 * mask.sum()
                seen.add(thing.class_name)
    assert seen == set(MARK_CLASSES)


def test_the_label_of_the_triangle_bounds_the_triangle_and_not_its_rectangle(generators):
    generator = generators(MARKED, seed=8, size=(480, 480))
    seen = 0
    for index in range(14):
        scene = replace(generator.scene(index), damages=())
        mine = [d for d in scene.decals if d.class_name == "elevated_temperature"]
        for camera in ("Cl", "Cr") if mine else ():
            sample = generator.render(scene=scene, camera=camera)
            shown = [t for t in sample.objects if t.class_name == "elevated_temperature"]
            whole = [t for t in shown if t.area >= 60 and not (t.occluded or t.truncated)]
            if not whole:
                continue
            mesh = SHAPES.container(scene.container.kind, scene.container.profiles)
            expected = oracle.object_ids(scene, mesh, oracle.cast(mesh, sample.view, scene))
            for thing in whole:
                true, mask = expected == thing.id, sample.ids == thing.id
                assert (true != mask).sum() <= max(0.03 * mask.sum(), 2)
                ys, xs = np.nonzero(true)
                np.testing.assert_allclose(
                    thing.bbox, (xs.min(), ys.min(), xs.max() + 1, ys.max() + 1), atol=1
                )
                outline = np.array(thing.polygon, np.float32).reshape(-1, 2)
                assert cv2.contourArea(outline) == pytest.approx(mask.sum(), rel=0.15)
                x0, y0, x1, y1 = thing.amodal_bbox
                assert mask.sum() < 0.62 * (x1 - x0) * (y1 - y0)
                seen += 1
    assert seen > 5


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("marks")
    (folder / "mine.yaml").write_text(yaml.safe_dump({"markings": MARKED.to_plain()["markings"]}))
    arguments = ["--images", "8", "--size", "400x400", "--seed", "8", "--quality", "draft"]
    arguments += ["--config", str(folder / "mine.yaml"), "--split", "train", "--also", "voc,kitti"]
    assert main(["generate", str(folder / "out"), *arguments]) == 0
    return folder / "out"


def test_all_label_files_have_the_marks_after_the_28_classes(out, capsys):
    names = yaml.safe_load((out / "imdg/data.yaml").read_text())
    assert names["nc"] == 33
    assert list(names["names"].values()) == [*DETECTION_CLASSES, *MARK_CLASSES]
    coco = COCO(str(out / "imdg/coco_train.json"))
    assert [each["id"] for each in coco.dataset["categories"]] == list(range(1, 34))
    read = {
        "coco": AnnotationSet.from_coco(file_path=out / "imdg/coco_train.json"),
        "yolo": AnnotationSet.from_yolo_v5(
            folder=out / "imdg/labels/train", image_folder=out / "imdg/images/train"
        ),
        "voc": AnnotationSet.from_pascal_voc(folder=out / "voc/Annotations"),
    }
    marks = Counter()
    for path in (out / "scenes/train").glob("*.json"):
        things = json.loads(path.read_text())["objects"]
        marks.update(
            t["class_name"]
            for t in things
            if t["class_name"] in MARK_CLASSES and t["bbox"] and not t["ignored"]
        )
    assert set(marks) >= set(MARK_CLASSES[:3])
    for form, found in read.items():
        labels = Counter(box.label for image in found for box in image.boxes)
        for name, count in marks.items():
            label = str(ALL_DETECTION_CLASSES.index(name)) if form == "yolo" else name
            assert labels[label] >= count, (form, name)
            if form == "yolo":  # the others list ignored objects
                assert labels[label] == count
    kitti = "".join(p.read_text() for p in (out / "kitti/train/label_2").glob("*.txt"))
    assert all(kitti.count(f"{name} ") == count for name, count in marks.items())
    assert main(["verify", str(out)]) == 0
    capsys.readouterr()
    assert main(["stats", str(out)]) == 0
    rows = {
        line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines() if line
    }
    assert all(int(rows[name][0]) == count for name, count in marks.items())


def test_training_targets_number_the_marks_from_28():
    torch_data = pytest.importorskip("fastgen.torch")
    assert torch_data.class_names("imdg") == DETECTION_CLASSES
    assert torch_data.class_names("imdg", MARKED) == ALL_DETECTION_CLASSES
    items = torch_data.ItemSettings(form="yolo")
    render = RenderSettings((400, 400), "draft")
    data = torch_data.ContainerDataset("imdg", MARKED, seed=8, render=render, items=items)
    found = np.zeros(33, int)
    for position in range(8):
        np.add.at(found, data[position][1][:, 0].long().numpy(), 1)
    data.close()
    counted = torch_data.class_counts("imdg", MARKED, seed=8, size=(400, 400), scenes=2).numpy()
    assert counted.shape == (33,)
    assert found[28:].sum() > 5
    assert np.abs(counted - found)[28:].max() <= 2


def test_a_curriculum_may_not_change_the_classes():
    torch_data = pytest.importorskip("fastgen.torch")

    def later(epoch):
        return {"markings": {"marks": {"limited_quantity": 0.5} if epoch else {}}}

    scenes = torch_data.SceneSettings(curriculum=later)
    data = torch_data.ContainerDataset("imdg", scenes=scenes)
    with pytest.raises(Exception, match="epoch 1 changes which classes there are"):
        data.set_epoch(1)
    data.close()

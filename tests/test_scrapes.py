"""Scrapes in label files: a sixth class where the configuration lists it, and none elsewhere."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from pycocotools.coco import COCO

from fastgen.classes import SEGMENTATION_CLASSES
from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.generator import Generator
from fastgen.scene.object_ids import scene_numbers
from fastgen.torch.targets import class_names

pytestmark = pytest.mark.usefixtures("no_workers")


def config_with(*kinds):
    return {"damage": {"probability": 1, "count": [4, 4], "kinds": list(kinds)}}


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scrapes")
    (folder / "config.yaml").write_text(yaml.safe_dump(config_with("scrape", "dented")))
    arguments = ["--images", "16", "--size", "160x160", "--seed", "3", "--quality", "draft"]
    assert (
        main(["generate", str(folder / "out"), "--config", str(folder / "config.yaml"), *arguments])
        == 0
    )
    return folder / "out"


def test_label_files_have_scrapes_as_the_sixth_class(out, capsys):
    seen = 0
    for split in ("train", "val", "test"):
        coco = COCO(str(out / f"damage/coco_{split}.json"))
        names = [each["name"] for each in coco.dataset["categories"]]
        assert names == [*SEGMENTATION_CLASSES, "scrape"]
        for annotation in coco.loadAnns(coco.getAnnIds(catIds=[6])):
            image = coco.loadImgs(annotation["image_id"])[0]
            stem = image["file_name"].rpartition("/")[2].rpartition(".")[0]
            mask = cv2.imread(str(out / f"damage/masks/{split}/{stem}.png"), cv2.IMREAD_UNCHANGED)
            drawn = coco.annToMask(annotation).astype(bool)
            assert set(np.unique(mask[drawn]) // 100) == {6}
            lines = (out / f"damage/yolo/{split}/{stem}.txt").read_text().splitlines()
            seen += annotation["iscrowd"] or any(line.startswith("5 ") for line in lines)
    assert seen
    assert main(["verify", str(out)]) == 0
    assert main(["stats", str(out)]) == 0
    assert "scrape" in capsys.readouterr().out


def test_objects_of_damages_have_their_face_and_severity(out):
    records = [json.loads(path.read_text()) for path in out.glob("scenes/*/*.json")]
    found = [(r["scene"], o) for r in records for o in r["objects"]]
    scrapes = [(scene, o) for scene, o in found if o["class_name"] == "scrape"]
    dents = [(scene, o) for scene, o in found if o["class_name"] == "dented"]
    assert scrapes
    assert dents
    for scene, item in scrapes + dents:
        same = [d for d in scene["damages"] if d["kind"] == item["class_name"]]
        damage = same[item["instance"] - 1]
        assert item["face"] == damage["face"]
        if damage["kind"] == "scrape":
            assert item["severity_mm"] == damage["size_mm"][0]
        else:
            assert 0.5 * damage["depth_mm"] < item["severity_mm"] <= damage["depth_mm"]
    assert {o["face"] for _, o in found if o["class_name"] == "container"} == {""}


def test_other_datasets_have_five_classes():
    plain, scraped = (
        Config.from_values(config_with(*kinds)) for kinds in (("dented",), ("dented", "scrape"))
    )
    assert class_names("damage", plain) == SEGMENTATION_CLASSES
    assert class_names("damage", scraped) == (*SEGMENTATION_CLASSES, "scrape")


def test_ids_leave_out_the_values_of_the_kinds_that_the_scene_has():
    taken = {}
    for kind in ("dented", "scrape"):
        scene = Generator(Config.from_values(config_with(kind)), seed=1).scene(0)
        crowded = replace(scene, decals=scene.decals * (2000 // len(scene.decals)))
        (numbers,) = scene_numbers(crowded)
        taken[kind] = [numbers.container, *filter(None, numbers.decals)]
        assert len(set(taken[kind])) == len(taken[kind]) > 300
        assert not set(taken[kind]) & set(numbers.damages)
    for kind, first in (("dented", 600), ("scrape", 700)):
        assert taken[kind][198:200] == [199, first]

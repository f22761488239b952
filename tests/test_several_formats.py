"""Label formats of a scene with several containers, read by other libraries."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from pycocotools import mask as coco_mask

from fastgen.config.config import LabelConfig
from fastgen.formats.item import Item
from fastgen.formats.registry import known_formats
from fastgen.labels.crops import text_crops
from fastgen.torch.targets import ItemSettings, item_of
from tests.test_several_containers import CAMERAS, CONFIG, POSES, neighbours_of, turned

SIZE = (480, 360)
FORMATS = known_formats()


@pytest.fixture(scope="module")
def sample(generators):
    generator = generators(CONFIG, seed=6, size=SIZE, quality="draft")
    first, *others = (generator.scene(i) for i in range(4))
    scene = replace(
        first,
        spreader=replace(first.spreader, present=False),
        neighbours=neighbours_of(others, POSES),
    )
    return generator.render(scene=scene, camera=CAMERAS[0])


@pytest.fixture(scope="module")
def item(sample):
    return Item(sample, "train", "000000_left", 0, LabelConfig())


def containers(sample):
    return [i for i in sample.objects if i.class_name == "container" and not i.background]


def test_each_container_is_an_instance_of_coco_with_its_own_pixels(sample, item):
    assert len(containers(sample)) == 4
    for name in ("imdg", "damage", "container"):
        _, facts = FORMATS[name].sample_files(item)
        found = [each for each in facts if each["category_id"] == 1]
        masks = np.array([decoded(each) for each in found], bool)
        assert len(masks) == 4
        assert not (masks.sum(axis=0) > 1).any()
        np.testing.assert_array_equal(masks.any(axis=0), sample.damage > 0)
        for each, mask, thing in zip(found, masks, containers(sample), strict=True):
            assert each["area"] == mask.sum() == thing.area
            np.testing.assert_array_equal(
                mask, np.isin(sample.damage, damage_values(sample, thing.container))
            )


def decoded(annotation):
    width, height = SIZE
    if "polygons" not in annotation:
        return coco_mask.decode(annotation["segmentation"])
    polygons = json.loads(annotation["polygons"])
    return coco_mask.decode(coco_mask.merge(coco_mask.frPyObjects(polygons, height, width)))


def damage_values(sample, number):
    own = [i.id for i in sample.objects if i.container == number and 200 <= i.id < 600]
    return [101 + number, *own]


def test_bop_has_the_pose_of_each_container(sample, item):
    files, facts = FORMATS["bop"].sample_files(item)
    assert len(facts["gt"]) == len(facts["info"]) == 4
    masks = [data for path, data in files.items() if "mask_visib" in path]
    for pose, info, mask, thing in zip(
        facts["gt"], facts["info"], masks, containers(sample), strict=True
    ):
        shown = cv2.imdecode(np.frombuffer(mask, np.uint8), cv2.IMREAD_UNCHANGED) > 0
        assert shown.sum() == info["px_count_visib"] == thing.area
        corner = np.array([3029.0, 1219.0, 0.0])  # the lower door casting at the back
        x, y, z = np.reshape(pose["cam_R_m2c"], (3, 3)) @ corner + pose["cam_t_m2c"]
        k = np.reshape(facts["camera"]["cam_K"], (3, 3))
        pixel = (k @ (x / z, y / z, 1.0))[:2] + 0.5
        named = dict(zip(range(8), thing.keypoints, strict=True))[6]
        if named[2] and not any(
            d.kind == "axis" for d in sample.container_at(thing.container).damages
        ):
            np.testing.assert_allclose(pixel, named[:2], atol=1.5)


def test_the_pose_in_the_container_format_is_that_of_its_own_camera(sample, item):
    _, facts = FORMATS["container"].sample_files(item)
    for each, pose in zip(facts, [None, *POSES], strict=True):
        if pose is None:
            continue
        camera = turned(CAMERAS[0], pose)
        eye = -np.array(each["rotation"]).T @ np.array(each["translation_mm"])
        np.testing.assert_allclose(eye, camera.position_mm, atol=1e-3)


def test_texts_of_all_containers_are_cropped_once(sample, item):
    texts = [i for i in sample.objects if i.class_name == "text"]
    assert {i.container for i in texts} == {0, 1, 2, 3}
    cropped = [thing for thing, _ in text_crops(sample, 2.0)]
    assert len(cropped) >= 2
    assert len({thing.id for thing in cropped}) == len(cropped)
    files, _ = FORMATS["text"].sample_files(item)
    assert len(files) == len(set(files))


def test_torch_targets_hold_every_container(sample):
    _, target = item_of(sample, "damage", ItemSettings(), LabelConfig(), 7)
    kinds = target["labels"].tolist()
    kept = [i for i in containers(sample) if i.bbox and not i.ignored]
    assert kinds.count(1) == len(kept)

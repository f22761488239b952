"""Targets of each task compared with generated files, and class counts with renders."""

import itertools
from collections import Counter

import numpy as np
import pytest
import torch
from PIL import Image

from fastgen import Config, Generator
from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.config.config import LabelConfig
from fastgen.dataset.storage import Folder
from fastgen.formats.format import assemble
from fastgen.formats.item import Item
from fastgen.formats.registry import SEAFRONT, formats_of
from fastgen.torch import (
    ContainerDataset,
    ItemSettings,
    Loader,
    RenderSettings,
    class_counts,
    class_names,
    class_weights,
    collate_yolo,
)

SMALL = (64, 64)


YOLO = ItemSettings(form="yolo")


def view(task, position=0, size=(320, 320), config=None, **items):
    """Return a dataset's item and the Sample it was made from."""
    data = ContainerDataset(
        task, config, seed=2, render=RenderSettings(size), items=ItemSettings(**items)
    )
    made = data[position], data.sample(position)
    data.close()
    return made


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder with the files of one 640x640 image, as `fastgen generate` writes them."""
    out = tmp_path_factory.mktemp("written")
    with Generator(seed=2, size=(640, 640)) as generator:
        sample = generator.render(index=1, camera="Cr")
    item = Item(sample, "train", "000001_Cr", 7, LabelConfig())
    Folder(out).commit(assemble(item, formats_of(SEAFRONT))[0], "test")
    Folder(out).make_folders([f"door/train/{name}" for name in ("door", "no_door")])
    return out


def _damaged():
    config = Config.from_values({"damage": {"probability": 1.0, "count": [4, 4]}})
    return view("damage", position=4, config=config)


def test_damage_boxes_and_areas_match_their_masks():
    (image, target), sample = _damaged()
    assert image.shape == (3, 320, 320)
    masks = target["masks"].numpy()
    assert masks.dtype == np.uint8
    assert len(masks) > 1
    for mask, box, area in zip(masks, target["boxes"].tolist(), target["area"], strict=True):
        y, x = np.nonzero(mask)
        assert box == [x.min(), y.min(), x.max() + 1, y.max() + 1]
        assert area == len(x)
    names = [SEGMENTATION_CLASSES[label - 1] for label in target["labels"]]
    assert names[0] == "container"
    for mask, label in zip(masks[1:], target["labels"].tolist()[1:], strict=True):
        assert set(np.unique(sample.damage[mask > 0]) // 100) == {label}
    np.testing.assert_array_equal(masks[0] > 0, sample.damage > 0)
    assert (target["boxes"].dtype, target["labels"].dtype) == (torch.float32, torch.int64)
    assert target["iscrowd"].tolist() == [0] * len(masks)


def test_an_empty_image_has_empty_targets_of_the_right_shape():
    rig = {"face": "front", "focal_mm": 2000, "distance_mm": 1e5, "target_shift_mm": 1e4}
    away = Config.from_values({"cameras": {"A": rig}})
    (_, target), _ = view("damage", size=SMALL, config=away)
    assert target["boxes"].shape == (0, 4)
    assert target["masks"].shape == (0, 64, 64)
    (image, rows), _ = view("imdg", size=SMALL, config=away, form="yolo")
    assert rows.shape == (0, 5)
    assert collate_yolo([(image, rows), (image, rows)])[1].shape == (0, 6)


def test_marker_targets_of_both_forms_equal_the_label_file(written):
    lines = (written / "imdg/labels/train/000001_Cr.txt").read_text().splitlines()
    file = np.array([[float(v) for v in line.split()] for line in lines])
    (_, rows), _ = view("imdg", position=7, size=(640, 640), form="yolo")
    np.testing.assert_allclose(rows.numpy(), file, atol=1e-6)
    (_, target), sample = view("imdg", position=7, size=(640, 640))
    assert (sample.scene.index, sample.camera.name) == (1, "Cr")
    assert target["image_id"] == 7
    assert target["labels"].tolist() == [int(row[0]) + 1 for row in file]
    centre, extent = file[:, 1:3] * 640, file[:, 3:] * 640
    corners = np.hstack([centre - extent / 2, centre + extent / 2])
    np.testing.assert_allclose(target["boxes"].numpy(), corners, atol=1e-3)


def test_yolo_batches_name_the_image_of_each_row():
    data = ContainerDataset("imdg", seed=2, render=RenderSettings(SMALL), items=YOLO)
    alone = [data[p][1] for p in range(3)]
    images, rows = next(iter(Loader(data, batch_size=3)))
    data.close()
    assert images.shape == (3, 3, 64, 64)
    for number, target in enumerate(alone):
        assert torch.equal(rows[rows[:, 0] == number, 1:], target)


def test_text_crops_and_strings_equal_the_files(written):
    lines = sorted((written / "text/train").glob("*.png"), key=lambda p: int(p.stem.split("_")[2]))
    data = ContainerDataset("text", seed=2)
    position = 7
    crops, texts = data.collate([data[position]])
    sample = data.sample(position)
    data.close()
    assert len(crops) == len(texts) == len(lines) > 0
    by_instance = {item.instance: item.text for item in sample.objects if item.class_name == "text"}
    for crop, text, path in zip(crops, texts, lines, strict=True):
        np.testing.assert_array_equal(crop.numpy().transpose(1, 2, 0), np.asarray(Image.open(path)))
        assert text == by_instance[int(path.stem.split("_")[2])]


def test_parts_of_a_text_crop_are_those_of_the_object_moved_into_the_crop():
    (crops, target), sample = view("text", position=7, size=(640, 640))
    by_box = {item.bbox: item for item in sample.objects if item.class_name == "text"}
    assert len(target["parts"]) == len(crops) > 0
    for crop, box, parts in zip(crops, target["boxes"].tolist(), target["parts"], strict=True):
        item = by_box[tuple(box)]
        assert [part[:2] for part in parts] == [(p.role, p.text) for p in item.parts]
        # the crop's pixel at the middle of a part is the image's pixel at the middle of that part
        for (_, _, quad), part in zip(parts, item.parts, strict=True):
            x, y = np.floor(np.array(part.quad).reshape(4, 2).mean(axis=0)).astype(int)
            column, row = np.floor(quad.numpy().mean(axis=0)).astype(int)
            np.testing.assert_array_equal(crop[:, row, column], sample.image[y, x])
            shift = np.array(part.quad).reshape(4, 2) - quad.numpy()
            np.testing.assert_allclose(shift, np.broadcast_to(shift.round()[0], (4, 2)), atol=1e-3)


def test_door_labels_equal_those_of_an_image_folder(written):
    folders = sorted(p.name for p in (written / "door/train").iterdir())
    data = ContainerDataset("door", seed=2, render=RenderSettings(SMALL))
    labels = {data.locate(p)[1]: data[p][1] for p in range(4)}
    images, batch = data.collate([data[0], data[1]])
    data.close()
    assert class_names("door") == tuple(folders)
    assert (written / "door/train" / folders[labels["Cr"]] / "000001_Cr.jpg").exists()
    assert set(labels) == {"Cl", "Cr"}
    assert batch.tolist() == [labels["Cl"], labels["Cr"]]
    assert images.dtype == torch.uint8


def test_transforms_get_image_and_target_and_floats_lie_in_0_to_1():
    def mirror(image, target):
        return image.flip(-1), {**target, "mirrored": True}

    (plain, _), _ = view("imdg", size=SMALL)
    (image, target), _ = view("imdg", size=SMALL, as_float=True, transforms=mirror)
    assert target["mirrored"]
    assert image.dtype == torch.float32
    np.testing.assert_allclose(image.numpy() * 255, plain.flip(-1).numpy(), atol=1e-4)


def test_counts_without_gl_are_close_to_rendered_labels():
    data = ContainerDataset("imdg", seed=6, items=YOLO)
    rendered = np.zeros(len(DETECTION_CLASSES))
    for position in range(24):
        np.add.at(rendered, data[position][1][:, 0].long().numpy(), 1)
    data.close()
    counted = class_counts("imdg", seed=6, scenes=6).numpy()
    assert counted[0] == rendered[0] == 24
    assert abs(counted.sum() - rendered.sum()) < 0.1 * rendered.sum()
    assert np.abs(counted - rendered)[2:].max() <= 2


def test_damage_counts_without_gl_are_close_to_rendered_masks():
    config = Config.from_values({"damage": {"probability": 1.0}})
    data = ContainerDataset("damage", config, seed=6, render=RenderSettings((320, 320)), items=YOLO)
    rendered = np.zeros(len(SEGMENTATION_CLASSES))
    for position in range(80):
        np.add.at(rendered, data[position][1][:, 0].long().numpy(), 1)
    data.close()
    counted = class_counts("damage", config, seed=6, size=(320, 320), scenes=20).numpy()
    assert counted[0] == rendered[0] == 80
    assert abs(counted.sum() - rendered.sum()) < 0.15 * (rendered.sum() - 80)


@pytest.mark.parametrize(("preset", "scenes"), [("gate", 2), ("yard", 1), ("quay", 2)])
def test_counts_of_all_containers_are_close_to_rendered_labels(preset, scenes):
    config = Config.preset(preset)
    rendered = Counter()
    with Generator(config, seed=2, size=(320, 320), quality="draft") as generator:
        for index, camera in itertools.product(range(scenes), config.cameras):
            objects = generator.render(index, camera).objects
            rendered.update(each.class_name for each in objects if each.bbox and not each.ignored)
    for task in ("imdg", "damage"):
        names = class_names(task, config)
        counts = class_counts(task, config, seed=2, size=(320, 320), scenes=scenes)
        counted = dict(zip(names, counts.tolist(), strict=True))
        assert counted["container"] == pytest.approx(rendered["container"], rel=0.1)
        for some in (("text",), names[2:]) if task == "imdg" else (names[1:],):
            real = sum(rendered[name] for name in some)
            assert sum(counted[name] for name in some) == pytest.approx(real, rel=0.25, abs=3)


def test_counts_leave_out_what_fog_hides():
    fog = {"fog_probability": 1.0, "visibility_mm": [9000, 9000]}
    clear, foggy = (
        class_counts("imdg", Config.from_values(values, base=Config.preset("quay")), scenes=2)
        for values in ({"weather": {"fog_probability": 0.0}}, {"weather": fog})
    )
    assert 0 < foggy.sum() < clear.sum()


def test_weights_balance_the_classes():
    counts = class_counts("damage", scenes=60).double()
    weights = class_weights("damage", scenes=60).double()
    shares = counts * weights
    np.testing.assert_allclose(shares, np.full(5, counts.sum() / 5), rtol=1e-5)


def test_classes_that_never_occur_are_named():
    config = Config.from_values({"damage": {"kinds": ["dented"], "probability": 1.0}})
    with pytest.warns(UserWarning, match="axis, concave, perforation have no label in 5 scenes"):
        weights = class_weights("damage", config, scenes=5)
    assert torch.isfinite(weights).all()


DAMAGED = Config.from_values({"damage": {"probability": 1.0, "count": [4, 4]}})


def test_a_pair_is_an_image_and_the_same_one_without_damages():
    (alone, target), sample = view("damage", position=4, config=DAMAGED)
    ((image, other), (own, without)), _ = view("damage", position=4, config=DAMAGED, pairs=True)
    assert torch.equal(image, alone)
    assert own.keys() == target.keys()
    for name, value in own.items():
        assert torch.equal(torch.as_tensor(value), torch.as_tensor(target[name])), name
    with Generator(DAMAGED, seed=2, size=(320, 320)) as generator:
        whole = generator.render(scene=sample.scene.undamaged(), camera=sample.camera.name)
    np.testing.assert_array_equal(other.permute(1, 2, 0).numpy(), whole.image)
    assert without["labels"].tolist() == [1]
    np.testing.assert_array_equal(without["masks"][0] > 0, whole.damage > 0)
    assert set(own["labels"].tolist()) > {1}


def test_pairs_stay_together_in_batches_and_transforms():
    def named(images, targets):
        assert len(images) == len(targets) == 2
        return images, tuple({**target, "part": part} for part, target in enumerate(targets))

    items = ItemSettings(pairs=True, transforms=named)
    data = ContainerDataset("damage", DAMAGED, 2, render=RenderSettings(SMALL), items=items)
    images, targets = next(iter(Loader(data, batch_size=3)))
    assert len(images) == len(targets) == 6
    assert [target["part"] for target in targets] == [0, 1] * 3
    assert [target["image_id"] for target in targets] == [0, 0, 1, 1, 2, 2]
    data.close()
    rows = ItemSettings(form="yolo", pairs=True)
    data = ContainerDataset("damage", DAMAGED, 2, render=RenderSettings(SMALL), items=rows)
    stacked, found = next(iter(Loader(data, batch_size=3)))
    data.close()
    assert torch.equal(stacked, torch.stack(images))
    assert (found[:, 1] > 0).any()
    assert set(found[found[:, 1] > 0, 0].tolist()) <= {0, 2, 4}
    assert set(found[found[:, 1] == 0, 0].tolist()) == {0, 1, 2, 3, 4, 5}

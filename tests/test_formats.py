"""Every output format, read back by a common tool and compared with pixels and algebra."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import supervision
import trimesh
from globox import AnnotationSet
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from fastgen.classes import DETECTION_CLASSES, SEGMENTATION_CLASSES
from fastgen.cli.main import main
from fastgen.formats.bop import OBJECT_IDS
from fastgen.formats.format import assemble
from fastgen.formats.item import Item
from fastgen.formats.registry import formats_of
from fastgen.labels.objects import CASTINGS
from fastgen.scene import Scene
from fastgen.validation import from_plain

pytestmark = pytest.mark.usefixtures("no_workers")

SPLITS = ("train", "val", "test")
SIZE = (320, 240)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("formats") / "out"
    arguments = ["--images", "24", "--size", "320x240", "--seed", "5", "--split", "0.5,0.25,0.25"]
    arguments += ["--also", "voc,kitti,bop,depth,ids"]
    assert main(["generate", str(folder), *arguments]) == 0
    return folder


def scenes(out, split="*"):
    """Return the content of the scene files by stem."""
    paths = sorted(out.glob(f"scenes/{split}/*.json"))
    return {path.stem: json.loads(path.read_text()) for path in paths}


def stems(data):
    """Return the sorted stems of the images of a supervision dataset; all must be readable."""
    assert all(cv2.imread(path) is not None for path in data.image_paths)
    return sorted(Path(path).stem for path in data.image_paths)


def ids(out, stem, split):
    return cv2.imread(str(out / f"ids/{split}/{stem}.png"), cv2.IMREAD_UNCHANGED)


def wanted_boxes(record):
    """Return class and box (x0, y0, x1, y1) of every object that the marker task labels."""
    return sorted(
        (thing["class_name"], *thing["bbox"])
        for thing in record["objects"]
        if thing["class_name"] in DETECTION_CLASSES and thing["bbox"] and not thing["ignored"]
    )


@pytest.mark.parametrize("task", ["damage", "imdg", "container"])
@pytest.mark.parametrize("split", SPLITS)
def test_coco_labels_score_full_marks_against_themselves(out, task, split):
    truth = COCO(str(out / task / f"coco_{split}.json"))
    found = [dict(a, score=1.0) for a in truth.dataset["annotations"] if not a["iscrowd"]]
    assert found
    kinds = ("bbox", "segm", "keypoints") if task == "container" else ("bbox", "segm")
    for kind in kinds:
        score = COCOeval(truth, truth.loadRes([dict(a) for a in found]), kind)
        if kind == "keypoints":
            score.params.kpt_oks_sigmas = np.full(len(CASTINGS), 0.05)
        score.evaluate()
        score.accumulate()
        score.summarize()
        assert score.stats[0] == pytest.approx(1.0)


@pytest.mark.parametrize("split", SPLITS)
def test_coco_masks_of_markers_are_the_pixels_of_their_ids(out, split):
    data = COCO(str(out / f"imdg/coco_{split}.json"))
    seen = 0
    for image in data.dataset["images"]:
        stem = Path(image["file_name"]).stem
        target = ids(out, stem, split)
        things = [t for t in scenes(out, split)[stem]["objects"] if t["bbox"]]
        things = [t for t in things if t["class_name"] in DETECTION_CLASSES]
        annotations = data.loadAnns(data.getAnnIds(image["id"]))
        assert len(annotations) == len(things)
        for thing, annotation in zip(things, annotations, strict=True):
            mask = data.annToMask(annotation).astype(bool)
            if thing["background"]:
                assert annotation["background"]
                assert not target[mask].any()
                continue
            own = (target > 0) & (target < 60000) if thing["id"] == 1 else target == thing["id"]
            np.testing.assert_array_equal(mask, own)
            assert annotation["area"] == own.sum()
            assert annotation["iscrowd"] == thing["ignored"]
            assert annotation.get("text", "") == thing["text"]
            seen += 1
    assert seen


def test_supervision_reads_yolo_detections(out):
    for split in SPLITS:
        data = supervision.DetectionDataset.from_yolo(
            images_directory_path=str(out / f"imdg/images/{split}"),
            annotations_directory_path=str(out / f"imdg/labels/{split}"),
            data_yaml_path=str(out / "imdg/data.yaml"),
        )
        assert data.classes == list(DETECTION_CLASSES)
        assert stems(data) == sorted(scenes(out, split))
        for path, _, found in data:
            boxes = sorted(
                (DETECTION_CLASSES[k], *np.rint(box).astype(int).tolist())
                for k, box in zip(found.class_id, found.xyxy, strict=True)
            )
            assert boxes == wanted_boxes(scenes(out, split)[Path(path).stem])


def test_supervision_reads_yolo_outlines_of_damage(out, tmp_path):
    (tmp_path / "data.yaml").write_text(json.dumps({"names": list(SEGMENTATION_CLASSES)}))
    for split in SPLITS:
        data = supervision.DetectionDataset.from_yolo(
            images_directory_path=str(out / f"images/{split}"),
            annotations_directory_path=str(out / f"damage/yolo/{split}"),
            data_yaml_path=str(tmp_path / "data.yaml"),
            force_masks=True,
        )
        assert stems(data) == sorted(scenes(out, split))
        for path, _, found in data:
            mask = cv2.imread(f"{out}/damage/masks/{split}/{Path(path).stem}.png", -1) > 0
            container = found.mask[found.class_id == 0][0]
            # this reader rounds by half a pixel, which matters for a container this far away
            assert (container & mask).sum() / (container | mask).sum() > 0.93


@pytest.mark.parametrize("form", ["voc", "yolo"])
def test_globox_reads_the_same_boxes(out, form):
    for split in SPLITS:
        wanted = scenes(out, split)
        if form == "voc":
            found = AnnotationSet.from_pascal_voc(folder=out / "voc/Annotations")
            listed = (out / f"voc/ImageSets/Main/{split}.txt").read_text().split()
            assert listed == list(wanted)
        else:
            found = AnnotationSet.from_yolo_v5(
                folder=out / f"imdg/labels/{split}",
                image_folder=out / f"imdg/images/{split}",
            )
        for stem, record in wanted.items():
            (one,) = [a for a in found if Path(a.image_id).stem == stem]
            assert one.image_size == SIZE
            boxes = []
            for box in one.boxes:
                name = box.label if form == "voc" else DETECTION_CLASSES[int(box.label)]
                # the first corner in VOC is 1-based
                shift = 1 if form == "voc" else 0
                corners = (box.xmin - shift, box.ymin - shift, box.xmax, box.ymax)
                boxes.append((name, *np.rint(corners).astype(int).tolist()))
            easy = set(wanted_boxes(record))
            if form == "voc":  # boxes without area are left out
                easy = {box for box in easy if box[3] - box[1] > 1 and box[4] - box[2] > 1}
                assert all(box.xmax > box.xmin and box.ymax > box.ymin for box in one.boxes)
            assert easy <= set(boxes)
            assert len(boxes) == len(easy) or form == "voc"


def test_kitti_rows_have_fifteen_columns_and_ignored_regions(out):
    rows = 0
    for split in SPLITS:
        for stem, record in scenes(out, split).items():
            text = (out / f"kitti/{split}/label_2/{stem}.txt").read_text()
            found = []
            for row in map(str.split, text.splitlines()):
                assert len(row) == 15
                left, top, right, bottom = (float(v) for v in row[4:8])
                assert 0 <= left < right <= SIZE[0]
                assert 0 <= top < bottom <= SIZE[1]
                if row[0] != "DontCare":
                    found.append((row[0], *map(round, (left, top, right, bottom))))
                rows += 1
            assert sorted(found) == wanted_boxes(record)
            ignored = [t for t in record["objects"] if t["bbox"] and t["ignored"]]
            ignored = [t for t in ignored if t["class_name"] in DETECTION_CLASSES]
            assert text.count("DontCare") == len(ignored)
            calibration = (out / f"kitti/{split}/calib/{stem}.txt").read_text().split()
            matrix = np.array(calibration[1:], float).reshape(3, 4)
            np.testing.assert_allclose(matrix[:, :3], record["view"]["intrinsics"], rtol=1e-8)
    assert rows


def test_bop_poses_project_the_model_onto_its_pixels(out):
    seen = 0
    infos = json.loads((out / "bop/models/models_info.json").read_text())
    models = {
        number: trimesh.load(out / f"bop/models/obj_{number:06d}.ply", process=False)
        for number in OBJECT_IDS.values()
    }
    for number, model in models.items():
        low, high = model.bounds
        info = infos[str(number)]
        assert [info[f"size_{a}"] for a in "xyz"] == pytest.approx(high - low, abs=0.01)
    for split in SPLITS:
        folder = out / f"bop/{split}/000000"
        cameras, truths, more = (
            json.loads((folder / f"scene_{name}.json").read_text())
            for name in ("camera", "gt", "gt_info")
        )
        assert len(truths) == len(scenes(out, split))
        for key, ((gt,), (info,)) in {k: (truths[k], more[k]) for k in truths}.items():
            rotation = np.array(gt["cam_R_m2c"]).reshape(3, 3)
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(rotation) == pytest.approx(1)
            points = models[gt["obj_id"]].vertices @ rotation.T + gt["cam_t_m2c"]
            pixels = points @ np.array(cameras[key]["cam_K"]).reshape(3, 3).T
            pixels = pixels[:, :2] / pixels[:, 2:]
            x, y, width, height = info["bbox_obj"]
            # BOP has pixel centres at whole numbers; wall profiles vary by some millimetres
            np.testing.assert_allclose(pixels.min(axis=0) + 0.5, (x, y), atol=1.0)
            np.testing.assert_allclose(pixels.max(axis=0) + 0.5, (x + width, y + height), atol=1.0)
            name = f"{int(key):06d}"
            mask = cv2.imread(str(folder / f"mask_visib/{name}_000000.png"), -1) > 0
            assert mask.sum() == info["px_count_visib"]
            depth = cv2.imread(str(folder / f"depth/{name}.png"), -1)
            assert info["px_count_valid"] == (depth[mask] > 0).sum()
            assert ((depth > 0) >= mask).all()
            assert depth[mask].min() * cameras[key]["depth_scale"] > points[:, 2].min() - 50
            assert (folder / f"rgb/{name}.jpg").is_file()
            seen += 1
    assert seen == 24


def test_the_view_in_a_scene_file_projects_the_castings_to_their_keypoints(out):
    seen = 0
    for record in scenes(out).values():
        scene = from_plain(Scene, record["scene"], "scene")
        if scene.damages:  # they may move the castings
            continue
        seen += 1
        view = {key: np.array(value) for key, value in record["view"].items()}
        points = record["objects"][0]["keypoints"]
        length = {"20": 6058, "40": 12192, "40HC": 12192, "45HC": 13716}[scene.container.kind]
        height = 2896 if scene.container.kind.endswith("HC") else 2591
        for name, (x, y, flag) in zip(CASTINGS, points, strict=True):
            corner = [
                (1 if name.startswith("door") else -1) * length / 2,
                (-1 if "front" in name else 1) * 2438 / 2,
                height if name.endswith("top") else 0,
            ]
            at = view["rotation"] @ corner + view["translation_mm"]
            pixel = view["intrinsics"] @ at
            inside = (pixel[:2] >= 0).all() and (pixel[:2] / pixel[2] < SIZE).all()
            assert (flag > 0) == (inside and at[2] > 0)
            if flag:
                np.testing.assert_allclose(pixel[:2] / pixel[2], (x, y), atol=0.01)
    assert seen >= 4


def test_ignored_objects_are_marked_if_a_format_can_and_omitted_otherwise(generators):
    generator = generators(seed=5, size=SIZE)
    generator.config = type(generator.config).from_values(
        {"labels": {"min_visible_px": 150, "min_visible_fraction": 0.5}}
    )
    sample = generator.render(index=1, camera="B")
    small = [t for t in sample.objects if t.bbox and t.ignored]
    assert small
    assert all(t.area < 150 or t.visible_fraction < 0.5 or t.background for t in small)
    item = Item(sample, "train", "000001_B", 5, generator.config.labels)
    files, record = assemble(item, formats_of(("imdg", "voc", "kitti")))
    crowds = [a for a in record["facts"]["imdg"] if a["iscrowd"]]
    count = len([t for t in small if t.class_name in DETECTION_CLASSES])
    assert len(crowds) == count
    assert files["voc/Annotations/000001_B.xml"].count(b"<difficult>1") == count
    assert files["kitti/train/label_2/000001_B.txt"].count(b"DontCare") == count
    rows = files["imdg/labels/train/000001_B.txt"].splitlines()
    listed = [t for t in sample.objects if t.bbox and t.class_name in DETECTION_CLASSES]
    assert len(rows) == len(listed) - count

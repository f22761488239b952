"""Containers of the panorama as labels, compared with lookups of each pixel's ray in the map."""

import json
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from scipy import ndimage

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.classes import BACKGROUND_ID
from fastgen.config.config import LabelConfig
from fastgen.errors import AssetError
from fastgen.formats.format import assemble
from fastgen.formats.item import Item
from fastgen.formats.registry import known_formats
from fastgen.labels.background import SMALL_PX, panorama_containers
from fastgen.light.container_map import load_container_map
from fastgen.light.hdri import bundled_hdris
from fastgen.resources import asset_path
from fastgen.scene import Camera, EnvironmentView
from fastgen.scene.optics import Lens

SIZE = (320, 240)
IGNORING = Config.from_values({"labels": {"background": "ignore"}})
PORTS = sorted(name for name in bundled_hdris() if name.startswith("port_"))

CAMERAS = (
    Camera("level", (0, -9000, 1500), (0, 0, 1300), 24.0),
    Camera("tele", (0, -9000, 1500), (30000, 0, 2500), 90.0, roll_deg=4.0),
    Camera("nadir", (0, -6000, 8000), (0, 0, 800), 14.0),
    Camera("zenith", (0, -6000, 2000), (0, 0, 9000), 12.0),
    Camera(
        "brown",
        (0, 9000, 1500),
        (0, 0, 1300),
        16.0,
        lens=Lens("brown_conrady", (-0.1, 0.01, 0.002, -0.001, 0.0)),
    ),
    Camera("fisheye", (-9000, 0, 1500), (0, 0, 300), 20.0, lens=Lens("fisheye", (-0.02, 0, 0, 0))),
)


def whole_map(name):
    """Return the numbers of containers in the map's file, read without the package."""
    values = np.asarray(Image.open(asset_path("hdri", f"{name}.containers.png")))
    return np.where(values == 65535, np.uint16(0), values)


def texels(numbers, view, yaw_deg):
    """Return column and row float64 of each pixel's ray in a map, from its corner."""
    _, ray = view.rays()
    azimuth = np.arctan2(ray[..., 1], ray[..., 0]) - np.deg2rad(yaw_deg)
    width = numbers.shape[1]
    column = (0.5 - azimuth / (2 * np.pi)) * width % width
    return column, np.arccos(ray[..., 2]) / np.pi * numbers.shape[0]


def looked_up(numbers, column, row):
    height, width = numbers.shape
    down = np.clip(np.floor(row).astype(int), 0, height - 1)
    return numbers[down, np.floor(column).astype(int) % width]


@pytest.fixture(scope="module")
def generator():
    with Generator(IGNORING, size=SIZE, quality="draft") as generator:
        yield generator


def in_port(generator, name="port_noon", yaw_deg=0.0, index=0):
    scene = generator.scene(index)
    return replace(scene, environment=EnvironmentView(name, yaw_deg))


def from_all_around(generator):
    """Yield samples in half of the ports, with the number of the container at each pixel's ray."""
    for number, name in enumerate(PORTS[::2]):
        camera, yaw_deg = CAMERAS[number % len(CAMERAS)], 77.0 * number - 180
        scene = in_port(generator, name, yaw_deg, number)
        numbers = whole_map(name)
        sample = generator.render(scene=scene, camera=camera)
        yield sample, looked_up(numbers, *texels(numbers, sample.view, yaw_deg))


def free_pixels(sample):
    return (sample.ids == 0) & (sample.damage == 0) & np.isinf(sample.depth)


def test_every_bundled_port_has_a_map_and_no_photograph_has_one():
    for name, path in bundled_hdris().items():
        found = load_container_map(path)
        assert (found is not None) == (name in PORTS)
        if found:
            numbers = whole_map(name)
            assert numbers.dtype == np.uint16
            assert numbers.shape == (2048, 4096)
            assert set(np.unique(numbers)) == set(range(found.count + 1))


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)
@pytest.mark.parametrize("yaw_deg", [0.0, 123.4, -179.0])
def test_each_pixel_shows_the_container_at_its_ray(camera, yaw_deg):
    view = view_of(camera, SIZE)
    numbers = whole_map("port_morning")
    containers = load_container_map(bundled_hdris()["port_morning"])
    shown = panorama_containers(view, containers, yaw_deg)[1:-1, 1:-1]
    column, row = texels(numbers, view, yaw_deg)
    wanted = looked_up(numbers, column, row)
    nearby = [looked_up(numbers, column + x, row + y) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    clear = np.all([near == wanted for near in nearby], axis=0)
    np.testing.assert_array_equal(shown[clear], wanted[clear])
    assert (shown != wanted).mean() < 1e-3
    assert wanted.any()


def test_the_border_continues_the_image():
    camera = CAMERAS[4]
    containers = load_container_map(bundled_hdris()["port_dusk"])
    small, large = view_of(camera, SIZE), view_of(camera, SIZE)
    large = replace(large, size=(SIZE[0] + 2, SIZE[1] + 2))
    inner = panorama_containers(large, containers, 20.0)[1:-1, 1:-1]
    assert (inner != panorama_containers(small, containers, 20.0)).mean() < 1e-3


def test_objects_are_the_visible_parts_of_containers(generator):
    seen = 0
    for sample, numbers in from_all_around(generator):
        shown = np.where(free_pixels(sample), numbers, 0)
        value, count = np.unique(shown[shown > 0], return_counts=True)
        found = {o.id - BACKGROUND_ID: o for o in sample.objects if o.background}
        for number, area in zip(value.tolist(), count.tolist(), strict=True):
            if abs(area - SMALL_PX) < 3:
                continue
            assert (number in found) == (area >= SMALL_PX)
            if area < SMALL_PX:
                continue
            thing = found[number]
            rows, columns = np.nonzero(shown == number)
            box = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
            assert np.abs(np.subtract(thing.bbox, box)).max() <= 1
            assert abs(thing.area - area) <= max(3, 0.03 * area)
            assert (sample.background == number).sum() == thing.area
            assert (thing.class_name, thing.ignored, thing.container) == ("container", True, -1)
            seen += 1
        assert all(not (sample.ids == o.id % 65536).any() for o in found.values())
    assert seen > 100


def test_small_containers_that_touch_form_groups(generator):
    groups = 0
    for sample, _ in from_all_around(generator):
        if sample.background is None or not sample.background.any():
            continue
        highest = load_container_map(bundled_hdris()[sample.scene.environment.name]).count
        small = sample.background > highest
        labelled, count = ndimage.label(small, np.ones((3, 3)))
        found = [o for o in sample.objects if o.id > BACKGROUND_ID + highest]
        assert len(found) == count
        for thing in found:
            assert thing.ignored
            part = sample.background == thing.id - BACKGROUND_ID
            assert np.array_equal(part, labelled == labelled[part][0])
        groups += count
    assert groups > 10


def test_turning_environment_and_camera_together_changes_no_label(generator):
    containers = load_container_map(bundled_hdris()["port_golden"])
    camera = replace(CAMERAS[0], position_mm=(0, -9000, 1500))
    turned = replace(camera, position_mm=(9000, 0, 1500))
    same = panorama_containers(view_of(camera, SIZE), containers, 15.0)
    other = panorama_containers(view_of(turned, SIZE), containers, 105.0)
    assert same.any()
    assert (same != other).mean() < 1e-3


def test_a_larger_yaw_moves_boxes_by_the_angle_to_the_left(generator):
    """Azimuth grows to the left in the image; on the horizon x = f tan(angle off the axis)."""
    camera = replace(CAMERAS[0], target_mm=(0, 0, 1500))
    view = view_of(camera, SIZE)
    containers = load_container_map(bundled_hdris()["port_golden"])
    before = panorama_containers(view, containers, 0.0)[1:-1, 1:-1]
    after = panorama_containers(view, containers, 5.0)[1:-1, 1:-1]
    row = SIZE[1] // 2
    middle = view.center_px[0]
    errors = []
    for number in np.unique(before[row])[1:]:
        start, then = np.flatnonzero(before[row] == number), np.flatnonzero(after[row] == number)
        if len(then) and start[0] and then[0]:
            angle = np.arctan((start[0] - middle) / view.focal_px) - np.deg2rad(5.0)
            errors.append(abs(middle + view.focal_px * np.tan(angle) - then[0]))
    assert len(errors) > 3
    # a sliver of a container is missed by the pixel centres of one image
    assert np.median(errors) < 1


def test_truncated_containers_go_on_outside_the_image(generator):
    camera = CAMERAS[0]
    scene = in_port(generator, "port_morning", 40.0)
    sample = generator.render(scene=scene, camera=camera)
    containers = load_container_map(bundled_hdris()["port_morning"])
    wide = replace(sample.view, size=(5 * SIZE[0], 5 * SIZE[1]))
    # the larger image has its principal point in its own middle
    outside = panorama_containers(wide, containers, 40.0)[1:-1, 1:-1].copy()
    outside[2 * SIZE[1] : 3 * SIZE[1], 2 * SIZE[0] : 3 * SIZE[0]] = 0
    cut = 0
    for thing in sample.objects:
        number = thing.id - BACKGROUND_ID
        if not thing.background or number > containers.count:
            continue
        beyond = int((outside == number).sum())
        assert thing.truncated == (beyond > 0) or beyond < 3
        if beyond > 100:
            inside = panorama_containers(sample.view, containers, 40.0)[1:-1, 1:-1] == number
            share = thing.area / (inside.sum() + beyond)
            assert abs(thing.visible_fraction - share) < 0.2
            cut += 1
    assert cut


def test_a_photograph_has_unknown_containers_and_says_so(generator):
    for name, known in (("forest", False), ("port_noon", True)):
        sample = generator.render(scene=in_port(generator, name), camera=CAMERAS[0])
        assert (sample.background is not None) == known
        assert any(thing.background for thing in sample.objects) == known
        files, _ = assemble(item_of(sample), [])
        assert json.loads(files["scenes/train/000000_x.json"])["background_known"] == known
    off = LabelConfig(background="none")
    sample = generator.render(scene=in_port(generator), camera=CAMERAS[0], labels=off)
    assert sample.background is None
    assert not any(thing.background for thing in sample.objects)


def item_of(sample, mode="ignore"):
    return Item(sample, "train", "000000_x", 0, LabelConfig(background=mode))


def written(generator, mode):
    """Return objects, files and facts of one image with this treatment of the background."""
    rules = LabelConfig(background=mode)
    sample = generator.render(scene=in_port(generator), camera=CAMERAS[0], labels=rules)
    formats = [known_formats()[n] for n in ("imdg", "damage", "container", "kitti", "voc")]
    files, record = assemble(item_of(sample, mode), formats)
    return sample, files, record


def coco_of(tmp_path, name, record):
    """Return a COCO file of one record, as pycocotools reads it."""
    made = dict(known_formats()[name].dataset_files("train", lambda: [record], Config()))
    path = tmp_path / f"{name}.json"
    path.write_text("".join(made[f"{name}/coco_train.json"]))
    with redirect_stdout(StringIO()):
        return COCO(str(path))


def test_formats_write_ignore_regions_where_they_have_them(generator, tmp_path):
    sample, files, record = written(generator, "ignore")
    _, before, _ = written(generator, "none")
    regions = [thing for thing in sample.objects if thing.background]
    boxes = sorted(thing.bbox for thing in regions)
    for name in ("imdg", "damage", "container"):
        coco = coco_of(tmp_path, name, record)
        crowd = [a for a in coco.loadAnns(coco.getAnnIds()) if a.get("background")]
        assert all(a["iscrowd"] == 1 and a["category_id"] == 1 for a in crowd)
        corners = [(x, y, x + w, y + h) for x, y, w, h in (a["bbox"] for a in crowd)]
        assert sorted(corners) == boxes
        covered = np.any([coco.annToMask(a) for a in crowd], axis=0)
        np.testing.assert_array_equal(covered, sample.background > 0)
    kitti = files["kitti/train/label_2/000000_x.txt"].decode().splitlines()
    ignored = [tuple(map(float, line.split()[4:8])) for line in kitti if "DontCare" in line]
    assert set(boxes) <= set(ignored)
    root = ElementTree.fromstring(files["voc/Annotations/000000_x.xml"])
    difficult = [o for o in root.iter("object") if o.findtext("difficult") == "1"]
    wide = [b for b in boxes if b[2] - b[0] > 1 and b[3] - b[1] > 1]
    assert len(difficult) >= len(wide) > 0
    for path in ("imdg/labels/train/000000_x.txt", "damage/labels/train/000000_x.txt"):
        assert files[path] == before[path]
    assert files["damage/masks/train/000000_x.png"] == before["damage/masks/train/000000_x.png"]


def test_scorers_of_coco_do_not_punish_detections_of_ignored_containers(generator, tmp_path):
    _, _, record = written(generator, "ignore")
    coco = coco_of(tmp_path, "imdg", record)
    own = [a for a in coco.loadAnns(coco.getAnnIds(catIds=[1])) if not a["iscrowd"]]
    crowd = [a for a in coco.loadAnns(coco.getAnnIds(catIds=[1])) if a["iscrowd"]]
    assert len(own) == 1
    assert len(crowd) > 5
    found = [
        {"image_id": 1, "category_id": 1, "bbox": a["bbox"], "score": 0.9 if a in crowd else 0.5}
        for a in own + crowd
    ]
    with redirect_stdout(StringIO()):
        score = COCOeval(coco, coco.loadRes(found), "bbox")
        score.params.catIds = [1]
        score.evaluate()
        score.accumulate()
        score.summarize()
    assert score.stats[0] == pytest.approx(1.0)


def test_containers_of_the_background_are_labelled_if_the_config_says_so(generator, tmp_path):
    sample, files, record = written(generator, "label")
    shown = [thing for thing in sample.objects if thing.background and not thing.ignored]
    assert shown
    assert all(thing.area >= LabelConfig().min_visible_px for thing in shown)
    coco = coco_of(tmp_path, "damage", record)
    annotations = coco.loadAnns(coco.getAnnIds(catIds=[1], iscrowd=False))
    assert sum(bool(a.get("background")) for a in annotations) == len(shown)
    for annotation in annotations:
        assert coco_mask.area(coco.annToRLE(annotation)) == annotation["area"]
    for path in ("imdg/labels/train/000000_x.txt", "damage/labels/train/000000_x.txt"):
        lines = files[path].decode().splitlines()
        assert sum(line.split()[0] == "0" for line in lines) == len(shown) + 1
    assert (sample.ids < 60100).all()


def test_a_panorama_of_the_user_may_have_a_map(tmp_path):
    for name in ("port_noon.exr", "port_noon.containers.png"):
        (tmp_path / name).write_bytes(asset_path("hdri", name).read_bytes())
    with Generator(IGNORING, size=SIZE, quality="draft", hdri_dir=tmp_path) as own:
        assert set(own.environment_record) == {"port_noon"}
        assert "containers" in own.environment_record["port_noon"]
        assert own.container_map("port_noon").count == whole_map("port_noon").max()


@pytest.mark.parametrize("numbers", [np.zeros((64, 64), np.uint16), np.zeros((256, 512), np.uint8)])
def test_a_map_of_another_kind_is_refused(tmp_path, numbers):
    Image.fromarray(numbers).save(tmp_path / "a.containers.png")
    with pytest.raises(AssetError, match=r"a\.containers\.png"):
        load_container_map(tmp_path / "a.exr")


def test_cameras_of_all_pitches_and_sizes_see_what_the_map_has_along_their_rays():
    path = bundled_hdris()["port_noon"]
    containers, numbers = load_container_map(path), whole_map("port_noon")
    assert containers is not None
    for size in ((97, 61), (64, 200), (320, 240)):
        for pitch in np.arange(-87.0, 88.0, 3.5):
            rise = 10000.0 * np.tan(np.deg2rad(pitch))
            camera = Camera("c", (0, -9000, 1500), (3000, 1000, 1500 + float(rise)), 24.0)
            view = view_of(camera, size)
            found = panorama_containers(view, containers, 25.0)[1:-1, 1:-1]
            wanted = looked_up(numbers, *texels(numbers, view, 25.0))
            assert (found != wanted).mean() < 0.02

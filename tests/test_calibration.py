"""Cameras from OpenCV's camera matrix and from calibration files, compared with OpenCV and rays."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from fastgen import Config, Generator
from fastgen.camera.projection import view_of
from fastgen.errors import ConfigError
from fastgen.geometry.prepared_scene import PreparedScene
from tests import oracle

SIZE = (320, 240)
MATRIX = np.array([[520.0, 0, 345.0], [0, 546.0, 205.0], [0, 0, 1]])  # of 640x480
NONE, BARREL = np.zeros(5), np.array([-0.22, 0.07, 0.0007, -0.0009, -0.008])
FISHEYE = np.array([-0.02, 0.003, -0.001, 0.0002])
RIG = {"face": "front", "distance_mm": [5200, 6000], "roll_deg": 3, "azimuth_deg": 8}


def opencv_file(path, coefficients, fisheye=False, shape=(-1, 1)):
    """Write a calibration as OpenCV's calibration samples do."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Fri Nov 27 2026")
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("fisheye_model", int(fisheye))
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", coefficients.reshape(shape))
    storage.release()


def ros_file(path, coefficients, fisheye=False):
    """Write a calibration as ROS's camera_calibration does."""
    content = {
        "image_width": 640,
        "image_height": 480,
        "camera_name": "gate",
        "camera_matrix": {"rows": 3, "cols": 3, "data": MATRIX.ravel().tolist()},
        "distortion_model": "equidistant" if fisheye else "plumb_bob",
        "distortion_coefficients": {
            "rows": 1,
            "cols": len(coefficients),
            "data": coefficients.tolist(),
        },
        "projection_matrix": {"rows": 3, "cols": 4, "data": [1.0] * 12},
    }
    path.write_text(yaml.dump(content))


def message_file(path, coefficients, fisheye=False):
    """Write a calibration as ROS prints the message camera_info."""
    model = "equidistant" if fisheye else "plumb_bob"
    path.write_text(
        f"height: 480\nwidth: 640\ndistortion_model: {model}\nD: {coefficients.tolist()}\n"
        f"K: {MATRIX.ravel().tolist()}\nbinning_x: 0\n"
    )


def config_of(folder, write, coefficients, fisheye):
    (folder / "port.yaml").write_text(
        yaml.dump({"cameras": {"G": {**RIG, "calibration": "camera.yaml"}}})
    )
    write(folder / "camera.yaml", coefficients, fisheye)
    return Config.load(folder / "port.yaml")


def opencv(view, coefficients, fisheye, points_mm, matrix=MATRIX):
    """Return the pixels of world points in a 640x480 image, by OpenCV alone.

    The centre of OpenCV's first pixel is (0, 0), and (0.5, 0.5) here.
    """
    turn, _ = cv2.Rodrigues(view.rotation)
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    arguments = (turn, view.translation_mm.reshape(3, 1), matrix, coefficients)
    return project(points_mm.reshape(-1, 1, 3), *arguments)[0].reshape(-1, 2) + 0.5


CASES = [(NONE, False), (BARREL, False), (FISHEYE, True)]
IDS = ["pinhole", "barrel", "fisheye"]


@pytest.mark.parametrize(("coefficients", "fisheye"), CASES, ids=IDS)
@pytest.mark.parametrize("write", [opencv_file, ros_file, message_file])
def test_a_calibration_file_projects_as_opencv(write, coefficients, fisheye, tmp_path):
    config = config_of(tmp_path, write, coefficients, fisheye)
    (camera,) = Generator(config, seed=2).scene(0).cameras
    points = np.random.default_rng(3).uniform((-9e3, -1500, -3e3), (9e3, 1500, 6e3), (4000, 3))
    view = view_of(camera, (640, 480))
    np.testing.assert_allclose(view.intrinsics[:2, 2], MATRIX[:2, 2] + 0.5, atol=1e-9)
    pixels, depth = view.project(points)
    inside = (depth > 0.3) & ((pixels > 0) & (pixels < (640, 480))).all(axis=1)
    assert inside.sum() > 300
    wanted = opencv(view, coefficients, fisheye, points[inside])
    np.testing.assert_allclose(pixels[inside], wanted, atol=1e-5)
    # half the size, and a crop of equal height above and below
    halved = view_of(camera, (320, 240)).project(points)[0][inside]
    np.testing.assert_allclose(halved, wanted / 2, atol=1e-5)
    square = view_of(camera, (640, 640)).project(points)[0][inside]
    np.testing.assert_allclose(square, wanted + (0, 80), atol=1e-5)


@pytest.mark.parametrize("shape", [(5,), (5, 1), (1, 5), (1, 1, 5), (5, 1, 1)])
@pytest.mark.parametrize("kind", ["yaml", "yml", "json"])
def test_a_file_of_opencv_is_read_whatever_the_shape_of_its_coefficients(kind, shape, tmp_path):
    file = tmp_path / f"camera.{kind}"
    opencv_file(file, BARREL, shape=shape)
    camera = Config.from_values({"cameras": {"G": {**RIG, "calibration": str(file)}}}).cameras["G"]
    found = [getattr(camera.lens, name)[0] for name in ("k1", "k2", "p1", "p2", "k3")]
    np.testing.assert_allclose(found, BARREL, rtol=1e-15)


def test_an_xml_file_of_opencv_is_refused_with_the_types_that_can_be_read(tmp_path):
    file = tmp_path / "camera.xml"
    opencv_file(file, BARREL)
    with pytest.raises(ConfigError, match=r"camera.xml: is an XML file; write .*as .yaml or .json"):
        Config.from_values({"cameras": {"G": {**RIG, "calibration": str(file)}}})


@pytest.mark.parametrize(("coefficients", "fisheye"), CASES, ids=IDS)
def test_drawn_ids_and_depth_are_those_of_rays(coefficients, fisheye, tmp_path):
    config = config_of(tmp_path, ros_file, coefficients, fisheye)
    with Generator(config, seed=5, size=SIZE) as generator:
        for index in (1, 2):
            sample = generator.render(index)
            mesh = PreparedScene(sample.scene).container
            hits = oracle.cast(mesh, sample.view, sample.scene)
            ids = oracle.object_ids(sample.scene, mesh, hits)
            wrong = ids != sample.ids
            assert wrong.sum() <= 2e-4 * wrong.size
            assert (ids > 0).mean() > 0.1


def test_a_matrix_in_the_file_is_that_of_opencv():
    matrix = {"fx": 520, "fy": 546, "cx": 345, "cy": 205, "width": 640, "height": 480}
    lens = dict(zip(("k1", "k2", "p1", "p2", "k3"), BARREL.tolist(), strict=True))
    config = Config.from_values({"cameras": {"G": {**RIG, "matrix": matrix, "lens": lens}}})
    (camera,) = Generator(config, seed=2).scene(0).cameras
    view = view_of(camera, (640, 480))
    points = np.random.default_rng(3).uniform(-1200, 1200, (50, 3))
    wanted = opencv(view, BARREL, False, points)
    np.testing.assert_allclose(view.project(points)[0], wanted, atol=1e-5)


@pytest.mark.parametrize("fov_deg", [30, 90, 120])
def test_the_field_of_view_spans_the_width_of_the_image(fov_deg):
    config = Config.from_values({"cameras": {"G": {**RIG, "fov_deg": fov_deg}}})
    (camera,) = Generator(config, seed=2).scene(0).cameras
    _, rays = view_of(camera, SIZE).rays(np.array([[0, 120], [320, 120]]))
    assert np.degrees(np.arccos(rays[0] @ rays[1])) == pytest.approx(fov_deg)


def test_the_field_of_view_of_a_fisheye_is_that_of_equal_angles():
    lens = {"model": "fisheye"}
    config = Config.from_values({"cameras": {"G": {**RIG, "fov_deg": 140, "lens": lens}}})
    (camera,) = Generator(config, size=(640, 64), seed=2).scene(0).cameras
    _, rays = view_of(camera, (640, 64)).rays(np.array([[0, 32], [640, 32]]))
    assert np.degrees(np.arccos(rays[0] @ rays[1])) == pytest.approx(140)


def test_a_calibration_replaces_the_lens_of_the_base(tmp_path):
    base = Config.preset("crane")
    ros_file(tmp_path / "camera.yaml", NONE)
    values = {"cameras": {"A": {"calibration": str(tmp_path / "camera.yaml")}}}
    assert base.cameras["A"].lens is not None
    assert Config.from_values(values, base).cameras["A"].lens is None
    ros_file(tmp_path / "camera.yaml", BARREL)
    lens = Config.from_values(values, base).cameras["A"].lens
    assert lens.model == "brown_conrady"
    assert (lens.k1, lens.p2) == ((-0.22, -0.22), (-0.0009, -0.0009))


def test_the_cameras_of_the_docs_page_can_be_drawn(tmp_path):
    page = (Path(__file__).parent.parent / "docs/sensor.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```yaml\n(cameras:\n[^`]*calibration:[^`]*)```$", page, re.MULTILINE)
    (tmp_path / "port.yaml").write_text(block)
    opencv_file(tmp_path / "gate_camera.yaml", BARREL)
    generator = Generator(Config.load(tmp_path / "port.yaml"), size=(192, 108))
    gate, roof, side = generator.scene(0).cameras
    assert gate.lens.coefficients == tuple(BARREL)
    assert roof.focal_mm == pytest.approx(18 / np.tan(np.radians(47.5)))
    view = view_of(side, (1920, 1080))
    wanted = [[1210.4, 0, 968.7], [0, 1208.9, 532.2], [0, 0, 1]]
    np.testing.assert_allclose(view.intrinsics, wanted, atol=1e-9)


GOOD = "image_width: 640\nimage_height: 480\nK: [900, 0, 300, 0, 900, 200, 0, 0, 1]\n"


@pytest.mark.parametrize(
    ("camera", "text", "words"),
    [
        (
            "{fov_deg: 180}",
            "",
            "fov_deg: 180 is not a field of view; give degrees between 0 and 180",
        ),
        ("{fov_deg: x}", "", "fov_deg: 'x' is not a field of view"),
        (
            "{fov_deg: 90, focal_mm: 20}",
            "",
            " fov_deg and focal_mm each give the focal length",
        ),
        ("{matrix: {fx: 1}}", "", "matrix: lacks fy, cx, cy, width, height; give fx,"),
        (
            "{matrix: {fx: 900, fy: 900, cx: 900, cy: 240, width: 640, height: 480}}",
            "",
            "matrix.cx: 900 is out of range; give 31.5 to 607.5",
        ),
        (
            "{calibration: c.yaml}",
            GOOD.replace("640", "wide"),
            "calibration: {folder}/c.yaml: image_width: expected a number of pixels above 0",
        ),
        (
            "{calibration: c.yaml}",
            GOOD.replace("900, 0, 300", "900, .nan, 300"),
            "calibration: {folder}/c.yaml: camera_matrix has nan in place of a number; give",
        ),
        (
            "{calibration: c.yaml}",
            GOOD + "D: [0, 0]\ndistortion_model: mei",
            "calibration: {folder}/c.yaml: distortion_model 'mei' is unknown (choose",
        ),
        (
            "{calibration: c.yaml}",
            GOOD + "D: [0, 0, 0, 0, 1]\ndistortion_model: fisheye",
            "calibration: {folder}/c.yaml: has distortion coefficients beyond the first 4;",
        ),
        ("{calibration: 5}", "", "calibration: expected the path of a file, got 5"),
        (
            "{calibration: gone.yaml}",
            "",
            "calibration: {folder}/gone.yaml: cannot be read (No such",
        ),
        (
            "{calibration: c.yaml, lens: null}",
            GOOD,
            " calibration and lens each give the",
        ),
        (
            "{calibration: c.yaml}",
            "a",
            "calibration: {folder}/c.yaml: holds 'a'; give a calibration",
        ),
        ("{calibration: c.yaml}", "a: [", "calibration: {folder}/c.yaml: not a YAML file ("),
        (
            "{calibration: c.yaml}",
            "K: []",
            "calibration: {folder}/c.yaml: has no width; name it",
        ),
        (
            "{calibration: c.yaml}",
            GOOD[:35] + "KK: [1]",
            "calibration: {folder}/c.yaml: has no matrix; name it camera_matrix or cameraMatrix or",
        ),
        (
            "{calibration: c.yaml}",
            GOOD.replace("900, 0, 300", "900, 1, 300"),
            "calibration: {folder}/c.yaml: camera_matrix has a skew of 1; calibrate without skew",
        ),
        (
            "{calibration: c.yaml}",
            GOOD + "D: [0.1, 0, 0, 0, 0, 0.2]",
            "calibration: {folder}/c.yaml: has distortion coefficients beyond the first 5;",
        ),
        (
            "{calibration: c.yaml}",
            GOOD + "D: [1, 0]\ndistortion_model: magic",
            "calibration: {folder}/c.yaml: distortion_model 'magic' is unknown (choose",
        ),
    ],
)
def test_an_unusable_camera_is_refused_by_its_key(camera, text, words, tmp_path):
    (tmp_path / "c.yaml").write_text(text)
    path = tmp_path / "port.yaml"
    path.write_text(f"cameras: {{A: {camera}}}")
    with pytest.raises(ConfigError) as caught:
        Config.load(path)
    wanted = re.sub(r"\{folder\}", str(tmp_path), words)
    joint = ":" if words.startswith(" ") else "."
    assert str(caught.value).startswith(f"{path}: cameras.A{joint}{wanted}")

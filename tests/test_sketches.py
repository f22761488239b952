"""Sketches of the documentation: drawn angles are those of the camera, and keys exist."""

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import sketches

from fastgen import Config
from fastgen.camera.projection import view_of
from fastgen.config.schema import json_schema
from fastgen.sampling.scene import sample_scene

SVG = "{http://www.w3.org/2000/svg}"


def stored(name):
    """Return the elements of a sketch by id, and its texts."""
    root = ElementTree.parse(sketches.FOLDER / f"{name}.svg").getroot()
    return {e.get("id"): e for e in root.iter() if e.get("id")}, [
        "".join(e.itertext()) for e in root.iter(f"{SVG}text")
    ]


def rotation(face, **angles):
    """Return the rotation, world to view, of a camera sampled with fixed angles."""
    still = {"azimuth_deg": 0, "elevation_deg": 0, "roll_deg": 0, "target_shift_mm": 0}
    rig = {"face": face, "focal_mm": 28, "distance_mm": 6000, **still, **angles}
    config = Config.from_values({"cameras": {"one": rig}})
    (camera,) = sample_scene(config, 1, 1, {"venice": 1.0}).cameras
    return view_of(camera, (100, 100)).rotation


def way(elements, start, end):
    points = [
        np.array([float(elements[f"{name}"].get(key)) for key in ("cx", "cy")])
        for name in (start, end)
    ]
    return points[1] - points[0]


@pytest.mark.parametrize("name", sorted(sketches.SKETCHES))
def test_stored_sketches_are_those_of_the_script(name):
    assert (sketches.FOLDER / f"{name}.svg").read_text() == sketches.SKETCHES[name]().svg()


def test_drawn_azimuth_and_elevation_are_those_of_the_camera_matrix():
    elements, texts = stored("camera")
    across, down = way(elements, "top-target", "top-camera")  # x right, -y down the page
    assert f"azimuth_deg {sketches.AZIMUTH_DEG:g}" in texts
    backward = -rotation("front", azimuth_deg=sketches.AZIMUTH_DEG)[2]
    assert math.atan2(across, down) == pytest.approx(
        math.atan2(backward[0], -backward[1]), abs=1e-3
    )
    across, down = way(elements, "side-target", "side-camera")  # y right, z up the page
    assert f"elevation_deg {sketches.ELEVATION_DEG:g}" in texts
    backward = -rotation("front", elevation_deg=sketches.ELEVATION_DEG)[2]
    assert math.atan2(-down, -across) == pytest.approx(
        math.atan2(backward[2], -backward[1]), abs=1e-3
    )


def test_drawn_roll_is_that_of_the_camera_matrix():
    elements, _ = stored("camera")
    points = np.array(
        [
            [float(v) for v in pair.split(",")]
            for pair in elements[f"door-{sketches.ROLL_DEG:g}"].get("points").split()
        ]
    )
    drawn = math.atan2(*(points[1] - points[0])[::-1])  # of the upper edge, clockwise
    right = rotation("door", roll_deg=sketches.ROLL_DEG)[:2] @ (0, 1, 0)
    assert drawn == pytest.approx(math.atan2(right[1], right[0]), abs=5e-3)
    assert drawn == pytest.approx(math.radians(sketches.ROLL_DEG), abs=5e-3)


def test_drawn_field_of_view_is_that_of_the_rays():
    camera = {"A": {"face": "front", "distance_mm": 6000, "focal_mm": sketches.FOCAL_MM}}
    scene = sample_scene(Config.from_values({"cameras": camera}), 1, 1, {"venice": 1.0})
    view = view_of(scene.cameras[0], (100, 100))
    _, edges = view.rays(np.array([(0.0, 50.0), (100.0, 50.0)]))
    fov_deg = math.degrees(math.acos(edges[0] @ edges[1]))
    assert f"fov_deg {fov_deg:.1f}" in stored("camera")[1]


def test_every_key_in_a_sketch_is_a_key_of_the_configuration():
    known = (
        json.dumps(json_schema())
        + (Path(sketches.__file__).parent.parent / "docs/sensor.md").read_text()
    )
    found = {key for name in sketches.SKETCHES for text in stored(name)[1]
             for key in re.findall(r"\b[a-z_]+_(?:mm|deg)\b|\baim_\w+", text)}  # fmt: skip
    assert len(found) >= 20
    assert {key for key in found - {"center_mm"} if key not in known} == set()

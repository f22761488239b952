"""Rigs are refused where a camera may come too near, before anything is drawn."""

import numpy as np
import pytest

from fastgen import Config
from fastgen.errors import ConfigError

HALF_WIDTH_MM, HALF_LENGTH_MM = 1219.0, 3029.0  # of a 20-foot container, ISO 668


def made(**camera):
    rig = {"face": "door", "focal_mm": 20, "elevation_deg": 0, "target_shift_mm": 0} | camera
    return Config.from_values({"cameras": {"N": rig}, "container": {"kinds": {"20": 1}}})


def refused(**camera):
    try:
        made(**camera)
    except ConfigError as error:
        return str(error).startswith("cameras.N: may come nearer to a container of kind 20")
    return False


@pytest.mark.parametrize("distance_mm", [300, 500, 1100])
@pytest.mark.parametrize("angle", ["azimuth_deg", "elevation_deg"])
def test_before_a_face_a_camera_keeps_100_mm_by_its_angle(distance_mm, angle):
    # the foot of the perpendicular lies on the face, so its length is the distance: d cos a
    steepest = np.degrees(np.arccos(100 / distance_mm))
    other = {"azimuth_deg": 0, "elevation_deg": 0} | {"distance_mm": distance_mm}
    for sign in (1, -1):
        assert not refused(**other | {angle: sign * (steepest - 0.01)})
        assert refused(**other | {angle: sign * (steepest + 0.01)})


def test_beyond_the_edge_of_a_face_a_camera_keeps_100_mm_from_the_edge():
    for away_mm, near in ((99.0, True), (101.0, False)):
        # 60 mm before the plane of the face, the rest of the way aside from its edge
        before, aside = 60.0, HALF_WIDTH_MM + np.sqrt(away_mm**2 - 60.0**2)
        azimuth = np.degrees(np.arctan2(aside, before))
        assert refused(distance_mm=np.hypot(before, aside), azimuth_deg=azimuth) is near


def test_ranges_count_as_a_whole():
    # where the camera stands farthest it is clear of the face, beyond its edge
    azimuth = 88.0
    far = (HALF_WIDTH_MM + 500) / np.sin(np.radians(azimuth))
    rig = {"azimuth_deg": azimuth, "target_shift_mm": [0, 0]}
    assert not refused(distance_mm=far, **rig)
    assert refused(distance_mm=[far - 450, far], **rig)
    # a shift of what it looks at brings it back over the face
    assert refused(distance_mm=far, **rig | {"target_shift_mm": [-450, 0]})
    assert not refused(distance_mm=far, **rig | {"target_shift_mm": [0, 450]})


def test_only_kinds_that_come_are_asked():
    beside = {"face": "front", "focal_mm": 20, "distance_mm": 4000, "azimuth_deg": 89}
    beside |= {"elevation_deg": 0, "target_shift_mm": 0}
    assert np.sin(np.radians(89)) * 4000 > HALF_LENGTH_MM + 100
    kinds = {"20": 1, "40": 0}
    Config.from_values({"cameras": {"N": beside}, "container": {"kinds": kinds}})
    with pytest.raises(ConfigError, match="container of kind 40 than 100 mm"):
        Config.from_values({"cameras": {"N": beside}, "container": {"kinds": kinds | {"40": 1}}})


@pytest.mark.parametrize("seed", range(8))
def test_no_draw_of_an_accepted_rig_comes_too_near(seed):
    rng = np.random.default_rng(seed)
    accepted = 0
    while accepted < 3:
        lo, hi = np.sort(rng.uniform(-89, 89, (2, 2)), axis=0)
        near = rng.uniform(300, 3000)
        rig = {
            "azimuth_deg": [lo[0], hi[0]],
            "elevation_deg": [lo[1], hi[1]],
            "distance_mm": [near, near * 1.5],
            "target_shift_mm": [-300, 300],
        }
        if refused(**rig):
            continue
        accepted += 1
        azimuth, elevation = np.radians(rng.uniform(lo, hi, (20000, 2))).T
        d = rng.uniform(near, near * 1.5, 20000)
        aside, up = rng.uniform(-300, 300, (2, 20000))
        away = np.stack(
            [
                d * np.cos(elevation) * np.cos(azimuth),
                np.abs(aside + d * np.cos(elevation) * np.sin(azimuth)) - HALF_WIDTH_MM,
                np.abs(up + d * np.sin(elevation)) - 2591 / 2,
            ]
        )
        assert np.linalg.norm(np.maximum(away, 0), axis=0).min() >= 100

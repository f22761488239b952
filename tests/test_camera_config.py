"""Camera rigs that could place a camera too close to a container are refused."""

import re

import numpy as np
import pytest

from fastgen import Config
from fastgen.config.cameras import CameraConfig
from fastgen.errors import ConfigError

HALF_WIDTH_MM, HALF_LENGTH_MM = 1219.0, 3029.0  # of a 20-foot container, ISO 668


RIG = {
    "face": "door",
    "focal_mm": 20,
    "azimuth_deg": 0,
    "elevation_deg": 0,
    "target_shift_mm": 0,
}


def refused(kind="20", **camera):
    values = {"cameras": {"N": RIG | camera}, "container": {"kinds": {str(kind): 1}}}
    try:
        Config.from_values(values | {"damage": {"probability": 0}})
    except ConfigError as error:
        words = rf"cameras\.N: may come within \d+ mm of a container of kind {kind}, and"
        return re.match(words, str(error)) is not None
    return False


@pytest.mark.parametrize("distance_mm", [300, 500, 1100])
@pytest.mark.parametrize("angle", ["azimuth_deg", "elevation_deg"])
def test_the_steepest_angle_in_front_of_a_face_leaves_100_mm(distance_mm, angle):
    # the perpendicular meets the face, so the distance to the face is its length d cos(a)
    steepest = np.degrees(np.arccos(100 / distance_mm))
    other = {"azimuth_deg": 0, "elevation_deg": 0} | {"distance_mm": distance_mm}
    for sign in (1, -1):
        assert not refused(**other | {angle: sign * (steepest - 0.01)})
        assert refused(**other | {angle: sign * (steepest + 0.01)})


def test_beyond_the_edge_of_a_face_a_camera_keeps_100_mm_from_the_edge():
    for away_mm, near in ((99.0, True), (101.0, False)):
        # 60 mm in front of the plane of the face, the rest of the distance beyond its edge
        before, aside = 60.0, HALF_WIDTH_MM + np.sqrt(away_mm**2 - 60.0**2)
        azimuth = np.degrees(np.arctan2(aside, before))
        assert refused(distance_mm=np.hypot(before, aside), azimuth_deg=azimuth) is near


def test_one_bad_value_within_a_range_refuses_the_rig():
    # at its largest distance the camera is clear of the face, beyond the edge
    azimuth = 88.0
    far = (HALF_WIDTH_MM + 500) / np.sin(np.radians(azimuth))
    rig = {"azimuth_deg": azimuth, "target_shift_mm": [0, 0]}
    assert not refused(distance_mm=far, **rig)
    assert refused(distance_mm=[far - 450, far], **rig)
    # shifting its target moves the camera back in front of the face
    assert refused(distance_mm=far, **rig | {"target_shift_mm": [-450, 0]})
    assert not refused(distance_mm=far, **rig | {"target_shift_mm": [0, 450]})


def test_only_container_kinds_with_a_weight_are_checked():
    beside = {"face": "front", "focal_mm": 20, "distance_mm": 4000, "azimuth_deg": 89}
    beside |= {"elevation_deg": 0, "target_shift_mm": 0}
    assert np.sin(np.radians(89)) * 4000 > HALF_LENGTH_MM + 100
    kinds = {"20": 1, "40": 0}
    values = {"cameras": {"N": beside}, "damage": {"probability": 0}}
    Config.from_values(values | {"container": {"kinds": kinds}})
    with pytest.raises(ConfigError, match="container of kind 40, and"):
        Config.from_values(values | {"container": {"kinds": kinds | {"40": 1}}})


@pytest.mark.parametrize("seed", range(12))
def test_no_camera_sampled_from_an_accepted_rig_is_too_close(seed):
    # half-sizes along right, up and out of each face; ISO 668
    faces = {"front": "lhw", "back": "lhw", "door": "whl", "no_door": "whl", "roof": "lwh"}
    kinds = {"20": (6058, 2438, 2591), "45HC": (13716, 2438, 2896)}
    rng = np.random.default_rng(seed)
    accepted = 0
    while accepted < 3:
        face, kind = rng.choice(list(faces)), rng.choice(list(kinds))
        sides = dict(zip("lwh", kinds[kind], strict=True))
        half_right, half_up = (sides[name] / 2 for name in faces[face][:2])
        lo, hi = np.sort(rng.uniform(-89, 89, (2, 2)), axis=0)
        near, far = np.sort(np.exp(rng.uniform(np.log(300), np.log(1.5e5), 2)))
        left, right = np.sort(rng.uniform(-1e4, 1e4, 2))
        rig = {"face": face, "azimuth_deg": [lo[0], hi[0]], "elevation_deg": [lo[1], hi[1]]}
        rig |= {"distance_mm": [near, far], "target_shift_mm": [left, right]}
        if refused(kind, **rig):
            continue
        accepted += 1
        azimuth, elevation = np.radians(rng.uniform(lo, hi, (50000, 2))).T
        d = rng.uniform(near, far, 50000)
        aside, up = rng.uniform(left, right, (2, 50000))
        away = [
            d * np.cos(elevation) * np.cos(azimuth),
            np.abs(aside + d * np.cos(elevation) * np.sin(azimuth)) - half_right,
            np.abs(up + d * np.sin(elevation)) - half_up,
        ]
        assert np.linalg.norm(np.maximum(away, 0), axis=0).min() >= 100


@pytest.mark.parametrize(
    ("kind", "face", "azimuth_deg", "elevation_deg", "shift_mm"),
    [
        ("40", "back", -87.9956, [-89, 89], [6805.5, 6806.7]),
        ("45HC", "roof", 84.539, [80.14, 83.86], [-7588.1, -7562.1]),
        ("45HC", "underside", 88.0407, [-89, 89], [-6745.4, -6743.3]),
    ],
)
def test_a_small_forbidden_region_of_a_wide_rig_is_found(
    kind, face, azimuth_deg, elevation_deg, shift_mm
):
    rig = {"face": face, "azimuth_deg": azimuth_deg, "elevation_deg": elevation_deg}
    assert refused(kind, distance_mm=[300, 150000], target_shift_mm=shift_mm, **rig)


def test_the_required_distance_includes_outward_damage():
    def config(distance_mm, damage):
        values = {"cameras": {"N": RIG | {"distance_mm": distance_mm}}, "damage": damage}
        return Config.from_values(values)

    concave = {"outward": 0.5, "depth_mm": [50, 150]}
    inward, deep = concave | {"outward": 0}, concave | {"depth_mm": 400}
    for damage in ({"probability": 0}, {"kinds": ["dented"]}, {"concave": inward}):
        config(300, damage)
        config(301, damage)
    config(300, {"concave": concave})
    config(301, {"concave": concave})
    config(501, {"concave": deep})
    for distance_mm in (300, 499):
        with pytest.raises(ConfigError, match="may bulge by 400 mm") as caught:
            config(distance_mm, {"concave": deep})
        # both settings are in another section, so the error has to name them
        assert "damage.concave.depth_mm" in str(caught.value)
        assert "damage.concave.outward: 0" in str(caught.value)
    # the lower lip of a tear bends outward by its depth, times the twist above 1
    hole = {"torn": 1, "depth_mm": 600, "twist": [0, 1.5]}
    for values in ({"torn": 0}, {"twist": 1}, {"depth_mm": 300}):
        config(301, {"concave": inward, "perforation": hole | values})
    config(301, {"concave": inward, "perforation": hole, "kinds": ["concave"]})
    config(401, {"concave": inward, "perforation": hole})
    with pytest.raises(ConfigError, match=r"may bulge by 300 mm .* and a twist up to 1"):
        config(399, {"concave": inward, "perforation": hole})


def test_a_rig_made_in_python_is_checked_like_one_from_a_file():
    rig = {"A": CameraConfig("front", 14.5, (5600, 7400), azimuth_deg=3)}
    found = Config.checked(Config(cameras=rig)).cameras["A"]
    assert found.distance_mm == (5600, 7400)
    assert found.azimuth_deg == (3, 3)
    with pytest.raises(ConfigError, match=r"^cameras\.A\.azimuth_deg: .* got '12'"):
        Config.checked(Config(cameras={"A": CameraConfig("front", 14.5, 6000, azimuth_deg="12")}))

"""Fits to photographs: statistics by independent formulas, and recovery of known cameras."""

import itertools
import re
import time
from concurrent.futures import ThreadPoolExecutor
from math import erf, sqrt

import cv2
import numpy as np
import pytest

from fastgen.camera.electronics import compress_jpeg, sharpened, vignette
from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.config.sensor import SensorConfig
from fastgen.config.yaml_values import loaded
from fastgen.fit.edges import edge_blur_and_overshoot
from fastgen.fit.frames import linear_frames, statistics_of_frames
from fastgen.fit.gap import Gap, gap
from fastgen.fit.paints import paint_weights
from fastgen.fit.photographs import read_photographs
from fastgen.fit.proposal import Effort, Proposal, propose
from fastgen.fit.search import mixed_shares, search
from fastgen.fit.space import VARIABLES, changes_at, point_of, sensor_at
from fastgen.fit.statistics import NAMES, STATISTICS, measured
from fastgen.scene.optics import Sharpening
from fastgen.validation import from_plain
from tests.photographs import photographs_in


def statistic(pixels, name):
    return float(measured(pixels)[NAMES.index(name)])


def grey_picture(values):
    """Return a grey picture of values 0..255 [H, W]."""
    codes = np.clip(np.rint(values), 0, 255).astype(np.uint8)
    return np.repeat(codes[..., None], 3, axis=2)


def blurred_bars(sigma, size=240, bar=40):
    """Return bars between codes 70 and 180 with edges that a Gaussian blurs."""
    x = np.arange(size) + 0.5
    row = np.full(size, 70.0)
    for number, edge in enumerate(range(bar, size, bar)):
        rise = np.array([0.5 * (1 + erf((v - edge) / (sigma * sqrt(2)))) for v in x])
        row += (110 if number % 2 == 0 else -110) * rise
    return np.tile(row, (size, 1))


def test_quantiles_of_a_ramp_are_its_values():
    ramp = grey_picture(np.tile(np.linspace(0, 255, 512), (64, 1)))
    for share in (5, 25, 50, 75, 95):
        assert statistic(ramp, f"luminance, {share} %") == pytest.approx(share / 100, abs=0.005)
    assert statistic(ramp, "contrast") == pytest.approx(sqrt(1 / 12), abs=0.002)
    assert statistic(ramp, "clipped share") == pytest.approx(13 / 256, abs=0.004)
    assert statistic(ramp, "black share") == pytest.approx(12.5 / 256, abs=0.004)


@pytest.mark.parametrize("sigma", [1.0, 3.0, 8.0])
def test_noise_is_that_which_was_added(sigma):
    # the flattest quarter of pure noise has up to a tenth less
    rng = np.random.default_rng(1)
    picture = grey_picture(128 + rng.normal(0, sigma, (240, 320)))
    assert 2 ** statistic(picture, "noise") - 0.25 == pytest.approx(0.95 * sigma, rel=0.12)


def test_chroma_noise_does_not_count_fine_noise():
    rng = np.random.default_rng(1)
    flat = np.full((240, 320, 3), 128.0)
    fine = flat + rng.normal(0, 4, flat.shape)
    blotches = cv2.resize(rng.normal(0, 6, (60, 80)).astype(np.float32), (320, 240))
    coarse = flat + blotches[..., None] * [1.402, -0.714, 0]
    fine, coarse = (np.clip(np.rint(each), 0, 255).astype(np.uint8) for each in (fine, coarse))
    assert statistic(coarse, "chroma noise") > statistic(fine, "chroma noise") + 0.7
    assert statistic(fine, "noise") > statistic(coarse, "noise") + 1


@pytest.mark.parametrize("sigma", [0.8, 1.2, 1.8])
def test_blur_of_an_edge_is_that_of_its_gaussian(sigma):
    picture = grey_picture(blurred_bars(sigma))
    assert statistic(picture, "edge blur") == pytest.approx(sigma, rel=0.12)
    assert abs(statistic(picture, "overshoot of edges")) < 0.02


def test_overshoot_is_that_of_an_unsharp_mask():
    amount, blur, radius = 1.0, 1.0, 1.5
    picture = sharpened(grey_picture(blurred_bars(blur)), Sharpening(amount, radius))
    x = np.linspace(0, 4, 401)
    step = [
        (1 + amount) * 0.5 * (1 + erf(v / (blur * sqrt(2))))
        - amount * 0.5 * (1 + erf(v / sqrt(2 * (blur**2 + radius**2))))
        for v in x
    ]
    _, overshoot = edge_blur_and_overshoot((picture[..., 0] / 255).astype(np.float32))
    assert overshoot == pytest.approx(max(step) - 1, abs=0.015)


def test_white_balance_is_in_stops_of_light():
    codes = np.array([128, 128, 128], float)
    light = ((codes / 255 + 0.055) / 1.055) ** 2.4 * [2**0.3, 1, 2**-0.2]
    encoded = 255 * (1.055 * light ** (1 / 2.4) - 0.055)
    picture = np.tile(np.rint(encoded).astype(np.uint8), (80, 80, 1))
    assert statistic(picture, "red over green") == pytest.approx(0.3, abs=0.03)
    assert statistic(picture, "blue over green") == pytest.approx(-0.2, abs=0.03)


def test_blockiness_falls_with_jpeg_quality():
    rng = np.random.default_rng(2)
    picture = grey_picture(cv2.GaussianBlur(rng.normal(128, 300, (240, 320)), (0, 0), 3))
    found = [statistic(compress_jpeg(picture, quality), "blockiness") for quality in (15, 50, 95)]
    assert found[0] > found[1] + 0.1 > found[2] + 0.1
    assert statistic(picture, "blockiness") == pytest.approx(0, abs=0.1)


def test_corner_light_follows_vignetting():
    light = 0.4 * vignette((320, 240), 0.5)[..., 0]
    picture = grey_picture(255 * (1.055 * light ** (1 / 2.4) - 0.055))
    assert -1 < statistic(picture, "corner light") < -0.6


def test_the_gap_is_the_shift_in_spreads_of_the_photographs():
    rng = np.random.default_rng(3)
    real = rng.normal(0, 1, (40, len(NAMES)))
    assert gap(real, real).total == pytest.approx(0, abs=1e-12)
    moved = gap(real, real + 2 * real.std(axis=0))
    np.testing.assert_allclose(moved.of_statistic, 2, rtol=1e-9)
    weights = np.array([1.0] * 40 + [0.0] * 40)
    assert gap(real, np.concatenate([real, real + 9]), weights).total == pytest.approx(0, abs=1e-9)
    one_dark = real.copy()
    one_dark[0] = np.nan
    assert np.isfinite(gap(one_dark, real).of_statistic).all()


@pytest.mark.parametrize("preset", ["seafront", "gate"])
def test_every_point_is_a_valid_sensor_and_the_preset_needs_no_change(preset):
    sensor = Config.preset(preset).sensor
    assert changes_at(point_of(sensor), sensor) == {}
    rng = np.random.default_rng(4)
    for point in (*rng.random((20, len(VARIABLES))), np.zeros(13), np.ones(13)):
        made = sensor_at(point, sensor)
        assert isinstance(made, SensorConfig)
        Config.from_values({"sensor": changes_at(point, sensor)}, Config.preset(preset))


def test_shares_of_light_are_a_mixture():
    shares = {"night": 0.2, "sun": 0.8}
    assert mixed_shares(shares, [0.5, 0.5]) == pytest.approx(shares)
    mixed = mixed_shares(shares, [1.0, 0.5])
    assert sum(mixed.values()) == pytest.approx(1)
    assert mixed["night"] > 0.8


def test_paints_of_photographs_gain_weight():
    surface = Config.preset().surface

    def picture(name):
        code = bytes.fromhex(surface.colors[name].removeprefix("#"))
        return np.tile(np.array(list(code), np.uint8), (80, 80, 1))

    both = [picture("signal blue"), picture("leaf green")]
    weights = paint_weights(surface, [picture("signal blue")], both)
    assert weights["signal blue"] > 1.5 * weights["oxide red"]
    assert weights["leaf green"] < 0.2 * weights["oxide red"]
    assert weights["white"] == 1
    colored = [name for name in weights if name not in ("white", "light grey", "mid grey")]
    assert sum(weights[name] for name in colored) == pytest.approx(len(colored), rel=0.02)


STRONG = {
    "exposure_error_ev": [0.6, 0.8],
    "white_balance_ev": [0.3, 0.3],
    "noise": {"probability": 1.0, "full_well_e": [300, 300]},
    "response": {"probability": 1.0, "clip": 1.2, "contrast": 1.5, "saturation": 1.5},
}
"""Camera whose photographs the closed loop fits: bright, magenta, noisy and hard."""


def test_a_fit_recovers_the_camera_of_photographs(generators):
    response = {"probability": 1.0, "clip": 1.2, "contrast": 1.0, "saturation": 1.0}
    sensor = {"response": response, "noise": {"probability": 1.0, "full_well_e": 8000}}
    whole = {"damage": {"probability": 0.0}, "environment": {"names": ["park", "city"]}}
    config = Config.from_values({**whole, "sensor": sensor})
    generator = generators(config, seed=3, size=(160, 120), quality="draft")
    frames = list(linear_frames(generator, 8))
    others = list(linear_frames(generator, 8, first=100))
    with ThreadPoolExecutor(2) as workers:
        taken = from_plain(SensorConfig, STRONG, base=SensorConfig())
        real = statistics_of_frames([*frames, *others], taken, workers)
        found = search(real, frames, config.sensor, {}, 300, seed=1)
        sensor = sensor_at(found.point, config.sensor)
        before, after = (
            [
                gap(real, statistics_of_frames(each, camera, workers)).total
                for each in (frames, others)
            ]
            for camera in (config.sensor, sensor)
        )
    assert after[0] < 0.5 * before[0]
    assert after[1] < 0.8 * before[1]  # scenes that the search did not see
    # a camera that clips later and exposes longer takes much the same picture
    exposure = sum(sensor.exposure_error_ev) / 2 - np.log2(np.mean(sensor.response.clip))
    assert exposure == pytest.approx(0.7 - np.log2(1.2), abs=0.35)
    assert sum(sensor.white_balance_ev) / 2 == pytest.approx(0.3, abs=0.15)
    assert 120 < sensor.noise.full_well_e.lo <= sensor.noise.full_well_e.hi < 800
    # the two make up for each other, and where the search ends depends on the CPU's rounding
    assert sensor.response.contrast.lo > 1.05
    assert sensor.response.saturation.lo > 1.1
    assert sensor.response.contrast.lo + sensor.response.saturation.lo > 2.4


def test_a_proposal_changes_paints_light_and_camera(tmp_path):
    names = ("park", "port_night")
    preset = Config.from_values({"environment": {"names": names}, "sensor": {"vignetting": 0.1}})
    photographs = read_photographs(photographs_in(tmp_path / "photos", 5), 640)
    effort = Effort(trials=12, frames=4, checked=3, size=(96, 72), quality="draft")
    proposal = propose(photographs, preset, effort, seed=2, boxes=[0.4, 0.6])
    assert set(proposal.values) == {"surface", "cameras", "environment", "sensor"}
    assert set(proposal.values["environment"]["weights"]) == set(names)
    assert proposal.after.total < proposal.before.total
    (tmp_path / "port.yaml").write_text(proposal.as_yaml("fitted"))
    config = Config.load(tmp_path / "port.yaml", preset)
    assert config == Config.from_values(proposal.values, preset)
    few = propose(photographs[:3], preset, effort, seed=2)
    assert not {"surface", "environment"} & set(few.values)
    assert "3 photographs are too few for weights" in few.notes[0]


STAGES = [
    "photographs",
    "pictures of the preset",
    "scenes for the search",
    "trials",
    "pictures of the proposal",
]


def test_a_log_of_the_command_has_plain_lines_about_each_stage(tmp_path, capsys, monkeypatch):
    def least(trials):
        return Effort(trials, frames=4, checked=3, size=(96, 72), quality="draft")

    monkeypatch.setattr("fastgen.fit.proposal.Effort", least)
    now = itertools.count(0, 20)  # each look at the clock is later than the next line in a log
    monkeypatch.setattr(time, "monotonic", lambda: float(next(now)))
    folder, file = photographs_in(tmp_path / "photos", 3), tmp_path / "port.yaml"
    assert main(["fit", str(folder), "-o", str(file), "--budget", "0.4", "--preset", "yard"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert all(line.isprintable() for line in lines)
    counted = [re.match(r"\[[#.]{28}\] (\d+)/(\d+) ([^,]+)", line).groups() for line in lines]
    assert list(dict.fromkeys(unit for *_, unit in counted)) == STAGES
    for stage, total in zip(STAGES, (3, 3, 4, 24, 3), strict=True):
        done = [int(count) for count, all_, unit in counted if unit == stage]
        assert done == sorted(done)
        assert {int(all_) for _, all_, unit in counted if unit == stage} == {total}
        assert len(done) > 1
        assert done[-1] == total
    assert any(re.search(r" 12/24 trials, .*smallest gap \d", line) for line in lines)


def test_the_command_refuses_before_it_renders(tmp_path, capsys):
    folder = photographs_in(tmp_path / "photos", 2)
    (folder / "1.png").write_bytes(b"no picture")  # too few are refused before any is read
    (tmp_path / "port.yaml").write_text("mine")
    for arguments, words in (
        ([], "port.yaml: exists; give another name with -o, or --force"),
        (["--force", "--budget", "0"], "budget: 0 is out of range"),
        (["--force", "--longest", "9"], "longest: 9 is out of range"),
        (["--force", "--preset", "gaet"], "did you mean gate"),
    ):
        assert main(["fit", str(folder), "-o", str(tmp_path / "port.yaml"), *arguments]) == 2
        assert words in capsys.readouterr().err
    assert main(["fit", str(folder), "-o", str(tmp_path / "port.yaml"), "--force"]) == 2
    assert capsys.readouterr().err == (
        f"fastgen: {folder}: has 2 photographs, too few to compare; give at least 3, or better 20\n"
    )
    assert (tmp_path / "port.yaml").read_text() == "mine"


def test_a_proposal_is_a_file_that_a_config_reads(tmp_path):
    values = {
        "surface": {"color_weights": {"oxide red": 2.0, "navy": 0.5}},
        "cameras": {"rear": {"distance_mm": [2500.0, 3000.0]}, "roof": {}},
        "sensor": {"response": {"clip": [1.1, 1.4]}, "jpeg_quality": [30, 60]},
        "environment": {"weights": {"park": 0.25}},
    }
    nothing = Gap(np.zeros(len(NAMES)), {}, 0.0)
    reasons = {"sensor.response": "photographs: contrast 0.2"}
    proposal = Proposal(values, reasons, nothing, nothing, ["few"])
    path = tmp_path / "port.yaml"
    path.write_text(proposal.as_yaml("two\nlines"))
    assert path.read_text().startswith("# two\n# lines\n# few\nsurface:\n")
    assert "  # photographs: contrast 0.2\n  response:\n" in path.read_text()
    assert loaded(path.read_text()) == values
    config = Config.load(path, Config.preset("gate"))
    assert config.cameras["rear"].distance_mm == (2500, 3000)
    assert config.cameras["roof"] == Config.preset("gate").cameras["roof"]


def test_a_file_that_cannot_be_written_is_refused_before_any_photograph_is_read(tmp_path, capsys):
    for path, message in ((tmp_path / "none" / "p.yaml", "no folder"), (tmp_path, "is a folder")):
        assert main(["fit", str(tmp_path / "photos"), "-o", str(path), "--force"]) != 0
        assert message in capsys.readouterr().err


def test_every_statistic_has_a_cue_and_a_floor():
    assert len(measured(grey_picture(np.full((64, 64), 99.0)))) == len(NAMES)
    assert all(each.cue and each.floor > 0 for each in STATISTICS.values())

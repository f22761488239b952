"""The comparison with real pictures: its folder, its measures and its reading order."""

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from crop_statistics import (
    auc,
    auc_interval,
    joint_scores,
    single_aucs,
    statistics_of,
    wilson,
)
from marker_search import Found, overlap, true_scores
from panel_crops import HANGING, STANDING, change_of, panels_of, square_crop
from real_crops import load_real
from text_peer import contains_code, joined

from fastgen import Generator
from fastgen.errors import ConfigError

CODE = "CSQU3054383"


def written(folder, table, rows, pictures=()):
    """Write a table and grey pictures."""
    (folder / table).write_text("\n".join(rows) + "\n")
    for name in pictures:
        (folder / name).parent.mkdir(exist_ok=True)
        cv2.imwrite(str(folder / name), np.full((20, 30, 3), 90, np.uint8))
    return folder


def test_folder_is_read_without_near_placards(tmp_path):
    rows = ["file,class,kind,side_px", "p/1.png,C3.1,exact,90", "p/2.png,C3.1,near,90"]
    written(tmp_path, "placards.csv", rows, ["p/1.png", "p/2.png"])
    rows = ["file,code,type,layout,view", f"i/1.jpg,{CODE},22G1,column,LB"]
    written(tmp_path, "identifiers.csv", rows, ["i/1.jpg"])
    rows = ["pair,kind", "00,hole"]
    written(tmp_path, "damage.csv", rows, ["damage/00_pos.jpg", "damage/00_neg.jpg"])
    found = load_real(tmp_path)
    assert [p.class_name for p in found.placards] == ["C3.1"]
    assert found.placards[0].pixels.shape == (20, 30, 3)
    assert [(i.code, i.layout, i.on_end) for i in found.identifiers] == [(CODE, "column", False)]
    assert [p.kind for p in found.panels] == ["hole"]
    assert found.photos == ()


@pytest.mark.parametrize(
    ("table", "rows", "message"),
    [
        ("placards.csv", ["file,class,kind", "1.png,C3.9,exact"], "row 2: class.*C3.9"),
        ("placards.csv", ["file,class,kind", "1.png,C3.1,exakt"], "row 2: kind.*exakt"),
        ("placards.csv", ["file,class,kind", "2.png,C3.1,exact"], "row 2: .*2.png.* missing"),
        ("placards.csv", ["file,kind", "1.png,exact"], "no column 'class'"),
        ("identifiers.csv", ["file,code,layout,view", "1.png,CSQU305438,rows,A"], "row 2: code"),
        (
            "identifiers.csv",
            ["file,code,layout,view", "1.png,CSQU3054384,rows,A"],
            "check digit of CSQU305438 is 3, not 4",
        ),
        ("identifiers.csv", ["file,code,layout,view", f"1.png,{CODE},row,A"], "row 2: layout"),
        ("identifiers.csv", ["file,code,layout,view", f"1.png,{CODE},rows,X"], "row 2: view"),
        ("damage.csv", ["pair,kind", "7,hole"], "row 2: .*7_pos.jpg.* missing"),
    ],
)
def test_a_wrong_row_is_refused_by_file_and_row(tmp_path, table, rows, message):
    written(tmp_path, table, rows, ["1.png"])
    with pytest.raises(ConfigError, match=message) as caught:
        load_real(tmp_path)
    assert table in str(caught.value)


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"has no placards.csv"):
        load_real(tmp_path)


def test_a_file_that_is_no_picture_is_refused(tmp_path):
    written(tmp_path, "placards.csv", ["file,class,kind", "1.png,C3.1,exact"])
    (tmp_path / "1.png").write_text("not a picture")
    with pytest.raises(ConfigError, match=r"row 2: .*not a JPEG or PNG"):
        load_real(tmp_path)


@pytest.mark.parametrize(("right", "count"), [(0, 7), (3, 16), (69, 107), (25, 25)])
def test_wilson_interval_solves_the_score_equation(right, count):
    """The ends p are where |share - p| is z standard errors of p."""
    share, low, high = wilson(right, count)
    assert share == right / count
    for end in (low, high):
        if 0 < end < 1:
            error = math.sqrt(end * (1 - end) / count)
            assert abs(share - end) == pytest.approx(1.959964 * error, rel=1e-6)
    assert 0 <= low <= share <= high <= 1


def test_auc_counts_pairs_and_half_of_ties():
    assert auc([3.0, 2.0], [1.0, 2.0]) == pytest.approx((1 + 1 + 1 + 0.5) / 4)
    assert math.isnan(auc([], [1.0]))
    value, low, high = auc_interval([3.0, 2.0, 5.0], [1.0, 2.0, 4.0])
    assert low <= value <= high


def test_reading_order_of_lines_and_columns():
    lines = [
        ("22G1", 150, 60, 240, 90),
        ("305438", 150, 12, 320, 48),
        ("[3]", 340, 15, 370, 50),
        ("CSQU", 5, 10, 110, 45),
    ]
    assert joined(lines, column=False) == "CSQU305438322G1"
    assert contains_code(lines, CODE, column=False)
    columns = [
        ("22G1", 90, 5, 120, 110),
        ("csqu", 10, 0, 42, 100),
        ("2,6m", 88, 150, 125, 200),
        ("305438", 8, 120, 40, 300),
    ]
    assert joined(columns, column=True) == "CSQU30543822G126M"
    assert contains_code(columns, CODE, column=True)
    assert not contains_code(columns, CODE, column=False)


def test_statistics_name_what_is_changed():
    rng = np.random.default_rng(0)
    plain = np.full((80, 120, 3), 120, np.uint8)
    pictures = {name: plain.copy() for name in ("plain", "noisy", "reddish", "stripes")}
    pictures["noisy"][:] = (plain + rng.normal(0, 12, plain.shape)).clip(0, 255)
    pictures["reddish"][..., 0] = 180
    pictures["stripes"][:, ::8] = 20
    of = {name: statistics_of(pixels, 120) for name, pixels in pictures.items()}
    assert of["noisy"]["noise of flat areas"] > of["plain"]["noise of flat areas"] + 1
    assert of["reddish"]["red over blue"] > of["plain"]["red over blue"] + 0.3
    assert of["reddish"]["mean saturation"] > of["plain"]["mean saturation"] + 0.2
    assert of["stripes"]["local contrast"] > of["plain"]["local contrast"] + 0.05
    assert of["stripes"]["upright over level edges"] > 3
    assert of["stripes"]["share of dark pixels"] == pytest.approx(1 / 8, abs=0.01)


def test_the_cue_that_differs_leads_and_noise_does_not_separate():
    rng = np.random.default_rng(1)
    ours, theirs = rng.normal(size=(60, 3)), rng.normal(size=(40, 3))
    apart = theirs + np.array([0.0, 3.0, 0.0])
    alone = single_aucs(ours, apart, ("a", "b", "c"))
    assert next(iter(alone)) == "b"
    assert alone["b"] > 0.9
    assert auc(*joint_scores(ours, apart)) > 0.9
    assert 0.25 < auc(*joint_scores(ours, theirs)) < 0.75


def test_square_crop_keeps_the_middle_at_the_border():
    image = np.zeros((40, 60, 3), np.uint8)
    image[0:10, 0:10] = 200
    crop = square_crop(image, (0, 0, 10, 10), 22, margin=0.0)
    assert crop.shape == (22, 22, 3)
    assert (crop == 200).all()


def test_true_markers_take_the_score_of_a_find_of_their_class():
    boxes = np.array([[0, 0, 10, 10], [20, 20, 30, 30.0]])
    assert overlap(boxes, boxes).tolist() == [[1, 0], [0, 1]]
    found = Found(boxes + 1, np.array([3, 5]), np.array([0.9, 0.8]))
    assert true_scores(found, boxes, np.array([3, 4])).tolist() == [0.9, 0.0]


def test_change_of_a_panel_is_that_of_its_most_changed_part():
    panel = np.full((80, 80, 3), 100, np.uint8)
    assert change_of(panel, panel) == 0
    assert change_of(panel + 7, panel) == pytest.approx(7, abs=1e-3)
    spot = panel.copy()
    spot[20:60, 20:60, 1] += 30
    assert change_of(spot, panel) == pytest.approx(30, abs=0.5)


@pytest.mark.parametrize("config", [HANGING, STANDING], ids=["hanging", "standing"])
def test_pairs_of_panels_show_the_same_place_with_and_without_damage(config):
    with Generator(config, seed=3, size=(160, 160), quality="draft") as generator:
        panels = panels_of(generator, generator.scene(0), np.random.default_rng(1))
    assert len(panels) > 2
    assert {pair.kind for pair in panels} <= set(config.damage.kinds)
    changes = [change_of(pair.damaged, pair.undamaged) for pair in panels]
    others = [change_of(a.damaged, b.undamaged) for a, b in pairwise(panels)]
    assert min(changes) > 0
    assert np.median(changes) < 0.5 * np.median(others)

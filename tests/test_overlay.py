"""Boxes and outlines drawn over images, by `overlay` and in contact sheets."""

import cv2
import numpy as np
import pytest

from fastgen import Config
from fastgen.classes import DAMAGE_CLASSES
from fastgen.cli.main import main
from fastgen.overlay import Outline, class_color, draw_outlines

pytestmark = pytest.mark.usefixtures("no_workers")


def test_boxes_have_the_colours_of_their_classes(generators):
    generator = generators(Config.from_values({"damage": {"probability": 1}}), seed=3)
    sample = generator.render(index=1, camera="Cr")
    shown = sample.overlay(np.zeros_like(sample.image)).reshape(-1, 3)
    strong = {"container", "text", "spreader", "seal", *DAMAGE_CLASSES}
    seen = {item.class_name for item in sample.objects if item.bbox is not None}
    assert len(seen & strong) >= 3
    for name in seen & strong:
        assert (shown == class_color(name)).all(axis=1).sum() > 20
    colors = np.array([class_color(name) for name in sorted(strong)])
    apart = np.abs(colors[:, None] - colors).max(axis=-1)
    assert apart[~np.eye(len(colors), dtype=bool)].min() > 60


def test_contact_sheet_outlines_damages_along_their_masks(tmp_path):
    (tmp_path / "damaged.yaml").write_text(
        "damage: {probability: 1, kinds: [perforation], faces: [no_door]}"
    )
    command = ["generate", str(tmp_path / "out"), "--images", "4", "--size", "400x400"]
    more = ["--config", str(tmp_path / "damaged.yaml"), "--cameras", "Cl", "--split", "val"]
    assert main([*command, *more]) == 0
    sheet = cv2.imread(str(tmp_path / "out/contact_sheet.png")).astype(int)
    color = np.array(class_color("perforation"))[::-1]
    masks = sorted((tmp_path / "out/damage/masks/val").iterdir())
    assert len(masks) == 4
    seen = 0
    for tile, path in zip(np.split(sheet, 4, axis=1), masks, strict=True):
        inside = (cv2.imread(str(path), cv2.IMREAD_UNCHANGED) >= 200).astype(np.uint8)
        around = cv2.dilate(inside, np.ones((5, 5))) - cv2.erode(inside, np.ones((3, 3)))
        drawn = np.abs(tile - color).max(axis=-1) < 40
        assert drawn[around == 1].sum() >= 0.15 * around.sum()
        within = cv2.erode(inside, np.ones((9, 9))) == 1  # other objects' names may lie here
        assert drawn[within].sum() <= 0.1 * within.sum()
        seen += inside.any()
    assert seen >= 2


def test_captions_of_touching_markers_cover_no_marker():
    names = [f"C{i}.1" for i in range(1, 9)]
    side = 28
    corners = [(180 + side * (i % 4), 300 + side * (i // 4)) for i in range(len(names))]
    boxes = [(x, y, x + side, y + side) for x, y in corners]
    image = np.zeros((400, 400, 3), np.uint8)
    around = Outline.of_box((150, 60, 320, 380), "container")
    draw_outlines(image, [around, *map(Outline.of_box, boxes, names)])
    for (x0, y0, x1, y1), name in zip(boxes, names, strict=True):
        assert not image[y0 + 1 : y1 - 1, x0 + 1 : x1 - 1].any()
        outline = 4 * (side - 1)
        caption = (image == class_color(name)).all(axis=-1).sum() - outline
        assert caption > 80  # the background of four letters is larger than this
        image[y0:y1, x0:x1] = 0


def test_captions_at_the_border_stay_inside_the_image():
    image = np.zeros((120, 90, 3), np.uint8)
    draw_outlines(image, [Outline.of_box((70, -5, 95, 8), "text", "text 123")])
    width = cv2.getTextSize("text 123", cv2.FONT_HERSHEY_SIMPLEX, 0.36, 1)[0][0]
    rows = (image == class_color("text")).all(axis=-1).sum(axis=1)
    assert (rows >= 0.7 * width).any()

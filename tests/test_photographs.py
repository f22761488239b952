"""Folders of photographs and of boxes beside them, as `fastgen fit` reads them."""

import re
import struct
import zlib

import cv2
import numpy as np
import pytest

from fastgen.config.config import Config
from fastgen.errors import AssetError
from fastgen.fit.boxes import camera_distances, read_box_heights
from fastgen.fit.photographs import _TYPES, read_photographs
from tests.photographs import photographs_in


def test_large_photographs_are_scaled_down(tmp_path):
    (photograph,) = read_photographs(photographs_in(tmp_path / "a", 1, (300, 100)), 150)
    assert photograph.pixels.shape == (50, 150, 3)
    assert photograph.size == (300, 100)


def test_bad_photographs_are_named(tmp_path):
    with pytest.raises(AssetError, match="no such folder"):
        read_photographs(tmp_path / "none", 640)
    (tmp_path / "small 0.jpg").touch()
    with pytest.raises(AssetError, match=r"small 0\.jpg: is a file, not a folder; give one that"):
        read_photographs(tmp_path / "small 0.jpg", 640)
    (tmp_path / "small 0.jpg").unlink()
    with pytest.raises(AssetError, match="no photograph in this folder"):
        read_photographs(tmp_path, 640)
    small = photographs_in(tmp_path / "small", 1, (96, 20))
    with pytest.raises(AssetError, match=r"0\.png: 96x20 pixels are too few"):
        read_photographs(small, 640)


CHUNKS = (struct.pack(">4sIIBBBBB", b"IHDR", 60_000, 60_000, 8, 2, 0, 0, 0), b"IDAT")
HUGE = [
    struct.pack(">I", len(each) - 4) + each + struct.pack(">I", zlib.crc32(each)) for each in CHUNKS
]
BAD_HEADS = {
    "nothing": b"",
    "text": b"no picture",
    "zeros": bytes(100),
    "another format": b"\x1f\x8b" * 50,
    "huge": b"\x89PNG\r\n\x1a\n" + b"".join(HUGE),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [*BAD_HEADS, *(f"{n}{t}" for t in _TYPES for n in (24, 60, 2000))])
def test_a_broken_photograph_has_a_reason_without_the_words_of_a_library(tmp_path, kind):
    path = tmp_path / "0.png"
    path.write_bytes(BAD_HEADS[kind] if kind in BAD_HEADS else cut_short(*kind.split(".")))
    with pytest.raises(AssetError) as caught:
        read_photographs(tmp_path, 640)
    words = re.fullmatch(
        rf"{path}: cannot be read as a picture \((.+)\); remove it", str(caught.value)
    )[1]
    assert not re.search("pillow|plugin|uri|unknown|0x", words, re.IGNORECASE)
    assert (words == "too many pixels") == (kind == "huge")


def cut_short(length, kind):
    """Return the first bytes of a file of noise."""
    pixels = np.random.default_rng(1).integers(0, 255, (100, 100, 3), np.uint8)
    return cv2.imencode(f".{kind}", pixels)[1].tobytes()[: int(length)]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("0.txt", b"\xe9 .5\n", r"0\.txt: not a YOLO file"),
        ("0.txt", b"0 .5 .5 .4 -.5\n", r"0\.txt: line 1 is not a YOLO box"),
        ("0.txt", b"0 50 40 30 30\n", r"0\.txt: line 1 is not a YOLO box"),
        ("0.txt", b"0 .1 .2 .3 .4 .5 .6 .7\n", r"0\.txt: line 1 is not a YOLO box"),
        ("0.txt", b"0 .5 nan .4 .5\n", r"0\.txt: line 1 is not a YOLO box"),
        ("c.json", b"[" * 100000, r"c\.json: not a COCO file"),
        *(
            (
                "c.json",
                b'{"images":[{"id":1,"file_name":"0.jpg","height":%s}],"annotations":'
                b'[{"image_id":1,"category_id":1,"bbox":[1,10,20,%s]}]}' % numbers,
                r"c\.json: not a COCO file",
            )
            for numbers in ((b"0", b"30"), (b"9" * 400, b"30"), (b"100", b"-30"))
        ),
    ],
)
def test_files_of_boxes_that_cannot_be_used_are_named(tmp_path, name, content, message):
    for number in range(2):
        cv2.imwrite(str(tmp_path / f"{number}.jpg"), np.full((80, 100, 3), 90, np.uint8))
    photographs = read_photographs(tmp_path, 640)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(AssetError, match=message):
        read_box_heights(tmp_path, photographs)


def test_heights_of_boxes_give_distances(tmp_path):
    folder = photographs_in(tmp_path / "photos", 3)
    photographs = read_photographs(folder, 640)
    (folder / "0.txt").write_text("0 0.5 0.5 0.9 0.5\n1 0.5 0.5 0.1 0.1\n")
    (folder / "1.txt").write_text("0 0.5 0.25 0.9 0.5\n")  # cut off by the upper border
    (folder / "boxes.json").write_text(
        '{"images": [{"id": 7, "file_name": "2.png", "height": 80}], "annotations": ['
        '{"image_id": 7, "category_id": 1, "bbox": [3, 10, 50, 40]}]}'
    )
    assert read_box_heights(folder, photographs) == pytest.approx([0.5, 0.5])
    preset = Config.from_values({"container": {"kinds": {"20": 1}}}, Config.preset("gate"))
    rig, words = camera_distances(preset, [0.5, 0.5])
    rear = preset.cameras["rear"]
    # a wall of 2591 mm has an image of half the sensor's height
    expected = rear.focal_mm * 2591 / (0.5 * 27)
    assert rig["rear"]["distance_mm"] == pytest.approx([expected, expected], abs=6)
    assert rig["roof"] == {}
    assert words == "boxes of 2 photographs are 50% to 50% of the image high"
    (folder / "0.txt").write_text("container 0.5\n")
    with pytest.raises(AssetError, match=r"0\.txt: line 1 is not a YOLO box"):
        read_box_heights(folder, photographs)

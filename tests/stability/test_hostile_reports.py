"""`fastgen report` on datasets that are broken, changed or made to harm the reader of the page."""

import json
import shutil

import cv2
import numpy as np
import pytest

from fastgen.cli.main import main
from fastgen.errors import OutputError
from fastgen.report.content import report_content
from fastgen.report.page import page, write_report
from tests.report_makers import Reader, change_shard


@pytest.fixture(scope="module")
def dataset(report_dataset):
    return report_dataset


def test_a_scene_file_cannot_make_the_page_large(copy):
    for path in copy.glob("scenes/*/*.json"):
        scene = json.loads(path.read_text())
        thing = scene["objects"][0]
        scene["objects"] = [
            {**thing, "class_name": f"{number}" * 99, "text": "x" * 9999} for number in range(3000)
        ]
        path.write_text(json.dumps(scene))
    written, _ = write_report(str(copy))
    assert written.stat().st_size < 5_000_000


def test_words_of_a_dataset_cannot_become_html(dataset):
    evil = "</script><img src=x onerror=alert(1)>\u2028&amp;<!--"
    changed = {
        **report_content(str(dataset)),
        "title": evil,
        "crops": [{"source": "", "text": evil, "stem": evil}],
    }
    text = page(changed)
    reader = Reader(text)
    assert "img" not in [tag for tag, _ in reader.elements]
    content = json.loads(reader.scripts[0][1])
    assert content["title"] == content["crops"][0]["text"] == evil
    assert len(reader.scripts) == 2


def test_scene_files_with_markup_are_shown_as_text(copy):
    path = next(copy.glob("scenes/*/*_A.json"))
    evil = "<script>alert(1)</script>"
    text = json.loads(path.read_text())
    text["scene"]["environment"]["name"] = text["objects"][0]["text"] = evil
    path.write_text(json.dumps(text))
    written, _ = write_report(str(copy))
    assert evil not in written.read_text()
    content = json.loads(Reader(written.read_text()).scripts[0][1])
    assert evil in [row["name"] for row in content["exposure"]["environments"]]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("imdg", [{"category_id": 0, "bbox": [0, 0, 1, 1], "iscrowd": 0}]),
        ("imdg", [{"category_id": 99, "bbox": [0, 0, 1, 1], "iscrowd": 0}]),
        ("imdg", [{"category_id": 1, "bbox": [0, 0, 999, 1], "iscrowd": 0}]),
        ("imdg", [{"category_id": 1, "bbox": [0, 0, "1", 1], "iscrowd": 0}]),
        ("imdg", [{"category_id": 1, "bbox": [0, 0, -1, 1], "iscrowd": 0}]),
        ("imdg", [7]),
        ("damage", "text"),
        ("text", [{"text": 4, "box": [0, 0, 1, 1]}]),
        ("text", [{"text": "A", "box": "0011"}]),
        ("text", 5),
    ],
)
def test_records_that_fastgen_does_not_write_give_one_error(copy, key, value, capsys):
    change_shard(copy, lambda shard: shard["records"][0]["facts"].update({key: value}))
    assert main(["report", str(copy)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "run fastgen verify" in said
    assert not list(copy.parent.glob("*.html"))


@pytest.mark.parametrize(
    "content",
    [b"{", b"[]", b'{"objects": [], "scene": {}}', b'{"objects": [{"class_name": 4}], "scene": 1}'],
)
def test_broken_scene_files_give_an_error_that_names_them(copy, content):
    path = next(copy.glob("scenes/*/*_A.json"))
    path.write_bytes(content)
    with pytest.raises(OutputError, match=path.stem):
        write_report(str(copy))


def test_missing_and_damaged_images_give_an_error_that_names_them(copy):
    path = next(copy.glob("images/*/*_A.jpg"))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(OutputError, match="verify"):
        write_report(str(copy))
    path.write_bytes(cv2.imencode(".jpg", np.zeros((64, 64, 3), np.uint8))[1].tobytes())
    with pytest.raises(OutputError, match=f"{path.stem}: the image is not 320x320"):
        write_report(str(copy))
    path.unlink()
    with pytest.raises(OutputError, match=path.name):
        write_report(str(copy))
    assert not list(copy.parent.glob("*.html"))


def test_files_outside_of_the_dataset_are_not_read(copy):
    path = next(copy.glob("images/*/*_A.jpg"))
    shutil.move(path, copy.parent / "elsewhere.jpg")
    path.symlink_to(copy.parent / "elsewhere.jpg")
    with pytest.raises(OutputError, match="leads out of the dataset"):
        write_report(str(copy))


def test_unfinished_and_changed_datasets_are_refused(copy, capsys):
    path = copy / "dataset.json"
    text = path.read_text()
    path.write_text(text.replace('"seed": 5', '"seed": 6'))
    assert main(["report", str(copy)]) == 2
    write_unfinished(path, text)
    assert main(["report", str(copy)]) == 2
    assert "not finished" in capsys.readouterr().err


def write_unfinished(path, text):
    """Write a dataset.json without its hash, as in a dataset that is not finished."""
    content = json.loads(text)
    del content["digest"]
    path.write_text(json.dumps(content))

"""Samples, scenes and grids as notebooks show them, and the notebook of the documentation."""

import base64
import io
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

from fastgen import Config, ConfigError, grid

NOTEBOOK = Path(__file__).parent.parent / "docs/first_steps.ipynb"


class Table(HTMLParser):
    """Cells of all tables row by row, and the attributes of all images."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.images = [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        elif tag == "img":
            self.images.append(dict(attributes))

    def handle_data(self, text):
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += text


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)))


@pytest.fixture(scope="module")
def sample(generators):
    config = Config.from_values({"damage": {"probability": 1}})
    return generators(config, seed=3, size=(320, 240), quality="draft").render(index=1, camera="Cr")


def test_a_sample_shows_its_image(sample):
    np.testing.assert_array_equal(pixels(sample._repr_png_()), sample.image)


def test_a_sample_shows_its_labels_and_lists_visible_objects(sample):
    shown = Table(sample._repr_html_())
    (image,) = shown.images
    data = base64.b64decode(image["src"].removeprefix("data:image/png;base64,"))
    np.testing.assert_array_equal(pixels(data), sample.overlay())
    visible = [item for item in sample.objects if item.bbox is not None]
    assert len(visible) > 3
    assert [row[0] for row in shown.rows[1:]] == [item.class_name for item in visible]
    assert [row[2] for row in shown.rows[1:]] == [item.text for item in visible]


def test_overlays_are_arrays_that_show_themselves(sample):
    drawn = sample.overlay()
    assert (drawn != sample.image).any()
    assert drawn.shape == sample.image.shape
    np.testing.assert_array_equal(pixels(drawn._repr_png_()), drawn)
    assert drawn[..., 0]._repr_png_() is None
    assert (drawn / 2)._repr_png_() is None
    black = sample.overlay(np.zeros_like(sample.image))
    assert (black == 0).mean() > 0.5
    with pytest.raises(ConfigError, match="image: has shape"):
        sample.overlay(np.zeros((2, 2, 3), np.uint8))


def test_a_scene_lists_what_it_shows(sample):
    shown = Table(sample.scene._repr_html_())
    values = dict(row for row in shown.rows[1:])
    assert values["container"] == sample.scene.container.kind
    assert values["environment"].startswith(sample.scene.environment.name)
    assert all(damage.kind in values["damages"] for damage in sample.scene.damages)
    assert "A, B, Cl, Cr" in values["cameras"]


def test_names_in_a_scene_cannot_become_html(sample):
    evil = "<img src=x>"
    environment = replace(sample.scene.environment, name=evil)
    shown = Table(replace(sample.scene, environment=environment)._repr_html_())
    assert not shown.images
    assert any(evil in cell for row in shown.rows for cell in row)


def test_a_grid_holds_each_sample_in_its_place(sample):
    plain = grid([sample] * 3, columns=2, tile_px=320, annotated=False)
    assert plain.shape == (480, 640, 3)
    for y, x in ((0, 0), (0, 320), (240, 0)):
        np.testing.assert_array_equal(plain[y : y + 240, x : x + 320], sample.image)
    assert (plain[240:, 320:] == 32).all()
    assert grid([sample], tile_px=100).shape == (75, 100, 3)
    assert (grid([sample], tile_px=320) == sample.overlay()).all()
    np.testing.assert_array_equal(pixels(plain._repr_png_()), plain)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"samples": []}, "samples: there are none"),
        ({"columns": 0}, "columns: 0"),
        ({"tile_px": 8}, "tile_px: 8"),
        ({"columns": 1.5}, "columns"),
    ],
)
def test_a_grid_refuses_bad_arguments(sample, arguments, words):
    with pytest.raises(ConfigError, match=words):
        grid(**{"samples": [sample], **arguments})


def test_the_notebook_runs_and_shows_pictures_and_sliders():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells)
    NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    kinds = [
        {kind for output in cell.outputs for kind in output.get("data", {})}
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]
    scene, sample, rows, sliders, labels, closed = kinds
    assert "text/html" in scene
    assert {"image/png", "text/html"} <= sample
    assert "image/png" in rows
    assert "application/vnd.jupyter.widget-view+json" in sliders
    assert labels == {"text/plain"}
    assert closed == set()

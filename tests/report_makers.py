"""Datasets for tests of the report, changes that keep their hashes right, and a page parser."""

import json
from html.parser import HTMLParser

from fastgen.cli.main import main
from fastgen.dataset.seal import digest, seal

CLOSE = {"cameras": {"A": {"distance_mm": [3000, 4000]}, "Cr": {"distance_mm": [2500, 3000]}}}
"""Configuration whose images have legible texts at small sizes."""


def make_dataset(folder, *options, images=8):
    """Generate a small dataset of camera A and Cr."""
    config = folder.parent / f"{folder.name}.json"
    config.write_text(json.dumps(CLOSE))
    arguments = ["generate", str(folder), "--images", str(images), "--size", "320x320"]
    more = ["--quality", "draft", "--seed", "5", "--config", str(config), "--workers", "1"]
    assert main([*arguments, *more, *options]) == 0
    return folder


def change_json(path, change):
    """Apply a function to the content of a sealed JSON file, and renew its hash."""
    content = json.loads(path.read_text())
    del content["digest"]
    change(content)
    path.write_bytes(seal(json.dumps(content).encode()))


def change_shard(folder, change):
    """Apply a function to the manifest of the first shard, and renew all hashes."""
    path = folder / "shards/000000.json"
    change_json(path, change)
    change_json(
        folder / "dataset.json",
        lambda content: content["shards"].update({"0": digest(path.read_bytes())}),
    )


class Reader(HTMLParser):
    """Elements of a page with their attributes, and the text of each script."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.scripts, self._script = [], [], None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        self._script = dict(attributes) if tag == "script" else None

    def handle_endtag(self, tag):
        self._script = None

    def handle_data(self, text):
        if self._script is not None:
            self.scripts.append((self._script, text))

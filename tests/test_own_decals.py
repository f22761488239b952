"""Markers, stickers and brands of a user's configuration, from the file to every label."""

import json
import re
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import yaml
from PIL import Image, ImageDraw

from fastgen.classes import DETECTION_CLASSES, MARKER_CLASSES
from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.decals.own_art import art_of
from fastgen.errors import ConfigError
from fastgen.generator import Generator
from fastgen.resources import asset_path
from fastgen.torch import class_counts, class_names

pytestmark = pytest.mark.usefixtures("no_workers")

CONFIG = """
preset: seafront
damage: {probability: 0}
markings:
  other_marker_weight: 0
  markers:
    ENV: {art: art/env.png, weight: 3, hazard_number: '90', un_numbers: ['3077']}
    C3.1: {weight: 1}
  marker_wear: 0
  marker_fade: 0
  stickers: {tag: {art: art/tag.png, size_mm: [400, 200], faces: [front, back], always: true}}
  labelled_stickers: [tag, owner_plate]
  brands: {Ours: {emblem: art/env.png, wordmark: OUR LINE, owner_codes: [OURU], ink: art}}
  bundled_brand_weight: 0
  identifiers: {brand_codes: 1}
"""
CLASSES = ["container", "text", "C3.1", "ENV", "tag", "owner_plate"]


@pytest.fixture(scope="module")
def port(tmp_path_factory):
    """A configuration file with its artwork beside it: a green marker and a blue sticker."""
    folder = tmp_path_factory.mktemp("port")
    (folder / "art").mkdir()
    Image.new("RGB", (300, 300), (10, 200, 30)).save(folder / "art/env.png")
    Image.new("RGBA", (200, 100), (20, 30, 220, 255)).save(folder / "art/tag.png")
    (folder / "port.yaml").write_text(CONFIG)
    return folder / "port.yaml"


@pytest.fixture(scope="module")
def config(port):
    return Config.load(port)


@pytest.fixture(scope="module")
def dataset(port, config, tmp_path_factory):
    """A dataset of this configuration, whose artwork does not exist any more."""
    out = tmp_path_factory.mktemp("made") / "out"
    arguments = ["--images", "12", "--size", "256x256", "--quality", "draft", "--also", "voc"]
    held = [(path, path.read_bytes()) for path in sorted((port.parent / "art").iterdir())]
    assert main(["generate", str(out), *arguments, "--config", str(port), "--workers", "2"]) == 0
    for path, _ in held:
        path.unlink()
    yield out
    for path, data in held:
        path.write_bytes(data)


def test_every_file_has_the_classes_of_the_configuration(dataset):
    data = yaml.safe_load((dataset / "imdg/data.yaml").read_text())
    assert data["names"] == dict(enumerate(CLASSES))
    record = json.loads((dataset / "dataset.json").read_text())
    assert record["classes"]["imdg"] == CLASSES
    boxes = {"yolo": Counter(), "coco": Counter(), "voc": Counter()}
    for path in (dataset / "imdg/labels").rglob("*.txt"):
        boxes["yolo"].update(CLASSES[int(line.split()[0])] for line in path.open())
    for path in (dataset / "imdg").glob("coco_*.json"):
        coco = json.loads(path.read_text())
        names = {each["id"]: each["name"] for each in coco["categories"]}
        assert list(names.values()) == CLASSES
        boxes["coco"].update(
            names[a["category_id"]] for a in coco["annotations"] if not a["iscrowd"]
        )
    for path in (dataset / "voc/Annotations").iterdir():
        for thing in ElementTree.parse(path).getroot().iter("object"):
            if thing.findtext("difficult") == "0":
                boxes["voc"][thing.findtext("name")] += 1
    assert boxes["yolo"] == boxes["coco"] == boxes["voc"]
    assert min(boxes["yolo"][name] for name in ("ENV", "C3.1", "tag")) > 0
    assert set(boxes["yolo"]) <= set(CLASSES)


def test_statistics_name_the_classes_of_the_dataset(dataset, capsys):
    assert main(["stats", str(dataset)]) == 0
    table = capsys.readouterr().out.partition("Table 3")[2].partition("\n\nPer image")[0]
    rows = [line.split() for line in table.splitlines()[3:]]
    assert [row[0] for row in rows] == CLASSES
    counted = Counter()
    for path in (dataset / "imdg/labels").rglob("*.txt"):
        counted.update(CLASSES[int(line.split()[0])] for line in path.open())
    assert {name: sum(map(int, counts)) for name, *counts in rows} == {
        name: counted[name] for name in CLASSES
    }


def test_a_dataset_is_verified_and_repaired_without_the_files_of_its_artwork(copy, capsys):
    assert main(["verify", str(copy)]) == 0
    (broken, *_) = sorted((copy / "images").rglob("*.jpg"))
    before = broken.read_bytes()
    broken.unlink()
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert broken.read_bytes() == before
    label = next(
        path for path in sorted((copy / "imdg/labels").rglob("*.txt")) if path.stat().st_size
    )
    label.write_text("3" + label.read_text()[1:])
    assert main(["verify", str(copy)]) == 1


def test_pixels_of_a_marker_and_of_a_sticker_have_the_colour_of_their_file(config, generators):
    generator = generators(config, 0, (512, 512), quality="draft")
    seen = Counter()
    for index in range(6):
        sample = generator.render(index, "A")
        for item in sample.objects:
            if item.class_name in ("ENV", "tag") and item.area > 30:
                red, green, blue = sample.image[sample.ids == item.id].mean(axis=0)
                assert (green > max(red, blue)) if item.class_name == "ENV" else blue > red
                seen[item.class_name] += 1
    assert seen["ENV"] > 2
    assert seen["tag"] > 2


def test_a_marker_covers_no_pixel_beside_its_diamond(config, generators):
    """The file is an opaque green square. Nearby the shader cuts it, far away its texels do."""
    generator = generators(config, 0, (320, 320), quality="draft")
    shown = 0
    for index, camera in ((0, "A"), (1, "Cl"), (2, "A"), (3, "Cr")):
        sample = generator.render(index, camera)
        ids = [item.id for item in sample.objects if item.class_name == "ENV"]
        inside = np.isin(sample.ids, ids).astype(np.uint8)
        beside = (cv2.dilate(inside, np.ones((13, 13))) > cv2.dilate(inside, np.ones((3, 3)))) > 0
        red, green, blue = np.moveaxis(sample.image.astype(int), -1, 0)
        green_pixels = green > 2 * np.maximum(red, blue)
        assert not (green_pixels & beside).any()
        shown += int((green_pixels & (inside > 0)).sum())
    assert shown > 100


def test_the_example_of_the_docs_page_is_drawn(tmp_path):
    page = (Path(__file__).parent.parent / "docs/extend.md").read_text(encoding="utf-8")
    block = re.findall(r"^```yaml\n([^`]*)```$", page, re.MULTILINE)[0]
    (tmp_path / "art").mkdir()
    for name in ("env", "tag", "emblem"):
        Image.new("RGB", (90, 90)).save(tmp_path / f"art/{name}.png")
    shutil.copy(asset_path("fonts", "antonio.woff"), tmp_path / "art/dock.ttf")
    (tmp_path / "port.yaml").write_text(block)
    config = Config.load(tmp_path / "port.yaml")
    assert config.markings.detection_classes[-3:] == ("ENV", "fleet_tag", "owner_plate")
    config = Config.from_values({"markings": {"marked_containers": 1}}, config)
    generator = Generator(config, seed=1)
    decals = [decal for index in range(30) for decal in generator.scene(index).decals]
    assert {decal.art for decal in decals} >= {"marker/ENV", "sticker/fleet_tag", "emblem/Ours"}
    fonts = {decal.font.partition("-")[0] for decal in decals if decal.class_name == "text"}
    assert fonts == {"dock", "oswald"}


def test_weights_are_the_frequencies_of_markers(config):
    generator = Generator(config, seed=3)
    drawn = Counter(
        decal.class_name
        for index in range(60)
        for decal in generator.scene(index).decals
        if decal.kind == "marker"
    )
    count = sum(drawn.values())
    assert set(drawn) == {"ENV", "C3.1"}
    assert abs(drawn["ENV"] / count - 0.75) < 4 * np.sqrt(0.75 * 0.25 / count)


def test_panels_and_texts_carry_what_the_configuration_says(config):
    generator = Generator(config, seed=3)
    decals = [decal for index in range(60) for decal in generator.scene(index).decals]
    texts = Counter(decal.text for decal in decals if decal.kind == "text")
    assert texts["3077"] > 0
    assert texts["90"] > 0
    assert texts["OUR LINE"] > 0
    owners = {decal.text[:4] for decal in decals if decal.class_name == "text"}
    assert owners == {"OURU"}
    emblems = {decal.art for decal in decals if decal.art.startswith("emblem")}
    assert emblems == {"emblem/Ours"}


def test_markers_of_equal_weight_are_drawn_as_without_weights():
    same = Config.from_values({"markings": {"markers": {"C1.1": {"weight": 1}}}})
    assert same.markings.detection_classes == DETECTION_CLASSES
    plain, weighted = Generator(seed=5), Generator(same, seed=5)
    assert [plain.scene(i) for i in range(5)] == [weighted.scene(i) for i in range(5)]


def test_a_marker_of_weight_0_is_neither_drawn_nor_a_class():
    config = Config.from_values({"markings": {"markers": {"C1.1": {"weight": 0}}}})
    assert config.markings.detection_classes == tuple(
        name for name in DETECTION_CLASSES if name != "C1.1"
    )
    generator = Generator(config, seed=5)
    names = {d.class_name for i in range(60) for d in generator.scene(i).decals}
    assert names >= set(MARKER_CLASSES) - {"C1.1"}
    assert "C1.1" not in names


def test_a_weight_of_0_leaves_out_a_sticker_that_every_container_has():
    def names(config):
        return {d.art for i in range(4) for d in Generator(config, seed=5).scene(i).decals}

    less = Config.from_values({"markings": {"sticker_weights": {"csc_safety_approval": 0}}})
    assert "csc_safety_approval" in names(Config.preset())
    assert "csc_safety_approval" not in names(less)


def test_loaders_have_the_classes_of_the_configuration(config):
    assert list(class_names("imdg", config)) == CLASSES
    counts = class_counts("imdg", config, seed=1, scenes=8, cameras=["A", "Cr"])
    assert len(counts) == len(CLASSES)
    assert counts[CLASSES.index("tag")] > 0
    assert counts[CLASSES.index("owner_plate")] > 0


def test_a_scene_needs_the_generator_of_its_artwork(config):
    scene = Generator(config, seed=3).scene(0)
    with pytest.raises(ConfigError, match=r"scene\.decals\[\d+\]\.\w+: '.*' is unknown"):
        Generator(seed=3).render(scene=scene)
    (marker, *_) = (d for d in scene.decals if d.class_name == "ENV")
    misspelt = replace(scene, decals=(replace(marker, class_name="ENW"),))
    with pytest.raises(ConfigError, match=r"class_name: 'ENW' is unknown \(did you mean ENV\?\)"):
        Generator(config, seed=3).render(scene=misspelt)


def test_a_later_file_keeps_the_artwork_of_an_earlier_one(port, config, tmp_path):
    more = tmp_path / "more.yaml"
    more.write_text("markings: {markers: {ENV: {weight: 9}}}")
    both = Config.load(more, config)
    assert both.markings.markers["ENV"] == replace(config.markings.markers["ENV"], weight=9)
    assert Config.from_values(json.loads(json.dumps(both.to_plain()))) == both


def drawn(folder, name, image):
    """Save an image, load it as a sticker and return its texels."""
    image.save(folder / name)
    values = {"markings": {"stickers": {"x": {"art": str(folder / name)}}}}
    return art_of(Config.from_values(values).markings.stickers["x"].art).astype(int)


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "I;16"])
def test_any_kind_of_png_keeps_its_colours(mode, tmp_path):
    if mode == "I;16":
        image, wanted = Image.new(mode, (256, 256), 46260), np.full((256, 256, 3), 46260 // 257)
    else:
        image = Image.new("RGB", (256, 256), (180, 60, 20)).convert(mode)
        wanted = np.array(image.convert("RGB"))
    texels = drawn(tmp_path, "x.png", image)
    np.testing.assert_array_equal(texels[..., :3], wanted)
    assert (texels[..., 3] == 255).all()


@pytest.mark.parametrize("size", [(512, 1024), (1000, 500), (60, 90), (100, 700)])
def test_images_of_any_size_are_stretched_without_the_colour_of_transparent_parts(size, tmp_path):
    image = Image.new("RGBA", size, (255, 0, 255, 0))
    width, height = size
    ImageDraw.Draw(image).rectangle((width // 4, 0, 3 * width // 4 - 1, height), (0, 120, 0, 255))
    texels = drawn(tmp_path, "x.png", image)
    assert abs(texels[..., 3].mean() / 255 - 0.5) < 0.02
    solid = texels[texels[..., 3] > 16]
    assert (np.abs(solid[:, :3] - [0, 120, 0]) <= 2).all()


def test_an_svg_is_drawn_at_full_resolution(tmp_path):
    path = tmp_path / "disc.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10">'
        '<circle cx="5" cy="5" r="4" fill="#0000ff"/></svg>'
    )
    values = {"markings": {"markers": {"disc": {"art": str(path)}}}}
    texels = art_of(Config.from_values(values).markings.markers["disc"].art).astype(float)
    assert abs(texels[..., 3].mean() / 255 - np.pi * 0.4**2) < 0.002
    assert (texels[128, 128] == [0, 0, 255, 255]).all()
    assert (texels[2, 2] == 0).all()


def test_text_in_an_svg_is_refused(tmp_path):
    path = tmp_path / "text.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><text y="5">a</text></svg>'
    )
    with pytest.raises(ConfigError, match=r"art: .*text\.svg: holds text, .* convert it to paths"):
        Config.from_values({"markings": {"markers": {"disc": {"art": str(path)}}}})


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ("markers: {ENV: {}}", "markings.markers.ENV.art: is missing, and fastgen has no such"),
        ("markers: {ENV: {art: gone.png}}", "markings.markers.ENV.art: {folder}/gone.png: cannot"),
        ("markers: {ENV: {art: bad.png}}", "markings.markers.ENV.art: {folder}/bad.png: not a PNG"),
        (
            "markers: {ENV: {art: clear.png}}",
            "markings.markers.ENV.art: {folder}/clear.png: is transparent everywhere; give",
        ),
        (
            "markers: {ENV: {art: bad.svg}}",
            "markings.markers.ENV.art: {folder}/bad.svg: not an SVG",
        ),
        ("markers: {ENV: {art: cut.png}}", "markings.markers.ENV.art: {folder}/cut.png: the image"),
        (
            "markers: {ENV: {art: wide.png}}",
            "markings.markers.ENV.art: {folder}/wide.png: is 20x10",
        ),
        (
            "markers: {ENV: {art: huge.png}}",
            "markings.markers.ENV.art: {folder}/huge.png: is 99999",
        ),
        ("markers: {E V: {art: wide.png}}", "markings.markers: 'E V' is not a name"),
        ("markers: {text: {weight: 1, art: square.png}}", "markings.markers.text: is the name of"),
        ("markers: {dented: {art: square.png}}", "markings.markers.dented: is the name of another"),
        ("markers: {ENV: {art: 'data:image/png;base64,xx'}}", "markings.markers.ENV.art: the text"),
        ("other_marker_weight: 0", "markings.markers: all weights are 0; give one above 0, or"),
        ("bundled_brand_weight: 0", "markings.brands: all weights are 0"),
        ("brands: {X: {wordmark: Y}}", "markings.brands.X.emblem: is missing"),
        (
            "brands: {X: {emblem: wide.png, wordmark: é}}",
            "markings.brands.X.wordmark: 'é': no font has 'é'; give capitals, digits and",
        ),
        ("stickers: {X: {faces: [door]}}", "markings.stickers.X.art: is missing"),
        (
            "stickers: {washed: {art: wide.png}}",
            "markings.stickers.washed: is a sticker of fastgen",
        ),
        ("sticker_weights: {wahsed: 1}", "markings.sticker_weights: 'wahsed' is unknown (did you"),
        ("labelled_stickers: [wahsed]", "markings.labelled_stickers: 'wahsed' is unknown (did you"),
    ],
)
def test_unusable_values_are_refused_by_their_key(values, words, tmp_path):
    Image.new("RGB", (20, 10)).save(tmp_path / "wide.png")
    Image.new("RGB", (10, 10)).save(tmp_path / "square.png")
    (tmp_path / "bad.png").write_text("no image")
    Image.new("RGBA", (10, 10)).save(tmp_path / "clear.png")
    (tmp_path / "bad.svg").write_text("<svg")
    whole = (tmp_path / "square.png").read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[:40])
    (tmp_path / "huge.png").write_bytes(whole[:16] + (99999).to_bytes(4, "big") * 2 + whole[24:])
    path = tmp_path / "port.yaml"
    path.write_text(f"markings:\n  {values}")
    with pytest.raises(ConfigError) as caught:
        Config.load(path)
    assert str(caught.value).startswith(f"{path}: {words.format(folder=tmp_path)}")

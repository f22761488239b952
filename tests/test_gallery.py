"""The pictures of the gallery: every tile can be drawn, and pages show the stored files."""

import re

import gallery
import pytest

from fastgen.sampling.scene import sample_scene

PAGES = gallery.FOLDER.parent


@pytest.mark.parametrize("name", sorted(gallery.SECTIONS))
def test_every_tile_names_a_camera_of_its_scene(name):
    for tile in gallery.SECTIONS[name].tiles:
        hdris = dict.fromkeys(tile.config.environment.names or ["venice"], 1.0)
        scene = sample_scene(tile.config, tile.seed, tile.index, hdris)
        assert scene.camera(tile.camera).name == tile.camera
        assert not tile.near or len(scene.damages) == 1


def test_every_arrangement_and_preset_has_a_tile():
    from fastgen.config.presets import PRESETS
    from fastgen.config.surroundings import ARRANGEMENTS

    captions = {tile.caption for tile in gallery.SECTIONS["surroundings"].tiles}
    assert set(ARRANGEMENTS) <= captions
    assert {tile.preset for tile in gallery.SECTIONS["presets"].tiles} == set(PRESETS)


def test_every_bundled_kind_of_damage_has_a_tile():
    from fastgen.classes import BUNDLED_DAMAGE_CLASSES

    kinds = {kind for tile in gallery.SECTIONS["damage"].tiles for kind in tile.config.damage.kinds}
    assert kinds == set(BUNDLED_DAMAGE_CLASSES)


def test_gallery_pages_show_every_stored_picture():
    for page, folder in (("gallery.md", "gallery"), ("output_pictures.md", "outputs")):
        shown = re.findall(rf"\({folder}/(\w+\.jpg)\)", (PAGES / page).read_text())
        assert sorted(shown) == sorted(path.name for path in (PAGES / folder).iterdir())

"""Files that block, never end or are far too large, wherever a file of somebody else is read."""

import struct
import zlib

import numpy as np
import pytest

from fastgen import Config
from fastgen.cli.main import main
from fastgen.errors import AssetError, ConfigError
from fastgen.files import disk_cache
from fastgen.files.plain_file import open_lock, read_plain
from fastgen.fit.boxes import read_box_heights
from fastgen.fit.photographs import Photograph, read_photographs
from fastgen.light.container_map import container_map_path, load_container_map
from fastgen.light.environment import load_environment
from fastgen.scene import Scene
from tests.stability.special_files import KINDS, put

pytestmark = pytest.mark.usefixtures("guarded", "no_workers")

ARGUMENTS = ["--images", "4", "--size", "64x64", "--cameras", "A,Cr", "--seed", "3"]


@pytest.mark.parametrize("kind", KINDS)
def test_only_plain_files_of_a_sane_size_are_read(tmp_path, kind):
    put(kind, tmp_path / "file")
    with pytest.raises(OSError, match=r"file|bytes"):
        read_plain(tmp_path / "file", 1 << 30)


def test_a_plain_file_is_read_up_to_its_limit_and_through_links(tmp_path):
    (tmp_path / "file").write_bytes(b"12345")
    (tmp_path / "link").symlink_to("file")
    assert read_plain(tmp_path / "link", 5) == b"12345"
    with pytest.raises(OSError, match="it has 5 bytes, more than the limit of 4"):
        read_plain(tmp_path / "link", 4)
    with pytest.raises(IsADirectoryError):
        read_plain(tmp_path, 5)


@pytest.mark.parametrize("kind", KINDS)
def test_a_special_file_as_configuration_is_refused_by_name(tmp_path, capsys, kind):
    path = tmp_path / "port.yaml"
    put(kind, path)
    with pytest.raises(ConfigError, match=r"port\.yaml: cannot be read \(it "):
        Config.load(path)
    assert main(["config", "--config", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"fastgen: {path}: cannot be read (it ")


def test_a_configuration_of_a_sane_size_is_read(tmp_path):
    (tmp_path / "port.yaml").write_text("seals: {probability: 1}\n" + "# words\n" * 20000)
    assert Config.load(tmp_path / "port.yaml").seals.probability == 1


def test_a_scene_text_that_is_too_long_is_refused():
    with pytest.raises(ConfigError, match=r"scene: has [\d,]+ characters; give at most"):
        Scene.from_json('{"scene": ' + " " * (70 << 20) + "{}}")


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_special_file_among_the_hdris_is_refused_by_name(tmp_path, capsys, kind, suffix):
    path = tmp_path / "lights" / f"sky{suffix}"
    put(kind, path)
    with pytest.raises(AssetError, match=rf"sky\{suffix}: "):
        load_environment(path, tmp_path / "cache")
    arguments = [*ARGUMENTS, "--hdri", str(path.parent), "--workers", "1"]
    assert main(["generate", str(tmp_path / "out"), *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"fastgen: {path}: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", KINDS)
def test_a_special_file_as_container_map_is_refused_by_name(tmp_path, kind):
    path = container_map_path(tmp_path / "sky.exr")
    put(kind, path)
    with pytest.raises(AssetError, match=r"sky\.containers\.png: "):
        load_container_map(tmp_path / "sky.exr")


@pytest.mark.parametrize("kind", KINDS)
def test_a_special_file_as_cache_entry_is_replaced(tmp_path, kind):
    arrays = {"values": np.arange(5)}
    disk_cache.cached("kind", 1, "a", lambda: arrays, tmp_path)
    (entry,) = tmp_path.iterdir()
    whole = entry.read_bytes()
    put(kind, entry)
    for _ in range(2):
        found = disk_cache.cached("kind", 1, "a", lambda: arrays, tmp_path)
        np.testing.assert_array_equal(found["values"], arrays["values"])
    assert entry.read_bytes() == whole


@pytest.mark.parametrize("kind", [*KINDS, "link"])
def test_a_special_file_as_lock_of_a_cache_entry_stops_nothing(tmp_path, kind):
    arrays = {"values": np.arange(5)}
    disk_cache.cached("kind", 1, "a", lambda: arrays, tmp_path / "first")
    (entry,) = (tmp_path / "first").iterdir()
    lock = tmp_path / "second" / f"{entry.stem}.lock"
    victim = tmp_path / "victim"
    if kind == "link":
        lock.parent.mkdir()
        lock.symlink_to(victim)
    else:
        put(kind, lock)
    disk_cache.cached("kind", 1, "a", lambda: arrays, lock.parent)
    assert (lock.parent / entry.name).read_bytes() == entry.read_bytes()
    assert not victim.exists()


def png_of(width, height, bits, color_type):
    """Return a PNG that claims this size and has almost no data."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, bits, color_type, 0, 0, 0)
    chunks = (head, b"IDAT" + zlib.compress(bytes(1000)), b"IEND")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
        for chunk in chunks
    )


@pytest.mark.parametrize("side", [20_000, 60_000, 2**31 - 1])
def test_a_photograph_that_claims_too_many_pixels_is_refused_by_name(tmp_path, side):
    (tmp_path / "quay.png").write_bytes(png_of(side, side, 8, 2))
    with pytest.raises(AssetError, match=r"quay\.png: cannot be read as a picture \("):
        read_photographs(tmp_path, 640)


@pytest.mark.parametrize("side", [20_000, 60_000, 2**30])
def test_a_container_map_that_claims_too_many_texels_is_refused_by_name(tmp_path, side):
    path = container_map_path(tmp_path / "sky.exr")
    path.write_bytes(png_of(2 * side - 1, side, 16, 0))
    with pytest.raises(AssetError, match=r"sky\.containers\.png: .* texels"):
        load_container_map(tmp_path / "sky.exr")
    path.write_bytes(png_of(512, 256, 16, 0))
    with pytest.raises(AssetError, match=r"sky\.containers\.png: a damaged PNG"):
        load_container_map(tmp_path / "sky.exr")


@pytest.mark.parametrize("kind", KINDS)
def test_special_files_among_photographs_and_boxes_are_refused_by_name(tmp_path, kind):
    put(kind, tmp_path / "quay.jpg")
    with pytest.raises(AssetError, match=r"quay\.jpg: cannot be read as a picture \("):
        read_photographs(tmp_path, 640)
    photograph = Photograph(tmp_path / "quay.jpg", (64, 64), np.zeros((64, 64, 3), np.uint8))
    for name in ("boxes.json", "quay.txt"):
        put(kind, tmp_path / name)
        with pytest.raises(AssetError, match=rf"{name}: not a \w+ file of boxes \("):
            read_box_heights(tmp_path, [photograph])
        (tmp_path / name).unlink()


def test_a_lock_keeps_the_content_of_a_file_with_that_name(tmp_path):
    (tmp_path / "victim").write_text("precious")
    (tmp_path / ".lock").hardlink_to(tmp_path / "victim")
    open_lock(tmp_path / ".lock").close()
    assert (tmp_path / "victim").read_text() == "precious"

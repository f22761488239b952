"""Unusual machines: full disks, missing home folders, odd folder names and little memory."""

import errno
import os
import shutil
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pytest

from fastgen.dataset.dataset_json import shard_numbers
from fastgen.dataset.progress import Progress
from fastgen.dataset.storage import Folder
from fastgen.dataset.workers import in_words
from fastgen.decals import artwork
from fastgen.errors import AssetError
from fastgen.files import disk_cache
from fastgen.render.contexts.shader_cache import spare_full_disk
from fastgen.resources import asset_path

Disk = namedtuple("Disk", "f_bavail f_frsize")


@pytest.mark.parametrize(("free_bytes", "switched"), [(1 << 20, "true"), (1 << 30, None)])
def test_mesas_shader_cache_is_off_on_a_nearly_full_disk(
    monkeypatch, tmp_path, free_bytes, switched
):
    asked = []

    def disk(place):
        asked.append(place)
        return Disk(free_bytes // 4096, 4096)

    monkeypatch.setattr(os, "statvfs", disk)
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path / "not" / "yet"))
    monkeypatch.setenv("MESA_SHADER_CACHE_DISABLE", "")
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE")
    spare_full_disk()
    assert asked == [tmp_path]
    assert os.environ.get("MESA_SHADER_CACHE_DISABLE") == switched


def test_a_user_without_a_home_caches_in_the_temporary_folder(monkeypatch, tmp_path):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert disk_cache.default_folder().parent == tmp_path
    assert str(os.getuid()) in disk_cache.default_folder().name


def test_art_is_read_from_a_folder_whose_name_is_not_utf8(tmp_path):
    source = next(asset_path("markers").rglob("*.png"))
    folder = tmp_path / os.fsdecode(b"inst\xe9")
    folder.mkdir()
    copy = shutil.copy(source, folder)
    ours = artwork._image(Path(copy), 4, None)
    assert (ours == artwork._image(source, 4, None)).all()
    Path(copy).write_bytes(b"")
    with pytest.raises(AssetError, match="not a PNG"):
        artwork._image(Path(copy), 4, None)


class FullLog:
    tried = 0

    def isatty(self):
        return False

    def write(self, text):
        self.tried += 1
        raise OSError(errno.ENOSPC, "No space left on device")

    def flush(self):
        pass


def test_an_unwritable_log_does_not_end_a_run():
    log = FullLog()
    progress = Progress(10, stream=log)
    progress.add(10)
    progress.close()
    assert log.tried


def test_a_new_volume_with_lost_and_found_counts_as_empty(tmp_path):
    (tmp_path / "lost+found").mkdir()
    (tmp_path / "lost+found" / "#1").write_text("x")
    assert Folder(tmp_path).names() == []
    assert Folder(tmp_path).sizes() == {}
    assert shard_numbers(Folder(tmp_path)) == []


def test_running_out_of_memory_is_reported_with_advice():
    assert in_words(MemoryError(), "scene 3") == (
        "scene 3: out of memory; use fewer workers or a smaller size"
    )


def test_a_full_stderr_keeps_the_exit_code_but_a_full_stdout_fails(tmp_path):
    command, out = [sys.executable, "-m", "fastgen"], str(tmp_path / "out")
    make = [*command, "generate", out, "--images", "1", "--size", "64x64"]
    with Path("/dev/full").open("w") as full:
        assert subprocess.run(make, stderr=full, check=False).returncode == 0
        bad = [*command, "verify", str(tmp_path / "none")]
        assert subprocess.run(bad, stderr=full, check=False).returncode == 2
        # losing requested output is an error
        told = subprocess.run(
            [*command, "verify", out], stdout=full, stderr=subprocess.PIPE, check=False
        )
    assert told.returncode == 2
    assert told.stderr.decode().splitlines() == [
        "fastgen: standard output: No space left on device"
    ]

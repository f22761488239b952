"""Unusual machines: full disks, missing home folders, odd folder names and little memory."""

import errno
import os
import shutil
import subprocess
import sys
import time
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

from fastgen.dataset import settings
from fastgen.dataset.dataset_json import shard_numbers
from fastgen.dataset.job import Job
from fastgen.dataset.progress import Progress
from fastgen.dataset.storage import Folder
from fastgen.dataset.workers import in_words
from fastgen.decals.asset_files import asset_image
from fastgen.errors import AssetError
from fastgen.files import cache_folder, disk_cache
from fastgen.light.hdri import bundled_hdris
from fastgen.render.contexts.shader_cache import spare_full_disk
from fastgen.render.settings import RenderSettings
from fastgen.resources import asset_path
from tests.folders import content

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


def without_home(patch, _):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    patch.setattr(Path, "home", no_home)


def with_unwritable_home(patch, folder):
    """docker run --user gives the home /, which only root can write; tests may run as root."""
    (folder / "file").write_text("")
    patch.setenv("HOME", str(folder / "file"))


def with_unwritable_xdg(patch, folder):
    (folder / "file").write_text("")
    patch.setenv("XDG_CACHE_HOME", str(folder / "file"))


def with_read_only_home(patch, folder):
    patch.setenv("HOME", str(folder))
    access = os.access
    cache = folder / ".cache" / "fastgen"
    patch.setattr(os, "access", lambda path, mode: path != cache and access(path, mode))


HOMES = [without_home, with_unwritable_home, with_unwritable_xdg, with_read_only_home]


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    """The directory for temporary files of this test, and a user whose folder is not known yet."""
    cache_folder._usable.cache_clear()
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    yield folder
    cache_folder._usable.cache_clear()


@pytest.mark.parametrize("home", HOMES)
def test_a_user_without_a_usable_home_caches_in_the_temporary_folder(
    home, temporary, monkeypatch, tmp_path, capsys
):
    home(monkeypatch, tmp_path)
    found = disk_cache.default_folder()
    assert found == temporary / f"fastgen-{os.getuid()}"
    assert found.stat().st_mode & 0o777 == 0o700
    first = disk_cache.cached("kind", 1, "a", lambda: {"x": np.arange(3)})
    second = disk_cache.cached("kind", 1, "a", lambda: pytest.fail("it was stored"))
    assert first["x"].tolist() == second["x"].tolist()
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err.startswith("fastgen: ")
    assert str(found) in said.err


def of_another_user(folder, patch):
    folder.mkdir(mode=0o700)
    real = folder.stat().st_uid
    patch.setattr(os, "getuid", lambda: real + 1)
    folder.rename(folder.with_name(f"fastgen-{real + 1}"))


def linked(folder, _):
    folder.with_name("theirs").mkdir(mode=0o700)
    folder.symlink_to(folder.with_name("theirs"))


def of_mode(mode):
    def make(folder, _):
        folder.mkdir()
        folder.chmod(mode)

    return make


def a_file(folder, _):
    folder.write_text("")


@pytest.mark.parametrize("home", HOMES)
@pytest.mark.parametrize(
    "make",
    [of_another_user, linked, a_file, *map(of_mode, (0o777, 0o770, 0o702, 0o755, 0o1700))],
)
def test_a_temporary_folder_that_others_can_change_is_not_used(
    make, home, temporary, monkeypatch, tmp_path, capsys
):
    make(temporary / f"fastgen-{os.getuid()}", monkeypatch)
    home(monkeypatch, tmp_path)
    before = content(temporary)
    for _ in range(2):
        assert disk_cache.default_folder() is None
        made = disk_cache.cached("kind", 1, "a", lambda: {"x": np.arange(3)})
        assert made["x"].tolist() == [0, 1, 2]
        assert not made["x"].flags.writeable
    assert content(temporary) == before
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "set XDG_CACHE_HOME to a folder of your own" in said


def test_a_usable_home_is_used_without_a_word(temporary, monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert disk_cache.default_folder() == tmp_path / ".cache" / "fastgen"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert disk_cache.default_folder() == tmp_path / "xdg" / "fastgen"
    assert not list(temporary.iterdir())
    assert capsys.readouterr().err == ""


def test_art_is_read_from_a_folder_whose_name_is_not_utf8(tmp_path):
    source = next(asset_path("markers").rglob("*.png"))
    folder = tmp_path / os.fsdecode(b"inst\xe9")
    folder.mkdir()
    copy = shutil.copy(source, folder)
    ours = asset_image(Path(copy), 4, None)
    assert (ours == asset_image(source, 4, None)).all()
    Path(copy).write_bytes(b"")
    with pytest.raises(AssetError, match="not a PNG"):
        asset_image(Path(copy), 4, None)


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


@pytest.mark.parametrize(("seconds", "lines"), [(2.0, 7), (0.01, 0)])
def test_loading_many_hdris_shows_progress_only_if_it_takes_long(
    monkeypatch, tmp_path, capsys, seconds, lines
):
    clock = [0.0]
    loaded = []

    def load(path):
        loaded.append(path)
        clock[0] += seconds

    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(settings, "load_environment", load)
    for number in range(48):
        shutil.copy(bundled_hdris()["sky"], tmp_path / f"sky{number}.exr")
    job = Job("x", 2, render=RenderSettings((64, 64), hdri_dir=tmp_path))
    settings.settled(job, 1)
    assert len(set(loaded)) == 48
    said = capsys.readouterr().err.splitlines()
    assert len(said) == lines
    assert all("/48 HDRIs, " in line for line in said)
    assert not said or "48/48 HDRIs" in said[-1]


def test_a_broken_hdri_is_reported_below_the_progress(monkeypatch, tmp_path, capsys):
    clock = iter(range(0, 100_000, 20))
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    for name in ("a", "b"):
        shutil.copy(bundled_hdris()["sky"], tmp_path / f"{name}.exr")
    (tmp_path / "c.exr").write_bytes(b"broken")
    job = Job("x", 2, render=RenderSettings((64, 64), hdri_dir=tmp_path))
    with pytest.raises(AssetError, match=r"c\.exr"):
        settings.settled(job, 1)
    assert "2/3 HDRIs" in capsys.readouterr().err.splitlines()[-1]

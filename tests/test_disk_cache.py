"""Disk cache: mapped entries, damage, trimming and unusable folders."""

import os
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fastgen.files import disk_cache
from fastgen.files.disk_cache import cached, fits, read, write

ARRAYS: dict[str, NDArray[Any]] = {
    "halves": np.linspace(0, 1, 70, dtype=np.float16).reshape(2, 5, 7),
    "bytes": np.arange(5, dtype=np.uint8),
    "none": np.zeros((0, 3)),
    "wide": np.arange(12, dtype=np.int64).reshape(3, 4).T,
}


def never():
    raise AssertionError("a stored entry was made again")


def assert_equal(found, wanted):
    assert list(found) == list(wanted)
    for name, array in wanted.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)
        assert not found[name].flags.writeable


def is_mapped(array):
    while isinstance(array, np.ndarray):
        if isinstance(array, np.memmap):
            return True
        array = array.base
    return False


def test_stored_arrays_are_equal_and_mapped(tmp_path):
    made = cached("kind", 1, "a", lambda: ARRAYS, tmp_path)
    found = cached("kind", 1, "a", never, tmp_path)
    for arrays in (made, found):
        assert_equal(arrays, ARRAYS)
        assert all(is_mapped(array) for array in arrays.values())


def test_arrays_are_read_where_files_cannot_be_mapped(tmp_path, monkeypatch):
    cached("kind", 1, "a", lambda: ARRAYS, tmp_path)

    def refuse(*_, **__):
        raise OSError("no mapping")

    monkeypatch.setattr(np, "memmap", refuse)
    monkeypatch.setattr(np.lib.format, "open_memmap", refuse)
    found = cached("kind", 1, "a", never, tmp_path)
    monkeypatch.undo()
    assert_equal(found, ARRAYS)
    assert not is_mapped(found["halves"])


@pytest.mark.parametrize("damage", ["truncated", "flipped", "flipped header", "empty", "foreign"])
def test_a_damaged_entry_is_made_again(tmp_path, damage):
    cached("kind", 1, "a", lambda: ARRAYS, tmp_path)
    (entry,) = tmp_path.iterdir()
    whole = entry.read_bytes()
    data = bytearray(whole)
    entry.unlink()  # mapped pages must not change
    if damage == "truncated":
        entry.write_bytes(data[:-1])
    elif damage == "flipped":
        data[-9] ^= 0xFF
        entry.write_bytes(data)
    elif damage == "flipped header":
        data[data.index(b"halves")] ^= 0x01
        entry.write_bytes(data)
    elif damage == "empty":
        entry.write_bytes(b"")
    else:
        np.save(entry, np.zeros(3))
    assert read(entry) is None
    assert_equal(cached("kind", 1, "a", lambda: ARRAYS, tmp_path), ARRAYS)
    assert entry.read_bytes() == whole


LAYOUT = {
    "halves": "float16 A 5 B",
    "bytes": "unsigned 5",
    "none": "float64 N 3",
    "wide": "int64 D 3",
}
"""The layout of ARRAYS."""


def test_arrays_with_the_layout_are_read(tmp_path):
    cached("kind", 1, "a", lambda: ARRAYS, tmp_path, LAYOUT)
    assert_equal(cached("kind", 1, "a", never, tmp_path, LAYOUT), ARRAYS)


@pytest.mark.parametrize(
    "changes",
    [
        {"halves": ARRAYS["halves"].astype(np.float32)},
        {"halves": ARRAYS["halves"].astype(">f2")},
        {"halves": ARRAYS["halves"][:, :4]},
        {"halves": ARRAYS["halves"].reshape(-1)},
        {"halves": ARRAYS["halves"][..., None]},
        {"bytes": ARRAYS["bytes"].astype(np.int8)},
        {"bytes": ARRAYS["bytes"].astype("S1")},
        {"bytes": ARRAYS["bytes"][:4]},
        {"none": np.zeros((0, 4))},
        {"none": np.zeros(0)},
        {"none": np.zeros((0, 3), complex)},
        {"wide": ARRAYS["wide"].T},
        {"more": np.zeros(1)},
        {"bytes": None},
    ],
    ids=lambda changes: " ".join(f"{k} {getattr(v, 'dtype', '')}" for k, v in changes.items()),
)
def test_a_whole_entry_with_another_layout_counts_as_missing(tmp_path, changes):
    """Its checksum is right: another program, or another version of ours, wrote it."""
    cached("kind", 1, "a", lambda: ARRAYS, tmp_path, LAYOUT)
    (entry,) = tmp_path.iterdir()
    entry.unlink()
    arrays = {name: array for name, array in {**ARRAYS, **changes}.items() if array is not None}
    write(entry, arrays)
    assert read(entry) is not None
    made = cached("kind", 1, "a", lambda: ARRAYS, tmp_path, LAYOUT)
    assert_equal(made, ARRAYS)
    assert_equal(cached("kind", 1, "a", never, tmp_path, LAYOUT), ARRAYS)


def test_arrays_with_a_shared_axis_must_agree_on_its_size():
    layout = {"a": "float64 V 3", "b": "float64 V"}
    assert fits({"a": np.zeros((4, 3)), "b": np.zeros(4)}, layout)
    assert not fits({"a": np.zeros((4, 3)), "b": np.zeros(5)}, layout)
    assert not fits({"b": np.zeros(4), "a": np.zeros((4, 3))}, layout)


def pipe(place):
    os.mkfifo(place)


def dangling(place):
    place.symlink_to(place.with_name("nowhere"))


def device(place):
    place.symlink_to("/dev/zero")


def folder(place):
    place.mkdir()


@pytest.mark.parametrize("special", [pipe, dangling, device, folder])
@pytest.mark.parametrize("suffix", [".npy", ".lock"])
def test_special_files_in_the_place_of_an_entry_count_as_missing(tmp_path, special, suffix):
    cached("kind", 1, "a", lambda: ARRAYS, tmp_path)
    (entry,) = tmp_path.iterdir()
    entry.unlink()
    special(entry.with_suffix(suffix))
    assert_equal(cached("kind", 1, "a", lambda: ARRAYS, tmp_path), ARRAYS)
    if special is not folder or suffix == ".lock":
        assert_equal(cached("kind", 1, "a", never, tmp_path), ARRAYS)


def test_every_part_of_the_key_counts(tmp_path, monkeypatch):
    for key in (("kind", 1, "a"), ("other", 1, "a"), ("kind", 2, "a"), ("kind", 1, "b")):
        cached(*key, lambda: ARRAYS, tmp_path)
    monkeypatch.setattr(disk_cache, "_LIBRARIES", ("99",))
    cached("kind", 1, "a", lambda: ARRAYS, tmp_path)
    assert len(list(tmp_path.iterdir())) == 5


def test_a_full_cache_drops_the_least_recently_read_entry(tmp_path, monkeypatch):
    monkeypatch.setattr(disk_cache, "LIMIT_BYTES", 3 * 9000)  # each takes 8000 bytes and a header
    for age, name in enumerate("abcd"):
        write(tmp_path / f"{name}.npy", {"values": np.zeros(1000)})
        if name < "d":
            os.utime(tmp_path / f"{name}.npy", (1000 + age, 1000 + age))
        if name == "c":
            assert read(tmp_path / "a.npy") is not None
    assert {entry.stem for entry in tmp_path.iterdir()} == {"a", "c", "d"}


def test_files_without_a_use_are_removed(tmp_path):
    for name in (".dead.part", "dead.lock", ".busy.part", "busy.lock"):
        (tmp_path / name).write_bytes(b"")
        if "dead" in name:
            os.utime(tmp_path / name, (1000, 1000))
    digest = 4 * "0123abcd"
    for name in (f"openness-{digest}", f"form-factors-{digest}", f"{digest}-12", "mine"):
        (tmp_path / f"{name}.npz").write_bytes(b"")
    write(tmp_path / "a.npy", {"values": np.zeros(10)})
    left = {entry.name for entry in tmp_path.iterdir()}
    assert left == {"a.npy", ".busy.part", "busy.lock", "mine.npz"}


def test_a_read_only_folder_only_disables_caching(tmp_path):
    (tmp_path / "file").write_text("in the way")
    for _ in range(2):
        assert_equal(cached("kind", 1, "a", lambda: ARRAYS, tmp_path / "file" / "x"), ARRAYS)

"""Datasets of a stranger, whose manifests have valid hashes and name files outside, or nonsense."""

import json
import shutil

import pytest

from fastgen.cli.main import main
from fastgen.dataset.seal import digest, seal
from fastgen.dataset.storage import Folder, Remote
from fastgen.errors import OutputError
from fastgen.files.inner_path import is_inner
from fastgen.formats.format import Same
from tests.folders import content
from tests.stability.special_files import KINDS, put
from tests.stability.test_hostile_datasets import sealed

pytestmark = pytest.mark.usefixtures("guarded", "no_workers")

ARGUMENTS = ["--images", "4", "--size", "64x64", "--cameras", "A,Cr", "--seed", "3"]
SHARD = "shards/000000.json"

OUTSIDE = [
    "../victim",
    "images/../../victim",
    "images/train/../../../victim",
    "{above}/victim",
    "./../victim",
    "link.d/victim",
    "images/link.d/victim",
]
"""Paths that lead to the victim beside the dataset; link.d is a link to the folder above it."""

ODD = ["", ".", "..", "images/", "images//a", "/", "C:/victim", "C:victim", "..\\victim", "a\0b"]
ODD += [".lock", ".git/hooks/post-checkout", "images/.hidden", "a\nb", "a" * 300, "\udcff", "~/a"]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "dataset"
    assert main(["generate", str(out), *ARGUMENTS, "--workers", "1"]) == 0
    return out


@pytest.fixture
def victim(copy):
    path = copy.parent / "victim"
    path.write_text("precious")
    for place in (copy, copy / "images"):
        (place / "link.d").symlink_to(copy.parent)
    return path


def reseal(path, change):
    """Change the content of a manifest and give it a valid hash."""
    manifest = json.loads(path.read_bytes())
    manifest.pop("digest")
    change(manifest)
    path.write_bytes(sealed(manifest))


def reseal_shard(out, change):
    """Change a shard's manifest and make dataset.json agree."""
    reseal(out / SHARD, change)
    hashed = digest((out / SHARD).read_bytes())
    reseal(out / "dataset.json", lambda manifest: manifest["shards"].update({"0": hashed}))


def use(out):
    """Run every command that reads a dataset; each ends with an exit code."""
    codes = {
        "verify": main(["verify", str(out)]),
        "stats": main(["stats", str(out)]),
        "repair": main(["verify", str(out), "--repair", "--workers", "1"]),
        "generate": main(["generate", str(out), *ARGUMENTS, "--workers", "1"]),
    }
    assert set(codes.values()) <= {0, 1, 2}
    return codes


@pytest.mark.parametrize("path", [*OUTSIDE, *ODD])
@pytest.mark.parametrize("manifest", ["dataset.json", SHARD])
def test_no_path_of_a_manifest_leads_out_of_the_dataset(copy, victim, capsys, manifest, path):
    path = path.format(above=copy.parent)

    def change(content):
        content["files"][path] = [8, digest(b"precious")]
        content["files"]["lost"] = content["files"][path]  # something to repair

    if manifest == SHARD:
        reseal_shard(copy, change)
    else:
        reseal(copy / manifest, change)
    around = {p.name: p.lstat() for p in copy.parent.iterdir() if p != copy}
    codes = use(copy)
    assert codes["verify"] in (1, 2)  # 2 if the text is not valid JSON
    assert {p.name: p.lstat() for p in copy.parent.iterdir() if p != copy} == around
    assert victim.read_text() == "precious"
    capsys.readouterr()


@pytest.mark.parametrize("stem", [path for path in OUTSIDE if "link" not in path] + ["", 3, None])
@pytest.mark.parametrize("key", ["stem", "split"])
def test_no_record_of_a_manifest_leads_out_of_the_dataset(copy, victim, key, stem):
    stem = stem.format(above=copy.parent) if isinstance(stem, str) else stem
    reseal_shard(copy, lambda content: content["records"][0].update({key: stem}))
    assert use(copy)["verify"] == 1
    assert victim.read_text() == "precious"


def test_all_files_of_a_dataset_are_inside_and_others_are_not(dataset):
    paths = [path.relative_to(dataset).as_posix() for path in dataset.rglob("*")]
    assert len(paths) > 20
    assert all(map(is_inner, paths))
    assert not any(map(is_inner, [*ODD, "../victim", "/victim", "a/../victim", None, 3, b"a"]))


@pytest.mark.parametrize("path", [*OUTSIDE, *ODD])
def test_a_storage_neither_reads_nor_changes_what_is_outside(copy, victim, path):
    path = path.format(above=copy.parent)
    before = content(copy.parent)
    places = [Folder(copy)] if "link.d" in path else [Folder(copy), Remote("memory://made")]
    for place in places:
        for use_path in (
            place.read,
            place.content_hash,
            place.remove,
            lambda name, place=place: place.write(name, [b"new"]),
            lambda name, place=place: place.commit({name: b"new"}, "test"),
            lambda name, place=place: place.commit({"a/b": b"new", name: Same("a/b")}, "test"),
        ):
            with pytest.raises(OutputError, match=r"inside the dataset|out of the dataset"):
                use_path(path)
    (copy / "a").exists() and shutil.rmtree(copy / "a")
    assert content(copy.parent) == before


@pytest.mark.parametrize("name", ["images", SHARD, "damage"])
def test_a_link_that_leads_out_is_a_fault_and_is_replaced(dataset, copy, tmp_path, capsys, name):
    """The target has the same bytes, so only the link itself gives it away."""
    path = {"images": next(copy.glob("images/*/*.jpg")), "damage": copy / "damage/coco_val.json"}
    path = path.get(name, copy / name)
    target = tmp_path / "target"
    shutil.move(path, target)
    path.symlink_to(target)
    whole = target.read_bytes()
    assert main(["verify", str(copy)]) == 1
    assert f"{path}: leads out of the dataset through a link" in capsys.readouterr().out
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert content(copy) == content(dataset)
    assert not path.is_symlink()
    assert target.read_bytes() == whole


def test_a_link_to_a_file_inside_is_no_fault_and_the_dataset_may_be_a_link(copy, tmp_path, capsys):
    path = next(copy.glob("images/*/*.jpg"))
    (tmp_path / "link").symlink_to(copy)
    shutil.move(path, copy / "moved.jpg")
    path.symlink_to(copy / "moved.jpg")
    assert main(["verify", str(tmp_path / "link")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:1] == ["moved.jpg: not part of the dataset"]
    assert len(lines) == 2
    (copy / "moved.jpg").rename(path)
    assert main(["verify", str(tmp_path / "link")]) == 0


WRONG = [None, True, 3, -1, "words", [], ["words"], {}, {"a": 1}, {"0": 7}, [[1]], 1e400]


@pytest.mark.parametrize("manifest", ["dataset.json", SHARD])
def test_a_manifest_with_any_value_replaced_ends_in_words(copy, capsys, manifest):
    whole = content(copy)
    originals = {name: (copy / name).read_bytes() for name in ("dataset.json", SHARD)}
    for key in json.loads(originals[manifest]):
        for value in (*WRONG, "missing"):

            def change(found, key=key, value=value):
                found[key] = value
                if value == "missing":
                    del found[key]

            if key == "digest":
                continue
            reseal(copy / manifest, change)
            if manifest == SHARD:
                hashed = digest((copy / SHARD).read_bytes())
                reseal(copy / "dataset.json", lambda m, h=hashed: m["shards"].update({"0": h}))
            assert main(["verify", str(copy)]) in (0, 1, 2), (key, value)
            assert main(["stats", str(copy)]) in (0, 2), (key, value)
            for name, data in originals.items():
                (copy / name).write_bytes(data)
    assert content(copy) == whole
    capsys.readouterr()


@pytest.mark.parametrize("text", [b"", b"[]", b"3", b"null", b"[" * 100000, b"\xff\xfe", b"{"])
@pytest.mark.parametrize("sealed", [True, False])
def test_a_shard_manifest_of_any_text_is_made_again(dataset, copy, text, sealed):
    if sealed:
        text = text + b"\n}"
        text = seal(text)
    (copy / SHARD).write_bytes(text)
    hashed = digest(text)
    reseal(copy / "dataset.json", lambda manifest: manifest["shards"].update({"0": hashed}))
    assert main(["verify", str(copy)]) == 1
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert content(copy) == content(dataset)


def a_folder(path):
    path.mkdir()


def a_loop(path):
    path.symlink_to(path.name)


def a_dangling_link(path):
    path.symlink_to("nowhere")


def a_link_to_a_folder(path):
    path.symlink_to(".")


def unreadable(path):
    path.write_bytes(b"?")
    path.chmod(0)


UNREADABLE = [a_folder, a_loop, a_dangling_link, a_link_to_a_folder, unreadable]


@pytest.mark.parametrize("spoil", UNREADABLE)
@pytest.mark.parametrize("name", [SHARD, "images", "damage/coco_val.json", "contact_sheet.png"])
def test_any_file_that_cannot_be_read_is_repaired(dataset, copy, capsys, name, spoil):
    path = next(copy.glob("images/*/*.jpg")) if name == "images" else copy / name
    path.unlink()
    spoil(path)
    assert main(["verify", str(copy)]) == 1
    assert str(path.relative_to(copy)) in capsys.readouterr().out
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert "repaired: " in capsys.readouterr().out
    assert content(copy) == content(dataset)


@pytest.mark.parametrize("name", [SHARD, "images"])
def test_a_folder_of_foreign_files_in_place_of_a_file_is_kept(copy, capsys, name):
    path = next(copy.glob("images/*/*.jpg")) if name == "images" else copy / name
    path.unlink()
    path.mkdir()
    (path / "mine.txt").write_text("precious")
    before = content(copy)
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"fastgen: {path}: is a folder that is not empty")
    assert content(copy) == before


@pytest.mark.parametrize("command", ["verify", "stats", "generate"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_special_file_as_dataset_json_is_refused_by_name(copy, capsys, kind, command):
    put(kind, copy / "dataset.json")
    more = [*ARGUMENTS, "--workers", "1"] if command == "generate" else []
    assert main([command, str(copy), *more]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"fastgen: {copy}/dataset.json: ")


@pytest.mark.parametrize("name", ["labels", "shards/000000.json", "images"])
@pytest.mark.parametrize("kind", KINDS)
def test_special_files_in_a_dataset_are_faults_that_repair_mends(dataset, copy, capsys, kind, name):
    # a special file has the size 0, as the label file of an image without labels
    found = {
        "labels": (path for path in copy.rglob("*.txt") if not path.stat().st_size),
        "images": copy.glob("images/*/*.jpg"),
    }
    path = next(found[name]) if name in found else copy / name
    put(kind, path)
    assert main(["verify", str(copy)]) == 1
    assert str(path.relative_to(copy)) in capsys.readouterr().out
    assert main(["verify", str(copy), "--repair", "--workers", "1"]) == 0
    assert content(copy) == content(dataset)


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_among_special_files_ends(copy, kind):
    for path in (*copy.glob("images/*/*.jpg"), *copy.rglob("*.txt")):
        put(kind, path)
    assert main(["generate", str(copy), *ARGUMENTS, "--workers", "1"]) in (0, 2)


@pytest.mark.parametrize("kind", ["pipe", "socket", "link", "dangling", "endless"])
def test_a_lock_that_is_no_plain_file_is_refused_and_left_alone(copy, tmp_path, capsys, kind):
    victim = tmp_path / "victim"
    lock = copy / ".lock"
    if kind in ("link", "dangling"):
        lock.symlink_to(victim)
    else:
        put(kind, lock)
    if kind == "link":
        victim.write_text("precious")
    before = lock.lstat().st_ino
    assert main(["generate", str(copy), *ARGUMENTS, "--workers", "1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"fastgen: {lock}: ")
    assert "remove it" in line
    assert lock.lstat().st_ino == before
    assert not victim.exists() if kind != "link" else victim.read_text() == "precious"

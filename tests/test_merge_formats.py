"""Merged tables and merged poses, read with pyarrow, `datasets` and plain JSON."""

import hashlib
import io
import json
import re
import shutil
import sys
import tarfile
import tracemalloc
from pathlib import Path

import cv2
import datasets
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fastgen.cli.main import main
from fastgen.dataset.seal import digest, seal
from fastgen.formats.archives import renamed_tar
from fastgen.formats.parquet import renamed_table
from fastgen.report.content import report_content

pytestmark = pytest.mark.usefixtures("no_workers")

IMAGES = {1: 6, 2: 9, 3: 2}
"""Number of images by seed. The last scenes of the first two lack some of the four cameras."""

SPLITS = {"train": "train", "val": "validation", "test": "test"}


def generate(out, seed, *more):
    command = ["generate", str(out), "--images", str(IMAGES[seed]), "--seed", str(seed)]
    fast = ["--size", "96x80", "--quality", "draft", "--workers", "1", "--split", "0.4,0.3,0.3"]
    short = ["--stems", "short"] if seed == 1 else []
    assert main([*command, *fast, *short, *more]) == 0
    return out


def made(folder, *options):
    """Return two datasets and one that is merged from them."""
    sources = [generate(folder / str(seed), seed, *options) for seed in (1, 2)]
    assert main(["merge", *map(str, sources), str(folder / "merged")]) == 0
    return *sources, folder / "merged"


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    return made(folder, "--format", "parquet", "--shard", "1", "--also", "voc")


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    return made(tmp_path_factory.mktemp("poses"), "--tasks", "damage", "--also", "bop")


def rows(root):
    """Return the rows of each split."""
    found = {split: [] for split in SPLITS}
    for path in sorted(root.glob("*.parquet")):
        found[path.name.split("-")[0]] += pq.read_table(path).to_pylist()
    return found


def test_merged_rows_differ_only_in_names_and_numbers(tables):
    one, two, merged = map(rows, tables)

    def expected(row):
        """Return a row of the first dataset, whose names lack the seed, as it should become."""
        stem = row["stem"]
        values = dict(row, stem=f"s1_{stem}")
        for name, value in row.items():
            if isinstance(value, dict) and value.keys() == {"bytes", "path"}:
                values[name] = {**value, "path": f"s1_{value['path']}"}
        for name, old in [("scene", f'"stem":"{stem}"'), ("voc_xml", f"<filename>{stem}.jpg")]:
            assert row[name].count(old) == 1
            values[name] = row[name].replace(old, old.replace(stem, f"s1_{stem}"))
        return values

    for split in SPLITS:
        moved = [dict(row, image_id=row["image_id"] + IMAGES[1]) for row in two[split]]
        assert merged[split] == [expected(row) for row in one[split]] + moved
    numbers = [row["image_id"] for split in SPLITS for row in merged[split]]
    assert sorted(numbers) == list(range(IMAGES[1] + IMAGES[2]))


def test_datasets_of_hugging_face_opens_merged_tables(tables, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    *_, merged = tables
    opened = datasets.load_dataset(str(merged), cache_dir=str(tmp_path))
    expected = {SPLITS[split]: found for split, found in rows(merged).items()}
    assert {name: split["stem"] for name, split in opened.items()} == {
        name: [row["stem"] for row in found] for name, found in expected.items() if found
    }
    row = next(iter(opened["train"]))
    assert row["image"].size == (96, 80)
    kinds = opened["train"].features["imdg"]["category"].feature
    assert "container" in map(kinds.int2str, row["imdg"]["category"])


def test_commands_take_merged_tables(tables, tmp_path, capsys):
    *sources, merged = tables
    assert main(["verify", str(merged)]) == 0
    counts = []
    for root in (*sources, merged):
        capsys.readouterr()
        assert main(["stats", str(root), "--json"]) == 0
        counts.append(json.loads(capsys.readouterr().out)["images"])
    one, two, both = counts
    assert both == {split: one[split] + two[split] for split in SPLITS}
    shown = report_content(str(merged))["sheet"]
    assert len(shown) == IMAGES[1] + IMAGES[2]
    again = tmp_path / "again"
    third = generate(tmp_path / "3", 3, "--format", "parquet", "--also", "voc")
    assert main(["merge", str(merged), str(third), str(again)]) == 0
    assert main(["verify", str(again)]) == 0
    found = [row for split in rows(again).values() for row in split]
    assert sorted(row["image_id"] for row in found) == list(range(sum(IMAGES.values())))
    assert len({row["stem"] for row in found}) == sum(IMAGES.values())


def without_column(table):
    return table.drop_columns(["damage_png"])


def other_names(table):
    features = table.schema.metadata[b"huggingface"].replace(b'"container"', b'"box"')
    return table.replace_schema_metadata({"huggingface": features})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without_column, r"the columns of \w+-000000.parquet differ .*1 \(damage_png\); generate"),
        (other_names, r"the columns of \w+-000000.parquet differ .*1 \(the features\); generate"),
        (lambda table: table.slice(1), r"\w+-000000.parquet is missing or was changed; run fast"),
    ],
)
def test_tables_that_do_not_fit_are_refused(tables, tmp_path, capsys, change, words):
    first, second, _ = tables
    copy = tmp_path / "copy"
    shutil.copytree(second, copy)
    path = next(copy.glob("*-000000.parquet"))
    pq.write_table(change(pq.read_table(path)), path)
    assert main(["merge", str(first), str(copy), str(tmp_path / "out")]) == 2
    assert re.search(rf"fastgen: {copy}: {words}", capsys.readouterr().err)
    path.write_bytes(path.read_bytes()[:-9])
    assert main(["merge", str(first), str(copy), str(tmp_path / "out")]) == 2
    assert f"{copy}: {path.name} is missing or was changed" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["copy"]


def test_merging_tables_without_pyarrow_says_what_to_install(tables, tmp_path, capsys, monkeypatch):
    first, second, _ = tables
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["merge", str(first), str(second), str(tmp_path / "out")]) == 2
    assert "pip install 'fastgen[parquet]'" in capsys.readouterr().err


def packed(path, kind, size, count):
    """Write an archive of `count` samples, each with `size` bytes that do not compress."""
    noise = hashlib.shake_256(b"noise")
    if kind == "tar":
        with tarfile.open(path, "w") as tar:
            for number in range(count):
                member = tarfile.TarInfo(f"{number:06d}_A.jpg")
                member.size = size
                tar.addfile(member, io.BytesIO(noise.digest(size)))
    else:
        row = {"image_id": 0, "image": {"bytes": noise.digest(size), "path": "000000_A.jpg"}}
        table = pa.Table.from_pylist([row])
        with pq.ParquetWriter(path, table.schema, use_dictionary=False) as writer:
            for _ in range(count):
                writer.write_table(table)


@pytest.mark.parametrize("kind", ["tar", "parquet"])
def test_memory_does_not_grow_with_the_archive(tmp_path, kind):
    size = 1 << 20
    packed(tmp_path / "archive", kind, size, 32)
    before, pool = pa.default_memory_pool(), pa.proxy_memory_pool(pa.default_memory_pool())
    pa.set_memory_pool(pool)
    tracemalloc.start()
    try:
        with (tmp_path / "archive").open("rb") as stream:
            pieces = (
                renamed_tar(stream, lambda name, data: (f"s1_{name}", data))
                if kind == "tar"
                else renamed_table(stream, lambda text: f"s1_{text}", 5)
            )
            written = sum(map(len, pieces))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        pa.set_memory_pool(before)
    assert written > 32 * size
    assert peak + pool.max_memory() < 12 * size


def bop(root):
    """Return what a BOP scene says of each image, by its content, and the ids of each split."""
    found, ids = {}, {}

    def pixels(path):
        return hashlib.sha256(path.read_bytes()).hexdigest()

    for split in SPLITS:
        for scene in (root / f"bop/{split}").iterdir():
            cameras, poses, infos = (
                json.loads((scene / f"scene_{name}.json").read_text())
                for name in ("camera", "gt", "gt_info")
            )
            assert cameras.keys() == poses.keys() == infos.keys()
            ids[split] = list(map(int, cameras))
            for folder in ("rgb", "depth") if cameras else ():
                assert sorted(int(p.stem) for p in (scene / folder).iterdir()) == ids[split]
            masks = [f"{int(key):06d}_{n:06d}.png" for key in poses for n in range(len(poses[key]))]
            assert {path.name for path in scene.glob("mask_visib/*")} == set(masks)
            for key in cameras:
                shown = [scene / f"mask_visib/{name}" for name in masks if name[:6] == f"{key:0>6}"]
                for path, info in zip(shown, infos[key], strict=True):
                    assert (cv2.imread(str(path), -1) > 0).sum() == info["px_count_visib"]
                image = pixels(scene / f"rgb/{key:0>6}.jpg")
                files = [pixels(path) for path in (scene / f"depth/{key:0>6}.png", *shown)]
                found[split, image] = (cameras[key], poses[key], infos[key], files)
    return found, ids


def test_poses_stay_with_their_image(poses):
    (one, first), (two, second), (merged, both) = map(bop, poses)
    assert len(one) + len(two) == len(merged) == IMAGES[1] + IMAGES[2]
    assert merged == one | two
    assert both == {
        split: first[split] + [number + IMAGES[1] for number in second[split]] for split in SPLITS
    }
    for path in Path(poses[0]).glob("bop/models/*"):
        assert (poses[2] / "bop/models" / path.name).read_bytes() == path.read_bytes()
    images = {path.stat().st_ino for path in poses[2].glob("images/*/*")}
    assert {path.stat().st_ino for path in poses[2].glob("bop/*/*/rgb/*")} == images


def test_merged_poses_pass_verify_and_can_be_merged_again(poses, tmp_path):
    *_, merged = poses
    assert main(["verify", str(merged)]) == 0
    third = generate(tmp_path / "3", 3, "--tasks", "damage", "--also", "bop")
    assert main(["merge", str(third), str(merged), str(tmp_path / "again")]) == 0
    assert main(["verify", str(tmp_path / "again")]) == 0
    found, ids = bop(tmp_path / "again")
    assert found == bop(third)[0] | bop(merged)[0]
    numbers = [number for split in ids.values() for number in split]
    assert sorted(numbers) == list(range(sum(IMAGES.values())))


def test_images_of_version_0_30_which_have_no_numbers_get_them(poses, tmp_path):
    first, second, merged = poses
    copy = tmp_path / "copy"
    shutil.copytree(second, copy)
    manifest = json.loads((copy / "dataset.json").read_bytes())
    for path in (copy / "shards").iterdir():
        shard = json.loads(path.read_bytes())
        for record in shard["records"]:
            del record["number"]
        del shard["digest"]
        text = seal(json.dumps(shard, separators=(",", ":")).encode())
        path.write_bytes(text)
        manifest["shards"][str(int(path.stem))] = digest(text)
    del manifest["digest"]
    (copy / "dataset.json").write_bytes(seal(json.dumps(manifest, indent=1).encode()))
    assert main(["merge", str(first), str(copy), str(tmp_path / "out")]) == 0
    assert bop(tmp_path / "out") == bop(merged)

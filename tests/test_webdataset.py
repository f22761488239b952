"""WebDataset shards read by the webdataset package, and datasets in an S3-compatible store."""

import io
import json
import re
from pathlib import Path

import boto3
import numpy as np
import pytest
import simplejpeg
import webdataset
from moto.server import ThreadedMotoServer
from PIL import Image
from s3fs import S3FileSystem

from fastgen.cli.main import main
from fastgen.dataset.storage import storage_of

pytestmark = pytest.mark.usefixtures("no_workers")

ARGUMENTS = ["--images", "12", "--size", "96x80", "--seed", "3", "--format", "webdataset"]


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tars") / "out"
    assert main(["generate", str(folder), *ARGUMENTS, "--shard", "2", "--also", "ids"]) == 0
    return folder


def test_samples_stream_with_all_their_labels(out, tmp_path):
    plain = tmp_path / "plain"
    arguments = ARGUMENTS[:-2]
    assert main(["generate", str(plain), *arguments, "--also", "ids"]) == 0
    seen = 0
    for path in sorted(out.glob("*.tar")):
        split = path.name.split("-")[0]
        for sample in webdataset.WebDataset(str(path), shardshuffle=False):
            stem = sample["__key__"]
            scene = json.loads(sample["json"])
            assert (scene["stem"], scene["split"]) == (stem, split)
            pairs = {
                f"images/{split}/{stem}.jpg": "jpg",
                f"scenes/{split}/{stem}.json": "json",
                f"damage/masks/{split}/{stem}.png": "damage.png",
                f"damage/yolo/{split}/{stem}.txt": "damage.txt",
                f"imdg/labels/{split}/{stem}.txt": "imdg.txt",
                f"ids/{split}/{stem}.png": "ids.png",
            }
            for name, key in pairs.items():
                assert sample[key] == (plain / name).read_bytes()
            assert simplejpeg.decode_jpeg(sample["jpg"]).shape == (80, 96, 3)
            ids = np.asarray(Image.open(io.BytesIO(sample["ids.png"])))
            for thing in scene["objects"]:
                if thing["id"] in (1, *range(200, 600)) or not thing["bbox"]:
                    continue
                if thing["background"]:
                    continue
                assert (ids == thing["id"]).sum() == thing["area"]
            seen += 1
    assert seen == 12


def test_the_documented_decoder_keeps_sixteen_bits(out):
    page = Path(__file__).parents[1] / "docs/output.md"
    (code,) = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
    seen = 0
    for path in out.glob("*.tar"):
        names: dict = {}
        exec(code.replace("OUT/train-000000.tar", str(path)), names)
        for sample in names["samples"]:
            assert sample["damage.png"].dtype == np.uint16
            found = {int(value) for value in np.unique(sample["ids.png"])} - {0}
            assert found == {
                thing["id"]
                for thing in sample["json"]["objects"]
                if thing["id"] not in range(200, 600) and thing["bbox"] and not thing["background"]
            }
            assert max(found) > 255
            seen += 1
    assert seen == 12


def test_tars_are_verified_and_resumed(out, tmp_path, capsys):
    assert main(["verify", str(out)]) == 0
    tar = min(out.glob("*.tar"))
    whole = tar.read_bytes()
    tar.write_bytes(whole[:700] + bytes([whole[700] ^ 1]) + whole[701:])
    assert main(["verify", str(out)]) == 1
    assert f"{tar.name}: changed" in capsys.readouterr().out
    tar.unlink()
    assert main(["generate", str(out), *ARGUMENTS, "--shard", "2", "--also", "ids"]) == 0
    assert tar.read_bytes() == whole
    assert main(["verify", str(out)]) == 0


@pytest.fixture
def bucket(monkeypatch):
    server = ThreadedMotoServer(port=0)
    server.start()
    host, port = server.get_host_and_port()
    address = f"http://{host}:{port}"
    for name, value in (
        ("AWS_ACCESS_KEY_ID", "test"),
        ("AWS_SECRET_ACCESS_KEY", "test"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
        ("AWS_ENDPOINT_URL", address),
        ("FSSPEC_S3_ENDPOINT_URL", address),
    ):
        monkeypatch.setenv(name, value)
    boto3.client("s3", endpoint_url=address).create_bucket(Bucket="port")
    S3FileSystem.clear_instance_cache()  # the cache remembers the address of an earlier server
    yield "s3://port/made"
    S3FileSystem.clear_instance_cache()
    server.stop()


def test_a_dataset_in_an_s3_store_equals_one_on_disk_and_resumes(bucket, out, capsys):
    arguments = [*ARGUMENTS, "--shard", "2", "--also", "ids"]
    assert main(["generate", bucket, *arguments]) == 0
    assert main(["verify", bucket]) == 0
    store = storage_of(bucket)
    assert store.sizes() == storage_of(out).sizes()
    for name in store.sizes():
        assert store.read(name) == (out / name).read_bytes()
    lost = min(name for name in store.sizes() if name.endswith(".tar"))
    boto3.client("s3").delete_object(Bucket="port", Key=f"made/{lost}")
    assert main(["verify", bucket]) == 1
    assert f"{lost}: missing" in capsys.readouterr().out
    assert main(["generate", bucket, *arguments]) == 0
    assert store.read(lost) == (out / lost).read_bytes()
    assert main(["generate", bucket, *arguments[:2], "--seed", "4", *ARGUMENTS[4:]]) == 2
    assert "was made with other settings (formats was [" in capsys.readouterr().err


def test_a_missing_bucket_is_named_and_not_created(bucket, capsys):
    assert main(["generate", "s3://prot/made", *ARGUMENTS]) == 2
    error = capsys.readouterr().err
    assert error.startswith("fastgen: s3://prot/made")
    assert "bucket does not exist" in error
    assert error.count("\n") == 1
    assert main(["verify", "s3://prot/made"]) == 2
    assert [b["Name"] for b in boto3.client("s3").list_buckets()["Buckets"]] == ["port"]


def test_a_store_without_credentials_gives_one_line(bucket, monkeypatch, capsys, tmp_path):
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "none"))
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "none"))
    for command in (["generate", bucket, *ARGUMENTS], ["verify", bucket], ["stats", bucket]):
        assert main(command) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"fastgen: {bucket}/dataset.json: cannot be read")
        assert error.count("\n") == 1


def test_storage_in_process_memory_is_refused(capsys):
    assert main(["generate", "memory://made", *ARGUMENTS]) == 2
    assert "memory://made: is memory of this process" in capsys.readouterr().err


def test_stats_of_tar_files_equal_those_of_a_folder(out, tmp_path, capsys):
    plain = tmp_path / "plain"
    at = ARGUMENTS.index("--format")
    assert main(["generate", str(plain), *ARGUMENTS[:at]]) == 0
    capsys.readouterr()
    assert main(["stats", str(out)]) == 0
    printed = capsys.readouterr().out
    assert main(["stats", str(plain)]) == 0
    assert capsys.readouterr().out == printed

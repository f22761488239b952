"""WebDataset shards streamed by the webdataset package, and datasets in an S3-compatible store."""

import io
import json

import boto3
import numpy as np
import pytest
import simplejpeg
import webdataset
from moto.server import ThreadedMotoServer
from PIL import Image

from fastgen.cli import main
from fastgen.storage import storage_of

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
                assert (ids == thing["id"]).sum() == thing["area"]
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
    yield "s3://port/made"
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
    assert "was made with another" in capsys.readouterr().err

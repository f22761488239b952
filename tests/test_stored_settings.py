"""Settings in datasets and loader states stay those of version 0.23, so that old ones resume."""

import hashlib
import json

import fastgen
from fastgen.dataset.job import Job
from fastgen.dataset.settings import settled
from fastgen.render.settings import RenderSettings
from fastgen.torch import (
    ContainerDataset,
    ContainerStream,
    ItemSettings,
    Loader,
    SceneSettings,
)


def digest(state):
    return hashlib.sha256(json.dumps(with_floats(state)).encode()).hexdigest()


def with_floats(value):
    """Turn all numbers into floats: states compare equal if one has 12 and the other 12.0."""
    if isinstance(value, dict):
        return {key: with_floats(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [with_floats(item) for item in value]
    return float(value) if isinstance(value, int | float) else value


def test_settings_of_a_job_are_stored_as_in_0_23(monkeypatch):
    monkeypatch.setattr(fastgen, "__version__", "0.23.0")  # it is one of the settings
    job = Job(
        "out",
        10,
        seed=3,
        cameras=("A", "Cr"),
        render=RenderSettings((96, 64)),
        also=("voc", "depth"),
    )
    settled_job, settings = settled(job, 1)
    assert list(settings) == [
        *("version", "format", "formats", "seed", "size", "quality", "cameras"),
        *("environments", "shard_scenes", "config"),
    ]
    assert settings["formats"] == ["damage", "imdg", "container", "text", "door", "depth", "voc"]
    written_by_0_23 = "b53e6a7be15df4cfd1a0054f0184f17448789db9d85a74ba3e2b870b9c94610f"
    assert settled_job.settings_digest == written_by_0_23


def test_state_of_a_loader_is_stored_as_in_0_23():
    data = ContainerDataset(
        "imdg",
        seed=4,
        length=23,
        render=RenderSettings((64, 64), "draft"),
        scenes=SceneSettings(
            ["A", "Cr"],
            "val",
            fixed=True,
            all_views=False,
            curriculum=lambda epoch: {"damage": {"probability": 1.0 / (1 + epoch)}},
        ),
        items=ItemSettings(form="yolo"),
    )
    state = Loader(data, batch_size=4, shuffle=True).state_dict()
    assert digest(state) == "d851010511f2504b64d3548ac36a970ccb432401d570e60acbcf7cbf5f9e20c9"


def test_state_of_an_endless_stream_is_stored_as_in_0_23():
    data = ContainerDataset("damage", seed=4, render=RenderSettings((64, 64)))
    state = Loader(ContainerStream(data, endless=True), batch_size=4).state_dict()
    assert digest(state) == "c360f0d8353f5aa9969c163f7f7f2277c1429800a1933c6ca58299d4111557ca"

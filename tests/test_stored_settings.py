"""Settings in datasets and loader states keep the form of version 0.23, so tools can read both.

The configuration is left out: versions add keys to it, and only its own version resumes a dataset.
"""

import hashlib
import json
from dataclasses import replace

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

# Panoramas that version 0.23 lacked.
ADDED = [
    *(f"port_{place}" for place in ("gate", "gate_rain", "gate_golden")),
    *(f"port_{place}" for place in ("aisle", "aisle_fog", "aisle_night")),
    *(f"port_{place}" for place in ("rail", "rail_rain", "rail_dusk")),
]


def digest(state):
    return hashlib.sha256(json.dumps(with_floats(state)).encode()).hexdigest()


def with_floats(value):
    """Turn all numbers into floats, as one state may have 12 and the other 12.0.

    Keys that version 0.23 lacked, or that depend on the configuration, are dropped: configuration,
    class lists, digests of a curriculum and of container maps, and later panoramas.
    """
    if isinstance(value, dict):
        dropped = {"config", "classes", "curriculum", "containers", *ADDED}
        kept = {key: item for key, item in value.items() if key not in dropped}
        return {key: with_floats(item) for key, item in kept.items()}
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
        shard_scenes=4,
        stems="short",
        coco_masks="rle",
    )
    _, settings = settled(job, 1)
    assert list(settings) == [
        *("version", "format", "formats", "seed", "size", "quality", "cameras"),
        *("environments", "shard_scenes", "classes", "config"),
    ]
    assert settings["formats"] == ["damage", "imdg", "container", "text", "door", "depth", "voc"]
    assert digest(settings) == "17f2f307e2b0a7b0cb03d1fb220c0de1873f1b0ebaa5d971b2d5457f90b57025"
    _, more = settled(replace(job, stems="seed", coco_masks="polygon"), 1)
    assert more == {**settings, "stems": "seed", "coco_masks": "polygon"}


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
    assert digest(state) == "2c13cb1820c1e396d5fac829aaca20a9490c00efe2770e44070668c19977a61e"


def test_state_of_an_endless_stream_is_stored_as_in_0_23():
    data = ContainerDataset("damage", seed=4, render=RenderSettings((64, 64)))
    state = Loader(ContainerStream(data, endless=True), batch_size=4).state_dict()
    assert digest(state) == "463a71d96f658c20bfd93dd564351663cfa2df16563389d4fdcdbb73e6c42bbc"

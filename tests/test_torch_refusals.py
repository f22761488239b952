"""Bad arguments and foreign states that datasets and loaders refuse."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from fastgen import Config, Generator
from fastgen.errors import ConfigError
from fastgen.formats.door import door_class
from fastgen.light.hdri import bundled_hdris
from fastgen.torch import (
    ContainerDataset,
    ContainerStream,
    ItemSettings,
    Loader,
    RenderSettings,
    SceneSettings,
    ShardSampler,
)
from tests.test_torch import SMALL, dataset, stream

SCRAPED = Config.from_values({"damage": {"kinds": ["axis", "scrape"]}})
SLANTED = Config.from_values({"cameras": {"Cr": {"azimuth_deg": [40, 80]}, "Cl": {}}})


def test_the_door_task_takes_the_cameras_that_always_see_an_end():
    assert ContainerDataset("door", SLANTED, length=2, render=SMALL).cameras == ("Cl",)


@pytest.mark.parametrize(("preset", "camera"), [("yard", "pole_door"), ("quay", "end_left")])
def test_the_door_task_says_which_cameras_it_needs(preset, camera):
    config = Config.preset(preset)
    seen = {door_class(Generator(config, seed=1).scene(i).camera(camera)) for i in range(3)}
    assert seen & {"door", "no_door"}  # `fastgen generate` writes these images
    words = "looks at an end of the container in every scene; .* azimuth_deg .* within 45 degrees"
    with pytest.raises(ConfigError, match=words):
        ContainerDataset("door", config, render=SMALL)
    angles = {"azimuth_deg": [-30, 30], "elevation_deg": [10, 30]}
    nearer = {each: angles if each == camera else {} for each in config.cameras}
    config = Config.from_values({"cameras": nearer}, base=config)
    assert ContainerDataset("door", config, render=SMALL).cameras == (camera,)


def dataset_of(task="imdg", config=None, length=23, size=(64, 64), form="detection", **scenes):
    """Make a dataset from plain values."""
    return ContainerDataset(
        task,
        config,
        length=length,
        render=RenderSettings(size),
        scenes=SceneSettings(**scenes),
        items=ItemSettings(form=form),
    )


def lit_by(folder):
    """Make a dataset whose HDRIs come from a folder."""
    return ContainerDataset("imdg", seed=4, length=23, render=replace(SMALL, hdri_dir=folder))


@pytest.mark.parametrize("position", [-1, 1.5, "a"])
def test_locate_refuses_positions_that_are_no_whole_numbers(position):
    with pytest.raises(ConfigError, match=r"position: .* is not a whole number of 0 or more"):
        dataset().locate(position)


@pytest.mark.parametrize("epoch", [-1, 1.5, "a", True, 10**10])
@pytest.mark.parametrize("name", ["locate", "sample", "item"])
def test_epochs_that_do_not_exist_are_refused(name, epoch):
    data = dataset()
    with pytest.raises(ConfigError, match=r"epoch: .* is not a whole number of 0"):
        getattr(data, name)(0, epoch)
    with pytest.raises(ConfigError, match=r"epoch: .* is not a whole number of 0"):
        data.config_at(epoch)
    assert data.locate(0, np.int64(2)) == data.locate(0, 2.0) == data.locate(0, 2)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (ItemSettings, "as_float"),
        (ItemSettings, "pairs"),
        (SceneSettings, "fixed"),
        (SceneSettings, "all_views"),
        (lambda **flags: Loader(dataset(), **flags), "shuffle"),
        (lambda **flags: Loader(dataset(), **flags), "drop_last"),
        (lambda **flags: ShardSampler(dataset(), **flags), "shuffle"),
        (lambda **flags: ContainerStream(dataset(), **flags), "endless"),
    ],
)
def test_only_booleans_are_accepted_as_booleans(make, name):
    for value in ("no", "False", 0, 1, None):
        with pytest.raises(ConfigError, match=f"^{name}: expected true or false, got"):
            make(**{name: value})
    for value in (False, True, np.True_):
        make(**{name: value})
    if make in (ItemSettings, SceneSettings):
        assert getattr(make(**{name: np.True_}), name) is True


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"task": "damge"}, r"task: 'damge' is unknown \(did you mean damage\?\)"),
        ({"length": 0}, "length: 0 is not a whole number of 1 to"),
        ({"cameras": ["A", "D"]}, "cameras: 'D' does not suit the imdg task"),
        ({"task": "door", "cameras": ["A"]}, "cameras: 'A' does not suit the door task"),
        ({"task": ["door"]}, r"task: \['door'\] is unknown"),
        ({"task": "door", "config": SLANTED, "cameras": ["Cr"]}, "cameras: 'Cr' .* 45 degrees"),
        ({"cameras": []}, "cameras: give at least one name"),
        ({"split": "trian"}, r"split: 'trian' is unknown \(did you mean train\?\)"),
        ({"form": "coco"}, "form: 'coco' is unknown"),
        ({"task": "door", "form": "yolo"}, "form: 'yolo' is for boxes"),
        ({"size": (10, 10)}, "size: 10x10 is out of range"),
        ({"curriculum": lambda epoch: 3}, "curriculum: epoch 0 gives 3"),
        ({"curriculum": lambda epoch: {"damge": {}}}, "curriculum: epoch 0: damge: unknown key"),
        ({"config": {}}, "config: dict is not a Config"),
        ({"cameras": "A"}, r"cameras: 'A' is not a list; give \['A'\]"),
        ({"length": "9"}, "length: '9' is not a whole number"),
        (
            {"curriculum": lambda epoch: {"damage": {"mask_threshold_mm": 9.0}}},
            "curriculum: epoch 0 changes damage.mask_threshold_mm",
        ),
        (
            {"curriculum": lambda epoch: {"damage": {"kinds": ["axis", "scrape"]}}},
            "curriculum: epoch 0 changes which classes there are; list the same last kind in",
        ),
        (
            {"config": SCRAPED, "curriculum": lambda epoch: {"damage": {"kinds": ["axis"]}}},
            "curriculum: epoch 0 changes which classes there are; list the same last kind in",
        ),
        (
            {"curriculum": lambda epoch: {"split": {"train": 0.5, "val": 0.5, "test": 0.0}}},
            "curriculum: epoch 0 changes split; leave it, because",
        ),
        (
            {
                "config": Config.from_values({"split": {"train": 1.0, "val": 0.0, "test": 0.0}}),
                "curriculum": lambda epoch: Config.preset(),
            },
            "curriculum: epoch 0 changes split; leave it, because",
        ),
        (
            {"split": "val", "config": Config.from_values({"split": {"val": 0.0}})},
            "split: config.split gives val no scenes",
        ),
    ],
)
def test_bad_arguments_are_named(arguments, words):
    with pytest.raises(ConfigError, match=words):
        dataset_of(**arguments)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("render", "draft", "render: str is not RenderSettings"),
        ("scenes", {"split": "train"}, "scenes: dict is not SceneSettings"),
        ("items", None, "items: NoneType is not ItemSettings"),
    ],
)
def test_settings_of_another_type_are_named(name, value, words):
    with pytest.raises(ConfigError, match=words):
        ContainerDataset("imdg", **{name: value})


def test_the_last_epoch_has_scenes_and_the_next_is_refused():
    data = dataset()
    last = (2**63 - 1 - 10**9) // 10**9  # epoch e has scenes e x 10^9 to (e + 1) x 10^9
    for epoch in (last, np.int64(last)):
        data.set_epoch(epoch)
        assert data.locate(0)[0] == last * 10**9
    for epoch in (last + 1, 10**10, 2**62):
        words = f"epoch: {epoch} is not a whole number of 0 to {last}"
        with pytest.raises(ConfigError, match=words):
            data.set_epoch(epoch)
    assert data.epoch == last
    assert data[0][0].shape[0] == 3


def test_bad_ranks_states_and_batches_are_named():
    for rank, world, words in ((2, 2, "rank: 2 is out of range"), (0, None, "give both")):
        with pytest.raises(ConfigError, match=words):
            ShardSampler(dataset(), rank, world)
    with pytest.raises(ConfigError, match="batch_size: 0"):
        Loader(dataset(), batch_size=0)
    with pytest.raises(ConfigError, match="sampler: a Loader divides the positions itself"):
        Loader(dataset(), sampler=[0, 1])
    with pytest.raises(ConfigError, match="dataset: list is neither"):
        Loader([1, 2])
    with pytest.raises(ConfigError, match="dataset: str is not a ContainerDataset"):
        ContainerStream("imdg")
    with pytest.raises(ConfigError, match="a stream has its own"):
        Loader(stream(), shuffle=True)
    with pytest.raises(ConfigError, match="epoch: -1"):
        dataset().set_epoch(-1)
    with pytest.raises(ConfigError, match="state: was taken with another length"):
        Loader(dataset(24)).load_state_dict(Loader(dataset(23)).state_dict())
    with pytest.raises(ConfigError, match="state: has no 'position'"):
        Loader(dataset()).load_state_dict({"epoch": 1})
    with pytest.raises(IndexError, match="position 23"):
        dataset()[23]


@pytest.mark.parametrize("make", [dataset, stream])
@pytest.mark.parametrize("value", [False, 0, None])
def test_a_loader_refuses_batches_out_of_order(make, value):
    with pytest.raises(
        ConfigError, match="in_order: a Loader resumes exactly only with batches in order"
    ):
        Loader(make(), num_workers=2, in_order=value)
    assert Loader(make(), num_workers=2, in_order=True).in_order


def picture(path, level):
    radiance = np.full((128, 256, 3), level, np.float32)
    assert cv2.imwrite(str(path), radiance)


def test_a_state_fits_only_loaders_with_the_same_hdris(tmp_path):
    folders = [tmp_path / name for name in ("one", "moved", "other")]
    for folder, level in zip(folders, (0.5, 0.5, 0.7), strict=True):
        folder.mkdir()
        picture(folder / "own.hdr", level)
    one, moved, other = (Loader(lit_by(folder)) for folder in folders)
    state = json.loads(json.dumps(one.state_dict()))
    moved.load_state_dict(state)  # another path with the same bytes
    for loader in (other, Loader(dataset())):
        with pytest.raises(ConfigError, match="state: was taken with another hdri_dir"):
            loader.load_state_dict(state)


def test_a_state_does_not_fit_a_loader_with_other_hdri_weights():
    shipped = next(iter(bundled_hdris().values())).parent
    with pytest.raises(ConfigError, match="state: was taken with another hdri_dir"):
        Loader(lit_by(shipped)).load_state_dict(Loader(dataset()).state_dict())


def test_a_state_fits_only_loaders_with_an_equal_curriculum():
    def rarer(epoch):
        return {"damage": {"probability": 1.0 / (1 + epoch)}}

    def taught(curriculum, epoch=0):
        loader = Loader(dataset(curriculum=curriculum))
        loader.set_epoch(epoch)
        return loader

    state = json.loads(json.dumps(taught(rarer, 5).state_dict()))
    taught(lambda epoch: Config.from_values(rarer(epoch))).load_state_dict(state)
    for other in (
        None,
        lambda epoch: rarer(epoch + 1),
        lambda epoch: rarer(0 if epoch == 1 else epoch),
        lambda epoch: rarer(min(epoch, 3)),
        lambda epoch: [rarer(0), rarer(1)][epoch],  # fails at epoch 5
    ):
        with pytest.raises(ConfigError, match="state: was taken with another curriculum"):
            taught(other).load_state_dict(state)
    short = taught(lambda epoch: [rarer(0)][epoch])
    short.load_state_dict(short.state_dict())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": "x"}, "state.position: 'x' is not a whole number of 0"),
        ({"position": -3}, "state.position: -3 is not a whole number of 0"),
        ({"position": 300}, "state.position: 300 is not a whole number of 0 to 23"),
        ({"epoch": None}, "state.epoch: None is not a whole number"),
    ],
)
def test_an_invalid_state_is_refused_and_changes_nothing(change, words):
    loader = Loader(dataset())
    loader.set_epoch(2)
    state = loader.state_dict()
    with pytest.raises(ConfigError, match=words):
        loader.load_state_dict({**state, "epoch": 7, **change})
    assert loader.state_dict() == state


def places(value, path=()):
    """Yield the path of every value in a state, and of every mapping and list."""
    yield path
    items = value.items() if isinstance(value, dict) else ()
    for step, item in enumerate(value) if isinstance(value, list) else items:
        yield from places(item, (*path, step))


def with_value(state, path, value):
    """Return a copy of a state with another value at one place."""
    if not path:
        return value
    copy = state.copy()
    copy[path[0]] = with_value(state[path[0]], path[1:], value)
    return copy


def endless():
    made = []
    made.append(made)
    return made


FOREIGN = {
    "tensor": torch.zeros(3),
    "number": torch.tensor(1),
    "array": np.zeros(3),
    "scalar": np.array(0.5),
    "half": np.float16(0.1),
    "bytes": b"x",
    "set": {1},
    "complex": 1j,
    "long": 10**5000,
    "endless": endless(),
    "mapping": {"0": torch.zeros(3), 1: 2},
    "digits": {"9" * 5000: "x"},
    "superscript": {"\u00b2": "x"},
    "many": dict.fromkeys(map(str, range(1000)), "x"),
}


@pytest.mark.parametrize("value", FOREIGN.values(), ids=FOREIGN)
def test_a_foreign_value_anywhere_in_a_state_is_refused_and_changes_nothing(value):
    """Programs that store states may turn their numbers into tensors or arrays."""
    called = []

    def taught(epoch):
        called.append(epoch)
        return {"damage": {"probability": 0.5}}

    loader = Loader(dataset(curriculum=taught))
    state = json.loads(json.dumps(loader.state_dict()))
    paths = [path for i, path in enumerate(places(state)) if len(path) < 3 or i % 5 == 0]
    assert len(paths) > 60
    for path in paths:
        with pytest.raises(ConfigError, match=r"^state[.:]") as caught:
            loader.load_state_dict(with_value(state, path, value))
        assert len(str(caught.value)) < 300, path
    assert loader.state_dict() == state
    assert len(called) < 100  # not once for each epoch that a state names


def test_a_curriculum_may_repeat_the_split():
    config = Config.from_values({"split": {"train": 0.5, "val": 0.5, "test": 0.0}})
    for taught in (lambda epoch: config, lambda epoch: {"split": config.to_plain()["split"]}):
        data = dataset_of(config=config, curriculum=taught, split="val")
        data.set_epoch(1)
        assert data.epoch == 1
        data.close()


@pytest.mark.parametrize("position", ["a", 1.5, None])
def test_indexing_refuses_positions_that_are_no_whole_numbers(position):
    with pytest.raises(TypeError, match="is not a whole number"):
        dataset()[position]


def test_transforms_that_return_no_pair_are_named():
    items = ItemSettings(transforms=lambda image, target: None)
    data = ContainerDataset("imdg", render=SMALL, items=items)
    with pytest.raises(ConfigError, match=r"transforms: gave NoneType; return \(image, target\)"):
        data[0]
    data.close()


def test_transforms_of_pairs_must_return_pairs():
    items = ItemSettings(pairs=True, transforms=lambda images, targets: (images[0], targets[0]))
    data = ContainerDataset("damage", render=SMALL, items=items)
    with pytest.raises(ConfigError, match="transforms: gave Tensor; return two images"):
        data[0]
    data.close()


@pytest.mark.parametrize("task", ["imdg", "text", "door", "seal"])
def test_only_the_damage_task_has_pairs(task):
    with pytest.raises(ConfigError, match=f"pairs: the {task} task does not look for damages"):
        ContainerDataset(task, items=ItemSettings(pairs=True))

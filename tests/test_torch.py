"""Datasets and loaders: every position once, in order, resumable, with the bytes of renders."""

import itertools
import multiprocessing
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from fastgen import Config, Generator
from fastgen.sampling.scene import split_of
from fastgen.torch import (
    ContainerDataset,
    ContainerStream,
    Loader,
    RenderSettings,
    SceneSettings,
    ShardSampler,
    collate_lists,
)
from fastgen.torch.plan import EPOCH_SCENES, positions

ROOT = Path(__file__).parent.parent
SMALL = RenderSettings((64, 64))
PERSISTENT = {"num_workers": 2, "persistent_workers": True, "multiprocessing_context": "fork"}


def test_without_torch_the_package_imports_and_the_loader_says_what_to_install():
    code = (
        "import sys; sys.modules['torch'] = None; import fastgen\n"
        "try: import fastgen.torch\n"
        "except ImportError as error: print(error)"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    assert "pip install 'fastgen[torch]'" in done.stdout


def test_torchvision_is_not_needed():
    code = "import sys; sys.modules['torchvision'] = None; import fastgen.torch"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.fixture
def bare(monkeypatch):
    """Replace rendered items with (epoch, position), in forked workers too."""
    monkeypatch.setattr(
        ContainerDataset,
        "item",
        lambda self, position, epoch=None: (self.epoch if epoch is None else epoch, position),
    )


def seen(loader):
    """Return the positions in the order in which batches deliver them."""
    return [position for batch in loader for position in batch[1]]


def dataset(length=23, **scenes):
    return ContainerDataset(
        "imdg", seed=4, length=length, render=SMALL, scenes=SceneSettings(**scenes)
    )


def stream(length=23, **options):
    return ContainerStream(dataset(length), **options)


@pytest.mark.parametrize("stop", [1, 2, 5, 24, 37])
def test_ranks_and_workers_divide_every_range_without_gap_or_overlap(stop):
    for world, workers, block in itertools.product((1, 2, 3, 5), (1, 2, 4), (1, 3)):
        for start in (0, 1, 7):
            found = [
                position
                for rank in range(world)
                for worker in range(workers)
                for position in positions(start, stop, (rank, world), (worker, workers), block)
            ]
            assert sorted(found) == list(range(start, stop))


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("kind", ["dataset", "stream"])
@pytest.mark.parametrize("workers", [0, 1, 2])
def test_ranks_of_real_loaders_deliver_each_position_once(kind, workers):
    found = []
    for rank in range(3):
        part = {"rank": rank, "world_size": 3}
        if kind == "stream":
            loader = Loader(stream(**part), batch_size=2, num_workers=workers)
        else:
            loader = Loader(dataset(), batch_size=2, num_workers=workers, shuffle=True, **part)
        mine = seen(loader)
        assert len(loader) == -(-len(mine) // 2)
        found += mine
    assert sorted(found) == list(range(23))


@pytest.mark.usefixtures("bare")
def test_a_streams_order_does_not_depend_on_the_number_of_workers():
    for workers in (0, 1, 2):
        loader = Loader(stream(), batch_size=4, num_workers=workers)
        assert seen(loader) == list(range(23))


@pytest.mark.usefixtures("bare")
def test_a_plain_dataloader_delivers_each_position_of_a_stream_once():
    loader = DataLoader(stream(), batch_size=3, num_workers=2, collate_fn=collate_lists)
    assert sorted(seen(loader)) == list(range(23))


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("make", [dataset, stream])
@pytest.mark.parametrize("workers", [0, 2])
def test_a_resumed_loader_continues_with_the_next_sample(make, workers):
    options = {"num_workers": workers, "shuffle": make is dataset}

    def loader():
        made = Loader(make(), batch_size=3, **options)
        made.set_epoch(2)
        return made

    whole = seen(loader())
    for taken in (0, 1, 4, 8):
        first = loader()
        batches = iter(first)
        begun = [position for _ in range(taken) for position in next(batches)[1]]
        state = pickle.loads(pickle.dumps(first.state_dict()))
        second = Loader(make(), batch_size=5, **options)
        second.load_state_dict(state)
        second.set_epoch(2)  # a training loop sets the epoch again
        assert begun + seen(second) == whole
        second.set_epoch(2)
        assert seen(second) == whole  # the next pass is complete


@pytest.mark.usefixtures("bare")
def test_state_resumes_on_another_number_of_ranks():
    first = [Loader(stream(rank=r, world_size=2), batch_size=2) for r in (0, 1)]
    begun = [position for loader in first for position in next(iter(loader))[1]]
    state = first[0].state_dict()
    rest = []
    for rank in range(3):
        loader = Loader(stream(rank=rank, world_size=3), batch_size=2)
        loader.load_state_dict(state)
        rest += seen(loader)
    assert sorted(begun + rest) == list(range(23))


@pytest.mark.usefixtures("bare")
def test_the_end_of_an_epoch_resumes_to_nothing_and_the_next_epoch_is_whole():
    first = Loader(dataset(), batch_size=4, drop_last=True)
    assert len(seen(first)) == 20
    assert len(first) == 5
    second = Loader(dataset(), batch_size=4)
    second.load_state_dict(first.state_dict())
    assert seen(second) == []
    second.set_epoch(1)
    assert len(seen(second)) == 23


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("make", [dataset, stream])
def test_persistent_workers_see_the_epoch_and_the_position(make):
    loader = Loader(make(), batch_size=4, **PERSISTENT)
    for epoch in (0, 1, 5):
        loader.set_epoch(epoch)
        batches = list(loader)
        assert {value for batch in batches for value in batch[0]} == {epoch}
        assert [p for batch in batches for p in batch[1]] == list(range(23))
    loader.load_state_dict({**loader.state_dict(), "epoch": 7, "position": 9})
    batches = list(loader)
    assert {value for batch in batches for value in batch[0]} == {7}
    assert [p for batch in batches for p in batch[1]] == list(range(9, 23))
    for _ in loader:
        break  # leaves prefetched batches in the workers
    loader.set_epoch(8)
    assert [value for batch in loader for value in batch[0]] == [8] * 23


@pytest.mark.usefixtures("bare")
def test_an_endless_stream_continues_and_resumes():
    loader = Loader(stream(endless=True), batch_size=5, num_workers=2)
    batches = iter(loader)
    assert [p for _ in range(9) for p in next(batches)[1]] == list(range(45))
    assert loader.state_dict()["position"] == 45
    with pytest.raises(TypeError, match="no end"):
        len(loader)
    again = Loader(stream(endless=True), batch_size=5)
    again.load_state_dict(loader.state_dict())
    assert next(iter(again))[1] == [45, 46, 47, 48, 49]


@pytest.mark.usefixtures("bare")
def test_shuffled_orders_change_with_the_epoch_and_are_the_same_on_all_ranks():
    def order(epoch, *part):
        data = dataset()  # each rank is a process with a dataset of its own
        data.set_epoch(epoch)
        return list(ShardSampler(data, *part, shuffle=True))

    orders = [order(epoch) for epoch in (0, 1)]
    for epoch, whole in enumerate(orders):
        assert [order(epoch, rank, 2) for rank in (0, 1)] == [whole[0::2], whole[1::2]]
    assert orders[0] != orders[1]
    assert sorted(orders[0]) == sorted(orders[1]) == list(range(23))


def _distributed_rank(rank, store, results):
    torch.distributed.init_process_group(
        "gloo", init_method=f"file://{store}", rank=rank, world_size=2
    )
    results.put((list(ShardSampler(dataset())), stream().part))
    torch.distributed.destroy_process_group()


def test_torch_distributed_gives_rank_and_world_size(tmp_path):
    fork = multiprocessing.get_context("fork")
    results = fork.Queue()
    arguments = (tmp_path / "store", results)
    ranks = [fork.Process(target=_distributed_rank, args=(rank, *arguments)) for rank in (0, 1)]
    for process in ranks:
        process.start()
    found = sorted(results.get(timeout=60) for _ in ranks)
    for process in ranks:
        process.join()
    assert found == [(list(range(0, 23, 2)), (0, 2)), (list(range(1, 23, 2)), (1, 2))]


def test_each_epoch_has_new_scenes_unless_fixed():
    cameras = list(Config.preset().cameras)
    places = [[dataset().locate(p, epoch) for p in range(23)] for epoch in range(3)]
    assert len({place for epoch in places for place in epoch}) == 3 * 23
    assert places[0] == [(p // 4, cameras[p % 4]) for p in range(23)]
    assert places[2][0] == (2 * EPOCH_SCENES, "A")
    still = dataset(fixed=True)
    assert [still.locate(p, 5) for p in range(23)] == places[0]


def test_splits_equal_those_of_generate():
    config = Config.preset()
    by_split = {
        split: [dataset(split=split, cameras=["B"]).locate(p, 0)[0] for p in range(20)]
        for split in ("train", "val", "test")
    }
    for split, scenes in by_split.items():
        last = scenes[-1]
        assert scenes == [i for i in range(last + 1) if split_of(config, 4, i) == split]
        later, camera = dataset(split=split, cameras=["B"]).locate(3, 2)
        assert camera == "B"
        assert split_of(config, 4, later) == split
        assert later >= 2 * EPOCH_SCENES


def test_one_view_per_scene_takes_the_cameras_in_turn():
    one = dataset(all_views=False, cameras=["A", "Cr"])
    assert [one.locate(p) for p in range(4)] == [(0, "A"), (1, "Cr"), (2, "A"), (3, "Cr")]


def test_a_curriculum_sets_the_chance_of_damage_by_epoch():
    data = ContainerDataset(
        "damage",
        length=4,
        render=SMALL,
        scenes=SceneSettings(
            all_views=False,
            curriculum=lambda epoch: {"damage": {"probability": float(epoch > 0)}},
        ),
    )
    assert not any(data.sample(p).scene.damages for p in range(4))
    data.set_epoch(1)
    assert all(data.sample(p).scene.damages for p in range(4))
    data.close()


def test_a_curriculum_sets_the_label_thresholds_by_epoch():
    data = ContainerDataset(
        "imdg",
        length=4,
        render=SMALL,
        scenes=SceneSettings(
            fixed=True,
            curriculum=lambda epoch: {"labels": {"min_visible_px": 10**6 if epoch else 1}},
        ),
    )
    counts = [[len(data.item(p, epoch)[1]["labels"]) for p in range(4)] for epoch in (0, 1)]
    assert min(counts[0]) > 0
    assert counts[1] == [0, 0, 0, 0]
    data.close()


@pytest.fixture(scope="module")
def renders():
    """Images [3, H, W] of the first six positions, rendered by a Generator in this process."""
    with Generator.of(None, 4, SMALL) as generator:
        cameras = list(generator.config.cameras)
        images = [generator.render(index=p // 4, camera=cameras[p % 4]).image for p in range(6)]
    return [image.transpose(2, 0, 1) for image in images]


@pytest.mark.parametrize(("context", "workers"), [(None, 0), ("fork", 2), ("spawn", 1)])
def test_images_equal_plain_renders_after_gl_was_opened_here(renders, context, workers):
    data = dataset(length=6)
    np.testing.assert_array_equal(data[0][0].numpy(), renders[0])  # opens GL in this process
    loader = Loader(data, batch_size=2, num_workers=workers, multiprocessing_context=context)
    images = [image for batch in loader for image in batch[0]]
    assert len(images) == 6
    for image, render in zip(images, renders, strict=True):
        assert image.dtype == torch.uint8
        np.testing.assert_array_equal(image.numpy(), render)
    np.testing.assert_array_equal(data[5][0].numpy(), renders[5])
    data.close()


def test_threads_have_contexts_of_their_own(renders):
    data = dataset(length=6)

    def in_thread(positions):
        images = [data[p][0].numpy() for p in positions]
        data.close()
        return images

    with ThreadPoolExecutor(2) as pool:
        halves = list(pool.map(in_thread, [(0, 1, 2), (3, 4, 5)]))
    for image, render in zip(itertools.chain(*halves), renders, strict=True):
        np.testing.assert_array_equal(image, render)


def test_a_stream_in_forked_workers_gives_the_same_bytes(renders):
    loader = Loader(stream(length=6), batch_size=2, num_workers=2, multiprocessing_context="fork")
    images = [image for batch in loader for image in batch[0]]
    for image, render in zip(images, renders, strict=True):
        np.testing.assert_array_equal(image.numpy(), render)


@pytest.mark.filterwarnings("ignore:'pin_memory'")
def test_pinned_batches_keep_their_form(renders):
    images, targets = next(iter(Loader(dataset(length=4), batch_size=4, pin_memory=True)))
    np.testing.assert_array_equal(images[3].numpy(), renders[3])
    assert targets[3]["image_id"] == 3


def test_a_pickled_dataset_renders_the_same(renders):
    data = pickle.loads(pickle.dumps(dataset(length=6)))
    np.testing.assert_array_equal(data[1][0].numpy(), renders[1])
    data.close()

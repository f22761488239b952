"""Epochs of loaders in training loops as libraries and users write them."""

import inspect
import itertools
import warnings

import pytest
import torch
from torch.utils.data import DataLoader

from fastgen.torch import ContainerDataset, ContainerStream, Loader, ShardSampler, collate_lists
from tests.test_torch import PERSISTENT, bare, dataset, stream  # noqa: F401, `bare` is a fixture

pytestmark = pytest.mark.usefixtures("bare")


def passes(loader, count):
    """Return epoch and position of each item of some passes, with no other call between them."""
    return [[item for batch in loader for item in zip(*batch, strict=True)] for _ in range(count)]


def in_epoch(epoch):
    """Return epoch and position of each item of an epoch."""
    return [(epoch, position) for position in range(23)]


def call_set_epoch_as_lightning_does(loader, epoch):
    """Call what lightning.fabric.utilities.data._set_sampler_epoch of Lightning 2.6 calls."""
    samplers = [loader.sampler, getattr(loader.batch_sampler, "sampler", None)]
    for sampler in {id(each): each for each in samplers}.values():
        if callable(getattr(sampler, "set_epoch", None)):
            sampler.set_epoch(epoch)


@pytest.mark.parametrize("make", [dataset, stream])
@pytest.mark.parametrize("options", [{}, {"num_workers": 2}, PERSISTENT], ids=str)
def test_each_pass_of_a_plain_loop_has_the_next_epoch(make, options):
    assert passes(Loader(make(), batch_size=4, **options), 3) == [in_epoch(e) for e in range(3)]


def test_a_plain_loop_shuffles_each_pass_in_its_own_way():
    orders = passes(Loader(dataset(), batch_size=4, shuffle=True), 3)
    assert [sorted(order) for order in orders] == [in_epoch(e) for e in range(3)]
    assert len({tuple(position for _, position in order) for order in orders}) == 3


@pytest.mark.parametrize("make", [dataset, stream])
@pytest.mark.parametrize("workers", [0, 2])
def test_a_new_loader_in_each_epoch_goes_on_to_the_next(make, workers):
    """A loop over `Loader(data)` inside a loop over epochs must not train on one epoch only."""
    data = make()
    found = [passes(Loader(data, batch_size=4, num_workers=workers), 1)[0] for _ in range(3)]
    assert found == [in_epoch(epoch) for epoch in range(3)]


@pytest.mark.parametrize("make", [dataset, stream])
@pytest.mark.parametrize("workers", [0, 2])
def test_a_loaded_position_is_not_used_in_another_epoch(make, workers):
    """Another loader has taken the pass of the loaded epoch in the meantime."""
    data = make()
    loader = Loader(data, batch_size=4, num_workers=workers)
    next(iter(loader))
    loader.load_state_dict({**loader.state_dict(), "epoch": 5, "position": 8})
    assert set(next(iter(Loader(data, batch_size=4)))[0]) == {5}
    assert passes(loader, 1) == [in_epoch(6)]


@pytest.mark.parametrize("make", [dataset, stream])
def test_a_pass_that_was_left_early_counts_and_one_without_a_batch_does_not(make):
    loader = Loader(make(), batch_size=4)
    iter(loader)
    starts = [next(iter(loader)) for _ in range(3)]
    assert [(set(epochs), positions[0]) for epochs, positions in starts] == [
        ({0}, 0),
        ({1}, 0),
        ({2}, 0),
    ]


@pytest.mark.parametrize("make", [dataset, stream])
@pytest.mark.parametrize("workers", [0, 2])
def test_lightning_chooses_the_epoch_of_each_pass(make, workers):
    loader = Loader(make(), batch_size=4, num_workers=workers)
    for epoch in (0, 1, 1, 5):
        call_set_epoch_as_lightning_does(loader, epoch)
        call_set_epoch_as_lightning_does(loader, epoch)  # when it sets up the data, and again
        assert passes(loader, 1) == [in_epoch(epoch)]


@pytest.mark.parametrize("make", [dataset, stream])
def test_lightning_resumes_in_the_middle_of_an_epoch_and_goes_on_to_the_next(make):
    first = Loader(make(), batch_size=4)
    call_set_epoch_as_lightning_does(first, 3)
    taken = list(itertools.islice(first, 2))
    second = Loader(make(), batch_size=4)
    second.load_state_dict(first.state_dict())
    call_set_epoch_as_lightning_does(second, 3)
    rest = passes(second, 1)[0]
    assert [item for batch in taken for item in zip(*batch, strict=True)] + rest == in_epoch(3)
    call_set_epoch_as_lightning_does(second, 4)
    assert passes(second, 1) == [in_epoch(4)]


@pytest.mark.parametrize("make", [dataset, stream])
def test_a_state_of_another_epoch_than_the_chosen_one_has_no_effect_on_the_pass(make):
    loader = Loader(make(), batch_size=4)
    loader.load_state_dict({**loader.state_dict(), "epoch": 2, "position": 9})
    call_set_epoch_as_lightning_does(loader, 3)
    assert loader.state_dict()["position"] == 0
    assert passes(loader, 2) == [in_epoch(3), in_epoch(4)]


@pytest.mark.parametrize("make", [dataset, stream])
def test_every_state_of_a_plain_loop_resumes_exactly(make):
    def loader():
        shuffled = {"shuffle": True} if make is dataset else {}
        return Loader(make(), batch_size=5, **shuffled)

    whole = list(itertools.chain(*passes(loader(), 3)))
    running, taken = loader(), 0
    batches = itertools.chain.from_iterable(running for _ in range(3))
    for _ in range(15):
        resumed = loader()
        resumed.load_state_dict(running.state_dict())
        rest = [item for each in passes(resumed, 4) for item in each]
        left = whole[taken:]
        assert rest[: len(left)] == left
        taken += len(next(batches, ((), ()))[0])
    assert taken == len(whole)


def test_accelerate_finds_no_dataloader_whose_samplers_it_would_replace():
    assert not isinstance(Loader(dataset()), DataLoader)


def test_a_loader_has_the_attributes_of_a_dataloader():
    for made in (Loader(dataset(), batch_size=4), Loader(stream(), batch_size=4)):
        reference = DataLoader(made.dataset, batch_size=4)
        for name in inspect.signature(DataLoader).parameters.keys() - {"shuffle", "in_order"}:
            assert hasattr(made, name) == hasattr(reference, name), name
        assert len(made) == 6
        assert made.num_workers == 0
        with pytest.raises(AttributeError, match="color"):
            made.color  # noqa: B018


@pytest.mark.parametrize("workers", [0, 2])
def test_a_plain_dataloader_with_our_sampler_goes_to_the_next_epoch_too(workers):
    data = dataset()
    loader = DataLoader(
        data, 4, sampler=ShardSampler(data), num_workers=workers, collate_fn=data.collate
    )
    assert passes(loader, 2) == [in_epoch(0), in_epoch(1)]
    call_set_epoch_as_lightning_does(loader, 7)
    assert passes(loader, 2) == [in_epoch(7), in_epoch(8)]


@pytest.mark.parametrize("kind", [ContainerDataset, ContainerStream])
@pytest.mark.parametrize("workers", [0, 2])
def test_ranks_that_start_after_the_loader_was_made_divide_the_positions(
    kind, workers, monkeypatch
):
    made = [dataset() if kind is ContainerDataset else stream() for _ in range(2)]
    loaders = [Loader(each, batch_size=4, num_workers=workers) for each in made]
    monkeypatch.setattr(torch.distributed, "is_initialized", lambda: True)
    monkeypatch.setattr(torch.distributed, "get_world_size", lambda: 2)
    found = []
    for rank, loader in enumerate(loaders):
        monkeypatch.setattr(torch.distributed, "get_rank", lambda rank=rank: rank)
        found.append(passes(loader, 1)[0])
        assert len(loader) == -(-len(found[-1]) // 4)
    assert found == [in_epoch(0)[0::2], in_epoch(0)[1::2]]


@pytest.mark.parametrize("make", [dataset, stream])
def test_a_second_pass_with_the_same_scenes_is_reported_once(make):
    loader = DataLoader(make(), 4, collate_fn=collate_lists)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert passes(loader, 1) == [in_epoch(0)]
    with pytest.warns(
        UserWarning, match="a second pass .* epoch 0 again; use fastgen.torch.Loader"
    ):
        passes(loader, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        passes(loader, 2)


@pytest.mark.parametrize("workers", [0, 2])
def test_passes_with_new_scenes_or_fixed_ones_are_not_reported(workers, capfd):
    data, fixed = dataset(), dataset(fixed=True)
    assert len({data[0], data[1], data[2]}) == 3  # reading single items is not a pass
    plain = DataLoader(data, 4, num_workers=workers, collate_fn=collate_lists)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for epoch in (0, 1, 1):
            data.set_epoch(epoch)
            passes(plain, 1)
        passes(DataLoader(fixed, 4, num_workers=workers, collate_fn=collate_lists), 3)
        for made in (dataset(), stream(), dataset(fixed=True)):
            passes(Loader(made, batch_size=4, num_workers=workers), 3)
    assert capfd.readouterr().err == ""

"""Loader: a DataLoader that divides positions among ranks and resumes at the next sample."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from torch.utils.data import DataLoader, Sampler

from fastgen.errors import ConfigError, shown
from fastgen.sampling.scene import stream
from fastgen.torch.datasets import MOST_DIGESTS, ContainerDataset, ContainerStream
from fastgen.torch.plan import MAX_EPOCH, shard
from fastgen.validation import whole


class ShardSampler(Sampler[int]):
    """Sampler of one rank. Each position occurs once over all ranks; none is repeated as padding.

    Args:
        dataset: Its length, epoch and seed decide the positions.
        rank: Rank of this process; by default that of torch.distributed if it runs, otherwise 0.
        world_size: Number of ranks; give both or neither.
        shuffle: Use a new order in each epoch, the same on all ranks.

    Attributes:
        start: Place in this order where passes begin, counted over all ranks.
    """

    def __init__(
        self,
        dataset: ContainerDataset,
        rank: int | None = None,
        world_size: int | None = None,
        shuffle: bool = False,
    ) -> None:
        self.part = shard(rank, world_size)
        self.start = 0
        self._dataset, self._shuffle = dataset, shuffle

    def __len__(self) -> int:
        """Return the number of positions of this rank in a whole epoch."""
        rank, world_size = self.part
        return len(range(rank, len(self._dataset), world_size))

    def __iter__(self) -> Iterator[int]:
        data = self._dataset
        places = range(len(data))
        if self._shuffle:
            order = stream(data.seed, data.epoch, "order").permutation(len(data)).tolist()
            places = order
        rank, world_size = self.part
        return iter(places[self.start + rank :: world_size])


class Loader:
    """Batches of a ContainerDataset or ContainerStream, with a position that can be saved.

    `state_dict` counts the samples handed out, not those that workers have prepared. After
    `load_state_dict`, a Loader with the same dataset continues with the next sample. Batch size,
    number of workers and number of ranks may differ. All ranks may load the state of rank 0.

    Args:
        dataset: The dataset or stream.
        batch_size: Items per batch on this rank.
        shuffle: Use a new order in each epoch; not for a stream.
        drop_last: Leave out an incomplete last batch.
        rank: Rank of this process, as for ShardSampler; a stream has its own.
        world_size: Number of ranks; give both or neither.
        options: Further options of DataLoader: collate_fn (by default the one for the task),
            num_workers, persistent_workers, pin_memory, prefetch_factor, multiprocessing_context,
            timeout, worker_init_fn, generator.

    Raises:
        ConfigError: A value is not valid.
    """

    def __init__(
        self,
        dataset: ContainerDataset | ContainerStream,
        batch_size: int = 8,
        *,
        shuffle: bool = False,
        drop_last: bool = False,
        rank: int | None = None,
        world_size: int | None = None,
        **options: Any,
    ) -> None:
        self.dataset = dataset
        self.batch_size, self.drop_last = whole("batch_size", batch_size, 1), drop_last
        self._shuffle = shuffle
        self._sampler: ShardSampler | None = None
        if isinstance(dataset, ContainerStream):
            if shuffle or rank is not None or world_size is not None:
                raise ConfigError("shuffle, rank, world_size: a stream has its own; leave them out")
            dataset.batch_size = self.batch_size
            self._items, self._part = dataset.dataset, dataset.part
            self._length = dataset.length
        elif not isinstance(dataset, ContainerDataset):
            raise ConfigError(
                f"dataset: {type(dataset).__name__} is neither a ContainerDataset nor a "
                "ContainerStream; torch's own DataLoader takes others"
            )
        else:
            self._sampler = ShardSampler(dataset, rank, world_size, shuffle)
            self._items, self._part = dataset, self._sampler.part
            self._length = dataset.length
        self._start = 0
        self._position = 0
        self._loader: DataLoader[Any] = DataLoader(
            dataset,
            batch_size=self.batch_size,
            sampler=self._sampler,
            drop_last=drop_last,
            **{**options, "collate_fn": options.get("collate_fn") or self._items.collate},
        )

    @property
    def epoch(self) -> int:
        """The current epoch."""
        return self._items.epoch

    def set_epoch(self, epoch: int) -> None:
        """Go to an epoch before a pass. The epoch of a loaded state keeps the position in it."""
        if epoch != self.epoch:
            self._start = self._position = 0
            self._items.set_epoch(epoch)

    def state_dict(self) -> dict[str, Any]:
        """Return epoch, position after the last sample and description of the samples as JSON."""
        return {
            "epoch": self.epoch,
            "position": self._position,
            "made": {**self._items.description, "length": self._length, "shuffle": self._shuffle},
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Let the next pass continue where `state` was taken.

        Raises:
            ConfigError: The state belongs to a loader with other samples; the message names what
                differs.
        """
        if not isinstance(state, Mapping):
            raise ConfigError(f"state: {shown(state)} is not what state_dict returned")
        for key in ("epoch", "position", "made"):
            if key not in state:
                raise ConfigError(f"state: has no {key!r}; give what state_dict returned")
        epoch = whole("state.epoch", state["epoch"], 0, MAX_EPOCH)
        most = 2**62 if self._length is None else self._length
        made, ours = _plain(state["made"]), self.state_dict()["made"]
        ours["curriculum"] = self._items.curriculum_digests(_epochs(made.get("curriculum")))
        for key, value in ours.items():
            if made.get(key) != value:
                raise ConfigError(
                    f"state: was taken with another {key}; make the loader in the same way"
                )
        position = whole("state.position", state["position"], 0, most)
        self._items.set_epoch(epoch)
        self._start = self._position = position

    def __len__(self) -> int:
        """Return the batches of this rank in a whole epoch. Raises TypeError if there is no end."""
        if self._length is None:
            raise TypeError("this loader has no end; make its stream with endless=False")
        return self._batches_in(0)

    def __iter__(self) -> Iterator[Any]:
        start, self._start = self._start, 0
        self._position = start
        if isinstance(self.dataset, ContainerStream):
            self.dataset.start_at(start)
        elif self._sampler is not None:
            self._sampler.start = start
        return self._run(start)

    def _run(self, start: int) -> Iterator[Any]:
        for number, batch in enumerate(self._loader, start=1):
            self._position = start + number * self.batch_size * self._part[1]
            if self._length is not None and number >= self._batches_in(start):
                self._position = self._length
            yield batch

    def _batches_in(self, start: int) -> int:
        """Return the number of batches of this rank from a position to the end of the epoch."""
        assert self._length is not None
        items = len(range(start + self._part[0], self._length, self._part[1]))
        return items // self.batch_size if self.drop_last else -(-items // self.batch_size)


def _plain(made: Any) -> dict[str, Any]:
    """Return the description in a state as JSON values.

    Raises:
        ConfigError: The description is not a mapping, or has values without a form in JSON, such as
            tensors.
    """
    try:
        plain = json.loads(json.dumps(made))
    except (TypeError, ValueError, RecursionError) as error:
        raise ConfigError(
            f"state.made: is not what state_dict returned ({error}); give its values unchanged"
        ) from None
    if not isinstance(plain, dict):
        raise ConfigError(f"state.made: {shown(made)} is not what state_dict returned")
    return plain


def _epochs(curriculum: Any) -> list[int]:
    """Return the epochs of the curriculum's digests in a state; none if it has no such digests."""
    known = isinstance(curriculum, dict) and len(curriculum) <= MOST_DIGESTS
    if not known or not all(re.fullmatch("[0-9]{1,20}", epoch) for epoch in curriculum):
        return []
    return [int(epoch) for epoch in curriculum]

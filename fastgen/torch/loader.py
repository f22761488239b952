"""Loader: a DataLoader that divides positions among ranks and resumes at the next sample."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from torch.utils.data import DataLoader, Sampler

from fastgen.errors import ConfigError, shown
from fastgen.sampling.streams import stream
from fastgen.torch.datasets import MOST_DIGESTS, ContainerDataset, ContainerStream
from fastgen.torch.plan import MAX_EPOCH, shard
from fastgen.validation import flag, whole


class ShardSampler(Sampler[int]):
    """Sampler of one rank. Each position occurs once over all ranks; none is repeated as padding.

    Each pass goes to the dataset's next epoch, unless `set_epoch` was called since the last pass.

    Args:
        dataset: Its length, epoch and seed decide the positions.
        rank: Rank of this process; by default that of torch.distributed if it runs when a pass
            begins, otherwise 0.
        world_size: Number of ranks; give both or neither.
        shuffle: Use a new order in each epoch, the same on all ranks.

    Each rank needs a dataset of its own, because all passes over a dataset count.

    Attributes:
        resume_at: Epoch, and the position in its order at which its pass begins, counted over all
            ranks. Passes of other epochs begin at 0.
        start: Where the last pass began.
    """

    def __init__(
        self,
        dataset: ContainerDataset,
        rank: int | None = None,
        world_size: int | None = None,
        shuffle: bool = False,
    ) -> None:
        shard(rank, world_size)  # refuses bad values here, not in a pass
        self.resume_at, self.start = (0, 0), 0
        self._dataset, self._shuffle = dataset, flag("shuffle", shuffle)
        self._rank, self._world_size = rank, world_size

    @property
    def part(self) -> tuple[int, int]:
        """Rank and world size; torch.distributed may have started after the sampler was made."""
        return shard(self._rank, self._world_size)

    def set_epoch(self, epoch: int) -> None:
        """Set the dataset's epoch; trainers call this before each pass."""
        self._dataset.set_epoch(epoch)

    def __len__(self) -> int:
        """Return the number of positions of this rank in a whole epoch."""
        rank, world_size = self.part
        return len(range(rank, len(self._dataset), world_size))

    def __iter__(self) -> Iterator[int]:
        data = self._dataset
        self.start = data.begin_pass(self.resume_at)
        places = range(len(data))
        if self._shuffle:
            order = stream(data.seed, data.epoch, "order").permutation(len(data)).tolist()
            places = order
        rank, world_size = self.part
        yield from places[self.start + rank :: world_size]


class Loader:
    """Batches of a ContainerDataset or ContainerStream, with a position that can be saved.

    Each pass goes to the dataset's next epoch, unless `set_epoch` was called since the last pass.
    All Loaders and ShardSamplers of a dataset count together. A pass counts as soon as it has
    delivered a batch.

    `state_dict` counts the samples handed out, not those that workers have prepared. After
    `load_state_dict`, a Loader with the same dataset continues with the next sample. Batch size,
    number of workers and number of ranks may differ. All ranks may load the state of rank 0.

    A Loader has the attributes of a DataLoader but is none. Libraries that replace the samplers of
    DataLoaders would divide the positions among the ranks a second time.

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

    Attributes:
        sampler: Has `set_epoch`, which trainers call before each pass. It is a ShardSampler, or the
            stream itself.

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
        for name in ("sampler", "batch_sampler"):
            if name in options:
                raise ConfigError(
                    f"{name}: a Loader divides the positions itself; leave it out, or give it to "
                    "torch's own DataLoader"
                )
        if options.get("in_order", True) is not True:
            raise ConfigError(
                "in_order: a Loader resumes exactly only with batches in order; leave it out, or "
                "give it to torch's own DataLoader"
            )
        self.dataset = dataset
        self.batch_size = whole("batch_size", batch_size, 1)
        self.drop_last = flag("drop_last", drop_last)
        self._shuffle = flag("shuffle", shuffle)
        self.sampler: ShardSampler | ContainerStream
        if isinstance(dataset, ContainerStream):
            if self._shuffle or rank is not None or world_size is not None:
                raise ConfigError("shuffle, rank, world_size: a stream has its own; leave them out")
            dataset.batch_size = self.batch_size
            self._items, self.sampler = dataset.dataset, dataset
        elif not isinstance(dataset, ContainerDataset):
            raise ConfigError(
                f"dataset: {type(dataset).__name__} is neither a ContainerDataset nor a "
                "ContainerStream; torch's own DataLoader takes others"
            )
        else:
            self._items, self.sampler = dataset, ShardSampler(dataset, rank, world_size, shuffle)
        self._length = dataset.length
        self._next_pass = (0, 0)  # epoch and first position; passes in other epochs begin at 0
        self._reached = (0, 0)  # epoch and position after the last sample
        self._loader: DataLoader[Any] = DataLoader(
            dataset,
            batch_size=self.batch_size,
            sampler=None if isinstance(dataset, ContainerStream) else self.sampler,
            drop_last=self.drop_last,
            **{**options, "collate_fn": options.get("collate_fn") or self._items.collate},
        )

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the DataLoader, such as `batch_sampler` or `num_workers`."""
        if name.startswith("_"):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(self._loader, name)

    @property
    def epoch(self) -> int:
        """The current epoch."""
        return self._items.epoch

    def set_epoch(self, epoch: int) -> None:
        """Choose the epoch of the next pass. The epoch of a loaded state keeps the position."""
        self._items.set_epoch(epoch)

    def state_dict(self) -> dict[str, Any]:
        """Return epoch, position after the last sample and description of the samples as JSON."""
        epoch, position = self._reached
        return {
            "epoch": self.epoch,
            "position": position if epoch == self.epoch else 0,
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
        self._next_pass = self._reached = (epoch, position)

    def __len__(self) -> int:
        """Return the batches of this rank in a whole epoch. Raises TypeError if there is no end."""
        if self._length is None:
            raise TypeError("this loader has no end; make its stream with endless=False")
        return self._batches_in(0)

    def __iter__(self) -> Iterator[Any]:
        resume_at, self._next_pass = self._next_pass, (0, 0)
        if isinstance(self.sampler, ContainerStream):
            self.sampler.start_at(self._items.begin_pass(resume_at))
        else:
            self.sampler.resume_at = resume_at
        _, world_size = self.sampler.part
        for number, batch in enumerate(self._loader, start=1):
            start = self.sampler.start  # a ShardSampler begins its pass with the first batch
            position = start + number * self.batch_size * world_size
            if self._length is not None and number >= self._batches_in(start):
                position = self._length
            self._reached = (self.epoch, position)
            yield batch

    def _batches_in(self, start: int) -> int:
        """Return the number of batches of this rank from a position to the end of the epoch."""
        assert self._length is not None
        rank, world_size = self.sampler.part
        items = len(range(start + rank, self._length, world_size))
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

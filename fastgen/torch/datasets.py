"""ContainerDataset and ContainerStream: items of an epoch, rendered when they are needed."""

import contextlib
import hashlib
import json
import operator
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import torch
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.render.settings import RenderSettings
from fastgen.sample import Sample
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Scene
from fastgen.torch.plan import (
    EPOCH_SCENES,
    MAX_EPOCH,
    Plan,
    SceneSettings,
    chosen_cameras,
    config_of,
    positions,
    shard,
)
from fastgen.torch.rendering import LocalGenerator
from fastgen.torch.targets import Collate, Item, ItemSettings, check_items, collate_of, item_of
from fastgen.validation import flag, whole

MAX_LENGTH = EPOCH_SCENES // 100
"""Most images in an epoch. A split with 1 % of the scenes still fits before the next epoch."""

MOST_DIGESTS = 3
"""Most epochs whose curriculum has a digest in `ContainerDataset.description`."""


class ContainerDataset(Dataset[Item]):
    """Map-style dataset whose items are rendered on access, with the same bytes in every process.

    Example:
        train = ContainerDataset("imdg", seed=1, length=20_000,
                                 scenes=SceneSettings(split="train"),
                                 items=ItemSettings(form="yolo"))

    With spawned workers, `scenes.curriculum` and `items.transforms` must be functions of a module.

    Args:
        task: damage, imdg, text, door or seal; `targets.item_of` describes image and target.
        config: Distribution of the scenes; by default that of the preset seafront.
        seed: Whole number of 0 or more.
        length: Items per epoch, over all ranks. An item is an image, or with `items.pairs` a pair.
        render: How images are rendered: size, quality, backend, device and HDRIs.
        scenes: Which scenes an epoch has, and which cameras see them.
        items: What an item holds.

    Raises:
        ConfigError: A value is not valid.
    """

    def __init__(
        self,
        task: str,
        config: Config | None = None,
        seed: int = 0,
        length: int = 1000,
        render: RenderSettings = RenderSettings(),  # noqa: B008
        scenes: SceneSettings = SceneSettings(),  # noqa: B008
        items: ItemSettings = ItemSettings(),  # noqa: B008
    ) -> None:
        self.task = task
        self.config = Config.checked(config)
        self.seed = whole("seed", seed)
        self.length = whole("length", length, 1, MAX_LENGTH)
        for name, given, kind in (
            ("render", render, RenderSettings),
            ("scenes", scenes, SceneSettings),
            ("items", items, ItemSettings),
        ):
            if not isinstance(given, kind):
                words = f"{type(given).__name__} is not {kind.__name__}; give {kind.__name__}(...)"
                raise ConfigError(f"{name}: {words}")
        self.render, self.scenes, self.items = render, scenes, items
        self.cameras = chosen_cameras(task, self.config, scenes.cameras)
        check_items(task, items)
        self._generator = LocalGenerator(self.config, self.seed, render)
        self._plan = Plan(self.config, self.seed, self.cameras, scenes)
        # shared memory, so that persistent workers see it change, forked or spawned
        self._epoch = torch.zeros(1, dtype=torch.int64).share_memory_()
        self._epoch_chosen = True  # for the next pass
        self._taken = torch.zeros(2, dtype=torch.int64).share_memory_()  # items, and if it warned
        self._epoch_config = (0, config_of(scenes.curriculum, self.config, 0))
        # epoch and index of the last scene, and the scene with and without damages
        self._scenes: tuple[tuple[int, int], tuple[Scene, Scene]] | None = None
        self._digests: dict[int, str] = {}
        self._environments: dict[str, Any] | None = None

    @property
    def description(self) -> dict[str, Any]:
        """Everything that decides the samples, as JSON values.

        HDRIs appear with their SHA-256 and weight, the curriculum with the SHA-256 of its
        configurations for epochs 0, 1 and the current one.
        """
        if self._environments is None:  # reads every HDRI
            self._environments = self._generator.get().environment_record
        return {
            "task": self.task,
            "seed": self.seed,
            "size": list(self.render.size),
            "length": self.length,
            "cameras": list(self.cameras),
            "split": self.scenes.split,
            "fixed": self.scenes.fixed,
            "all_views": self.scenes.all_views,
            "quality": self.render.quality,
            "config": self.config.to_plain(),
            "hdri_dir": self._environments,
            "curriculum": self.curriculum_digests(sorted({0, 1, self.epoch})),
        }

    def curriculum_digests(self, epochs: Sequence[int]) -> dict[str, str]:
        """Return the SHA-256 of each epoch's configuration, by the epoch as text.

        The result has no epochs for which the curriculum fails.
        """
        for epoch in epochs:
            with contextlib.suppress(Exception):  # one that indexes a list may end after epoch 0
                if epoch not in self._digests:
                    config = config_of(self.scenes.curriculum, self.config, epoch)
                    # checked, so that 12 and 12.0 have the same digest
                    plain = json.dumps(Config.checked(config).to_plain(), sort_keys=True)
                    self._digests[epoch] = hashlib.sha256(plain.encode()).hexdigest()
        return {str(epoch): self._digests[epoch] for epoch in epochs if epoch in self._digests}

    @property
    def epoch(self) -> int:
        """The current epoch; workers share it."""
        return int(self._epoch)

    def set_epoch(self, epoch: int) -> None:
        """Go to an epoch, 0 to plan.MAX_EPOCH. Call it between two passes over the data."""
        epoch = whole("epoch", epoch, 0, MAX_EPOCH)
        config_of(self.scenes.curriculum, self.config, epoch)  # fails here, not in a worker
        self._epoch.fill_(epoch)
        self._taken[0] = 0
        self._epoch_chosen = True

    def begin_pass(self, resume_at: tuple[int, int] = (0, 0)) -> int:
        """Go to the next epoch, unless one was set since the last pass over the data.

        ShardSampler calls this when a pass begins, and Loader does so for a stream.

        Args:
            resume_at: Epoch, and the position at which its pass begins.

        Returns:
            Position at which the pass begins: 0 in another epoch than that of `resume_at`.
        """
        if not self._epoch_chosen:
            self.set_epoch(self.epoch + 1)
        self._epoch_chosen = False
        self._taken[0] = 0  # single items may have been taken since set_epoch
        epoch, position = resume_at
        return position if epoch == self.epoch else 0

    @property
    def collate(self) -> Collate:
        """The collate function for this dataset's items. Loader uses it by default."""
        return collate_of(self.task, self.items)

    def locate(self, position: int, epoch: int | None = None) -> tuple[int, str]:
        """Return scene index and camera name at a position of an epoch, by default the current."""
        return self._plan.locate(self._chosen(epoch), position)

    def sample(self, position: int, epoch: int | None = None) -> Sample:
        """Return the Sample from which the item at a position is made.

        With `items.pairs` it is the one with damages.
        """
        return self._sample(position, self._chosen(epoch))

    def _chosen(self, epoch: int | None) -> int:
        """Return an epoch after checking it; None stands for the current one."""
        return self.epoch if epoch is None else whole("epoch", epoch, 0, MAX_EPOCH)

    def _sample(self, position: int, epoch: int, undamaged: bool = False) -> Sample:
        index, camera = self._plan.locate(epoch, position)
        generator = self._generator.get()
        last = self._scenes
        if last is None or last[0] != (epoch, index):  # a scene's cameras mostly follow each other
            scene = sample_scene(self.config_at(epoch), self.seed, index, generator.environments)
            counterpart = scene.undamaged() if self.items.pairs else scene
            last = self._scenes = ((epoch, index), (scene, counterpart))
        labels = self.config_at(epoch).labels
        return generator.render(scene=last[1][undamaged], camera=camera, labels=labels)

    def item(self, position: int, epoch: int | None = None) -> Item:
        """Return image and target at a position, 0 or more, after transforms.

        item_of describes both. With `items.pairs` these are a tuple of two images and a tuple of
        their targets, the one with damages first.
        """
        epoch = self._chosen(epoch)
        made = self._made(position, epoch)
        if self.items.pairs:
            images, targets = zip(made, self._made(position, epoch, undamaged=True), strict=True)
            made = images, targets
        if self.items.transforms is None:
            return made
        changed = self.items.transforms(*made)
        image, target = _two(changed, "(image, target)")
        if self.items.pairs:
            image, target = _two(image, "two images"), _two(target, "two targets")
        return image, target

    def _made(self, position: int, epoch: int, undamaged: bool = False) -> Item:
        """Return a single image and its target, without transforms."""
        sample = self._sample(position, epoch, undamaged)
        names = list(self.config.cameras)
        image_id = sample.scene.index * len(names) + names.index(sample.camera.name)
        return item_of(sample, self.task, self.items, self.config_at(epoch).labels, image_id)

    def count_item(self) -> None:
        """Count an item that a pass takes, and warn once if a second pass has the same scenes."""
        self._taken[0] += 1
        # half an epoch more, because somebody may look at single items between passes
        again = 2 * self._taken[0] > 3 * self.length
        if again and not self._taken[1] and not self.scenes.fixed:
            self._taken[1] = 1
            warnings.warn(
                f"a second pass over the data has the scenes of epoch {self.epoch} again; use "
                "fastgen.torch.Loader or ShardSampler, or call set_epoch before each pass "
                "(SceneSettings(fixed=True) says that this is intended)",
                stacklevel=3,
            )

    def config_at(self, epoch: int) -> Config:
        """Return the configuration of an epoch."""
        epoch = whole("epoch", epoch, 0, MAX_EPOCH)
        last = self._epoch_config
        if last[0] != epoch:
            config = config_of(self.scenes.curriculum, self.config, epoch)
            last = self._epoch_config = (epoch, config)
        return last[1]

    def close(self) -> None:
        """Free what this process opened for rendering. The next item opens it again."""
        self._generator.close()

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, position: int) -> Item:
        try:
            position = operator.index(position)
        except TypeError:
            raise TypeError(f"position {position!r} is not a whole number") from None
        if not -self.length <= position < self.length:
            raise IndexError(f"position {position} is out of range; there are {self.length}")
        self.count_item()
        return self.item(position % self.length)


def _two(changed: Any, wanted: str) -> tuple[Any, Any]:
    """Return what a transform returned as a tuple of two."""
    if not isinstance(changed, tuple | list) or len(changed) != 2:
        raise ConfigError(f"transforms: gave {type(changed).__name__}; return {wanted}")
    first, second = changed
    return first, second


class ContainerStream(IterableDataset[Item]):
    """Iterable dataset: the items of a ContainerDataset in order, divided among ranks and workers.

    Each position occurs exactly once over all ranks and workers, so ranks may differ by one item.

    Args:
        dataset: The dataset.
        endless: Continue after the dataset's length without an end.
        rank: Rank of this process; by default that of torch.distributed if it runs when a Loader
            begins a pass, or for a plain DataLoader when the stream is made; otherwise 0.
        world_size: Number of ranks; give both or neither.
        batch_size: Batch size of the DataLoader, so that items come in order with any number of
            workers. Loader sets it.

    Raises:
        ConfigError: A value is not valid.
    """

    def __init__(
        self,
        dataset: ContainerDataset,
        *,
        endless: bool = False,
        rank: int | None = None,
        world_size: int | None = None,
        batch_size: int = 1,
    ) -> None:
        if not isinstance(dataset, ContainerDataset):
            raise ConfigError(
                f"dataset: {type(dataset).__name__} is not a ContainerDataset; give one"
            )
        self.dataset = dataset
        self.length = None if flag("endless", endless) else len(dataset)
        self.batch_size = whole("batch_size", batch_size, 1)
        self._rank, self._world_size = rank, world_size
        # first position, rank and world size: workers read them, but torch.distributed does not run
        # there
        self._place = torch.zeros(3, dtype=torch.int64).share_memory_()
        self.start_at(0)

    @property
    def part(self) -> tuple[int, int]:
        """Rank and world size."""
        if get_worker_info() is None:
            return shard(self._rank, self._world_size)
        return int(self._place[1]), int(self._place[2])

    @property
    def epoch(self) -> int:
        """The current epoch; workers share it."""
        return self.dataset.epoch

    def set_epoch(self, epoch: int) -> None:
        """Go to an epoch, 0 to plan.MAX_EPOCH. Call it between two passes over the data."""
        self.dataset.set_epoch(epoch)

    @property
    def start(self) -> int:
        """Position of the epoch where passes begin, counted over all ranks."""
        return int(self._place[0])

    def start_at(self, position: int) -> None:
        """Let passes begin at a position of the epoch, counted over all ranks."""
        self._place.copy_(torch.tensor([whole("position", position), *self.part]))

    def __len__(self) -> int:
        """Return the number of items of this rank in an epoch. Raises TypeError if endless."""
        if self.length is None:
            raise TypeError("this stream has no end; make it with endless=False")
        rank, world_size = self.part
        return len(range(rank, self.length, world_size))

    def __iter__(self) -> Iterator[Item]:
        worker = get_worker_info()
        share = (worker.id, worker.num_workers) if worker else (0, 1)
        epoch = self.epoch  # read once: a pass stays in one epoch
        places = positions(self.start, self.length, self.part, share, self.batch_size)
        for position in places:
            if self.length is not None:
                self.dataset.count_item()
            yield self.dataset.item(position, epoch)

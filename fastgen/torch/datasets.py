"""ContainerDataset and ContainerStream: positions of an epoch, rendered when they are asked for."""

import contextlib
import hashlib
import json
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.sample import Sample
from fastgen.sampling.scene import sample_scene
from fastgen.scene import Scene
from fastgen.torch.plan import (
    EPOCH_SCENES,
    MAX_EPOCH,
    Plan,
    chosen_cameras,
    config_of,
    positions,
    shard,
)
from fastgen.torch.rendering import LocalGenerator
from fastgen.torch.targets import Collate, Item, check_form, collate_of, item_of
from fastgen.validation import whole

Curriculum = Callable[[int], Config | Mapping[str, Any]]
Transforms = Callable[[Any, Any], Item]

MAX_LENGTH = EPOCH_SCENES // 100
"""Images of an epoch: a split of one in a hundred scenes still fits before the next epoch."""


class ContainerDataset(Dataset[Item]):
    """Map-style: item i of `length` is rendered when asked for, the same bytes in every process.

    task: damage, imdg, text or door; targets.item_of says what image and target hold. config,
    seed, size, backend, hdri_dir, quality, device_index: as for Generator. length: images of
    an epoch over all ranks. cameras: names, by default all of the rig that the task can use.
    split: 'train', 'val' or 'test' as `fastgen generate` deals scenes out, None for all scenes.
    fixed: whether every epoch has the same scenes, as a validation set should; else each has new
    ones. all_views: whether each scene is seen by all cameras in turn, or by one. form:
    'detection' or 'yolo'. as_float: images as float32 in 0..1 in place of uint8. transforms:
    called with (image, target), returns both. curriculum: called with the epoch, returns the
    epoch's Config, or values that replace those of `config`, as a file would hold them.

    With workers that are spawned, transforms and curriculum must be functions of a module.
    Raises ConfigError for a value that cannot be.
    """

    def __init__(
        self,
        task: str,
        config: Config | None = None,
        seed: int = 0,
        size: tuple[int, int] = (640, 640),
        length: int = 1000,
        cameras: Sequence[str] | None = None,
        *,
        split: str | None = None,
        fixed: bool = False,
        all_views: bool = True,
        form: str = "detection",
        as_float: bool = False,
        transforms: Transforms | None = None,
        curriculum: Curriculum | None = None,
        backend: str = "auto",
        hdri_dir: str | Path | None = None,
        quality: str = "balanced",
        device_index: int | None = None,
    ) -> None:
        length = whole("length", length, 1, MAX_LENGTH)
        seed = whole("seed", seed)
        self.config = Config.checked(config)
        if not (transforms is None or callable(transforms)):
            raise ConfigError(f"transforms: {transforms!r} is no function of image and target")
        self.task, self.form, self.as_float = task, form, as_float
        self.seed, self.length = seed, length
        self.transforms, self.curriculum = transforms, curriculum
        self.cameras = chosen_cameras(task, self.config, cameras)
        check_form(task, form)
        self._generator = LocalGenerator(
            config=self.config,
            seed=seed,
            size=size,
            backend=backend,
            hdri_dir=hdri_dir,
            quality=quality,
            device_index=device_index,
        )
        self._plan = Plan(self.config, seed, self.cameras, split, fixed, all_views)
        # workers that persist through epochs see it change, forked or spawned
        self._epoch = torch.zeros(1, dtype=torch.int64).share_memory_()
        self._epoch_config: tuple[int, Config] = (0, config_of(curriculum, self.config, 0))
        self._scene: tuple[tuple[int, int], Scene] | None = None
        self._digests: dict[int, str] = {}
        self._made: dict[str, Any] = {
            "task": task,
            "seed": seed,
            "size": [int(side) for side in size],
            "length": self.length,
            "cameras": list(self.cameras),
            "split": split,
            "fixed": fixed,
            "all_views": all_views,
            "quality": quality,
            "config": self.config.to_plain(),
        }

    @property
    def description(self) -> dict[str, Any]:
        """What decides the samples, as plain values; of files and of the curriculum, SHA-256.
        HDRIs' weights in the draw are among them.

        The curriculum stands here by what it gives for epochs 0 and 1 and the present one.
        """
        if "hdri_dir" not in self._made:  # reads every HDRI
            self._made["hdri_dir"] = self._generator.get().environment_record
        epochs = sorted({0, 1, self.epoch})
        return {**self._made, "curriculum": self.curriculum_digests(epochs)}

    def curriculum_digests(self, epochs: Sequence[int]) -> dict[str, str]:
        """Epoch, as text -> SHA-256 of its configuration; without epochs that there is none of."""
        for epoch in epochs:
            with contextlib.suppress(Exception):  # one that indexes a list may end after epoch 0
                if epoch not in self._digests:
                    config = config_of(self.curriculum, self.config, epoch)
                    # checked, so that 12 and 12.0 read the same
                    plain = json.dumps(Config.checked(config).to_plain(), sort_keys=True)
                    self._digests[epoch] = hashlib.sha256(plain.encode()).hexdigest()
        return {str(epoch): self._digests[epoch] for epoch in epochs if epoch in self._digests}

    @property
    def epoch(self) -> int:
        """The epoch that items are of; workers share it."""
        return int(self._epoch)

    def set_epoch(self, epoch: int) -> None:
        """Go to an epoch, 0 to plan.MAX_EPOCH, between two passes over the data."""
        epoch = whole("epoch", epoch, 0, MAX_EPOCH)
        config_of(self.curriculum, self.config, epoch)  # refused here, not in a worker
        self._epoch.fill_(epoch)

    @property
    def collate(self) -> Collate:
        """The collate function that fits this dataset's items; Loader uses it by itself."""
        return collate_of(self.task, self.form)

    def locate(self, position: int, epoch: int | None = None) -> tuple[int, str]:
        """Scene index and camera name of a position; `epoch` by default the present one."""
        return self._plan.locate(self.epoch if epoch is None else epoch, position)

    def sample(self, position: int, epoch: int | None = None) -> Sample:
        """The Sample that the item at a position is made from."""
        epoch = self.epoch if epoch is None else epoch
        index, camera = self._plan.locate(epoch, position)
        generator = self._generator.get()
        last = self._scene
        if last is None or last[0] != (epoch, index):  # cameras of a scene come one by one
            config = self.config_at(epoch)
            scene = sample_scene(config, self.seed, index, generator.environments)
            last = self._scene = ((epoch, index), scene)
        labels = self.config_at(epoch).labels
        return generator.render(scene=last[1], camera=camera, labels=labels)

    def item(self, position: int, epoch: int | None = None) -> Item:
        """Image and target at a position, 0 or more, transforms applied; see targets.item_of."""
        epoch = self.epoch if epoch is None else epoch
        sample = self.sample(position, epoch)
        names = list(self.config.cameras)
        image_id = sample.scene.index * len(names) + names.index(sample.camera.name)
        labels = self.config_at(epoch).labels
        made = item_of(sample, self.task, self.form, labels, image_id, self.as_float)
        if self.transforms is None:
            return made
        changed = self.transforms(*made)
        if not isinstance(changed, tuple | list) or len(changed) != 2:
            what = type(changed).__name__
            raise ConfigError(f"transforms: gave {what}; return the pair (image, target)")
        image, target = changed
        return image, target

    def config_at(self, epoch: int) -> Config:
        """The configuration of an epoch, by the curriculum if there is one."""
        last = self._epoch_config
        if last[0] != epoch:
            last = self._epoch_config = (epoch, config_of(self.curriculum, self.config, epoch))
        return last[1]

    def close(self) -> None:
        """Free what this process opened to render; the next item opens it again."""
        self._generator.close()

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, position: int) -> Item:
        try:
            position = operator.index(position)
        except TypeError:
            raise TypeError(f"position {position!r} is no whole number") from None
        if not -self.length <= position < self.length:
            raise IndexError(f"position {position} is out of range; there are {self.length}")
        return self.item(position % self.length)


class ContainerStream(IterableDataset[Item]):
    """Iterable: the items of a ContainerDataset in order, by this rank and worker its share.

    task, config, seed, size, cameras, options: as for ContainerDataset. length: images of an epoch
    over all ranks; None for no end. rank, world_size: which part of the positions is ours, by
    default torch.distributed's where it runs when the stream is made, else all. Each position comes
    exactly once over all ranks and workers, so ranks may differ by one item at the end.
    batch_size: the DataLoader's, so that items come in order whatever the number of workers;
    Loader sets it by itself.
    """

    def __init__(
        self,
        task: str,
        config: Config | None = None,
        seed: int = 0,
        size: tuple[int, int] = (640, 640),
        length: int | None = None,
        cameras: Sequence[str] | None = None,
        *,
        rank: int | None = None,
        world_size: int | None = None,
        batch_size: int = 1,
        **options: Any,
    ) -> None:
        known = MAX_LENGTH if length is None else length
        self.items = ContainerDataset(task, config, seed, size, known, cameras, **options)
        self.length = None if length is None else int(length)
        self.part = shard(rank, world_size)
        self.batch_size = whole("batch_size", batch_size, 1)
        self._start = torch.zeros(1, dtype=torch.int64).share_memory_()

    @property
    def epoch(self) -> int:
        """The epoch that items are of; workers share it."""
        return self.items.epoch

    def set_epoch(self, epoch: int) -> None:
        """Go to an epoch, 0 to plan.MAX_EPOCH, between two passes over the data."""
        self.items.set_epoch(epoch)

    def start_at(self, position: int) -> None:
        """Let passes begin at a position of the epoch, counted over all ranks."""
        self._start.fill_(whole("position", position))

    def __len__(self) -> int:
        """Items of this rank in an epoch. Raises TypeError where there is no end."""
        if self.length is None:
            raise TypeError("this stream has no end; give it a length")
        rank, world_size = self.part
        return len(range(rank, self.length, world_size))

    def __iter__(self) -> Iterator[Item]:
        worker = get_worker_info()
        share = (worker.id, worker.num_workers) if worker else (0, 1)
        epoch = self.epoch  # read once: a pass is of one epoch
        places = positions(int(self._start), self.length, self.part, share, self.batch_size)
        return (self.items.item(position, epoch) for position in places)

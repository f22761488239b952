"""Which scene and camera stand at each position of an epoch, on every rank and in every worker."""

import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import torch

from fastgen.config.config import Config
from fastgen.errors import ConfigError
from fastgen.formats.door import always_at_an_end
from fastgen.sampling.scene import SPLITS, split_of
from fastgen.torch.targets import class_names
from fastgen.validation import check_known, nearest, whole

EPOCH_SCENES = 10**9
"""Scenes of epoch e count up from e times this, so that no two epochs share one."""

MAX_EPOCH = 2**63 // EPOCH_SCENES - 1
"""The last epoch all of whose scene numbers a Scene can have."""


class Plan:
    """Position in an epoch -> scene index and camera; plain arithmetic, no GL.

    split: only scenes of 'train', 'val' or 'test' by config.split, as `fastgen generate` deals
    them out; None for all. fixed: every epoch has the scenes of epoch 0. all_views: each scene is
    seen by all cameras in turn, else by one, the next scene by the next.
    Raises ConfigError for cameras or a split that cannot be.
    """

    def __init__(
        self,
        config: Config,
        seed: int,
        cameras: Sequence[str],
        split: str | None,
        fixed: bool,
        all_views: bool,
    ) -> None:
        if split is not None:
            check_known("split", split, SPLITS)
            if not getattr(config.split, split):
                raise ConfigError(f"split: config.split gives {split} no scenes; raise its share")
        self.cameras = tuple(cameras)
        self._config, self._seed, self._split = config, seed, split
        self._fixed, self._all_views = fixed, all_views
        self._epoch = -1
        self._scenes: list[int] = []
        self._following = 0
        self._lock = threading.Lock()

    def locate(self, epoch: int, position: int) -> tuple[int, str]:
        """Scene index and camera name of one position, 0 or more, of an epoch."""
        position = whole("position", position)
        camera = self.cameras[position % len(self.cameras)]
        number = position // len(self.cameras) if self._all_views else position
        first = 0 if self._fixed else epoch * EPOCH_SCENES
        if self._split is None:
            return first + number, camera
        with self._lock:
            if self._epoch != epoch:
                self._epoch, self._scenes, self._following = epoch, [], first
            while len(self._scenes) <= number:
                if split_of(self._config, self._seed, self._following) == self._split:
                    self._scenes.append(self._following)
                self._following += 1
            return self._scenes[number], camera

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _lock=threading.Lock())


def chosen_cameras(task: str, config: Config, cameras: Sequence[str] | None) -> tuple[str, ...]:
    """The cameras that a task's images come from; None takes all of the rig that it can use.

    Raises ConfigError for an unknown task or camera, or one that says nothing about the task.
    """
    class_names(task)
    rig = config.cameras
    if isinstance(cameras, str) or not (cameras is None or isinstance(cameras, Iterable)):
        raise ConfigError(f"cameras: {cameras!r} is no list; give [{cameras!r}]")
    usable = [name for name in rig if task != "door" or always_at_an_end(rig[name])]
    if not usable:
        raise ConfigError(f"cameras: none of {', '.join(rig)} looks at an end of the container")
    chosen = tuple(usable if cameras is None else cameras)
    for name in chosen:
        if name not in usable:
            why = nearest(name, usable)
            if task == "door" and name in rig:
                why = (
                    "; it takes those at the container's ends whose azimuth_deg and elevation_deg "
                    "keep them, taken together, within 45 degrees of its length"
                )
            raise ConfigError(f"cameras: {name!r} is none of the {task} task's{why}")
    if not chosen or len(set(chosen)) != len(chosen):
        raise ConfigError("cameras: name at least one, and each only once")
    return chosen


def config_of(curriculum: Any, base: Config, epoch: int) -> Config:
    """The configuration of an epoch: what curriculum(epoch) gives, a Config or values over `base`.

    Raises ConfigError where it changes what must stay the same through a training.
    """
    if curriculum is None:
        return base
    if not callable(curriculum):
        raise ConfigError(f"curriculum: {curriculum!r} is no function of the epoch")
    made = curriculum(epoch)
    if not isinstance(made, Config | Mapping):
        raise ConfigError(f"curriculum: epoch {epoch} gives {made!r}, not a Config or a mapping")
    try:
        values = made.to_plain() if isinstance(made, Config) else made
        made = Config.from_values(values, base)
    except ConfigError as error:
        raise ConfigError(f"curriculum: epoch {epoch}: {error}") from None
    if made.damage.mask_threshold_mm != base.damage.mask_threshold_mm:
        raise ConfigError(f"curriculum: epoch {epoch} changes damage.mask_threshold_mm; leave it")
    if list(made.cameras) != list(base.cameras):
        raise ConfigError(f"curriculum: epoch {epoch} changes which cameras there are; keep them")
    return made


def shard(rank: int | None, world_size: int | None) -> tuple[int, int]:
    """(rank, world size) as given, else of torch.distributed where it runs, else (0, 1).

    Raises ConfigError for one without the other, or a rank that is not below the world size.
    """
    if rank is None and world_size is None:
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            return torch.distributed.get_rank(), torch.distributed.get_world_size()
        return 0, 1
    if rank is None or world_size is None:
        raise ConfigError("rank, world_size: give both or neither")
    rank, world_size = whole("rank", rank), whole("world_size", world_size, 1)
    if rank >= world_size:
        raise ConfigError(f"rank: {rank} is out of range; world_size {world_size} has 0 and up")
    return rank, world_size


def positions(
    start: int, stop: int | None, part: tuple[int, int], worker: tuple[int, int], block: int
) -> Iterator[int]:
    """Positions from `start` to before `stop` (None: no end) that one worker of one rank renders.

    part: (rank, world size); ranks take positions in turn. worker: (number, count); the workers of
    a rank take its positions in turn too, in blocks. Where a block is the loader's batch, which it
    fetches from worker after worker, batches come in the same order whatever the count.
    """
    rank, world_size = part
    number, count = worker
    turn = number
    while True:
        for i in range(turn * block, (turn + 1) * block):
            position = start + rank + i * world_size
            if stop is not None and position >= stop:
                return
            yield position
        turn += count

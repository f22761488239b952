"""Plan of an epoch: scene and camera at each position, the same on every rank and worker."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch

from fastgen.config.cameras import CameraConfig
from fastgen.config.config import Config
from fastgen.errors import ConfigError, nearest
from fastgen.formats.door import always_at_an_end
from fastgen.sampling.scene import SPLITS, split_of
from fastgen.torch.targets import class_names
from fastgen.validation import check_known, flag, whole

EPOCH_SCENES = 10**9
"""Epoch e starts at scene index e times this, so that no two epochs share a scene."""

MAX_EPOCH = 2**63 // EPOCH_SCENES - 1
"""The last epoch whose scene indices all fit into a Scene."""

Curriculum = Callable[[int], Config | Mapping[str, Any]]
"""Returns the configuration of an epoch, or values that replace those of the dataset's."""


_AT_AN_END = (
    "give a camera with face door or no_door whose azimuth_deg and elevation_deg together keep it "
    "within 45 degrees of the long axis"
)
"""Advice in errors about cameras of the door task."""


@dataclass(frozen=True)
class SceneSettings:
    """Scenes of an epoch, and the cameras that see them.

    Attributes:
        cameras: Names of the cameras; None takes all of the configuration that suit the task.
        split: "train", "val" or "test" for the scenes that `fastgen generate` puts there; None for
            all scenes.
        fixed: Every epoch has the scenes of epoch 0, as a validation set should. Otherwise each
            epoch has new scenes.
        all_views: Each scene is seen by all cameras in turn. Otherwise each scene is seen by one
            camera, and the next scene by the next camera.
        curriculum: Called with the epoch. Returns the epoch's Config, or values that replace those
            of the dataset's Config, nested as in a configuration file.

    Raises:
        ConfigError: `fixed` or `all_views` is not a boolean. ContainerDataset checks the rest.
    """

    cameras: Sequence[str] | None = None
    split: str | None = None
    fixed: bool = False
    all_views: bool = True
    curriculum: Curriculum | None = None

    def __post_init__(self) -> None:
        """Check the booleans, and turn those of NumPy into Python's."""
        for name in ("fixed", "all_views"):
            object.__setattr__(self, name, flag(name, getattr(self, name)))


class Plan:
    """Scene index and camera at each position of an epoch.

    Args:
        config: Configuration, whose fractions decide the split of a scene.
        seed: Seed of the dataset.
        cameras: Names of the cameras to use.
        scenes: The remaining settings; `scenes.cameras` is not used.

    Raises:
        ConfigError: The split is unknown or has no scenes.
    """

    def __init__(
        self, config: Config, seed: int, cameras: Sequence[str], scenes: SceneSettings
    ) -> None:
        split = scenes.split
        if split is not None:
            check_known("split", split, SPLITS)
            if not getattr(config.split, split):
                raise ConfigError(
                    f"split: config.split gives {split} no scenes; raise its fraction"
                )
        self.cameras = tuple(cameras)
        self._config, self._seed, self._split = config, seed, split
        self._fixed, self._all_views = scenes.fixed, scenes.all_views
        self._epoch = -1
        self._scenes: list[int] = []
        self._following = 0
        self._lock = threading.Lock()

    def locate(self, epoch: int, position: int) -> tuple[int, str]:
        """Return scene index and camera name at a position, 0 or more, of an epoch."""
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
    """Return the cameras of a dataset: `cameras`, or all of the configuration that suit the task.

    Raises:
        ConfigError: The task or a camera is unknown, or a camera or the configuration does not
            suit the task.
    """
    class_names(task)
    if task == "door" and config.container.absent > 0:
        raise ConfigError(
            f"container.absent: {config.container.absent:g} leaves images without a class for the "
            "door task; set it to 0"
        )
    rig = config.cameras
    if isinstance(cameras, str) or not (cameras is None or isinstance(cameras, Iterable)):
        raise ConfigError(f"cameras: {cameras!r} is not a list; give [{cameras!r}]")
    usable = [name for name in rig if _suits(task, rig[name])]
    if not usable:
        where = "the door"
        if task == "door":
            where = f"an end of the container in every scene; {_AT_AN_END}"
        raise ConfigError(f"cameras: none of {', '.join(rig)} looks at {where}")
    chosen = tuple(usable if cameras is None else cameras)
    for name in chosen:
        if name not in usable:
            why = nearest(name, usable)
            if task == "door" and name in rig:
                why = f"; {_AT_AN_END}"
            raise ConfigError(f"cameras: {name!r} does not suit the {task} task{why}")
    if not chosen or len(set(chosen)) != len(chosen):
        raise ConfigError("cameras: give at least one name, and each only once")
    return chosen


def _suits(task: str, camera: CameraConfig) -> bool:
    if task == "door":
        return always_at_an_end(camera)
    return task != "seal" or camera.face == "door"


def config_of(curriculum: Any, base: Config, epoch: int) -> Config:
    """Return the configuration of an epoch.

    Args:
        curriculum: As in SceneSettings.
        base: Configuration that the curriculum's values change.
        epoch: The epoch, from 0.

    Raises:
        ConfigError: The curriculum gives no configuration, or changes a value that must stay the
            same during training.
    """
    if curriculum is None:
        return base
    if not callable(curriculum):
        raise ConfigError(f"curriculum: {curriculum!r} is not a function of the epoch")
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
    if made.markings.detection_classes != base.markings.detection_classes:
        raise ConfigError(
            f"curriculum: epoch {epoch} changes which classes there are; give markings.marks in "
            "every epoch or in none, with 0 for no mark, and keep markers above weight 0"
        )
    if made.markings.own_art != base.markings.own_art:
        raise ConfigError(
            f"curriculum: epoch {epoch} changes the images of markers, stickers or brands; keep "
            "them, and change their weights"
        )
    if made.markings.own_fonts != base.markings.own_fonts:
        raise ConfigError(
            f"curriculum: epoch {epoch} changes markings.own_fonts; keep them, and change "
            "markings.fonts"
        )
    if made.damage.segmentation_classes != base.damage.segmentation_classes:
        raise ConfigError(
            f"curriculum: epoch {epoch} changes which classes there are; list the "
            "same last kind in damage.kinds of every epoch, in the order of the classes"
        )
    if made.split != base.split:
        raise ConfigError(
            f"curriculum: epoch {epoch} changes split; leave it, because a scene is always in the "
            "same split"
        )
    if list(made.cameras) != list(base.cameras):
        raise ConfigError(f"curriculum: epoch {epoch} changes which cameras there are; keep them")
    return made


def shard(rank: int | None, world_size: int | None) -> tuple[int, int]:
    """Return (rank, world size): as given, else of torch.distributed if it runs, else (0, 1).

    Raises:
        ConfigError: One is given without the other, or the rank is not below the world size.
    """
    if rank is None and world_size is None:
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            return torch.distributed.get_rank(), torch.distributed.get_world_size()
        return 0, 1
    if rank is None or world_size is None:
        raise ConfigError("rank, world_size: give both or neither")
    rank, world_size = whole("rank", rank), whole("world_size", world_size, 1)
    if rank >= world_size:
        raise ConfigError(
            f"rank: {rank} is out of range; world_size {world_size} has ranks 0 to {world_size - 1}"
        )
    return rank, world_size


def positions(
    start: int, stop: int | None, part: tuple[int, int], worker: tuple[int, int], block: int
) -> Iterator[int]:
    """Yield the positions that one worker of one rank renders.

    Ranks take positions in turn, and the workers of a rank take its positions in turn in blocks. If
    a block is the loader's batch, batches come in the same order with any number of workers.

    Args:
        start: First position over all ranks.
        stop: End of the positions; None for no end.
        part: Rank and world size.
        worker: Number of the worker and number of workers.
        block: Positions of this rank that a worker takes at a time.
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

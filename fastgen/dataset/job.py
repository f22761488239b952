"""Job: everything that decides the files of a dataset; and the names of its files."""

import re
from dataclasses import dataclass, field

from fastgen.config.config import Config
from fastgen.formats.registry import SEAFRONT
from fastgen.generator import Generator
from fastgen.render.settings import RenderSettings

SHARD_SCENES = {"seafront": 2, "webdataset": 64, "parquet": 64}
"""Default number of scenes per shard in each layout.

Small shards share few scenes evenly among workers. Archives need large ones.
"""

LAYOUTS = tuple(SHARD_SCENES)

ARCHIVE_ENDINGS = {"webdataset": "tar", "parquet": "parquet"}
"""File name extension of the archives in each layout that packs samples."""

STEMS = ("seed", "short")
"""Kinds of file names: with the seed, as in s7_000017_A, or without it, as in 000017_A."""

COCO_MASKS = ("polygon", "rle")
"""Ways to write the masks of COCO annotations that are not crowds."""

STEM_PATTERN = "(?:s(?P<seed>[0-9]{1,19})_)?(?P<scene>[0-9]{6,19})_(?P<camera>[A-Za-z0-9_-]{1,64})"
"""Stem of an image with either kind of name. Seeds and indices of scenes are below 2^63."""


@dataclass(frozen=True)
class Job:
    """A dataset to generate.

    Attributes:
        out: Folder, or an fsspec address such as s3://bucket/folder.
        images: Number of images of all cameras together, 1 to 10^9.
        config: Distribution of the scenes.
        seed: Whole number of 0 or more.
        cameras: Names of the cameras to render in each scene; () takes all of `config`.
        render: Settings of the renderer.
        layout: "seafront" (one folder for each task), "webdataset" (tar files) or "parquet".
        tasks: Names of the formats to write.
        also: Names of formats to write in addition to `tasks`.
        shard_scenes: Scenes that one process makes and commits together. None takes
            SHARD_SCENES of the layout.
        stems: One of STEMS. Names with the seed stay distinct when datasets are merged.
        coco_masks: One of COCO_MASKS.
        settings_digest: Hash of everything that decides the content of the files. It tells whose a
            shard is. `generate` fills it in.
    """

    out: str
    images: int
    config: Config = field(default_factory=Config.preset)
    seed: int = 0
    cameras: tuple[str, ...] = ()
    render: RenderSettings = field(default_factory=RenderSettings)
    layout: str = LAYOUTS[0]
    tasks: tuple[str, ...] = SEAFRONT
    also: tuple[str, ...] = ()
    shard_scenes: int | None = None
    stems: str = STEMS[0]
    coco_masks: str = COCO_MASKS[0]
    settings_digest: str = ""

    def __post_init__(self) -> None:
        """Replace empty cameras with all of the configuration."""
        if not self.cameras:
            object.__setattr__(self, "cameras", tuple(self.config.cameras))

    @property
    def formats(self) -> tuple[str, ...]:
        """Names of all formats to write, in an order that does not depend on the job's."""
        chosen = {*self.tasks, *self.also}
        return tuple([each for each in SEAFRONT if each in chosen] + sorted(chosen - {*SEAFRONT}))

    @property
    def scenes_per_shard(self) -> int:
        """Scenes that one process makes and commits together."""
        default = SHARD_SCENES.get(self.layout, 1)
        return default if self.shard_scenes is None else self.shard_scenes

    @property
    def shard_count(self) -> int:
        """Number of shards that hold all images."""
        return -(-self.images // (self.scenes_per_shard * len(self.cameras)))

    def wanted(self, shard: int) -> list[tuple[int, str]]:
        """Return scene index and camera name of each image of a shard."""
        count = len(self.cameras)
        per_shard = self.scenes_per_shard * count
        numbers = range(shard * per_shard, min((shard + 1) * per_shard, self.images))
        return [(number // count, self.cameras[number % count]) for number in numbers]

    def stem(self, index: int, camera: str) -> str:
        """Return the file name, without extension, of scene `index` as seen by `camera`."""
        seed = f"s{self.seed}_" if self.stems == "seed" else ""
        return f"{seed}{index:06d}_{camera}"

    def generator(self) -> Generator:
        """Return a Generator for this job. Raises ConfigError for invalid values."""
        return Generator.of(self.config, self.seed, self.render)


@dataclass(frozen=True)
class Task:
    """One shard to make.

    Attributes:
        shard: Its number.
        skip: Scenes that are given up: reason by scene index.
    """

    shard: int
    skip: dict[int, str] = field(default_factory=dict)


def scene_and_camera(stem: str) -> tuple[int, str]:
    """Return the scene's index and the camera of an image by its stem."""
    found = re.fullmatch(STEM_PATTERN, stem)
    if found is None:
        raise ValueError(f"{stem!r} is not the name of an image")
    return int(found["scene"]), found["camera"]


def manifest_path(shard: int) -> str:
    """Return the path of a shard's manifest."""
    return f"shards/{shard:06d}.json"


def shard_of(path: str) -> int | None:
    """Return the number of the shard whose manifest has this path, or None."""
    name = path.removeprefix("shards/").removesuffix(".json")
    return int(name) if name.isdecimal() and manifest_path(int(name)) == path else None

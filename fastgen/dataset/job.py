"""Job: everything that decides the files of a dataset; and the names of its files."""

from dataclasses import dataclass, field

from fastgen.config.config import Config
from fastgen.formats.registry import SEAFRONT
from fastgen.generator import Generator
from fastgen.render.settings import RenderSettings

SHARD_SCENES = {"seafront": 4, "webdataset": 64}
"""Default number of scenes per shard in each layout."""

LAYOUTS = tuple(SHARD_SCENES)


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
        layout: "seafront" (one folder for each task) or "webdataset" (tar files).
        also: Names of formats to write in addition to those of SEAFRONT.
        shard_scenes: Scenes that one process makes and commits together. None takes
            SHARD_SCENES of the layout.
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
    also: tuple[str, ...] = ()
    shard_scenes: int | None = None
    settings_digest: str = ""

    def __post_init__(self) -> None:
        """Replace empty cameras with all of the configuration."""
        if not self.cameras:
            object.__setattr__(self, "cameras", tuple(self.config.cameras))

    @property
    def formats(self) -> tuple[str, ...]:
        """Names of all formats to write, in an order that does not depend on that of `also`."""
        return tuple(dict.fromkeys((*SEAFRONT, *sorted(self.also))))

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


def stem_of(index: int, camera: str) -> str:
    """Return the file name, without extension, of scene `index` as seen by `camera`."""
    return f"{index:06d}_{camera}"


def manifest_path(shard: int) -> str:
    """Return the path of a shard's manifest."""
    return f"shards/{shard:06d}.json"


def shard_of(path: str) -> int | None:
    """Return the number of the shard whose manifest has this path, or None."""
    name = path.removeprefix("shards/").removesuffix(".json")
    return int(name) if name.isdecimal() and manifest_path(int(name)) == path else None

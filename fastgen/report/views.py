"""Images that the report looks at: pixels and scene file of some images of a dataset.

All layouts have both: as files, as members of tar files, and as columns of Parquet files.
"""

import io
import tarfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

import numpy as np
import simplejpeg
from annotated_types import Ge, Le
from numpy.typing import NDArray

from fastgen.dataset.finished import FinishedDataset
from fastgen.dataset.job import ARCHIVE_ENDINGS, scene_and_camera
from fastgen.dataset.manifest_types import parsed_json, unfit
from fastgen.errors import OutputError
from fastgen.formats.format import Record
from fastgen.formats.parquet import opened_table
from fastgen.report.labels import is_box

MOST_ARCHIVES = 24
"""Archives that are opened; a shard's archive holds hundreds of images."""

_LARGEST_MEMBER = 64 << 20
"""Largest image or scene file in bytes."""

_LARGEST_ROWS = 4 << 30
"""Largest row group of a Parquet file in bytes."""

_LONGEST_NAME = 80

T = TypeVar("T")


@dataclass(frozen=True)
class Seen:
    """An object in a scene file; see `fastgen.sample.Object`."""

    class_name: str
    bbox: tuple[int, int, int, int] | None
    visible_fraction: Annotated[float, Ge(0), Le(1)]
    ignored: bool
    text: str = ""
    background: bool = False


@dataclass(frozen=True)
class _Environment:
    name: str


@dataclass(frozen=True)
class _Scene:
    environment: _Environment


@dataclass(frozen=True)
class _SceneFile:
    objects: tuple[Seen, ...]
    scene: _Scene


@dataclass(frozen=True)
class Place:
    """An image of a dataset and what its record says about it.

    Attributes:
        shard: Number of its shard.
        split: train, val or test.
        stem: Name of its files.
        size: Width and height in pixels.
        crops: Text and box x0, y0, x1, y1 of each text crop.
    """

    shard: int
    split: str
    stem: str
    size: tuple[int, int]
    crops: tuple[tuple[str, tuple[int, ...]], ...]

    @property
    def camera(self) -> str:
        """Name of its camera."""
        return scene_and_camera(self.stem)[1]


@dataclass(frozen=True, eq=False)
class LoadedView:
    """An image with the objects of its scene file.

    Attributes:
        place: Its place in the dataset.
        image: uint8 sRGB [H, W, 3].
        environment: Name of its HDRI.
        objects: Its objects.
    """

    place: Place
    image: NDArray[np.uint8]
    environment: str
    objects: Sequence[Seen]


def spread(items: Sequence[T], count: int) -> list[T]:
    """Return up to `count` items, evenly spread."""
    count = min(count, len(items))
    return [items[i * len(items) // count] for i in range(count)]


def place_of_record(record: Record, shard: int) -> Place:
    """Return the place of a record's image.

    Raises:
        ValueError: Its text crops are not as fastgen writes them.
    """
    crops = []
    facts = record["facts"].get("text", [])
    if not isinstance(facts, list):
        raise ValueError(f"{record['stem']}: has no list of text crops")
    for crop in facts:
        if not (isinstance(crop, dict) and isinstance(crop.get("text"), str)):
            raise ValueError(f"{record['stem']}: a text crop has no text")
        if not is_box(crop.get("box")):
            raise ValueError(f"{record['stem']}: a text crop has no box")
        crops.append((crop["text"], tuple(int(v) for v in crop["box"])))
    width, height = record["size"]
    return Place(shard, record["split"], record["stem"], (width, height), tuple(crops))


def chosen_places(places: Sequence[Place], count: int, archived: bool) -> list[Place]:
    """Return about `count` places that are evenly spread over shards and cameras.

    Args:
        places: Places to choose from, at least one.
        count: Number of places.
        archived: Keep to MOST_ARCHIVES shards.
    """
    if archived:
        shards = spread(list(dict.fromkeys(place.shard for place in places)), MOST_ARCHIVES)
        places = [place for place in places if place.shard in shards]
    # one camera at a time: a stride over all would hit the same camera again and again
    by_camera: dict[str, list[Place]] = {}
    for place in places:
        by_camera.setdefault(place.camera, []).append(place)
    share = -(-count // max(len(by_camera), 1))
    chosen = [spread(group, share) for group in by_camera.values()]
    return sorted(
        (place for group in chosen for place in group), key=lambda each: (each.shard, each.stem)
    )


def load_views(dataset: FinishedDataset, places: Iterable[Place]) -> Iterator[LoadedView]:
    """Yield the images at some places.

    Raises:
        OutputError: A file is missing or damaged; the message names it.
    """
    layout = dataset.manifest["format"]
    groups: dict[str, list[Place]] = {}
    for place in places:
        archive = f"{place.split}-{place.shard:06d}.{ARCHIVE_ENDINGS.get(layout, '')}"
        groups.setdefault(archive if layout in ARCHIVE_ENDINGS else "", []).append(place)
    for archive, wanted in groups.items():
        try:
            if layout not in ARCHIVE_ENDINGS:
                yield from (_view(place, *_loose(dataset, place)) for place in wanted)
                continue
            with dataset.storage.opened(archive) as stream:
                members = (_tar_members if layout == "webdataset" else _parquet_rows)(
                    stream, {place.stem for place in wanted}
                )
            for place in wanted:
                if place.stem not in members:
                    raise ValueError(f"{place.stem} is missing")
                yield _view(place, *members[place.stem])
        except FileNotFoundError as error:
            raise _broken(dataset, f"{error} is missing") from None
        except (ValueError, tarfile.TarError) as error:
            raise _broken(dataset, f"{archive}: {error}" if archive else str(error)) from None


def _broken(dataset: FinishedDataset, words: str) -> OutputError:
    return OutputError(f"{dataset.out}: {words}; run fastgen verify {dataset.out}")


def _loose(dataset: FinishedDataset, place: Place) -> tuple[bytes, bytes]:
    name = f"{place.split}/{place.stem}"
    read = dataset.storage.read
    return read(f"images/{name}.jpg"), read(f"scenes/{name}.json")


def _tar_members(stream: io.BufferedReader, stems: set[str]) -> dict[str, tuple[bytes, bytes]]:
    """Return image and scene file of the samples with these stems."""
    found: dict[str, dict[str, bytes]] = {}
    with tarfile.open(fileobj=stream, mode="r:") as tar:
        for member in tar:
            stem, _, extension = member.name.partition(".")
            if stem in stems and extension in ("jpg", "json") and member.isreg():
                if member.size > _LARGEST_MEMBER:
                    raise ValueError(f"{member.name} has {member.size:,} bytes")
                content = tar.extractfile(member)
                assert content is not None
                found.setdefault(stem, {})[extension] = content.read()
    return {stem: (parts["jpg"], parts["json"]) for stem, parts in found.items() if len(parts) == 2}


def _parquet_rows(stream: io.BufferedReader, stems: set[str]) -> dict[str, tuple[bytes, bytes]]:
    """Return image and scene file of the rows with these stems."""
    found = {}
    with opened_table(stream) as table:
        for group in range(table.num_row_groups):
            names = table.read_row_group(group, ["stem"])["stem"].to_pylist()
            if stems.isdisjoint(names):
                continue
            if table.metadata.row_group(group).total_byte_size > _LARGEST_ROWS:
                raise ValueError("has a row group of more than 4 GiB")
            rows = table.read_row_group(group, ["image", "scene"])
            for at, name in enumerate(names):
                if name in stems:
                    image, scene = (rows[column][at].as_py() for column in ("image", "scene"))
                    found[name] = (image["bytes"], scene.encode())
    return found


def _view(place: Place, jpeg: bytes, scene: bytes) -> LoadedView:
    width, height = place.size
    problem = unfit(scene, _SceneFile)
    if problem:
        raise ValueError(f"{place.stem}: scene file: {problem}")
    # before decoding, because the decoder allocates the size that the file claims
    if simplejpeg.decode_jpeg_header(jpeg)[:2] != (height, width):
        raise ValueError(f"{place.stem}: the image is not {width}x{height}")
    content: dict[str, Any] = parsed_json(scene)
    objects = [
        Seen(**{name: each[name] for name in Seen.__dataclass_fields__ if name in each})
        for each in content["objects"]
    ]
    return LoadedView(
        place=place,
        image=simplejpeg.decode_jpeg(jpeg, strict=True),
        environment=content["scene"]["environment"]["name"][:_LONGEST_NAME],
        objects=objects,
    )

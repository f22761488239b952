"""Types of the values in dataset.json and in the manifests of shards, checked as they are read.

Both files contain a hash of themselves, but whoever edits a file can also update its hash.
"""

import functools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Ge, Le, MinLen

from fastgen.dataset.job import COCO_MASKS, LAYOUTS, STEM_PATTERN, STEMS
from fastgen.errors import shown, shown_name
from fastgen.files.inner_path import INNER_PATH
from fastgen.render.settings import MAX_SIZE
from fastgen.sampling.scene import SPLITS
from fastgen.validation import Matching, OneOf

if TYPE_CHECKING:
    from pydantic import TypeAdapter

_Count = Annotated[int, Ge(0)]
_Number = Annotated[int, Ge(1)]
_Side = Annotated[int, Ge(1), Le(MAX_SIZE)]
_Entries = dict[
    Annotated[str, Matching(INNER_PATH, "is not a path inside the dataset")], tuple[_Count, str]
]
"""Size and SHA-256 of each file, by path."""


@dataclass(frozen=True)
class _Failure:
    scene: _Count
    seed: _Count
    error: str


@dataclass(frozen=True, kw_only=True)
class _Layout:
    version: str
    format: Annotated[str, OneOf(LAYOUTS)]
    formats: tuple[str, ...]
    images: _Number
    classes: dict[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Started(_Layout):
    """Values of dataset.json in a dataset that is not finished.

    Defaults are those of versions that did not write the value.
    """

    seed: _Count
    size: tuple[_Side, _Side]
    quality: str
    cameras: Annotated[tuple[str, ...], MinLen(1)]
    environments: dict[str, Any]
    shard_scenes: _Number
    config: dict[str, Any]
    postprocess: dict[str, str] = field(default_factory=dict)
    stems: Annotated[str, OneOf(STEMS)] = "short"
    coco_masks: Annotated[str, OneOf(COCO_MASKS)] = "rle"


@dataclass(frozen=True, kw_only=True)
class _Result:
    backend: str
    renderer: str
    counts: dict[str, dict[str, _Count]]
    failed: tuple[_Failure, ...]
    files: _Entries
    shards: dict[Annotated[str, Matching("[0-9]{1,12}", "is not a number")], str]
    digest: str


@dataclass(frozen=True, kw_only=True)
class Finished(_Result, Started):
    """Values of dataset.json in a dataset that was generated completely."""


@dataclass(frozen=True, kw_only=True)
class Merged(_Result, _Layout):
    """Values of dataset.json in a dataset that was merged from others.

    Attributes:
        merged_from: What dataset.json of each of the others says about how it was made.
    """

    merged_from: Annotated[tuple[Started, ...], MinLen(1)]


@dataclass(frozen=True)
class _Record:
    stem: Annotated[str, Matching(STEM_PATTERN, "is not the name of an image")]
    split: Annotated[str, OneOf(SPLITS)]
    size: tuple[_Side, _Side]
    facts: dict[str, Any]
    number: _Count = 0


@dataclass(frozen=True)
class Shard:
    """Values of a shard's manifest."""

    shard: _Count
    settings: str
    backend: str
    renderer: str
    images: tuple[str, ...]
    failed: tuple[_Failure, ...]
    files: _Entries
    records: tuple[_Record, ...]
    digest: str


def parsed_json(text: bytes | str) -> Any:
    """Return the value of a JSON text.

    Raises:
        ValueError: It is not JSON, or nested so deeply that other code could not handle it.
    """
    from pydantic_core import from_json

    return from_json(text)


def unfit_finished(text: bytes) -> str:
    """Return what does not fit in the text of a finished or merged dataset's dataset.json."""
    return unfit(text, Merged if "merged_from" in parsed_json(text) else Finished)


def unfit(text: bytes, cls: type) -> str:
    """Return what does not fit the class in a JSON text, naming the field; "" if all fits."""
    from pydantic import ValidationError

    try:
        _reader(cls).validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = ".".join(map(shown_name, first["loc"]))
        if first["type"] == "missing":
            return f"{path}: is missing"
        ours = first.get("ctx", {}).get("otherwise")
        if ours:
            return f"{path}: {shown(first['input'])} {ours}"
        reason = f" ({first['msg']})" if first["msg"] else ""
        return f"{path}: {shown(first['input'])} does not fit{reason}"
    return ""


@functools.cache
def _reader(cls: type) -> "TypeAdapter[Any]":
    from pydantic import ConfigDict, TypeAdapter, with_config

    # a later version may add keys
    return TypeAdapter(with_config(ConfigDict(extra="ignore", strict=True))(cls))

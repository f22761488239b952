"""Parquet files with one row per image, typed for `datasets` of Hugging Face.

Columns are `stem`, `image_id`, `width`, `height`, `image` and `scene` (the scene file); the members
of a sample in tar files with `_` for `.`, as in `damage_png`; and for each task with COCO
annotations a column of labels: lists of boxes, categories from 0, areas, and flags of crowds.
"""

import contextlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO

from fastgen.config.config import Config
from fastgen.errors import OutputError
from fastgen.formats import coco
from fastgen.formats.archives import Made, by_split, drained, members
from fastgen.formats.format import Files, Format

if TYPE_CHECKING:
    import pyarrow.parquet as pq

_ROWS = 100
"""Rows per row group, so that readers of single rows need not load hundreds of images."""

_COMPRESSION = "zstd"

_RENAMED = {"jpg": "image", "json": "scene"}


def parquet_files(
    made: Sequence[Made], shard: int, formats: Sequence[Format], config: Config
) -> Files:
    """Pack samples into one Parquet file for each split that occurs.

    Args:
        made: The samples.
        shard: Number of the shard, which names the files.
        formats: Formats that the samples have.
        config: Configuration of the dataset, which decides the list of classes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    tasks = {each.name: each.coco_task(config) for each in formats}
    packed: Files = {}
    for split, chosen in by_split(made):
        rows = [_row(sample, tasks) for sample in chosen]
        features = _features(rows[0], tasks)
        schema = pa.schema(
            [pa.field(name, _arrow(feature)) for name, feature in features.items()],
            {"huggingface": json.dumps({"info": {"features": features}})},
        )
        buffer = io.BytesIO()
        table = pa.Table.from_pylist(rows, schema)
        pq.write_table(table, buffer, row_group_size=_ROWS, compression=_COMPRESSION)
        packed[f"{split}-{shard:06d}.parquet"] = buffer.getvalue()
    return packed


@contextlib.contextmanager
def opened_table(stream: BinaryIO) -> Iterator["pq.ParquetFile"]:
    """Open a Parquet file for the length of a block.

    Raises:
        OutputError: pyarrow is not installed.
        ValueError: The file is not as `parquet_files` made it.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise OutputError(
            "parquet: reading this dataset needs pyarrow: pip install 'fastgen[parquet]'"
        ) from None
    try:
        yield pq.ParquetFile(stream)
    except (pa.ArrowException, AttributeError, KeyError, OSError, TypeError) as error:
        raise ValueError(f"is not as fastgen writes it ({error})") from None


def renamed_table(stream: BinaryIO, rename: Callable[[str], str], by: int) -> Iterator[bytes]:
    """Yield a Parquet file with other names in pieces, so that memory holds one row group.

    Args:
        stream: A file that `parquet_files` made.
        rename: Returns the new form of a text that may contain names of images.
        by: Added to each `image_id`.

    Raises:
        ValueError: The file is not such a file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    with opened_table(stream) as old:
        with pq.ParquetWriter(buffer, old.schema_arrow, compression=_COMPRESSION) as new:
            for group in range(old.num_row_groups):
                rows = [_texts(row, rename) for row in old.read_row_group(group).to_pylist()]
                for row in rows:
                    row["image_id"] += by
                new.write_table(pa.Table.from_pylist(rows, old.schema_arrow))
                yield drained(buffer)
        yield drained(buffer)


def _texts(value: Any, rename: Callable[[str], str]) -> Any:
    """Return a value of a row with its texts in their new form."""
    if isinstance(value, str):
        return rename(value)
    if isinstance(value, dict):
        return {key: _texts(each, rename) for key, each in value.items()}
    return value


def _row(sample: Made, tasks: Mapping[str, coco.Task | None]) -> dict[str, Any]:
    _, record = sample
    stem, (width, height) = record["stem"], record["size"]
    row = {"stem": stem, "image_id": record["number"], "width": width, "height": height}
    for extension, content in members(sample):
        picture = extension.endswith(("jpg", "png"))
        name = _RENAMED.get(extension, extension.replace(".", "_"))
        row[name] = (
            {"bytes": content, "path": f"{stem}.{extension}"} if picture else content.decode()
        )
    for name, task in tasks.items():
        if task is not None:
            row[name] = coco.columns(record["facts"][name], task)
    return row


def _features(row: Mapping[str, Any], tasks: Mapping[str, coco.Task | None]) -> dict[str, Any]:
    """Return the features of all columns in the JSON form of `datasets`."""
    whole, text, number = (
        {"dtype": dtype, "_type": "Value"} for dtype in ("int64", "string", "float64")
    )
    features: dict[str, Any] = {}
    for name, value in row.items():
        task = tasks.get(name)
        if task is not None:
            classes = [each["name"] for each in task.categories[: task.usual]]
            more = {key: text if empty == "" else _list(number) for key, empty in task.more}
            labels: dict[str, Any] = {
                "bbox": _list(number),
                "category": {"names": classes, "_type": "ClassLabel"},
                "area": whole,
                "iscrowd": {"dtype": "bool", "_type": "Value"},
                **more,
            }
            features[name] = {key: _list(each) for key, each in labels.items()}
        elif isinstance(value, dict):
            features[name] = {"_type": "Image"}
        else:
            features[name] = whole if isinstance(value, int) else text
    return features


def _list(feature: dict[str, Any]) -> dict[str, Any]:
    return {"feature": feature, "_type": "Sequence"}


def _arrow(feature: dict[str, Any]) -> Any:
    """Return the Arrow type in which `datasets` stores a feature."""
    import pyarrow as pa

    match feature.get("_type"):
        case "Sequence":
            return pa.list_(_arrow(feature["feature"]))
        case "ClassLabel":
            return pa.int64()
        case "Image":
            return pa.struct({"bytes": pa.binary(), "path": pa.string()})
        case "Value":
            return pa.type_for_alias(feature["dtype"])
        case _:
            return pa.struct([(key, _arrow(each)) for key, each in feature.items()])

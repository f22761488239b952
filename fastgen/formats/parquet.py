"""Parquet files with one row per image, typed for `datasets` of Hugging Face.

Columns are `stem`, `image_id`, `width`, `height`, `image` and `scene` (the scene file); the members
of a sample in tar files with `_` for `.`, as in `damage_png`; and for each task with COCO
annotations a column of labels: lists of boxes, categories from 0, areas, and flags of crowds.
"""

import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

from fastgen.config.config import Config
from fastgen.formats import coco
from fastgen.formats.archives import Made, by_split, members
from fastgen.formats.format import Files, Format

_ROWS = 100
"""Rows per row group, so that readers of single rows need not load hundreds of images."""

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
        pq.write_table(table, buffer, row_group_size=_ROWS, compression="zstd")
        packed[f"{split}-{shard:06d}.parquet"] = buffer.getvalue()
    return packed


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

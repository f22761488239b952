"""JSON Schema of configuration files, by which editors complete and check them."""

import typing
from typing import Any

from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from fastgen.config.calibration import SHORTHANDS
from fastgen.config.commented_yaml import meanings
from fastgen.config.config import PRESET_KEY, Config
from fastgen.validation import Bounds, adapter, annotation


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of configuration files.

    All keys are optional, because a file inherits what it leaves out. Limits that involve several
    values, such as a range whose lowest value is above its highest, are not part of it.
    """
    schema = adapter(Config).json_schema(schema_generator=_Generator)
    start = {
        "type": "string",
        "description": "Preset to start from, or the path of another file, relative to this one.",
    }
    schema["properties"] = {PRESET_KEY: start, **schema["properties"]}
    schema["$defs"]["CameraConfig"]["properties"] |= SHORTHANDS
    return {"$schema": _Generator.schema_dialect, **schema, "title": "fastgen configuration"}


class _Generator(GenerateJsonSchema):
    """pydantic's generator, with descriptions from docstrings and without required keys."""

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> dict[str, Any]:
        """Add the descriptions of a dataclass and of its fields."""
        made = super().dataclass_schema(schema)
        about, words = meanings(schema["cls"])
        hints = typing.get_type_hints(schema["cls"], include_extras=True)
        for name, field in made["properties"].items():
            bounds = annotation(Bounds, hints[name])
            unit = f"Unit: {bounds.unit}." if bounds and bounds.unit else ""
            field.pop("title", None)
            field["description"] = f"{words.get(name, '')} {unit}".strip()
            if not field["description"]:
                del field["description"]
        return {**made, "description": about}

    def dict_schema(self, schema: core_schema.DictSchema) -> dict[str, Any]:
        """Refuse keys that do not match the pattern of the keys."""
        made = super().dict_schema(schema)
        return {**made, "additionalProperties": False} if "patternProperties" in made else made

    def field_is_required(self, *_: Any, **__: Any) -> bool:
        """Return False for every field."""
        return False

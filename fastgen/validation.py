"""Validation of user input: of single arguments, and of whole dataclasses with pydantic.

The type of a dataclass field declares its limits, for example `Annotated[Range, Bounds(0, 1)]` or
`Annotated[str, OneOf(FACES)]`. pydantic enforces these types; the YAML comments and the JSON Schema
of configurations show them. `validation_messages` translates pydantic's errors to ConfigError.

Importing pydantic takes about 0.1 s. The first validation does it, not the import of this module.
"""

import dataclasses
import functools
import numbers
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np

from fastgen.errors import ConfigError, nearest, shown
from fastgen.validation_messages import NUMBER, PAIR, in_words, is_number

if typing.TYPE_CHECKING:
    from pydantic import TypeAdapter
    from pydantic_core import CoreSchema

T = TypeVar("T")

FOLDER = "folder"
"""Key of the folder of relative paths in the context of pydantic's validators."""


class Range(NamedTuple):
    """A closed interval that a value is drawn from, uniformly unless documented otherwise."""

    lo: float
    hi: float

    def draw(self, rng: np.random.Generator) -> float:
        """Return a uniformly distributed value of the interval."""
        return float(rng.uniform(self.lo, self.hi))


class Bounds(NamedTuple):
    """Closed interval of a number, and its unit.

    It annotates `float`, `int`, `Range` or `tuple[int, int]`. The latter two must be ordered, and
    one number stands for both values.
    """

    lo: float
    hi: float
    unit: str = ""

    @property
    def words(self) -> str:
        """The interval in words, for example '0.5 to 2 mm'."""
        return f"{self.lo:g} to {self.hi:g} {self.unit}".rstrip()

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        if source is float or source is int:
            return self._number_schema(source)
        make, kind = (Range._make, float) if source is Range else (tuple, int)
        number = self._number_schema(kind)
        pair = core_schema.tagged_union_schema(
            {NUMBER: number, PAIR: core_schema.tuple_schema([number, number])},
            lambda value: NUMBER if is_number(value) else PAIR,
        )
        return core_schema.no_info_after_validator_function(
            functools.partial(self._ordered, make), pair
        )

    def _number_schema(self, kind: type) -> "CoreSchema":
        from pydantic_core import core_schema

        if kind is int:
            whole_number = core_schema.int_schema(ge=int(self.lo), le=int(self.hi))
            schema = core_schema.no_info_before_validator_function(_integral, whole_number)
            return _refusing("number", schema, bounds=self)
        number = core_schema.float_schema(strict=True, allow_inf_nan=False, ge=self.lo, le=self.hi)
        return _refusing("number", number, bounds=self)

    def _ordered(self, make: Callable[..., Any], pair: Any) -> Any:
        lo, hi = pair if isinstance(pair, tuple) else (pair, pair)
        if lo > hi:
            from pydantic_core import PydanticCustomError

            full_turn = self.unit == "degrees" and lo - 360 >= self.lo
            instead = f", or write [{lo - 360:g}, {hi:g}]" if full_turn else ""
            words = f"the lowest value {lo:g} is above the highest {hi:g}; swap them{instead}"
            raise PydanticCustomError("words", "{words}", {"words": words})
        # -0.0 becomes 0.0: a range from 0.0 down to -0.0 cannot be drawn
        return make((lo + 0, hi + 0))


class OneOf(NamedTuple):
    """Allowed values of a text field."""

    choices: tuple[str, ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        literal = core_schema.literal_schema(list(self.choices))
        return _refusing("choice", literal, choices=self.choices)


class Matching(NamedTuple):
    """Regular expression of a text field, and the end of the message about other text."""

    pattern: str
    otherwise: str

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        text = core_schema.str_schema(pattern=f"^(?:{self.pattern})$", strict=True)
        return _refusing("text", text, otherwise=self.otherwise)


class _Strict:
    """Accepts only booleans, Python's and NumPy's; pydantic would convert 1 to True."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> "CoreSchema":
        from pydantic_core import core_schema

        strict = typing.cast("CoreSchema", {**handler(source), "strict": True})
        return core_schema.no_info_before_validator_function(
            lambda value: bool(value) if isinstance(value, np.bool_) else value, strict
        )


def _refusing(kind: str, schema: "CoreSchema", **context: Any) -> "CoreSchema":
    """Return a schema whose errors have type `kind` and the `context` for `in_words`."""
    from pydantic_core import core_schema

    return core_schema.custom_error_schema(
        schema, kind, custom_error_message="", custom_error_context=context
    )


UNIT = Bounds(0.0, 1.0)
"""Bounds of shares, probabilities and colors."""

LENGTH = Bounds(0.0, 20000.0, "mm")
"""Bounds of lengths on a container, with room to spare."""

Flag = Annotated[bool, _Strict()]
Share = Annotated[float, UNIT]


def check_known(name: str, value: Any, choices: Collection[str]) -> None:
    """Raise ConfigError, starting with `name`, unless `value` is one of `choices`."""
    if not isinstance(value, str) or value not in choices:
        raise ConfigError(f"{name}: {shown(value)} is unknown{nearest(value, choices)}")


def check_weights(
    name: str, weights: Iterable[float], hint: str = "give at least one above 0"
) -> None:
    """Raise ConfigError, starting with `name`, if no weight is above 0; `hint`: what to do."""
    if sum(weights) <= 0:
        raise ConfigError(f"{name}: all weights are 0; {hint}")


def check_distinct(name: str, values: Collection[str], hint: str) -> None:
    """Raise ConfigError, starting with `name`, if a value is repeated; `hint`: what to do."""
    if len(set(values)) < len(values):
        raise ConfigError(f"{name}: a value is given twice; {hint}")


def whole(name: str, value: Any, least: int = 0, most: int = 2**63 - 1) -> int:
    """Return `value` as an int if it is a whole number of `least` to `most`, of any numeric type.

    Raises:
        ConfigError: otherwise; the message starts with `name`.
    """
    value = value.item() if isinstance(value, np.generic) else value  # float16 ends at 65504
    numeric = is_number(value)
    if numeric and least <= value <= most and value == int(value):
        return int(value)
    too_large = numeric and value > most
    wanted = f"{least} to {most}" if too_large or most < 2**63 - 1 else f"{least} or more"
    raise ConfigError(f"{name}: {shown(value)} is not a whole number of {wanted}")


def flag(name: str, value: Any) -> bool:
    """Return a boolean of Python or NumPy as a bool.

    Raises:
        ConfigError: `value` is not a boolean. The message starts with `name`.
    """
    if not isinstance(value, bool | np.bool_):
        raise ConfigError(f"{name}: expected true or false, got {shown(value)}")
    return bool(value)


def to_plain(value: Any) -> Any:
    """Return dataclasses, tuples and mappings as the dicts, lists and scalars of JSON and YAML."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(item) for item in value]
    return value


def from_plain(
    cls: type[T], data: Any, path: str = "", base: T | None = None, folder: Path | None = None
) -> T:
    """Return an instance of dataclass `cls`, validated.

    Args:
        cls: Dataclass whose field types declare their limits.
        data: Mapping from field names to plain values, nested like `cls`; or an instance of `cls`.
        path: Prefix of field names in error messages, for example 'scene'.
        base: Values of the fields that `data` leaves out, at any depth. A `dict` field is replaced
            as a whole, but a dataclass in it takes from the base's entry of the same name what it
            leaves out. Without a base, the defaults of `cls` apply.
        folder: Folder that paths of files are relative to; None for the working directory.

    Raises:
        ConfigError: naming the field, the value and what to give instead.
    """
    try:
        values = _over(base, data)
    except RecursionError:  # a value contains itself, so no field accepts it
        values = data
    made: T = _validated(cls, values, path, strict=None, folder=folder, base=base)
    return made


def check_fields(value: Any, cls: type[T], path: str) -> T:
    """Return a copy of an instance of `cls` whose fields fit their types.

    Numbers and texts of other types, such as NumPy's, are Python's in the copy. Unlike `from_plain`
    this converts nothing else: a list is not accepted as a tuple.

    Raises:
        ConfigError: naming the field that does not fit.
    """
    copy: T = _validated(cls, value, path, strict=True)
    return copy


def annotation(kind: type[T], hint: Any) -> T | None:
    """Return the first annotation of class `kind` in a type, or in the types inside it."""
    for note in getattr(hint, "__metadata__", ()):
        if isinstance(note, kind):
            return note
    inner = (annotation(kind, part) for part in typing.get_args(hint))
    return next((found for found in inner if found is not None), None)


def _over(base: Any, new: Any) -> Any:
    """Return `new` with what it inherits from `base`, and without NumPy's types."""
    if isinstance(new, (np.generic, np.ndarray)):
        return new.tolist()
    if isinstance(new, list):
        return [_over(None, item) for item in new]
    if not isinstance(new, Mapping):
        return new
    inherited = vars(base) if dataclasses.is_dataclass(base) else {}
    old = base if isinstance(base, Mapping) else inherited
    # YAML reads the name 20 as a number. Names like no or ~ become other types and are refused.
    named = {
        str(key) if is_number(key) else key: _over(old.get(key), item) for key, item in new.items()
    }
    return {**inherited, **named}


def _integral(value: Any) -> Any:
    """Refuse text and booleans, which pydantic would convert, and convert NumPy's integers."""
    if isinstance(value, (bool, str, bytes)):
        raise ValueError
    return int(value) if isinstance(value, numbers.Integral) else value


@functools.cache
def adapter(cls: type) -> "TypeAdapter[Any]":
    """Return pydantic's validator of a dataclass; nested dataclasses share its settings."""
    from pydantic import ConfigDict, TypeAdapter, with_config

    settings = ConfigDict(extra="forbid", revalidate_instances="always")
    return TypeAdapter(with_config(settings)(cls))


def _validated(
    cls: type,
    value: Any,
    path: str,
    strict: bool | None,
    folder: Path | None = None,
    base: Any = None,
) -> Any:
    from pydantic import ValidationError

    try:
        context = {FOLDER: folder or Path()}
        return adapter(cls).validate_python(value, strict=strict, context=context)
    except ValidationError as error:
        raise in_words(cls, error.errors(include_url=False), path, base) from None

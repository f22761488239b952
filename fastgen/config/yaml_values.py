"""Reading and writing of YAML and JSON text, with corrections to PyYAML."""

import re
import reprlib
from typing import Any

import yaml

_JSON_FLOATS: tuple[str, re.Pattern[str], list[str]] = (
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)
"""Arguments of add_implicit_resolver that make PyYAML read 1e-05 as a number."""


def loaded(text: str) -> Any:
    """Return the value of a YAML or JSON text.

    Raises:
        yaml.YAMLError: naming the line and column of the mistake.
        ValueError, RecursionError: from PyYAML itself, for example for an invalid date.
    """
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        bare = re.search(r"[\[{,:]\s*(#[0-9a-fA-F]{6})\b", text)
        hint = f"; put colors in quotes, as in '{bare[1]}'" if bare else ""
        raise yaml.YAMLError(_in_words(error) + hint) from None


def _in_words(error: yaml.YAMLError) -> str:
    """Return PyYAML's message with line and column, but without file name and excerpt."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return str(error).replace('in "<unicode string>", ', "at ")
    said = ((error.context, error.context_mark), (error.problem, error.problem_mark))
    return ": ".join(
        f"{words} (line {mark.line + 1}, column {mark.column + 1})" if mark else words
        for words, mark in said
        if words
    )


class _Loader(yaml.SafeLoader):
    """YAML loader that is stricter than PyYAML's, following YAML 1.2.2, 3.2.1.1 and 10.3.2.

    It reads all JSON numbers, also 1e-05, which is text in YAML 1.1. It refuses octal and base-60
    numbers, which users rarely intend. It refuses repeated keys, where PyYAML ignores the first.
    """

    def construct_number(self, node: yaml.ScalarNode) -> float:
        whole = node.tag.endswith(":int")
        try:
            number = self.construct_yaml_int(node) if whole else self.construct_yaml_float(node)
        except (ArithmeticError, IndexError, ValueError):
            words = f"{reprlib.repr(node.value)} is not a number"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark) from None
        if number and (":" in node.value or (whole and re.match(r"[-+]?0[0-9_]", node.value))):
            words = (
                f"YAML reads {reprlib.repr(node.value)} as {reprlib.repr(number)}; write that, or "
                "put it in quotes as a text"
            )
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark)
        return number

    def construct_scalar(self, node: yaml.ScalarNode | yaml.MappingNode) -> Any:
        text = super().construct_scalar(node)
        try:  # PyYAML does not join the surrogate pairs of JSON (RFC 8259, section 7)
            return str(text).encode("utf-16", "surrogatepass").decode("utf-16")
        except UnicodeDecodeError:
            words = "a text contains half of a surrogate pair"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark) from None

    def compose_mapping_node(self, anchor: dict[Any, Any]) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            number = key.tag.endswith((":int", ":float"))
            name = str(self.construct_object(key)) if number else key.value  # 0x8 is 8
            if name in seen:
                words = f"the key {name!r} is given twice in one mapping"
                raise yaml.composer.ComposerError(None, None, words, key.start_mark)
            seen.add(name)
        return node


class Dumper(yaml.SafeDumper):
    """YAML dumper that quotes text which `loaded` would read as a number."""


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_number)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_number)
_Loader.add_implicit_resolver(*_JSON_FLOATS)
Dumper.add_implicit_resolver(*_JSON_FLOATS)

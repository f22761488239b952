"""Reading and writing of YAML and JSON text, with corrections to PyYAML."""

import re
from pathlib import Path
from typing import Any

import yaml

from fastgen.errors import ConfigError, shown
from fastgen.files.plain_file import read_plain

LONGEST_FILE = 512 << 10
"""Most bytes of a file. PyYAML reads about 100 kB per second, and a whole configuration has 40 kB.
"""

_MOST_VALUES = 200_000
"""Most values of a file after each alias is replaced by the values that it repeats."""

_LONGEST_NUMBER = 1000
"""Most characters of a number. Base-60 numbers take quadratic time to read."""

_JSON_FLOATS: tuple[str, re.Pattern[str], list[str]] = (
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)
"""Arguments of add_implicit_resolver that make PyYAML read 1e-05 as a number."""


def loaded_file(path: str | Path) -> Any:
    """Return the value of a YAML or JSON file.

    Raises:
        ConfigError: naming the file, and the line and column of a mistake.
    """
    try:
        data = read_plain(Path(path), LONGEST_FILE)
    except (OSError, TypeError, ValueError) as error:  # ValueError: a null character
        words = error.strerror if isinstance(error, OSError) else "give a path"
        raise ConfigError(f"{path}: cannot be read ({words})") from None
    try:
        return loaded(data.decode("utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a YAML file ({error})") from None


def loaded(text: str) -> Any:
    """Return the value of a YAML or JSON text.

    Raises:
        yaml.YAMLError: naming the line and column of the mistake.
    """
    try:
        loader = _Loader(text)
        try:
            return loader.get_single_data()
        except RecursionError:
            mark = loader.get_mark()
            raise yaml.MarkedYAMLError(None, None, "values are nested too deeply", mark) from None
        except (ArithmeticError, ValueError):  # of PyYAML's scanner
            words = "a character or version number is out of range"
            raise yaml.MarkedYAMLError(None, None, words, loader.get_mark()) from None
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
    It refuses texts that take much longer to read than usual for their length.
    """

    def get_single_node(self) -> yaml.Node | None:
        node: yaml.Node | None = super().get_single_node()
        if node is not None and _count(node, {}) > _MOST_VALUES:
            words = f"aliases repeat more than {_MOST_VALUES} values"
            raise yaml.composer.ComposerError(None, None, words, node.start_mark)
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (yaml.YAMLError, RecursionError):
            raise
        except Exception:  # PyYAML's own types, such as !!bool and !!timestamp
            words = f"{shown(node.value)} is not of the type {node.tag.rpartition(':')[2]}"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark) from None

    def construct_number(self, node: yaml.ScalarNode) -> float:
        whole = node.tag.endswith(":int")
        if len(node.value) > _LONGEST_NUMBER:
            words = f"{shown(node.value)} has more characters than a number may, {_LONGEST_NUMBER}"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark)
        try:
            number = self.construct_yaml_int(node) if whole else self.construct_yaml_float(node)
        except (ArithmeticError, IndexError, ValueError):
            words = f"{shown(node.value)} is not a number"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark) from None
        if number and (":" in node.value or (whole and re.match(r"[-+]?0[0-9_]", node.value))):
            words = (
                f"YAML reads {shown(node.value)} as {shown(number)}; write that, or "
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


def _count(node: yaml.Node, counts: dict[int, int]) -> int:
    """Return the number of values in a node if each alias stands for all values it repeats.

    `counts` caches results by the id of the node. A node that contains itself counts once.
    """
    if id(node) not in counts:
        counts[id(node)] = 1
        children = node.value if isinstance(node, yaml.CollectionNode) else ()
        for child in children:
            for each in child if isinstance(child, tuple) else (child,):
                counts[id(node)] += _count(each, counts)
    return counts[id(node)]


class Dumper(yaml.SafeDumper):
    """YAML dumper that quotes text which `loaded` would read as a number."""


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_number)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_number)
_Loader.add_implicit_resolver(*_JSON_FLOATS)
Dumper.add_implicit_resolver(*_JSON_FLOATS)

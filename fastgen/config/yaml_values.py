"""YAML as people and other programs write it, JSON among it: what PyYAML leaves undone."""

import re
import reprlib
from typing import Any

import yaml

_JSON_FLOATS: tuple[str, re.Pattern[str], list[str]] = (
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)
"""Arguments of add_implicit_resolver, by which PyYAML takes 1e-05 for a number."""


def loaded(text: str) -> Any:
    """The value of a YAML or JSON text. Raises yaml.YAMLError that says where, and ValueError or
    RecursionError for what PyYAML itself stumbles over."""
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        bare = re.search(r"[\[{,:]\s*(#[0-9a-fA-F]{6})\b", text)
        hint = f"; put colors in quotes, as in '{bare[1]}'" if bare else ""
        raise yaml.YAMLError(_in_words(error) + hint) from None


def _in_words(error: yaml.YAMLError) -> str:
    """What PyYAML says, with line and column, but without a name and an excerpt of the text."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return str(error).replace('in "<unicode string>", ', "at ")
    said = ((error.context, error.context_mark), (error.problem, error.problem_mark))
    return ": ".join(
        f"{words} (line {mark.line + 1}, column {mark.column + 1})" if mark else words
        for words, mark in said
        if words
    )


class _Loader(yaml.SafeLoader):
    """Takes numbers as JSON writes them, 1e-05 too, which YAML 1.1 has for text; refuses those that
    YAML 1.1 counts by eights or sixties, which people mean otherwise, and a key that stands twice,
    of which PyYAML would drop the first without a word (YAML 1.2.2, sections 10.3.2 and 3.2.1.1).
    """

    def construct_number(self, node: yaml.ScalarNode) -> float:
        whole = node.tag.endswith(":int")
        try:
            number = self.construct_yaml_int(node) if whole else self.construct_yaml_float(node)
        except (ArithmeticError, IndexError, ValueError):
            words = f"{reprlib.repr(node.value)} is no number"
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
        try:  # JSON escapes some letters as two halves (RFC 8259, section 7), which PyYAML keeps
            return str(text).encode("utf-16", "surrogatepass").decode("utf-16")
        except UnicodeDecodeError:
            words = "a text holds half of a letter"
            raise yaml.constructor.ConstructorError(None, None, words, node.start_mark) from None

    def compose_mapping_node(self, anchor: dict[Any, Any]) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            number = key.tag.endswith((":int", ":float"))
            name = str(self.construct_object(key)) if number else key.value  # 0x8 is 8
            if name in seen:
                words = f"the key {name!r} stands twice in one mapping"
                raise yaml.composer.ComposerError(None, None, words, key.start_mark)
            seen.add(name)
        return node


class Dumper(yaml.SafeDumper):
    """Quotes text that `loaded` would take for a number."""


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_number)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_number)
_Loader.add_implicit_resolver(*_JSON_FLOATS)
Dumper.add_implicit_resolver(*_JSON_FLOATS)

"""The structure that docs/architecture.md describes, checked on the source text."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import fastgen

ROOT = Path(fastgen.__file__).parent
MODULES = {path.relative_to(ROOT).with_suffix("").parts: path for path in ROOT.rglob("*.py")}
MOST_PARAMETERS = 7


def package_of(parts):
    """Return a module's package, or the module itself for a module outside of all packages."""
    return parts[0] if (ROOT / parts[0]).is_dir() else f"{parts[0]}.py"


def imports_of(path):
    """Yield the dotted names that a module imports, at its top or inside functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{name.name}" for name in node.names)
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def package_imports():
    """Return the packages that each package imports."""
    found = {}
    for parts, path in MODULES.items():
        ours = found.setdefault(package_of(parts), set())
        for name in imports_of(path):
            first, *rest = name.split(".")
            if first == "fastgen" and rest and not rest[0].startswith("__"):
                other = rest[0] if (ROOT / rest[0]).is_dir() else f"{rest[0]}.py"
                if (ROOT / other).exists() and other != package_of(parts):
                    ours.add(other)
    # the package's own names are loaded lazily, so that the command starts quickly
    found.pop("__init__.py")
    return found


def test_no_two_packages_import_each_other():
    order = list(TopologicalSorter(package_imports()).static_order())  # raises on a cycle
    assert order.index("scene") < order.index("geometry") < order.index("render")
    assert order.index("render") < order.index("dataset") < order.index("cli")


def test_only_the_renderer_uses_opengl():
    users = {
        parts[0]
        for parts, path in MODULES.items()
        for name in imports_of(path)
        if name.split(".")[0] in ("moderngl", "OpenGL", "glcontext")
    }
    assert users == {"render"}


@pytest.mark.parametrize("parts", sorted(MODULES), ids=".".join)
def test_no_parameter_list_is_longer_than_seven(parts):
    long = [
        node.name
        for node in ast.walk(ast.parse(MODULES[parts].read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and parameters(node) > MOST_PARAMETERS
    ]
    assert not long


def parameters(function):
    arguments = function.args
    names = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return sum(name.arg not in ("self", "cls") for name in names)

"""Paths of the bundled shaders and assets, in the wheel or in the source tree."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

from fastgen.errors import AssetError


@cache
def _folder(name: str) -> Path:
    # a wheel has the folder as package fastgen.NAME; a checkout has it beside the package
    spec = find_spec(f"fastgen.{name}")
    packaged = list(spec.submodule_search_locations or ()) if spec else []
    for folder in (*map(Path, packaged), Path(__file__).resolve().parent.parent / name):
        if folder.is_dir():
            return folder
    raise AssetError(f"the folder {name} of fastgen is missing; reinstall fastgen")


def _inside(folder: Path, parts: tuple[str, ...]) -> Path:
    path = folder.joinpath(*parts)
    if path.exists():
        return path
    if path.is_relative_to(folder):
        raise AssetError(f"{path}: missing from this copy of fastgen; reinstall it")
    raise AssetError(f"{path}: is missing; list it in the package data of its package")


def asset_path(*parts: str) -> Path:
    """Return the path of a bundled asset, for example `asset_path("hdri", "index.json")`.

    Raises:
        AssetError: if it does not exist.
    """
    return _inside(_folder("assets"), parts)


def shader_path(*parts: str) -> Path:
    """Return the path of a bundled shader file, or of one of a package by its absolute path.

    Raises:
        AssetError: if it does not exist.
    """
    return _inside(_folder("shaders"), parts)

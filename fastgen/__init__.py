"""fastgen: exactly labelled synthetic images of shipping containers, rasterized fast."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastgen.config.config import Config
    from fastgen.errors import FastgenError
    from fastgen.generator import Generator

__all__ = ["Config", "FastgenError", "Generator"]
__version__ = "0.23.0"

_HOMES = {"Config": "config", "FastgenError": "errors", "Generator": "generator"}


def __getattr__(name: str) -> Any:
    """The public names, imported when they are first asked for (PEP 562).

    The command has to hear Ctrl-C before numpy, OpenCV and SciPy load, which takes a second.
    """
    if name not in _HOMES:
        raise AttributeError(f"module 'fastgen' has no attribute {name!r}")
    from importlib import import_module

    value = globals()[name] = getattr(import_module(f"fastgen.{_HOMES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""fastgen: exactly labelled synthetic images of shipping containers, rasterized fast."""

from fastgen.config import Config
from fastgen.errors import FastgenError
from fastgen.generator import Generator

__all__ = ["Config", "FastgenError", "Generator"]
__version__ = "0.1.0"

"""Configuration: the distributions that scenes are drawn from.

`config.Config` holds everything; the other modules describe its parts, read and write YAML, and
make the JSON Schema. Nothing here samples or renders.
"""

from fastgen.config.config import Config

__all__ = ["Config"]

"""Configuration: the distributions that scenes are drawn from.

`config.Config` holds everything; the other modules describe its parts. A file changes single values
of a preset. Nothing here draws or renders.
"""

from fastgen.config.config import Config

__all__ = ["Config"]

"""Imports and tables that all workers share, loaded in the process that workers are forked from.

Nothing here depends on environment variables or opens OpenGL.
"""

import gc

from fastgen.config.config import Config
from fastgen.dataset import shards as shards
from fastgen.decals.glyphs import glyph_tiles
from fastgen.validation import adapter

adapter(Config)
glyph_tiles()
gc.freeze()  # otherwise the garbage collector writes to pages that workers share

"""What every worker needs, loaded once in the server process that workers are forked from.

Nothing here depends on environment variables or opens OpenGL.
"""

import gc

from fastgen.config.config import Config
from fastgen.dataset import shards as shards
from fastgen.decals.glyphs import glyph_tiles
from fastgen.validation import adapter

adapter(Config)
glyph_tiles()
gc.freeze()  # the collector would write to the shared pages of these objects

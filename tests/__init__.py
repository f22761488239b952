"""Tests of fastgen.

llvmpipe gets no threads of its own here: pytest-xdist already runs one process per core, and
without threads a forked process can use the contexts that its parent opened.
"""

import os

os.environ.setdefault("LP_NUM_THREADS", "0")

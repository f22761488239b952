"""Tests. llvmpipe gets no threads of its own: pytest runs a process a core, and a fork may then use
what its parent opened."""

import os

os.environ.setdefault("LP_NUM_THREADS", "0")

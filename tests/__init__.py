"""Tests of fastgen.

pytest-xdist already runs one process per core, so libraries get no threads of their own here.
Threads that wait for work would spin on the cores of the other processes. Without threads in
llvmpipe, a forked process can also use the contexts that its parent opened.
"""

import os

os.environ.setdefault("LP_NUM_THREADS", "0")
os.environ.setdefault("OMP_NUM_THREADS", "1")  # PyTorch and OpenBLAS

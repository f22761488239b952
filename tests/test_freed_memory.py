"""Freed memory between blocks in use is returned to the system."""

import subprocess
import sys

PROGRAM = """
from fastgen.dataset.freed_memory import return_freed_memory

def resident_kb():
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))

before = resident_kb()
blocks = [bytes([1]) * 20_000 for _ in range(4_000)]  # too small for glibc to map each on its own
held = resident_kb()
kept = blocks[::50]  # so that the freed memory is not only at the end of the heap
del blocks
return_freed_memory()
print(held - before, resident_kb() - before, sum(map(len, kept)))
"""


KEEPING = """
import resource
import numpy as np
from fastgen.dataset.freed_memory import keep_freed_memory

keep_freed_memory()
for _ in range(100):
    np.ones(1_000_000, np.float32)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(1_000_000, np.float32)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_arrays_of_the_next_image_take_the_pages_of_the_last_one() -> None:
    out = subprocess.run([sys.executable, "-c", KEEPING], capture_output=True, check=True)
    assert int(out.stdout) < 100  # of a thousand


def test_pages_between_blocks_in_use_are_returned() -> None:
    out = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, check=True)
    held, left, kept = map(int, out.stdout.split())
    assert held > 70_000
    assert left < held / 5
    assert kept == 80 * 20_000

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


FAULTS = """
import ctypes
import resource
import sys
import numpy as np
from fastgen.dataset.freed_memory import keep_freed_memory

ctypes.CDLL(None).prctl(41, 1, 0, 0, 0)  # no huge pages, each of which takes a single fault
if "keep" in sys.argv:
    keep_freed_memory()
for _ in range(10):  # 30 MB at once, as for one image: more than glibc keeps by default
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    held = [np.ones(750_000, np.float32) for _ in range(10)]
    del held
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(*arguments: str) -> int:
    """Return the page faults of the last of several images."""
    command = [sys.executable, "-c", FAULTS, *arguments]
    return int(subprocess.run(command, capture_output=True, check=True).stdout)


def test_arrays_of_the_next_image_take_the_pages_of_the_last_one() -> None:
    assert faults("keep") < 100
    assert faults() > 5_000  # of 7,300 pages


def test_pages_between_blocks_in_use_are_returned() -> None:
    out = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, check=True)
    held, left, kept = map(int, out.stdout.split())
    assert held > 70_000
    assert left < held / 5
    assert kept == 80 * 20_000

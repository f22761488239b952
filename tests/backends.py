"""The backends that tests draw with: those that there can be on this system."""

import re
import subprocess
import sys
from ctypes.util import find_library

import pytest


def _possible() -> tuple[str, ...]:
    """Both, where OSMesa is missing but could be installed too: tests fail there, as they should.
    Mesa gave it up with 25.1."""
    if find_library("OSMesa") is None:
        command = [sys.executable, "-m", "fastgen", "doctor"]
        words = subprocess.run(command, capture_output=True, text=True, check=False).stdout
        mesa = re.search(r"Mesa (\d+)\.(\d+)", words)
        if mesa and tuple(map(int, mesa.groups())) >= (25, 1):
            return ("egl",)
    return ("egl", "osmesa")


BACKENDS = _possible()

needs_osmesa = pytest.mark.skipif("osmesa" not in BACKENDS, reason="this Mesa has no OSMesa")

"""GL backends that the tests can use on this system."""

import re
import subprocess
import sys
from ctypes.util import find_library

import pytest


def _possible() -> tuple[str, ...]:
    """Return both backends unless Mesa is 25.1 or later, which has no OSMesa.

    On an older Mesa a missing OSMesa could be installed, so its tests run and fail.
    """
    if find_library("OSMesa") is None:
        command = [sys.executable, "-m", "fastgen", "doctor"]
        words = subprocess.run(command, capture_output=True, text=True, check=False).stdout
        mesa = re.search(r"Mesa (\d+)\.(\d+)", words)
        if mesa and tuple(map(int, mesa.groups())) >= (25, 1):
            return ("egl",)
    return ("egl", "osmesa")


BACKENDS = _possible()

needs_osmesa = pytest.mark.skipif("osmesa" not in BACKENDS, reason="this Mesa has no OSMesa")

"""Guard of tests against files that block or never end."""

import resource
from pathlib import Path

import pytest

from tests.stability.special_files import not_waiting

_SPARE_BYTES = 4 << 30
"""Memory that a test may take in addition; reading without end fails before the machine is full."""


@pytest.fixture
def guarded():
    """End a test that waits, and refuse memory to one that reads without end."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + _SPARE_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    with not_waiting():
        yield
    resource.setrlimit(resource.RLIMIT_AS, before)

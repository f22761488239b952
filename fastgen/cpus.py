"""Number of CPUs that this process may use, by its affinity and by the quotas of its cgroups."""

import contextlib
import math
import os
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

_PROCESS = Path("/proc/self")


def usable_cpus() -> int:
    """Return the number of CPUs that this process can keep busy, 1 or more.

    A container with `docker run --cpus 2` sees all CPUs of its machine, but may use only the time
    of two. A quota of 1.5 CPUs counts as 2.
    """
    return max(math.ceil(min(len(os.sched_getaffinity(0)), cpu_quota())), 1)


def cpu_quota(process: Path = _PROCESS) -> float:
    """Return the smallest quota of the cgroups around a process, in CPUs; infinity without one.

    A group is limited by its own quota and by those of all groups that contain it; see cgroups(7),
    and cgroup-v2 and sched-bwc in the documentation of Linux.

    Args:
        process: Folder of the process in /proc.
    """
    quotas = [
        quota
        for mount, group in _mounted_groups(process)
        for folder in (group, *group.parents)
        if folder.is_relative_to(mount)
        for quota in (_quota_v2(folder), _quota_v1(folder))
    ]
    return min(quotas, default=math.inf)


def _mounted_groups(process: Path) -> Iterator[tuple[Path, Path]]:
    """Yield mount point and folder of each cgroup of a process that can limit its CPUs."""
    try:
        groups = (process / "cgroup").read_text().splitlines()
        mounts = (process / "mountinfo").read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return
    paths = {}
    for line in groups:  # hierarchy:controllers:path, and 0::path for version 2
        _, controllers, path = line.split(":", 2)
        if not controllers or "cpu" in controllers.split(","):
            paths["cgroup" if controllers else "cgroup2"] = path
    for line in mounts:
        before, _, after = line.partition(" - ")
        root, place = (_unescaped(field) for field in before.split(" ")[3:5])
        kind, _, options = after.split(" ", 2)
        is_for_cpus = kind == "cgroup2" or (kind == "cgroup" and "cpu" in options.split(","))
        if is_for_cpus and kind in paths:
            inside = PurePosixPath(paths[kind])
            # in a container the path may be that of the host, whose groups are not mounted
            below = inside.relative_to(root) if inside.is_relative_to(root) else PurePosixPath()
            yield Path(place), Path(place) / below


def _unescaped(field: str) -> str:
    """Return a field of mountinfo, which has spaces and line ends as octal numbers."""
    return re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), field)


def _quota_v2(folder: Path) -> float:
    with contextlib.suppress(OSError, ValueError):
        quota, period = (folder / "cpu.max").read_text().split()
        if quota != "max" and int(quota) > 0 and int(period) > 0:
            return int(quota) / int(period)
    return math.inf


def _quota_v1(folder: Path) -> float:
    with contextlib.suppress(OSError, ValueError):
        quota = int((folder / "cpu.cfs_quota_us").read_text())
        period = int((folder / "cpu.cfs_period_us").read_text())
        if quota > 0 and period > 0:  # -1 stands for no limit
            return quota / period
    return math.inf

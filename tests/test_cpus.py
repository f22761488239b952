"""The number of CPUs under quotas of cgroups, in trees of files like those of Linux."""

import math
import os

import pytest

from fastgen import cpus
from fastgen.cpus import cpu_quota, usable_cpus
from fastgen.dataset.generate import default_workers


class Machine:
    """A process, its mounts and its groups in a folder."""

    def __init__(self, folder):
        self.folder = folder
        self.process = folder / "proc"
        self.process.mkdir()
        self.mounts, self.groups = ["23 28 0:21 / /proc rw - proc proc rw"], ["1:name=systemd:/"]

    def mount(self, kind, name, root="/", options="rw"):
        """Mount the part of a hierarchy below `root`; return the folder."""
        place = self.folder / name
        place.mkdir(parents=True)
        shown = str(place).replace(" ", "\\040")
        self.mounts.append(f"30 23 0:26 {root} {shown} rw,nosuid shared:4 - {kind} none {options}")
        return place

    def quota(self):
        (self.process / "mountinfo").write_text("\n".join(self.mounts) + "\n")
        (self.process / "cgroup").write_text("\n".join(self.groups) + "\n")
        return cpu_quota(self.process)


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


def limit(group, quota, period=100_000, version=2):
    group.mkdir(parents=True, exist_ok=True)
    if version == 2:
        (group / "cpu.max").write_text(f"{quota} {period}\n")
    else:
        (group / "cpu.cfs_quota_us").write_text(f"{quota}\n")
        (group / "cpu.cfs_period_us").write_text(f"{period}\n")


def test_the_smallest_quota_around_a_nested_group_counts(machine):
    top = machine.mount("cgroup2", "sys fs/cgroup")
    machine.groups.append("0::/pod/container/job")
    limit(top / "pod", 250_000)
    limit(top / "pod/container", "max")
    limit(top / "pod/container/job", 800_000)
    limit(top / "pod/other", 50_000)
    assert machine.quota() == 2.5
    limit(top / "pod/container", 60_000, 40_000)
    assert machine.quota() == 1.5


def test_quotas_of_version_1_count(machine):
    machine.mount("cgroup", "memory", options="rw,memory")
    limit(machine.folder / "memory/docker/abc", 1000, version=1)
    top = machine.mount("cgroup", "cpu,cpuacct", options="rw,cpu,cpuacct")
    machine.groups += ["4:memory:/docker/abc", "3:cpu,cpuacct:/docker/abc", "0::/docker/abc"]
    limit(top, -1, version=1)
    limit(top / "docker", -1, version=1)
    limit(top / "docker/abc", 300_000, version=1)
    assert machine.quota() == 3
    limit(top / "docker", 100_000, 50_000, version=1)
    assert machine.quota() == 2


def test_both_versions_may_be_mounted_at_once(machine):
    first = machine.mount("cgroup", "cpu", options="rw,cpu")
    second = machine.mount("cgroup2", "unified")
    machine.groups += ["1:cpu:/a", "0::/b"]
    limit(first / "a", 300_000, version=1)
    limit(second / "b", 200_000)
    assert machine.quota() == 2
    limit(second / "b", 400_000)
    assert machine.quota() == 3


@pytest.mark.parametrize("group", ["/docker/abc", "/", "/../../elsewhere", "/docker/abc/inner"])
def test_a_container_sees_its_own_group_as_the_root(machine, group):
    top = machine.mount("cgroup2", "cgroup", root="/docker/abc")
    machine.groups.append(f"0::{group}")
    limit(top, 200_000)
    assert machine.quota() == 2


@pytest.mark.parametrize(
    "content", ["", "max 100000", "0 100000", "-1 100000", "many 5", "5", "200000 0", "\0\0"]
)
def test_files_without_a_quota_are_no_limit(machine, content):
    top = machine.mount("cgroup2", "cgroup")
    machine.groups.append("0::/")
    (top / "cpu.max").write_text(content)
    (top / "cpu.cfs_quota_us").write_text(content)
    assert machine.quota() == math.inf


def test_a_machine_without_cgroups_has_no_limit(machine, tmp_path):
    assert cpu_quota(tmp_path / "none") == math.inf
    assert machine.quota() == math.inf
    machine.groups.append("0::/a")
    assert machine.quota() == math.inf


@pytest.mark.parametrize(
    ("quota", "affine", "wanted"),
    [
        (math.inf, 4, 4),
        (2.0, 4, 2),
        (1.5, 4, 2),
        (0.1, 4, 1),
        (8.0, 4, 4),
        (3.0, 1, 1),
    ],
)
def test_affinity_and_quota_both_limit_the_workers(monkeypatch, quota, affine, wanted):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(affine)))
    monkeypatch.setattr(cpus, "cpu_quota", lambda: quota)
    assert usable_cpus() == default_workers() == wanted

"""Runs on a two-node Ray cluster: same bytes as without Ray, even when nodes or actors die."""

import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import ray
from ray.cluster_utils import Cluster

from fastgen.cli.main import main
from fastgen.config.config import Config
from fastgen.dataset.generate import generate, run_here
from fastgen.dataset.job import Job
from fastgen.dataset.on_ray import run_on_ray
from fastgen.errors import OutputError
from fastgen.render.settings import RenderSettings
from tests.crash_run import FAULTY_SCENE, QuickMaker
from tests.folders import content
from tests.interruptible import interruptible
from tests.ray_makers import (
    HANG_S,
    HANGING_SCENE,
    BrokenMaker,
    FaultyMaker,
    LocatedMaker,
    PreparingMaker,
)

ROOT = str(Path(__file__).parent.parent)
SCENES = 24
NODE = {"num_cpus": 1, "object_store_memory": 80 * 2**20, "include_dashboard": False}


def job_at(out, scenes):
    config = Config.preset()
    return Job(str(out), scenes, config, 1, ("A",), RenderSettings((64, 64)), shard_scenes=2)


@pytest.fixture(scope="module")
def cluster():
    """Cluster of a head node and one more node, one CPU each, which this process has joined."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_AUTH_TOKEN", secrets.token_hex(32))
        # the nodes' processes must import the makers and the fastgen under test
        patch.setenv("PYTHONPATH", ROOT, prepend=os.pathsep)
        made = Cluster(initialize_head=True, head_node_args=NODE)
        made.add_node(**NODE)
        ray.init(address=made.address)
        yield made
        ray.shutdown()
        made.shutdown()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Output folder of an undisturbed run without Ray."""
    out = tmp_path_factory.mktemp("whole") / "out"
    generate(job_at(out, SCENES), 2, run_here(2, maker=QuickMaker))
    return out


def test_a_node_killed_in_mid_run_changes_no_byte(cluster, whole, tmp_path):
    out = tmp_path / "out"
    victim = cluster.add_node(**NODE)
    cluster.wait_for_nodes()
    seen = []

    def run(job, tasks, on_report):
        def hear(kind, value):
            if kind == "made on":
                seen.append(value)
            else:
                on_report(kind, value)

        run_on_ray(None, maker=LocatedMaker)(job, tasks, hear)

    def kill():
        while [node for node, _ in seen].count(victim.node_id) < 2:
            time.sleep(0.01)
        # a dying machine takes its actors along, but they outlive a killed raylet for a while
        (pid,) = {pid for node, pid in seen if node == victim.node_id}
        # recorded first: on a busy machine the run may end before the node is removed
        seen.append(("killed", pid))
        os.kill(pid, signal.SIGKILL)
        cluster.remove_node(victim, allow_graceful=False)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    generate(job_at(out, SCENES), 1, run)
    killer.join(timeout=10)
    nodes = [node for node, _ in seen]
    after = nodes[nodes.index("killed") + 1 :]
    assert set(after) - {victim.node_id}  # other nodes continued
    assert not victim.any_processes_alive()
    assert content(out) == content(whole)


def test_only_scenes_that_kill_or_hang_their_actors_are_given_up(cluster, whole, tmp_path):
    out = tmp_path / "out"
    runner = run_on_ray(None, 2, hang_s=HANG_S, maker=FaultyMaker)
    made = generate(job_at(out, SCENES), 2, runner)
    failed = {each["scene"]: each["error"] for each in made["failed"]}
    assert failed.keys() == {FAULTY_SCENE, HANGING_SCENE}
    assert "died" in failed[FAULTY_SCENE]
    assert "no sign of life" in failed[HANGING_SCENE]
    assert sum(split["images"] for split in made["counts"].values()) == SCENES - 2
    assert content(out / "images").items() <= content(whole / "images").items()


def test_a_slow_start_that_reports_progress_is_not_given_up(cluster, tmp_path):
    runner = run_on_ray(None, 2, hang_s=HANG_S, maker=PreparingMaker)
    made = generate(job_at(tmp_path / "out", 4), 2, runner)
    assert not made["failed"]
    assert sum(split["images"] for split in made["counts"].values()) == 4


def test_an_actors_error_reaches_the_caller_in_its_own_words(cluster, tmp_path):
    with pytest.raises(OutputError, match=r"node .*: .*No space left on device"):
        generate(job_at(tmp_path / "out", 8), 2, run_on_ray(None, maker=BrokenMaker))


def test_an_output_that_other_nodes_cannot_see_is_named(cluster):
    # fsspec's memory:// belongs to one process
    with pytest.raises(OutputError, match=r"node .*memory://unseen.* all nodes share"):
        generate(job_at("memory://unseen", 8), 2, run_on_ray(None))


def test_rendered_images_equal_a_run_without_ray(cluster, tmp_path):
    arguments = ["--images", "6", "--size", "64x64", "--seed", "3", "--shard", "1"]
    assert main(["generate", str(tmp_path / "here"), *arguments, "--workers", "1"]) == 0
    # the path is relative to the driver's folder; actors have their own working folders
    command = [sys.executable, "-m", "fastgen", "generate", "there", *arguments]
    subprocess.run([*command, "--ray", cluster.address], cwd=tmp_path, check=True)
    assert len(list((tmp_path / "there").glob("images/*/*.jpg"))) == 6
    assert content(tmp_path / "there") == content(tmp_path / "here")


WITHOUT_RENDERING = """
import runpy
from functools import partial
from fastgen.cli import dataset_commands
from tests.ray_makers import SlowMaker

dataset_commands.run_on_ray = partial(dataset_commands.run_on_ray, maker=SlowMaker)
runpy.run_module("fastgen", run_name="__main__", alter_sys=True)
"""


def run_alone(out, *more):
    command = [sys.executable, "-c", WITHOUT_RENDERING, "generate", str(out), "--images", "400"]
    return interruptible(
        [*command, "--size", "64x64", *more], stderr=subprocess.PIPE, start_new_session=True
    )


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_ray_and_the_folder_is_left_clean(cluster, tmp_path, stop):
    """SIGTERM ends the Ray that the run started; SIGINT a run on the cluster."""
    out = tmp_path / "out"
    where = ["--ray"] if stop == signal.SIGTERM else ["--ray", cluster.address]
    process = run_alone(out, *where, "--workers", "1", "--shard", "1")
    while not list(out.glob("shards/*.json")) and process.poll() is None:
        time.sleep(0.05)
    # Ctrl-C reaches the whole process group, docker signals only the first process
    (os.killpg if stop == signal.SIGINT else os.kill)(process.pid, stop)
    error = process.communicate(timeout=120)[1]
    assert process.returncode == 128 + stop
    assert "fastgen: stopped; run the same command again to go on" in error
    assert "KeyboardInterrupt" not in error
    assert not [p for p in out.iterdir() if p.name.startswith(".")]


@pytest.mark.parametrize("address", ["127.0.0.1:{free}", "head", "ray://head:1", "head:port"])
def test_an_address_without_a_cluster_is_named(address, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    with socket.socket() as unheard:
        unheard.bind(("127.0.0.1", 0))
        named = address.format(free=unheard.getsockname()[1])
        arguments = ["--images", "2", "--size", "64x64", "--ray", named]
        assert main(["generate", str(tmp_path / "out"), *arguments]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith(f"fastgen: --ray {named}: ")


def test_without_ray_one_line_says_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["generate", str(tmp_path / "out"), "--images", "2", "--ray"]) == 2
    assert "pip install 'fastgen[ray]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()

"""The comparison with other renderers: they get fastgen's scene, and failures are reported."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

sys.path.insert(0, str(Path(__file__).parent.parent / "bench" / "peer_renderers"))

import growth
import measure
import peer_jobs
import peers

from fastgen import Config, Generator


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    """A job of one scene, and fastgen's id images of its two views."""
    folder = tmp_path_factory.mktemp("job")
    with Generator(Config.preset(), seed=7, size=(320, 240)) as generator:
        truths = peer_jobs.write_jobs(generator, [0], ["A", "Cr"], 1, folder)
    return measure.read_job(folder), truths


def test_markers_of_the_glb_project_onto_their_pixels(job):
    found, truths = job
    (scene,) = found.scenes
    parts = trimesh.load_scene(scene.glb, process=False).geometry
    width, height = found.size
    gaps = []
    for shot, (_, camera, ids) in zip(scene.shots, truths, strict=True):
        assert shot.camera == camera
        to_camera = np.linalg.inv(shot.pose_y_up)
        for number in shot.markers:
            rows, columns = np.nonzero(ids == number)
            points = trimesh.transform_points(parts[f"marker_{number}"].vertices, to_camera)
            x = width / 2 + shot.focal_px * points[:, 0] / -points[:, 2]
            y = height / 2 - shot.focal_px * points[:, 1] / -points[:, 2]
            for drawn, seen in ((x, columns + 0.5), (y, rows + 0.5)):
                gaps += [seen.min() - drawn.min(), drawn.max() - seen.max()]
    assert len(gaps) >= 16
    assert min(gaps) > -0.5  # no marker pixel lies outside the marker's mesh
    assert np.median(gaps) < 1  # most markers are seen whole; a rod covers some


def test_every_labelled_object_has_its_own_node(job):
    found, _ = job
    (scene,) = found.scenes
    names = trimesh.load_scene(scene.glb, process=False).geometry.keys()
    numbers = [measure.object_id(name) for name in names]
    assert len(set(numbers)) == len(numbers)
    assert {measure.CONTAINER_ID, *scene.shots[0].markers, *scene.shots[1].markers} <= set(numbers)


def test_painted_ids_are_read_back_from_rounded_colors():
    colors = measure.id_colors(list(range(1, 61)))
    assert len({*colors.values(), (0, 0, 0)}) == 61
    ids = np.arange(61).reshape(1, -1)
    pixels = np.array([[(0, 0, 0), *colors.values()]], np.int64)
    noisy = np.clip(pixels + np.resize([-2, 2, 1], pixels.shape), 0, 255).astype(np.uint8)
    assert (measure.nearest_id(noisy, colors) == ids).all()


def test_a_peer_that_is_not_installed_is_listed_with_the_install_command(tmp_path, capsys):
    absent = peers.Peer("absent", "with_pyrender.py", environment="no such environment")
    result = peers.run(absent, tmp_path, tmp_path / "out")
    peers.show({"absent": result})
    assert "not measured: not installed: python bench/peers.py --install" in capsys.readouterr().out


def test_a_failing_script_is_listed_with_its_error(tmp_path):
    broken = peers.Peer("broken", "with_fastgen.py", ("draft",))
    assert "job.json" in peers.run(broken, tmp_path, tmp_path / "out")["failed"]


def test_a_steady_run_shows_no_drift():
    counts = [float(n) for n in range(100, 2100, 100)]
    table = {"images": counts, "seconds": [n / 20 for n in counts], "resident_mb": [500.0] * 20}
    words = growth.drift(table)
    assert "first tenth 20.00/s, last tenth 20.00/s" in words
    assert "from image 100 to 2000: +0.00%" in words

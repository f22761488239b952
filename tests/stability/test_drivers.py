"""Labels and images do not depend on the backend, the number of threads or the vectors' width."""

import os
import subprocess
import sys

import numpy as np

from fastgen import Config, Generator
from tests.backends import BACKENDS

DAMAGED = {"damage": {"probability": 1.0}, "environment": {"names": ["sky"]}}

DRAW = "from tests.stability.test_drivers import draw; import sys; draw(*sys.argv[1:])"


def draw(path, backend):
    """Write image, ids, damage and depth of one view, drawn by this process's driver."""
    config = Config.from_values(DAMAGED)
    with Generator(config, seed=7, size=(200, 160), quality="draft", backend=backend) as generator:
        sample = generator.render(1, camera="Cr")
    np.savez(path, image=sample.image, ids=sample.ids, damage=sample.damage, depth=sample.depth)


def drawn(path, backend, **variables):
    words = [sys.executable, "-c", DRAW, str(path), backend]
    subprocess.run(words, check=True, env=dict(os.environ, **variables))
    with np.load(path) as file:
        return dict(file)


def test_another_backend_with_threads_and_narrow_vectors_draws_the_same(tmp_path):
    """OSMesa, two threads and vectors of 128 bits at once, against EGL, no thread and the CPU's own
    width."""
    usual = drawn(tmp_path / "usual.npz", "egl", LP_NUM_THREADS="0")
    # Mesa's cache ignores the width: programs compiled for wider vectors would write out of bounds
    narrow = {"LP_NATIVE_VECTOR_WIDTH": "128", "MESA_SHADER_CACHE_DIR": str(tmp_path)}
    other = drawn(tmp_path / "other.npz", BACKENDS[-1], LP_NUM_THREADS="2", **narrow)
    assert np.unique(usual["ids"]).size > 3
    assert (usual["damage"] > 200).any()
    for name in ("ids", "damage"):
        np.testing.assert_array_equal(other[name], usual[name])
    np.testing.assert_allclose(other["depth"], usual["depth"], rtol=1e-6)
    difference = np.abs(other["image"].astype(int) - usual["image"])
    assert difference.max() <= 1

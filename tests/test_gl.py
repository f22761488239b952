"""Contexts: both backends draw what geometry says, are released whole, and work in processes."""

import multiprocessing
import os

import numpy as np
import pytest

from fastgen import doctor, gl
from fastgen.errors import ConfigError, ContextError

BACKENDS = ("egl", "osmesa")

VERTEX = "#version 430\nin vec2 p; void main() { gl_Position = vec4(p, 0.0, 1.0); }"
FRAGMENT = "#version 430\nout uint id; void main() { id = 7u; }"


def triangle(backend):
    """uint32 [32, 48] with 7 inside the triangle (4, 4), (44, 4), (4, 28), row 0 at the bottom."""
    with gl.open_context(backend) as context:
        ctx = context.ctx
        program = ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        corners = np.array([[4, 4], [44, 4], [4, 28]]) / (24, 16) - 1
        array = ctx.vertex_array(program, [(ctx.buffer(corners.astype("f4").tobytes()), "2f", "p")])
        target = ctx.texture((48, 32), 1, data=bytes(48 * 32 * 4), dtype="u4")
        ctx.framebuffer([target]).use()
        array.render()
        return np.frombuffer(target.read(), np.uint32).reshape(32, 48)


def expected():
    x, y = np.meshgrid(np.arange(48) + 0.5, np.arange(32) + 0.5)
    return ((x > 4) & (y > 4) & ((x - 4) / 40 + (y - 4) / 24 < 1)) * 7


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_triangle_covers_the_pixel_centres_inside_it(backend):
    np.testing.assert_array_equal(triangle(backend), expected())


def test_backends_can_take_turns_in_one_process():
    for backend in ("egl", "osmesa", "egl", "osmesa"):
        np.testing.assert_array_equal(triangle(backend), expected())


def _resident_mb():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def _cycles(backend, count):
    for _ in range(count):
        gl.open_context(backend).release()


@pytest.mark.parametrize("backend", BACKENDS)
def test_500_contexts_leave_nothing_behind(backend):
    _cycles(backend, 60)  # what the driver keeps once
    memory, files = _resident_mb(), len(os.listdir("/proc/self/fd"))
    _cycles(backend, 500)
    assert len(os.listdir("/proc/self/fd")) <= files
    # a context holds several megabytes while it lives; a leaked one would add over a gigabyte
    assert _resident_mb() - memory < 30


def test_contexts_work_in_spawned_processes():
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for image in pool.map(triangle, BACKENDS):
            np.testing.assert_array_equal(image, expected())


def test_unknown_backends_are_named_with_the_choices():
    with pytest.raises(ConfigError, match="backend: 'elg' is unknown"):
        gl.open_context("elg")


def test_without_libraries_the_error_names_the_packages(monkeypatch):
    def missing(name, *_):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(gl.ctypes, "CDLL", missing)
    with pytest.raises(ContextError, match=r"apt-get install libegl1.*apt-get install libosmesa6"):
        gl.open_context("auto")


def test_doctor_tells_of_both_backends():
    words, works = doctor.report()
    assert works
    assert "egl device 0" in words
    assert "osmesa" in words
    assert "llvmpipe" in words

"""GL contexts: both backends draw correctly, are released completely, and work in processes."""

import itertools
import multiprocessing
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from fastgen.errors import ConfigError, ContextError
from fastgen.render import doctor, gl
from fastgen.render.contexts import driver_variables
from fastgen.render.contexts.egl import EGL_PACKAGES, EglDevice
from tests.backends import BACKENDS, needs_osmesa

PAIRS = tuple(itertools.product(BACKENDS, repeat=2))

VERTEX = "#version 430\nin vec2 p; void main() { gl_Position = vec4(p, 0.0, 1.0); }"
FRAGMENT = "#version 430\nout uint id; void main() { id = 7u; }"


def triangle(backend):
    """Draw 7 inside the triangle (4, 4), (44, 4), (4, 28).

    Returns uint32 [32, 48] with row 0 at the bottom.
    """
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


@pytest.mark.parametrize("pair", PAIRS)
def test_contexts_open_at_the_same_time_keep_their_own_objects(pair):
    with gl.open_context(pair[0]) as first, gl.open_context(pair[1]) as second:
        owned = []
        for content, context in ((b"1111", first), (b"2222", second)):
            context.make_current()
            owned.append((context, context.ctx.buffer(content), content))
        # one context holding both buffers would have given them different names
        assert owned[0][1].glo == owned[1][1].glo
        for context, buffer, content in owned * 2:
            context.make_current()
            assert buffer.read() == content


@pytest.mark.parametrize("pair", PAIRS)
def test_releasing_one_context_does_not_affect_the_current_one(pair):
    first = gl.open_context(pair[0])
    with gl.open_context(pair[1]) as second:
        buffer = second.ctx.buffer(b"2222")
        first.release()
        assert buffer.read() == b"2222"
        second.make_current()
        assert buffer.read() == b"2222"


@pytest.mark.parametrize("backend", BACKENDS)
def test_using_a_released_context_is_an_error(backend):
    context = gl.open_context(backend)
    context.release()
    context.release()
    with pytest.raises(ContextError, match=f"{backend}: the context was released"):
        context.make_current()


def _resident_mb():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def _cycles(backend, count):
    for _ in range(count):
        gl.open_context(backend).release()


@pytest.mark.parametrize("backend", BACKENDS)
def test_500_contexts_leave_nothing_behind(backend):
    _cycles(backend, 60)  # memory that the driver allocates once
    memory, files = _resident_mb(), len(os.listdir("/proc/self/fd"))
    _cycles(backend, 500)
    assert len(os.listdir("/proc/self/fd")) <= files
    # a context uses at least 0.4 MB, so leaking 500 would add at least 200 MB; the allocator's own
    # variation is a few MB
    assert _resident_mb() - memory < 30


def test_contexts_work_in_spawned_processes():
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for image in pool.map(triangle, BACKENDS):
            np.testing.assert_array_equal(image, expected())


def _send(connection, work, *arguments):
    try:
        connection.send(work(*arguments))
    except ContextError as error:
        connection.send(str(error))


def in_fork(work, *arguments):
    """Return the result of `work` in a forked child, or its ContextError's text; fail on a hang."""
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe()
    child = fork.Process(target=_send, args=(theirs, work, *arguments))
    child.start()
    answered = ours.poll(20)
    if not answered:
        child.kill()
    child.join()
    assert answered, "the child hangs"
    return ours.recv()


def parent_and_child(backend, wanted, threads):
    """Return a triangle drawn here, in a forked child with backend `wanted`, and here again."""
    os.environ["LP_NUM_THREADS"] = threads
    here = triangle(backend)
    child = in_fork(triangle, wanted)
    return here, child, triangle(backend)


FORKS = (
    ("egl", "egl", "2"),
    ("egl", "osmesa", "2"),
    ("osmesa", "auto", "2"),
    ("osmesa", "osmesa", "0"),  # without threads a fork loses nothing
)


@pytest.mark.parametrize(
    ("backend", "wanted", "threads"),
    [case for case in FORKS if {*case[:2]} <= {*BACKENDS, "auto"}],
)
def test_a_child_forked_from_a_process_with_a_context_draws(backend, wanted, threads):
    for image in spawned(parent_and_child, backend, wanted, threads):
        np.testing.assert_array_equal(image, expected())


@needs_osmesa
def test_a_forked_child_that_cannot_open_a_display_says_so():
    _, words, _ = spawned(parent_and_child, "osmesa", "osmesa", "2")
    assert "osmesa: was opened before this process was forked" in words
    assert "spawn or forkserver" in words


def spawned(work, *arguments):
    """Return the result of `work` in a fresh process, which may start children."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, *arguments).result()


def test_hardware_is_tried_first_and_software_is_the_fallback(monkeypatch):
    (software,) = (device for device in gl.egl_devices() if device.software)
    broken = EglDevice(handle=64, software=False)
    tried = []
    create = gl.Egl.create
    monkeypatch.setattr(gl.Egl, "devices", lambda _: [software, broken])
    monkeypatch.setattr(
        gl.Egl, "create", lambda egl, device: tried.append(device) or create(egl, device)
    )
    gl.open_context("egl").release()
    assert tried == [broken, software]
    with pytest.raises(ContextError, match="device 1: eglGetPlatformDisplayEXT failed"):
        gl.open_context("egl", device_index=1)


def test_surfaceless_egl_is_used_if_no_device_is_listed(monkeypatch):
    monkeypatch.setattr(gl.Egl, "devices", lambda _: [])
    np.testing.assert_array_equal(triangle("egl"), expected())


def test_unknown_backends_are_named_with_the_choices():
    with pytest.raises(ConfigError, match=r"backend: 'elg' is unknown \(did you mean egl"):
        gl.open_context("elg")


@pytest.mark.parametrize("index", [-1, 99])
def test_a_device_that_does_not_exist_is_named_and_not_replaced(index):
    with pytest.raises(ContextError, match=f"there is no device {index} among") as caught:
        gl.open_context("auto", device_index=index)
    assert "osmesa" not in str(caught.value)


def test_a_device_for_osmesa_is_refused():
    with pytest.raises(ConfigError, match="device_index: 0: osmesa has no devices"):
        gl.open_context("osmesa", device_index=0)


def test_without_libraries_the_error_names_the_packages(monkeypatch):
    def missing(name, *_):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(gl.ctypes, "CDLL", missing)
    pattern = (
        r"egl: libEGL\.so\.1: cannot open.* apt-get install libegl1 .*"
        r"osmesa: libOSMesa\.so\.8: cannot open.* apt-get install libosmesa6 \(Mesa 25\.1"
    )
    with pytest.raises(ContextError, match=pattern):
        gl.open_context("auto")


def test_doctor_reports_on_both_backends():
    words, works = doctor.report()
    assert works
    egl, osmesa = (
        next(line for line in words.splitlines() if line[6:].startswith(name))
        for name in ("egl device 0", "osmesa")
    )
    works_here = "^ok .*llvmpipe"
    assert re.search(works_here, egl)
    missing = "^FAIL .*libosmesa6 .*Mesa 25.1 and later have no OSMesa"
    assert re.search(works_here if "osmesa" in BACKENDS else missing, osmesa)


@pytest.fixture
def plain_environment(monkeypatch):
    """An environment without variables that change the driver."""
    for name in driver_variables._NAMES:
        monkeypatch.delenv(name, raising=False)


CHANGES = {
    "an old version": {"MESA_GL_VERSION_OVERRIDE": "4.1"},
    "an old language": {"MESA_GLSL_VERSION_OVERRIDE": "130"},
    "a new version with an old language": {
        "MESA_GL_VERSION_OVERRIDE": "4.5",
        "MESA_GLSL_VERSION_OVERRIDE": "330",
    },
    "no extension": {"MESA_EXTENSION_OVERRIDE": "-GL_ARB_clear_texture"},
    "no driver": {"GALLIUM_DRIVER": "none"},
    "an old driver": {"GALLIUM_DRIVER": "softpipe"},
    "no folder of EGL": {"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"},
    "no file of EGL": {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"},
    "no folder of drivers": {"LIBGL_DRIVERS_PATH": "/nonexistent"},
}
"""Variables that make the installed driver of EGL fail."""


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_variables_that_change_the_driver_are_named(plain_environment, monkeypatch, changes):
    for name, value in changes.items():
        monkeypatch.setenv(name, value)
    egl, *_, osmesa = doctor.diagnose()
    assert not egl.works
    for finding in (egl, osmesa):
        if not finding.works and "libosmesa6" not in finding.words:
            for name, value in changes.items():
                assert f"{name}='{value}'" in finding.words
            assert f"unset {'them' if len(changes) > 1 else 'it'}" in finding.words
            assert "apt-get" not in finding.words
            assert "update" not in finding.words


@pytest.mark.parametrize("backend", ["auto", "osmesa"])
@pytest.mark.parametrize(
    "name", ["MESA_GL_VERSION_OVERRIDE", "MESA_GLSL_VERSION_OVERRIDE", "GALLIUM_DRIVER"]
)
def test_such_variables_do_not_end_the_process(name, backend, tmp_path):
    """OSMesa crashes with unknown drivers and old languages, and nothing is printed."""
    values = {"MESA_GL_VERSION_OVERRIDE": "3.0", "MESA_GLSL_VERSION_OVERRIDE": "130"}
    environment = {**os.environ, name: values.get(name, "none")}
    command = [sys.executable, "-m", "fastgen", "show", "--index", "0", "--size", "64x64"]
    command += ["--backend", backend, "-o", str(tmp_path / "x.png")]
    done = subprocess.run(command, env=environment, capture_output=True, check=False, text=True)
    assert done.returncode == 2
    assert re.search(f"^fastgen: .*{name}=.* in the environment", done.stderr, re.MULTILINE)


def test_a_variable_that_does_no_harm_is_not_named(plain_environment, monkeypatch):
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
    monkeypatch.setenv("EGL_PLATFORM", "")
    words, works = doctor.report()
    assert works
    assert "LIBGL_ALWAYS_SOFTWARE" not in words
    assert driver_variables.advice("x") == (
        "LIBGL_ALWAYS_SOFTWARE='1' in the environment changes the driver; unset it"
    )


def test_the_packages_are_named_if_egl_finds_no_driver(plain_environment, monkeypatch):
    def none(*_):
        raise ContextError("eglInitialize failed: EGL_NOT_INITIALIZED")

    monkeypatch.setattr(gl.Egl, "create", none)
    with pytest.raises(ContextError, match=f"apt-get install {EGL_PACKAGES}"):
        gl.open_context("egl")


def three_devices():
    return ["egl device 0", "egl device 1", "egl device 2"]


def bad_driver(backend, index):
    """Crash on device 0, hang on device 1 and work on device 2; OSMesa is missing."""
    if index == 0:
        os.abort()
    if index == 1:
        time.sleep(60)
    if backend == "osmesa":
        raise ContextError("osmesa: none here")
    return "a renderer"


def test_doctor_continues_after_crashes_and_hangs(monkeypatch):
    monkeypatch.setattr(doctor, "_egl_device_names", three_devices)
    monkeypatch.setattr(doctor, "_renderer", bad_driver)
    monkeypatch.setattr(doctor, "_TIMEOUT_S", 1.0)
    assert doctor.diagnose() == [
        doctor.Finding("egl device 0", False, "the driver crashed (SIGABRT)"),
        doctor.Finding("egl device 1", False, "no answer within 1 s: the driver hangs"),
        doctor.Finding("egl device 2", True, "a renderer"),
        doctor.Finding("osmesa", False, "osmesa: none here"),
    ]

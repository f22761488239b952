"""Frames for CUDA: GL runs on the driver of this machine, CUDA on a fake libcuda."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from fastgen import Config, Generator
from fastgen.errors import ConfigError, ContextError
from fastgen.render import cuda

SIZE = (101, 67)  # no row of any target is a multiple of 8 bytes
CONFIG = Config.from_values({"damage": {"probability": 1}})
NAMES = {
    1: b"CUDA_ERROR_INVALID_VALUE",
    100: b"CUDA_ERROR_NO_DEVICE",
    201: b"CUDA_ERROR_INVALID_CONTEXT",
    208: b"CUDA_ERROR_ALREADY_MAPPED",
    211: b"CUDA_ERROR_NOT_MAPPED",
    304: b"CUDA_ERROR_OPERATING_SYSTEM",
}
"""Some CUresult values of cuda.h."""

CONTEXT, DEVICE, FIRST_RESOURCE = 0x5EED_0000_1234, 5, 0x7F00_0000_0000


class FakeDriver:
    """Fake libcuda.so.1 with the functions that fastgen calls, and their rules.

    A call that breaks a rule returns the error code in the CUDA driver reference. Mapping a GL
    buffer copies it to the host, and the host address replaces the GPU address.

    Attributes:
        calls: Names of the functions called, in order.
        fails: Names of functions that return error 304.
        devices: CUDA devices of the GL context.
    """

    def __init__(self, gl):
        self.calls, self.fails, self.devices = [], set(), [DEVICE]
        self.retained, self.pushed, self.buffers, self.mapped = 0, 0, {}, {}
        types = ctypes.c_uint, ctypes.c_ssize_t, ctypes.c_ssize_t, ctypes.c_void_p
        self._read_buffer = gl.function("glGetNamedBufferSubData", None, *types)
        size = ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p
        self._buffer_value = gl.function("glGetNamedBufferParameteriv", None, *size)

    def __getattr__(self, name):
        work = getattr(type(self), f"_{name}", None)
        if work is None:
            raise AttributeError(name)

        def call(*arguments):
            self.calls.append(name)
            return 304 if name in self.fails else work(self, *arguments)

        return call

    def _cuInit(self, flags):
        return 0 if flags.value == 0 else 1

    def _cuGetErrorName(self, code, text):
        text._obj.value = NAMES[code.value]
        return 0

    def _cuGLGetDevices_v2(self, count, devices, room, which):
        assert (room.value, which.value) == (1, 1)
        count._obj.value = len(self.devices)
        devices._obj.value = next(iter(self.devices), -1)
        return 0

    def _cuDevicePrimaryCtxRetain(self, context, device):
        assert device.value == DEVICE
        context._obj.value = CONTEXT
        self.retained += 1
        return 0

    def _cuDevicePrimaryCtxRelease_v2(self, device):
        assert device.value == DEVICE
        assert not self.pushed
        self.retained -= 1
        return 0

    def _cuCtxPushCurrent_v2(self, context):
        if not self.retained or context.value != CONTEXT:
            return 201
        self.pushed += 1
        return 0

    def _cuCtxPopCurrent_v2(self, context):
        context._obj.value = CONTEXT
        self.pushed -= 1
        return 0

    def _cuGraphicsGLRegisterBuffer(self, resource, buffer, flags):
        if not self.pushed:
            return 201
        assert flags.value == 0
        resource._obj.value = FIRST_RESOURCE + buffer.value
        self.buffers[resource._obj.value] = buffer.value
        return 0

    def _cuGraphicsMapResources(self, count, resources, stream):
        if not self.pushed:
            return 201
        assert stream is None
        assert count.value == len(resources) == len(set(resources))
        for resource in resources:
            if resource in self.mapped:
                return 208
            size = ctypes.c_int()
            self._buffer_value(self.buffers[resource], 0x8764, ctypes.byref(size))  # GL_BUFFER_SIZE
            memory = ctypes.create_string_buffer(size.value)
            self._read_buffer(self.buffers[resource], 0, size.value, memory)
            self.mapped[resource] = memory
        return 0

    def _cuGraphicsResourceGetMappedPointer_v2(self, pointer, size, resource):
        if resource.value not in self.mapped:
            return 211
        memory = self.mapped[resource.value]
        pointer._obj.value, size._obj.value = ctypes.addressof(memory), len(memory)
        return 0

    def _cuGraphicsUnmapResources(self, count, resources, stream):
        if not self.pushed:
            return 201
        assert stream is None
        assert count.value == len(resources)
        for resource in resources:
            if resource not in self.mapped:
                return 211
            del self.mapped[resource]
        return 0

    def _cuGraphicsUnregisterResource(self, resource):
        if not self.pushed or resource.value in self.mapped:
            return 201
        del self.buffers[resource.value]
        return 0


def on_host(array):
    """Return a copy that NumPy makes from the array's `__cuda_array_interface__`."""
    said = array.__cuda_array_interface__
    assert said["version"] == 3
    assert said["stream"] == 1
    keys = ("data", "shape", "typestr", "strides", "version")
    return np.array(SimpleNamespace(__array_interface__={key: said[key] for key in keys}))


@pytest.fixture
def generator():
    with Generator(CONFIG, seed=5, size=SIZE, backend="egl") as made:
        yield made


@pytest.fixture
def driver(generator, monkeypatch):
    """Fake driver, with `generator` treated as if it ran on an NVIDIA GPU."""
    assert generator.renderer_name  # opens its context
    fake = FakeDriver(generator.gpu.context())
    monkeypatch.setattr(cuda, "_VENDOR", generator.gpu.context().vendor)
    monkeypatch.setattr(cuda, "_load_library", lambda: fake)
    return fake


@pytest.mark.parametrize(("index", "camera"), [(0, "A"), (1, "Cr"), (2, "B"), (3, "Cl")])
def test_a_frame_is_bit_identical_to_that_of_render(generator, driver, index, camera):
    sample = generator.render(index=index, camera=camera)
    generator.render_cuda(index=index + 1, camera=camera)
    frame = generator.render_cuda(index=index, camera=camera)
    image, labels, depth = map(on_host, (frame.image, frame.labels, frame.depth))
    np.testing.assert_array_equal(image[..., :3], sample.image)
    np.testing.assert_array_equal(image[..., 3], sample.cover)
    assert (image.dtype, labels.dtype, depth.dtype) == (np.uint8, np.uint32, np.float32)
    np.testing.assert_array_equal(labels & 0xFFFF, sample.ids)
    np.testing.assert_array_equal(labels >> 16, sample.damage)
    np.testing.assert_array_equal(depth.view(np.uint32), sample.depth.view(np.uint32))
    assert (frame.scene, frame.camera) == (sample.scene, sample.camera)
    np.testing.assert_array_equal(frame.view.clip_matrix(), sample.view.clip_matrix())


def test_buffers_are_registered_once_and_mapped_for_each_frame(generator, driver):
    scene = generator.scene(0)
    for name in ("A", "B"):
        generator.render_cuda(scene=scene, camera=name)
    generator.close()
    prefix = "cuGraphics"
    graphics = [name.removeprefix(prefix) for name in driver.calls if name.startswith(prefix)]
    mapped = ["MapResources", *["ResourceGetMappedPointer_v2"] * 3, "UnmapResources"]
    registered, unregistered = ["GLRegisterBuffer"] * 3, ["UnregisterResource"] * 3
    assert graphics == [*registered, *mapped, *mapped, *unregistered]
    assert driver.calls[-1] == "cuDevicePrimaryCtxRelease_v2"
    assert (driver.retained, driver.pushed, driver.buffers, driver.mapped) == (0, 0, {}, {})


def test_a_frame_is_valid_until_the_next_render_cuda(generator, driver):
    first = generator.render_cuda(index=0)
    before = on_host(first.image)
    generator.render(index=1)
    np.testing.assert_array_equal(on_host(first.image), before)
    second = generator.render_cuda(index=1)
    for array in (first.image, first.labels, first.depth):
        with pytest.raises(ContextError, match="went back to OpenGL; clone"):
            on_host(array)
    generator.close()
    with pytest.raises(ContextError, match="went back to OpenGL"):
        on_host(second.depth)


def test_a_closed_generator_can_render_for_cuda_again(generator, driver):
    before = on_host(generator.render_cuda(index=0).depth)
    generator.close()
    np.testing.assert_array_equal(on_host(generator.render_cuda(index=0).depth), before)


@pytest.mark.parametrize(
    "name",
    [
        "cuGraphicsGLRegisterBuffer",
        "cuGraphicsMapResources",
        "cuGraphicsResourceGetMappedPointer_v2",
    ],
)
def test_a_failing_call_is_named_and_leaves_nothing_behind(generator, driver, name):
    driver.fails.add(name)
    with pytest.raises(ContextError, match=rf"^{name} failed: CUDA_ERROR_OPERATING_SYSTEM \(304\)"):
        generator.render_cuda(index=0)
    driver.fails.clear()
    assert on_host(generator.render_cuda(index=0).depth).shape == SIZE[::-1]
    generator.close()
    assert (driver.retained, driver.pushed, driver.buffers, driver.mapped) == (0, 0, {}, {})


def test_a_working_driver_gives_no_reason(generator, driver):
    assert generator.cuda_reason() == ""
    assert driver.retained == 0


def test_the_reason_names_what_the_driver_lacks(generator, driver, monkeypatch):
    driver.fails.add("cuInit")
    assert generator.cuda_reason().startswith("cuInit failed: CUDA_ERROR_OPERATING_SYSTEM")
    driver.fails.clear()
    driver.devices.clear()
    assert generator.cuda_reason() == "the GPU that OpenGL runs on is hidden from CUDA"
    monkeypatch.delattr(FakeDriver, "_cuGraphicsMapResources")
    assert generator.cuda_reason() == (
        "libcuda.so.1 has no cuGraphicsMapResources; update the NVIDIA driver"
    )


def test_the_reason_names_a_missing_library(generator, monkeypatch):
    assert generator.renderer_name
    monkeypatch.setattr(cuda, "_VENDOR", generator.gpu.context().vendor)
    monkeypatch.setattr(cuda, "_LIBRARY", "libcuda-of-no-machine.so.1")
    assert "libcuda-of-no-machine.so.1: cannot open" in generator.cuda_reason()


def test_the_reason_names_another_vendors_driver_and_suggests_render(generator):
    reason = generator.cuda_reason()
    assert "OpenGL runs on llvmpipe" in reason
    assert "\n" not in reason
    with pytest.raises(ContextError, match=r"not on an NVIDIA GPU; use Generator\.render"):
        generator.render_cuda(index=0)


def test_arguments_are_checked_like_those_of_render(generator):
    with pytest.raises(ConfigError, match="give either index or scene"):
        generator.render_cuda()
    with pytest.raises(ConfigError, match="camera: 'D' is unknown"):
        generator.render_cuda(index=0, camera="D")

"""Rendered frames as CUDA memory for PyTorch or CuPy, without a copy through the host.

The rendered textures are copied on the GPU to OpenGL buffers that are registered with the CUDA
driver. Only libcuda.so.1 is needed. Tests replace it by a stand-in; on a GPU, bench/gpu.py compares
the frames with frames that are read back.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from fastgen.camera.projection import View
from fastgen.errors import ContextError
from fastgen.render.gl import GLContext
from fastgen.render.image_targets import ImageTargets
from fastgen.scene import Camera, Scene

_LIBRARY = "libcuda.so.1"
_VENDOR = "NVIDIA Corporation"

# names of cuda.h and cudaGL.h; _v2 is the version with 64-bit addresses
_CALLS = (
    "cuInit",
    "cuGetErrorName",
    "cuGLGetDevices_v2",
    "cuDevicePrimaryCtxRetain",
    "cuDevicePrimaryCtxRelease_v2",
    "cuCtxPushCurrent_v2",
    "cuCtxPopCurrent_v2",
    "cuGraphicsGLRegisterBuffer",
    "cuGraphicsUnregisterResource",
    "cuGraphicsMapResources",
    "cuGraphicsUnmapResources",
    "cuGraphicsResourceGetMappedPointer_v2",
)
_ALL_DEVICES = 1  # CU_GL_DEVICE_LIST_ALL
_READ_AND_WRITE = 0  # CU_GRAPHICS_REGISTER_FLAGS_NONE: consumers may write
_LEGACY_STREAM = 1  # value of the CUDA array interface; the driver uses NULL


class CudaArray:
    """Array in GPU memory for `torch.as_tensor` or `cupy.asarray`, which do not copy it.

    The data are ready on CUDA's default stream, which PyTorch uses by default. Work on another
    stream has to wait for the default stream.

    Args:
        pointer: Device address.
        shape: Array shape, rows first, without padding.
        typestr: NumPy type string, such as '<f4'.
    """

    def __init__(self, pointer: int, shape: tuple[int, ...], typestr: str) -> None:
        self._pointer = pointer
        self.shape = shape
        self.typestr = typestr

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """Version 3 of the interface. Raises ContextError after the memory went back to OpenGL."""
        if not self._pointer:
            raise ContextError("this frame's memory went back to OpenGL; clone a frame to keep it")
        return {
            "data": (self._pointer, False),
            "shape": self.shape,
            "typestr": self.typestr,
            "strides": None,
            "version": 3,
            "stream": _LEGACY_STREAM,
        }

    def expire(self) -> None:
        """Invalidate the address."""
        self._pointer = 0


@dataclass(frozen=True, eq=False)
class CudaFrame:
    """One rendered frame in GPU memory, row 0 at the top; valid until the next `render_cuda`.

    There are no objects, because they are computed on the host; `Generator.render` has them.

    Attributes:
        image: uint8 [H, W, 4], sRGB and Frame.cover.
        labels: uint32 [H, W], id | damage << 16, see Frame.
        depth: float32 [H, W], metres along the optical axis, inf for the panorama.
        scene: The scene.
        camera: The camera.
        view: Projection of the camera.
    """

    image: CudaArray
    labels: CudaArray
    depth: CudaArray
    scene: Scene
    camera: Camera
    view: View


def cuda_reason(gl: GLContext) -> str:
    """Return why CUDA cannot access frames of the current context `gl`, '' if it can."""
    if gl.vendor != _VENDOR:
        return f"OpenGL runs on {gl.renderer} ({gl.vendor}), not on an NVIDIA GPU"
    try:
        _Driver().device()
    except ContextError as error:
        return str(error)
    return ""


class CudaFrames:
    """GPU memory for one frame, shared by OpenGL and CUDA.

    Args:
        gl: Current context; the caller owns it.
        size: (width, height) in pixels.

    Raises:
        ContextError: CUDA cannot access the frames, see `cuda_reason`.
    """

    def __init__(self, gl: GLContext, size: tuple[int, int]) -> None:
        reason = cuda_reason(gl)
        if reason:
            raise ContextError(f"cuda: {reason}; use Generator.render, or see fastgen doctor")
        width, height = size
        self._gl = gl
        self._layouts = (
            ((height, width, 4), "|u1"),
            ((height, width), "<u4"),
            ((height, width), "<f4"),
        )
        self._driver = _Driver()
        self._device = self._driver.device()
        self._context = ctypes.c_void_p()
        # PyTorch and CuPy use the primary context
        self._driver("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), self._device)
        self._buffers = [gl.ctx.buffer(reserve=4 * width * height) for _ in self._layouts]
        self._resources: list[ctypes.c_void_p] = []
        self._mapped = False
        self._arrays: list[CudaArray] = []
        try:
            with self._current():
                for buffer in self._buffers:
                    self._resources.append(self._register(buffer.glo))
        except ContextError:
            self.release()
            raise

    def take(self, targets: ImageTargets) -> tuple[CudaArray, CudaArray, CudaArray]:
        """Return image, labels and depth of a rendered frame, see CudaFrame.

        The arrays of the previous call become invalid once CUDA's default stream has finished with
        them.

        Args:
            targets: The rendered frame.
        """
        self._unmap()
        targets.copy_to(*self._buffers)
        with self._current():
            self._driver("cuGraphicsMapResources", *self._all())
            self._mapped = True
            pointers = [self._pointer(resource) for resource in self._resources]
        image, labels, depth = self._arrays = [
            CudaArray(pointer, *layout)
            for pointer, layout in zip(pointers, self._layouts, strict=True)
        ]
        return image, labels, depth

    def release(self) -> None:
        """Free the memory in OpenGL and CUDA."""
        self._gl.make_current()
        self._unmap()
        with self._current():
            while self._resources:
                self._driver("cuGraphicsUnregisterResource", self._resources.pop())
        for buffer in self._buffers:
            buffer.release()
        self._driver("cuDevicePrimaryCtxRelease_v2", self._device)

    def _unmap(self) -> None:
        for array in self._arrays:
            array.expire()
        if self._mapped:
            self._mapped = False
            with self._current():
                self._driver("cuGraphicsUnmapResources", *self._all())

    def _all(self) -> tuple[Any, ...]:
        """Return count, resources and stream, the arguments of map and unmap."""
        count = len(self._resources)
        handles = (ctypes.c_void_p * count)(*[resource.value for resource in self._resources])
        return ctypes.c_uint(count), handles, None

    def _register(self, buffer: int) -> ctypes.c_void_p:
        resource = ctypes.c_void_p()
        arguments = ctypes.c_uint(buffer), ctypes.c_uint(_READ_AND_WRITE)
        self._driver("cuGraphicsGLRegisterBuffer", ctypes.byref(resource), *arguments)
        return resource

    def _pointer(self, resource: ctypes.c_void_p) -> int:
        pointer, size = ctypes.c_uint64(), ctypes.c_size_t()
        found = ctypes.byref(pointer), ctypes.byref(size)
        self._driver("cuGraphicsResourceGetMappedPointer_v2", *found, resource)
        return pointer.value

    @contextmanager
    def _current(self) -> Iterator[None]:
        """Make the primary context current inside the with block."""
        self._driver("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self._driver("cuCtxPopCurrent_v2", ctypes.byref(ctypes.c_void_p()))


class _Driver:
    """The CUDA driver: call it with the name of a function and its arguments as ctypes objects.

    Failures become ContextErrors that name the function.
    """

    def __init__(self) -> None:
        self._library = _load_library()
        missing = [name for name in _CALLS if not hasattr(self._library, name)]
        if missing:
            raise ContextError(f"{_LIBRARY} has no {missing[0]}; update the NVIDIA driver")
        self("cuInit", ctypes.c_uint(0))

    def __call__(self, name: str, *arguments: Any) -> None:
        code = getattr(self._library, name)(*arguments)
        if code:
            text = ctypes.c_char_p()
            self._library.cuGetErrorName(ctypes.c_int(code), ctypes.byref(text))
            raise ContextError(f"{name} failed: {(text.value or b'error').decode()} ({code})")

    def device(self) -> ctypes.c_int:
        """Return the CUDA device of the current OpenGL context, in CUDA's order, not EGL's."""
        count, device = ctypes.c_uint(), ctypes.c_int()
        found = ctypes.byref(count), ctypes.byref(device)
        self("cuGLGetDevices_v2", *found, ctypes.c_uint(1), ctypes.c_int(_ALL_DEVICES))
        if not count.value:
            raise ContextError("the GPU that OpenGL runs on is hidden from CUDA")
        return device


def _load_library() -> Any:
    try:
        return ctypes.CDLL(_LIBRARY)
    except OSError as error:
        raise ContextError(str(error)) from None

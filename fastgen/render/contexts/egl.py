"""Headless OpenGL contexts on EGL devices.

The calls are typed here and not taken from PyOpenGL, which supports one platform per process. Its
EGL modules fail to import if PYOPENGL_PLATFORM is osmesa, and its OSMesa module fails to import
otherwise, but contexts of both kinds may be open at once. Its OpenGL constants need libGL or
libOpenGL at import time, which machines with EGL alone lack.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fastgen.errors import ContextError
from fastgen.render.contexts.native_context import NativeContext

EGL_PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"
EGL_LIBRARY = "libEGL.so.1"

# EGL 1.5, EGL_EXT_platform_device, EGL_MESA_platform_surfaceless (Khronos EGL registry)
_EGL_NONE = 0x3038
_EGL_EXTENSIONS = 0x3055
_EGL_OPENGL_API = 0x30A2
_EGL_PLATFORM_DEVICE_EXT = 0x313F
_EGL_PLATFORM_SURFACELESS_MESA = 0x31DD
_EGL_SURFACE_TYPE, _EGL_PBUFFER_BIT = 0x3033, 0x0001
_EGL_RENDERABLE_TYPE, _EGL_OPENGL_BIT = 0x3040, 0x0008
_EGL_CONTEXT_MAJOR_VERSION, _EGL_CONTEXT_MINOR_VERSION = 0x3098, 0x30FB
_EGL_CONTEXT_OPENGL_PROFILE_MASK, _EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT = 0x30FD, 0x0001
_CONFIG = (
    *(_EGL_SURFACE_TYPE, _EGL_PBUFFER_BIT),
    *(_EGL_RENDERABLE_TYPE, _EGL_OPENGL_BIT),
    _EGL_NONE,
)
_CONTEXT = (
    *(_EGL_CONTEXT_MAJOR_VERSION, 4),
    *(_EGL_CONTEXT_MINOR_VERSION, 4),
    *(_EGL_CONTEXT_OPENGL_PROFILE_MASK, _EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT),
    _EGL_NONE,
)
_EGL_ERRORS = {  # EGL 1.5 section 3.1, possible errors of context creation
    0x3001: "EGL_NOT_INITIALIZED",
    0x3002: "EGL_BAD_ACCESS: the context is in use by another thread; open one in each",
    0x3003: "EGL_BAD_ALLOC",
    0x3005: "EGL_BAD_CONFIG",
    0x3009: "EGL_BAD_MATCH",
    0x300C: "EGL_BAD_PARAMETER",
}

_POINTER, _INT, _UINT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint


@dataclass(frozen=True)
class EglDevice:
    """One device that EGL lists. software: whether it is Mesa's CPU rasterizer."""

    handle: int
    software: bool


class Egl:
    """Typed calls of libEGL. Failures become ContextErrors that name the call."""

    def __init__(self) -> None:
        try:
            self._library = ctypes.CDLL(EGL_LIBRARY)
        except OSError as error:
            raise ContextError(
                f"egl: {error}; on Debian or Ubuntu: apt-get install {EGL_PACKAGES}"
            ) from None
        self.address = self._call("eglGetProcAddress", _POINTER, ctypes.c_char_p)
        self.current = self._call("eglGetCurrentContext", _POINTER)
        self._error = self._call("eglGetError", _INT)
        self._text = self._call("eglQueryString", ctypes.c_char_p, _POINTER, _INT)
        self._make_current = self._call("eglMakeCurrent", _UINT, *[_POINTER] * 4)
        self._destroy = self._call("eglDestroyContext", _UINT, _POINTER, _POINTER)

    def devices(self) -> list[EglDevice]:
        """Return the devices of eglQueryDevicesEXT; [] without device enumeration."""
        supported = (self._text(None, _EGL_EXTENSIONS) or b"").split()
        if b"EGL_EXT_platform_device" not in supported or not (
            {b"EGL_EXT_device_base", b"EGL_EXT_device_enumeration"} & set(supported)
        ):
            return []
        query = self._extension("eglQueryDevicesEXT", _UINT, _INT, _POINTER, _POINTER)
        text = self._extension("eglQueryDeviceStringEXT", ctypes.c_char_p, _POINTER, _INT)
        count = _INT(0)
        query(0, None, ctypes.byref(count))
        handles = (_POINTER * count.value)()
        query(count.value, handles, ctypes.byref(count))
        return [
            EglDevice(handle, b"EGL_MESA_device_software" in (text(handle, _EGL_EXTENSIONS) or b""))
            for handle in handles[: count.value]
            if handle
        ]

    def create(self, device: EglDevice | None) -> tuple[int, int]:
        """Create an OpenGL 4.4 core context.

        Args:
            device: Device to draw on, or None for Mesa's surfaceless platform.

        Returns:
            Handles of the display and of the context.
        """
        get = self._extension("eglGetPlatformDisplayEXT", _POINTER, _UINT, _POINTER, _POINTER)
        platform = _EGL_PLATFORM_DEVICE_EXT if device else _EGL_PLATFORM_SURFACELESS_MESA
        display = self._checked(
            "eglGetPlatformDisplayEXT", get(platform, device and device.handle, 0)
        )
        # never call eglTerminate: other contexts may use the display, which is unique per device
        initialize = self._call("eglInitialize", _UINT, *[_POINTER] * 3)
        self._checked("eglInitialize", initialize(display, None, None))
        self._checked("eglBindAPI", self._call("eglBindAPI", _UINT, _UINT)(_EGL_OPENGL_API))
        config, count = _POINTER(), _INT(0)
        choose = self._call("eglChooseConfig", _UINT, *[_POINTER] * 3, _INT, _POINTER)
        required = (_INT * len(_CONFIG))(*_CONFIG)
        choose(display, required, ctypes.byref(config), 1, ctypes.byref(count))
        self._checked("eglChooseConfig (an OpenGL configuration)", count.value)
        create = self._call("eglCreateContext", _POINTER, *[_POINTER] * 4)
        attributes = (_INT * len(_CONTEXT))(*_CONTEXT)
        context = create(display, config, None, attributes)
        return display, self._checked("eglCreateContext (OpenGL 4.4 core)", context)

    def make_current(self, display: int, context: int | None) -> None:
        """Bind a context to this thread without a surface; None binds no context."""
        self._checked("eglMakeCurrent", self._make_current(display, None, None, context))

    def destroy(self, display: int, context: int) -> None:
        self._destroy(display, context)

    def _call(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        call = getattr(self._library, name)
        call.restype, call.argtypes = result, arguments
        function: Callable[..., Any] = call
        return function

    def _extension(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        return ctypes.CFUNCTYPE(result, *arguments)(
            self._checked(name, self.address(name.encode()))
        )

    def _checked(self, call: str, value: Any) -> Any:
        if value:
            return value
        code = self._error()
        raise ContextError(f"{call} failed: {_EGL_ERRORS.get(code, hex(code))}")


class EglContext(NativeContext):
    """OpenGL context on an EGL device, or on Mesa's surfaceless platform."""

    def __init__(self, egl: Egl, device: EglDevice | None) -> None:
        self._egl = egl
        self._display, handle = egl.create(device)
        super().__init__("egl", handle)

    def load_opengl_function(self, name: str) -> int:
        return self._egl.address(name.encode()) or 0

    def _is_current(self, handle: int) -> bool:
        return bool(self._egl.current() == handle)

    def _bind(self, handle: int) -> None:
        self._egl.make_current(self._display, handle)

    def _unbind(self) -> None:
        self._egl.make_current(self._display, None)

    def _destroy(self, handle: int) -> None:
        self._egl.destroy(self._display, handle)

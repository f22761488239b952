"""EGL: devices without a screen, and contexts on them."""

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
_EGL_PLATFORM_DEVICE = 0x313F
_EGL_PLATFORM_SURFACELESS = 0x31DD
# EGL_SURFACE_TYPE: EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE: EGL_OPENGL_BIT
_EGL_CONFIG = (0x3033, 0x0001, 0x3040, 0x0008, _EGL_NONE)
# EGL_CONTEXT_MAJOR_VERSION, _MINOR_VERSION, _OPENGL_PROFILE_MASK: core
_EGL_CONTEXT = (0x3098, 4, 0x30FB, 4, 0x30FD, 0x0001, _EGL_NONE)
_EGL_ERRORS = {  # EGL 1.5 section 3.1, those that creating a context gives
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
    """One device that EGL lists. software: whether it is Mesa's rasterizer on the processor."""

    handle: int
    software: bool


class Egl:
    """libEGL with its calls typed. Failures become ContextErrors that name the call."""

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
        """What eglQueryDevicesEXT lists; [] where EGL lacks device enumeration."""
        known = (self._text(None, _EGL_EXTENSIONS) or b"").split()
        if b"EGL_EXT_platform_device" not in known or not (
            {b"EGL_EXT_device_base", b"EGL_EXT_device_enumeration"} & set(known)
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
        """Display and a new 4.4 core context on `device`, or on no device: Mesa's surfaceless."""
        get = self._extension("eglGetPlatformDisplayEXT", _POINTER, _UINT, _POINTER, _POINTER)
        platform = _EGL_PLATFORM_DEVICE if device else _EGL_PLATFORM_SURFACELESS
        display = self._got("eglGetPlatformDisplayEXT", get(platform, device and device.handle, 0))
        # never eglTerminate: a device has one display, which other contexts may be using
        initialize = self._call("eglInitialize", _UINT, *[_POINTER] * 3)
        self._got("eglInitialize", initialize(display, None, None))
        self._got("eglBindAPI", self._call("eglBindAPI", _UINT, _UINT)(_EGL_OPENGL_API))
        config, count = _POINTER(), _INT(0)
        choose = self._call("eglChooseConfig", _UINT, *[_POINTER] * 3, _INT, _POINTER)
        wanted = (_INT * len(_EGL_CONFIG))(*_EGL_CONFIG)
        choose(display, wanted, ctypes.byref(config), 1, ctypes.byref(count))
        self._got("eglChooseConfig (an OpenGL configuration)", count.value)
        create = self._call("eglCreateContext", _POINTER, *[_POINTER] * 4)
        attributes = (_INT * len(_EGL_CONTEXT))(*_EGL_CONTEXT)
        context = create(display, config, None, attributes)
        return display, self._got("eglCreateContext (OpenGL 4.4 core)", context)

    def make_current(self, display: int, context: int | None) -> None:
        """Bind `context` to this thread without a surface; None binds no context."""
        self._got("eglMakeCurrent", self._make_current(display, None, None, context))

    def destroy(self, display: int, context: int) -> None:
        self._destroy(display, context)

    def _call(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        call = getattr(self._library, name)
        call.restype, call.argtypes = result, arguments
        return call

    def _extension(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        return ctypes.CFUNCTYPE(result, *arguments)(self._got(name, self.address(name.encode())))

    def _got(self, call: str, value: Any) -> Any:
        if value:
            return value
        code = self._error()
        raise ContextError(f"{call} failed: {_EGL_ERRORS.get(code, hex(code))}")


class EglContext(NativeContext):
    """A context on a device, or on Mesa's surfaceless platform."""

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

"""OpenGL contexts without a screen: EGL, or OSMesa where the system still has it.

Mesa dropped OSMesa in version 25.1; EGL with the software device does the same job there.
"""

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, Self

import moderngl

from fastgen import gl_forks
from fastgen.errors import ConfigError, ContextError
from fastgen.records import check_known
from fastgen.shader_cache import spare_full_disk

BACKENDS = ("auto", "egl", "osmesa")

MIN_VERSION = 440
"""Textures cleared in part: OpenGL 4.4 core."""

EGL_PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"
OSMESA_PACKAGES = "libosmesa6"

_EGL_NAME = "libEGL.so.1"
_OSMESA_NAMES = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")

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

# GL/osmesa.h: OSMESA_FORMAT: OSMESA_RGBA, OSMESA_DEPTH_BITS, OSMESA_PROFILE: OSMESA_CORE_PROFILE
_OSMESA_ATTRIBUTES = (0x22, 0x1908, 0x30, 24, 0x33, 0x34)
_OSMESA_MAJOR, _OSMESA_MINOR = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401

_POINTER, _INT, _UINT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint


class _Native(Protocol):
    """A context of one backend, with what moderngl asks of it."""

    def load_opengl_function(self, name: str) -> int: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def release(self) -> None: ...


class GLContext:
    """A current OpenGL context. A context manager: leaving it releases the context.

    ctx: moderngl.Context. backend: 'egl' or 'osmesa'. renderer, vendor, version: the driver's
    own words. One thread at a time uses it: `let_go` hands it on. Several may live at once, of
    both backends: call `make_current` before going on with one, and before freeing what was made
    through `ctx`.
    """

    def __init__(self, native: _Native, backend: str) -> None:
        foreign: Any = native  # moderngl's annotation knows no foreign contexts
        try:
            self.ctx = moderngl.create_context(
                require=MIN_VERSION, standalone=True, context=foreign
            )
        except (ValueError, moderngl.Error) as error:  # an old version, a missing function
            native.release()
            raise ContextError(f"{backend}: OpenGL 4.4 core is needed ({error})") from None
        self.backend = backend
        self.renderer: str = self.ctx.info["GL_RENDERER"]
        self.vendor: str = self.ctx.info["GL_VENDOR"]
        self.version: str = self.ctx.info["GL_VERSION"]
        self._native = native

    def function(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        """The GL function `name` as a ctypes call, which lets other threads run meanwhile.

        result, arguments: ctypes types. It acts on whichever context is current.
        Raises ContextError when the driver lacks it.
        """
        address = self._native.load_opengl_function(name)
        if not address:
            raise ContextError(f"{self.renderer}: this driver has no {name}; update Mesa")
        return ctypes.CFUNCTYPE(result, *arguments)(address)

    def make_current(self) -> None:
        """Make this the thread's context again, after another one was used.

        Costs nothing where it is current already. Raises ContextError after a release.
        """
        self._native.__enter__()

    def let_go(self) -> None:
        """Leave this thread without it, so that another may make it current.

        Does nothing where it is not current.
        """
        self._native.__exit__()

    def release(self) -> None:
        """Free the context; a second call does nothing.

        No context is current afterwards if this one was; another that was current stays so.
        Objects made through `ctx` are the caller's: free them first, or not at all.
        """
        self.ctx.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


@dataclass(frozen=True)
class EglDevice:
    """One device that EGL lists. software: whether it is Mesa's rasterizer on the processor."""

    handle: int
    software: bool


def open_context(
    backend: str = "auto", device_index: int | None = None, threads: int | None = None
) -> GLContext:
    """A new context, current in this thread.

    backend: 'egl', 'osmesa', or 'auto' for the first that works in this order. device_index:
    which device in EGL's own order, so never OSMesa; None takes the first whose context comes
    up, hardware before software. threads: rasterizer threads of llvmpipe, 0 for none but the
    caller's. It sets the environment's LP_NUM_THREADS, which wins when set already; llvmpipe
    reads that once a process and backend, at the first context, so later values change nothing.
    Raises ContextError naming the packages to install when nothing works, ConfigError for an
    unknown backend or a value out of range.
    """
    check_known("backend", backend, BACKENDS)
    if threads is not None:
        if threads < 0:
            raise ConfigError(f"threads: {threads} is no count; give 0 or more")
        os.environ.setdefault("LP_NUM_THREADS", str(threads))
    if device_index is not None:
        if backend == "osmesa":
            raise ConfigError(f"device_index: {device_index}: osmesa has no devices; use egl")
        backend = "egl"
    spare_full_disk()
    failures = []
    for name in ("egl", "osmesa") if backend == "auto" else (backend,):
        try:
            if name == "egl":
                return _open_egl(device_index)
            return GLContext(_OSMesaContext(), "osmesa")
        except ContextError as error:
            failures.append(str(error))
    raise ContextError("; ".join(failures))


def egl_devices() -> list[EglDevice]:
    """The devices that EGL lists, in the order that `device_index` counts; [] where it cannot.

    Raises ContextError where libEGL is missing.
    """
    return _Egl().devices()


class _Egl:
    """libEGL with its calls typed. Failures become ContextErrors that name the call."""

    def __init__(self) -> None:
        try:
            self._library = ctypes.CDLL(_EGL_NAME)
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


class _EglContext:
    def __init__(self, egl: _Egl, device: EglDevice | None) -> None:
        self._egl = egl
        self._display, context = egl.create(device)
        self._handle: int | None = context
        try:
            self.__enter__()
        except ContextError:
            self.release()
            raise

    def load_opengl_function(self, name: str) -> int:
        return self._egl.address(name.encode()) or 0

    def __enter__(self) -> Self:
        if self._handle is None:
            raise ContextError("egl: the context was released; open another")
        if self._egl.current() != self._handle:
            self._egl.make_current(self._display, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        if self._handle is not None and self._egl.current() == self._handle:
            self._egl.make_current(self._display, None)

    def release(self) -> None:
        if self._handle is not None:
            self.__exit__()
            self._egl.destroy(self._display, self._handle)
            self._handle = None


def _open_egl(device_index: int | None) -> GLContext:
    egl = _Egl()
    devices = egl.devices()
    tries: list[EglDevice | None]
    if device_index is None:
        tries = [*sorted(devices, key=lambda device: device.software), None]
    elif 0 <= device_index < len(devices):
        tries = [devices[device_index]]
    else:
        raise ContextError(
            f"egl: device_index: there is no device {device_index} among the {len(devices)} "
            f"that EGL lists; fastgen doctor shows them"
        )
    failures = []
    for device in tries:
        where = f"device {devices.index(device)}" if device else "surfaceless"
        software = device is None or device.software
        if not gl_forks.usable(f"egl {where}"):
            failures.append(f"{where}: {gl_forks.REASON}")
            if software:
                continue  # the same rasterizer is reached by another display
            break
        gl_forks.opened(f"egl {where}", software)
        try:
            return GLContext(_EglContext(egl, device), "egl")
        except ContextError as error:
            failures.append(f"{where}: {error}")
    raise ContextError(
        f"egl: no context with OpenGL 4.4 core ({', '.join(failures)}); "
        f"for Mesa's software driver on Debian or Ubuntu: apt-get install {EGL_PACKAGES}"
    )


class _OSMesaContext:
    def __init__(self) -> None:
        if not gl_forks.usable("osmesa"):
            raise ContextError(f"osmesa: {gl_forks.REASON}")
        gl_forks.opened("osmesa", software=True)
        self._library = _osmesa_library()
        self._library.OSMesaCreateContextAttribs.restype = _POINTER
        self._library.OSMesaCreateContextAttribs.argtypes = [_POINTER, _POINTER]
        self._library.OSMesaMakeCurrent.argtypes = [_POINTER, _POINTER, _UINT, _INT, _INT]
        self._library.OSMesaGetCurrentContext.restype = _POINTER
        self._library.OSMesaGetProcAddress.restype = _POINTER
        self._library.OSMesaDestroyContext.argtypes = [_POINTER]
        self._handle: int | None = None
        for minor in (5, 4):
            flat = (*_OSMESA_ATTRIBUTES, _OSMESA_MAJOR, 4, _OSMESA_MINOR, minor, 0)
            attributes = (_INT * len(flat))(*flat)
            self._handle = self._library.OSMesaCreateContextAttribs(attributes, None)
            if self._handle:
                break
        else:
            raise ContextError("osmesa: this Mesa gives no OpenGL 4.4 core context; update it")
        # OSMesa binds no context without a buffer; nothing is ever drawn into this one
        self._pixels = ctypes.create_string_buffer(16 * 16 * 4)
        try:
            self.__enter__()
        except ContextError:
            self.release()
            raise

    def load_opengl_function(self, name: str) -> int:
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def __enter__(self) -> Self:
        if self._handle is None:
            raise ContextError("osmesa: the context was released; open another")
        if not self._is_current():
            _unbind_egl()
            if not self._library.OSMesaMakeCurrent(
                self._handle, self._pixels, _GL_UNSIGNED_BYTE, 16, 16
            ):
                raise ContextError("osmesa: the context cannot be made current")
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_current():
            self._library.OSMesaMakeCurrent(None, None, 0, 0, 0)

    def release(self) -> None:
        if self._handle is not None:
            self.__exit__()
            self._library.OSMesaDestroyContext(self._handle)
            self._handle = None

    def _is_current(self) -> bool:
        return bool(self._library.OSMesaGetCurrentContext() == self._handle)


def _osmesa_library() -> ctypes.CDLL:
    failures = []
    for name in _OSMESA_NAMES:
        try:
            return ctypes.CDLL(name)
        except OSError as error:
            failures.append(str(error))
    raise ContextError(
        f"osmesa: {failures[0]}; on Debian or Ubuntu: apt-get install {OSMESA_PACKAGES} "
        f"(Mesa 25.1 and later have no OSMesa; use egl there)"
    )


def _unbind_egl() -> None:
    """Tell EGL that its context of this thread gives way to OSMesa.

    Both share Mesa's dispatch table. Without this EGL would take its context for current still,
    skip the next eglMakeCurrent, and its calls would land in OSMesa's context.
    """
    try:
        library = ctypes.CDLL(_EGL_NAME, mode=os.RTLD_NOLOAD)
    except OSError:
        return  # EGL is not in use
    library.eglGetCurrentDisplay.restype = _POINTER
    library.eglMakeCurrent.argtypes = [_POINTER] * 4
    display = library.eglGetCurrentDisplay()
    if display:
        library.eglMakeCurrent(display, None, None, None)

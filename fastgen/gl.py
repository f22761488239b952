"""OpenGL contexts without a screen: EGL, or OSMesa where the system still has it.

Mesa dropped OSMesa in version 25.1; EGL with the software device does the same job there.
"""

import ctypes
import ctypes.util
import os
from collections.abc import Callable
from typing import Any, Self

import moderngl

from fastgen.errors import ConfigError, ContextError
from fastgen.records import nearest

BACKENDS = ("auto", "egl", "osmesa")

MIN_VERSION = 430
"""Shader storage, indirect draws and explicit bindings: OpenGL 4.3 core."""

EGL_PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"
OSMESA_PACKAGES = "libosmesa6"

_OSMESA_NAMES = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
_OSMESA_ATTRIBUTES = {
    "format": (0x22, 0x1908),  # OSMESA_FORMAT, OSMESA_RGBA
    "depth": (0x30, 24),
    "profile": (0x33, 0x34),  # OSMESA_PROFILE, OSMESA_CORE_PROFILE
}
_OSMESA_MAJOR, _OSMESA_MINOR = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401


class GLContext:
    """A current OpenGL context. A context manager: leaving it releases the context.

    ctx: moderngl.Context. backend: 'egl' or 'osmesa'. renderer, vendor, version: the driver's
    own words. Use it from the thread that made it.
    """

    def __init__(self, ctx: moderngl.Context, backend: str, address: Callable[[str], int]) -> None:
        self.ctx = ctx
        self.backend = backend
        self.renderer: str = ctx.info["GL_RENDERER"]
        self.vendor: str = ctx.info["GL_VENDOR"]
        self.version: str = ctx.info["GL_VERSION"]
        self._address = address

    def function(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        """The GL function `name` as a ctypes call, which lets other threads run meanwhile.

        Raises ContextError when the driver lacks it.
        """
        address = self._address(name)
        if not address:
            raise ContextError(f"{self.renderer}: this driver has no {name}; update Mesa")
        return ctypes.CFUNCTYPE(result, *arguments)(address)

    def make_current(self) -> None:
        """Make this the thread's context again, after another one was used."""
        self.ctx.__enter__()

    def release(self) -> None:
        """Free the context. What was made through `ctx` must not be used afterwards."""
        self.ctx.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def open_context(
    backend: str = "auto", device_index: int | None = None, threads: int | None = None
) -> GLContext:
    """A new context, current in this thread.

    backend: 'egl', 'osmesa', or 'auto' for the first that works in this order. device_index:
    which EGL device; None takes the first whose context comes up, hardware before software.
    threads: rasterizer threads of llvmpipe, 0 for none but the caller's; it reads them once a
    process from LP_NUM_THREADS, which stays as it is when already set.
    Raises ContextError naming the packages to install when nothing works, ConfigError for an
    unknown backend.
    """
    if backend not in BACKENDS:
        raise ConfigError(f"backend: {backend!r} is unknown{nearest(backend, BACKENDS)}")
    if threads is not None:
        os.environ.setdefault("LP_NUM_THREADS", str(threads))
    failures = []
    for name in ("egl", "osmesa") if backend == "auto" else (backend,):
        try:
            return _open_egl(device_index) if name == "egl" else _open_osmesa()
        except ContextError as error:
            failures.append(str(error))
    raise ContextError("; ".join(failures))


def _checked(made: GLContext) -> GLContext:
    if made.ctx.version_code < MIN_VERSION:
        version = made.version
        made.release()
        raise ContextError(f"{made.backend}: OpenGL 4.3 is needed, this driver has {version}")
    return made


def _open_egl(device_index: int | None) -> GLContext:
    try:
        library = ctypes.CDLL("libEGL.so.1")
    except OSError:
        raise ContextError(
            f"egl: libEGL.so.1 is missing; install it with: apt-get install {EGL_PACKAGES}"
        ) from None
    library.eglGetProcAddress.restype = ctypes.c_void_p
    options: dict[str, Any] = {"backend": "egl", "standalone": True}
    last: Exception | None = None
    for index in range(8) if device_index is None else (device_index,):
        options["device_index"] = index
        try:
            ctx = moderngl.create_context(require=MIN_VERSION, **options)
        except Exception as error:  # glcontext raises bare Exception
            last = last or error
            if "device" in str(error) and "index" in str(error):
                break
            continue
        return _checked(GLContext(ctx, "egl", lambda n: library.eglGetProcAddress(n.encode()) or 0))
    raise ContextError(
        f"egl: no device gives an OpenGL 4.3 context ({last}); "
        f"install a software driver with: apt-get install {EGL_PACKAGES}"
    )


class _OSMesaContext:
    """What moderngl asks of a context: addresses of functions, and being made current."""

    def __init__(self) -> None:
        for name in _OSMESA_NAMES:
            try:
                self._library = ctypes.CDLL(name)
                break
            except OSError:
                continue
        else:
            raise ContextError(
                f"osmesa: libOSMesa is missing; install it with: apt-get install {OSMESA_PACKAGES} "
                f"(Mesa 25.1 and later have none; use egl there)"
            )
        library = self._library
        library.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
        library.OSMesaCreateContextAttribs.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
        library.OSMesaMakeCurrent.argtypes = (
            [ctypes.c_void_p] * 2 + [ctypes.c_uint] + [ctypes.c_int] * 2
        )
        library.OSMesaGetProcAddress.restype = ctypes.c_void_p
        library.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
        self._handle: int | None = None
        for minor in (5, 3):
            pairs = [*_OSMESA_ATTRIBUTES.values(), (_OSMESA_MAJOR, 4), (_OSMESA_MINOR, minor)]
            flat = [value for pair in pairs for value in pair] + [0]
            self._handle = library.OSMesaCreateContextAttribs(
                (ctypes.c_int * len(flat))(*flat), None
            )
            if self._handle:
                break
        if not self._handle:
            raise ContextError("osmesa: this Mesa gives no OpenGL 4.3 core context; update it")
        self._pixels = ctypes.create_string_buffer(16 * 16 * 4)
        self.__enter__()

    def load_opengl_function(self, name: str) -> int:
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def __enter__(self) -> Self:
        if not self._library.OSMesaMakeCurrent(
            self._handle, self._pixels, _GL_UNSIGNED_BYTE, 16, 16
        ):
            raise ContextError("osmesa: the context cannot be made current")
        return self

    def __exit__(self, *_: object) -> None:
        self._library.OSMesaMakeCurrent(None, None, 0, 0, 0)

    def release(self) -> None:
        if self._handle:
            self.__exit__()
            self._library.OSMesaDestroyContext(self._handle)
            self._handle = None


def _open_osmesa() -> GLContext:
    context = _OSMesaContext()
    made: Any = context  # moderngl's annotation knows no foreign contexts
    ctx = moderngl.create_context(context=made, require=MIN_VERSION)
    return _checked(GLContext(ctx, "osmesa", context.load_opengl_function))

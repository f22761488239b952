"""OSMesa: contexts in memory, where the system still has it."""

import ctypes
import os
from typing import Self

from fastgen import gl_forks
from fastgen.egl import EGL_LIBRARY
from fastgen.errors import ContextError

OSMESA_PACKAGES = "libosmesa6"

_OSMESA_NAMES = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")

# GL/osmesa.h: OSMESA_FORMAT: OSMESA_RGBA, OSMESA_DEPTH_BITS, OSMESA_PROFILE: OSMESA_CORE_PROFILE
_OSMESA_ATTRIBUTES = (0x22, 0x1908, 0x30, 24, 0x33, 0x34)
_OSMESA_MAJOR, _OSMESA_MINOR = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401

_POINTER, _INT, _UINT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint


class OSMesaContext:
    """A context that draws into a buffer of its own; current from the start."""

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
        library = ctypes.CDLL(EGL_LIBRARY, mode=os.RTLD_NOLOAD)
    except OSError:
        return  # EGL is not in use
    library.eglGetCurrentDisplay.restype = _POINTER
    library.eglMakeCurrent.argtypes = [_POINTER] * 4
    display = library.eglGetCurrentDisplay()
    if display:
        library.eglMakeCurrent(display, None, None, None)

"""Off-screen OpenGL contexts in memory with OSMesa."""

import ctypes
import os

from fastgen.errors import ContextError
from fastgen.render.contexts import gl_forks
from fastgen.render.contexts.driver_variables import advice, check_osmesa
from fastgen.render.contexts.egl import EGL_LIBRARY
from fastgen.render.contexts.native_context import NativeContext

OSMESA_PACKAGES = "libosmesa6"

_OSMESA_NAMES = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")

# GL/osmesa.h
_OSMESA_FORMAT, _OSMESA_RGBA = 0x22, 0x1908
_OSMESA_DEPTH_BITS = 0x30
_OSMESA_PROFILE, _OSMESA_CORE_PROFILE = 0x33, 0x34
_OSMESA_CONTEXT_MAJOR_VERSION, _OSMESA_CONTEXT_MINOR_VERSION = 0x36, 0x37
_ATTRIBUTES = (
    *(_OSMESA_FORMAT, _OSMESA_RGBA),
    *(_OSMESA_DEPTH_BITS, 24),
    *(_OSMESA_PROFILE, _OSMESA_CORE_PROFILE),
    *(_OSMESA_CONTEXT_MAJOR_VERSION, 4),
)
_GL_UNSIGNED_BYTE = 0x1401

_POINTER, _INT, _UINT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint


class OSMesaContext(NativeContext):
    """OpenGL context that draws to memory."""

    def __init__(self) -> None:
        if not gl_forks.usable("osmesa"):
            raise ContextError(f"osmesa: {gl_forks.REASON}")
        check_osmesa()
        gl_forks.opened("osmesa", software=True)
        self._library = _osmesa_library()
        # OSMesa requires a buffer to bind a context; nothing is drawn to this one
        self._pixels = ctypes.create_string_buffer(16 * 16 * 4)
        for minor in (5, 4):
            flat = (*_ATTRIBUTES, _OSMESA_CONTEXT_MINOR_VERSION, minor, 0)
            attributes = (_INT * len(flat))(*flat)
            handle = self._library.OSMesaCreateContextAttribs(attributes, None)
            if handle:
                break
        else:
            raise ContextError(f"osmesa: no OpenGL 4.4 core context; {advice('update Mesa')}")
        super().__init__("osmesa", handle)

    def load_opengl_function(self, name: str) -> int:
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def _is_current(self, handle: int) -> bool:
        return bool(self._library.OSMesaGetCurrentContext() == handle)

    def _bind(self, handle: int) -> None:
        _unbind_egl()
        if not self._library.OSMesaMakeCurrent(handle, self._pixels, _GL_UNSIGNED_BYTE, 16, 16):
            raise ContextError("osmesa: the context cannot be made current")

    def _unbind(self) -> None:
        self._library.OSMesaMakeCurrent(None, None, 0, 0, 0)

    def _destroy(self, handle: int) -> None:
        self._library.OSMesaDestroyContext(handle)


def _osmesa_library() -> ctypes.CDLL:
    failures = []
    for name in _OSMESA_NAMES:
        try:
            library = ctypes.CDLL(name)
            break
        except OSError as error:
            failures.append(str(error))
    else:
        raise ContextError(
            f"osmesa: {failures[0]}; on Debian or Ubuntu: apt-get install {OSMESA_PACKAGES} "
            f"(Mesa 25.1 and later have no OSMesa; use egl there)"
        )
    library.OSMesaCreateContextAttribs.restype = _POINTER
    library.OSMesaCreateContextAttribs.argtypes = [_POINTER, _POINTER]
    library.OSMesaMakeCurrent.argtypes = [_POINTER, _POINTER, _UINT, _INT, _INT]
    library.OSMesaGetCurrentContext.restype = _POINTER
    library.OSMesaGetProcAddress.restype = _POINTER
    library.OSMesaDestroyContext.argtypes = [_POINTER]
    return library


def _unbind_egl() -> None:
    """Release EGL's context from this thread before OSMesa binds its own.

    Both share Mesa's dispatch table. Otherwise EGL would still consider its context current and
    skip the next eglMakeCurrent, and OpenGL calls would go to the context of OSMesa.
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

"""Headless OpenGL contexts with EGL or OSMesa.

Mesa removed OSMesa in version 25.1. The software device of EGL replaces it there.
"""

import ctypes
import re
from collections.abc import Callable
from typing import Any, Self

import moderngl

from fastgen.errors import ConfigError, ContextError
from fastgen.render.contexts import gl_forks
from fastgen.render.contexts.driver_variables import advice
from fastgen.render.contexts.egl import EGL_PACKAGES, Egl, EglContext, EglDevice
from fastgen.render.contexts.native_context import NativeContext
from fastgen.render.contexts.osmesa import OSMesaContext
from fastgen.render.contexts.shader_cache import spare_full_disk
from fastgen.validation import check_known

BACKENDS = ("auto", "egl", "osmesa")

MIN_VERSION = 440
"""Version that has glClearTexSubImage: OpenGL 4.4 core."""

_LEAST_SHADING = (4, 40)
_SHADING_LANGUAGE_VERSION = 0x8B8C  # OpenGL 4.4 core, table 23.56


class GLContext:
    """A current OpenGL context, and a context manager that releases it.

    One thread at a time can use a context; `let_go` makes it available to another thread. Several
    contexts of both backends may exist. Call `make_current` before continuing with one of them and
    before freeing objects made through `ctx`.

    Attributes:
        ctx: The moderngl.Context.
        backend: 'egl' or 'osmesa'.
        renderer: GL_RENDERER of the driver.
        vendor: GL_VENDOR of the driver.
        version: GL_VERSION of the driver.
        software: Whether it is one of Mesa's CPU rasterizers.
    """

    def __init__(self, native: NativeContext, backend: str) -> None:
        foreign: Any = native  # moderngl's type annotation excludes foreign contexts
        try:
            self.ctx = moderngl.create_context(
                require=MIN_VERSION, standalone=True, context=foreign
            )
        except (ValueError, moderngl.Error) as error:  # an old version, a missing function
            native.release()
            raise ContextError(
                f"{backend}: OpenGL 4.4 core is needed ({error}); "
                f"{advice('update the graphics driver')}"
            ) from None
        self.backend = backend
        self.renderer: str = self.ctx.info["GL_RENDERER"]
        self.vendor: str = self.ctx.info["GL_VENDOR"]
        self.version: str = self.ctx.info["GL_VERSION"]
        self.software = is_software(self.renderer)
        self._native = native
        language = self.function("glGetString", ctypes.c_char_p, ctypes.c_uint)
        shading = (language(_SHADING_LANGUAGE_VERSION) or b"").decode(errors="replace")
        found = re.match(r"([0-9]+)\.([0-9]+)", shading)
        if not found or (int(found[1]), int(found[2])) < _LEAST_SHADING:
            self.release()
            raise ContextError(
                f"{backend}: GLSL 4.40 is needed, but this driver has {shading or 'none'}; "
                f"{advice('update the graphics driver')}"
            )

    def function(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        """Return an OpenGL function as a ctypes function, which releases the GIL.

        The function acts on the context that is current when it is called.

        Args:
            name: Name of the function, such as 'glClearTexSubImage'.
            result: The ctypes type of the result, None for void.
            *arguments: The ctypes types of the arguments.

        Raises:
            ContextError: The driver does not have the function.
        """
        address = self._native.load_opengl_function(name)
        if not address:
            raise ContextError(
                f"{self.renderer}: this driver has no {name}; {advice('update Mesa')}"
            )
        return ctypes.CFUNCTYPE(result, *arguments)(address)

    def make_current(self) -> None:
        """Make this context current in the calling thread; costs nothing if it already is.

        Raises:
            ContextError: The context was released.
        """
        self._native.__enter__()

    def let_go(self) -> None:
        """Release the context from this thread, if it is current, for use in another thread."""
        self._native.__exit__()

    def release(self) -> None:
        """Free the context; a second call does nothing.

        If another context is current, it stays current. The caller owns the objects made through
        `ctx`: free them first, or not at all.
        """
        self.ctx.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def is_software(renderer: str) -> bool:
    """Return whether the GL_RENDERER string names one of Mesa's CPU rasterizers."""
    return any(name in renderer for name in ("llvmpipe", "softpipe"))


def open_context(backend: str = "auto", device_index: int | None = None) -> GLContext:
    """Open a context that is current in this thread.

    Args:
        backend: 'egl', 'osmesa', or 'auto' for the first that works in this order.
        device_index: Index of a device in the order of EGL; excludes OSMesa. None uses the first
            device that works, hardware before software.

    Raises:
        ContextError: Nothing works; the message names variables of the environment that change the
            driver, or the packages to install.
        ConfigError: Unknown backend, or a device index for OSMesa.
    """
    check_known("backend", backend, BACKENDS)
    check_device(backend, device_index)
    if device_index is not None:
        backend = "egl"
    spare_full_disk()
    failures = []
    for name in ("egl", "osmesa") if backend == "auto" else (backend,):
        try:
            if name == "egl":
                return _open_egl(device_index)
            return GLContext(OSMesaContext(), "osmesa")
        except ContextError as error:
            failures.append(str(error))
    raise ContextError("; ".join(failures))


def check_device(backend: str, device_index: int | None) -> None:
    """Raise ConfigError if a device index is given for a backend without devices."""
    if device_index is not None and backend == "osmesa":
        raise ConfigError(f"device_index: {device_index}: osmesa has no devices; use egl")


def egl_devices() -> list[EglDevice]:
    """Return the devices that EGL lists, in the order of `device_index`; [] if it cannot list them.

    Raises:
        ContextError: The library libEGL is missing.
    """
    return Egl().devices()


def _open_egl(device_index: int | None) -> GLContext:
    egl = Egl()
    devices = egl.devices()
    tries: list[EglDevice | None]
    if device_index is None:
        tries = [*sorted(devices, key=lambda device: device.software), None]
    elif 0 <= device_index < len(devices):
        tries = [devices[device_index]]
    else:
        raise ContextError(
            f"egl: device_index: there is no device {device_index} among the {len(devices)} "
            f"devices of EGL; fastgen doctor lists them"
        )
    failures = []
    for device in tries:
        where = f"device {devices.index(device)}" if device else "surfaceless"
        software = device is None or device.software
        if not gl_forks.usable(f"egl {where}"):
            failures.append(f"{where}: {gl_forks.REASON}")
            if software:
                continue  # another display gives the same rasterizer
            break
        gl_forks.opened(f"egl {where}", software)
        try:
            return GLContext(EglContext(egl, device), "egl")
        except ContextError as error:
            failures.append(f"{where}: {error}")
    install = f"for Mesa's software driver on Debian or Ubuntu: apt-get install {EGL_PACKAGES}"
    raise ContextError(
        f"egl: no context with OpenGL 4.4 core ({', '.join(failures)}); {advice(install)}"
    )

"""OpenGL contexts without a screen: EGL, or OSMesa where the system still has it.

Mesa dropped OSMesa in version 25.1; EGL with the software device does the same job there.
"""

import ctypes
import os
from collections.abc import Callable
from typing import Any, Self

import moderngl

from fastgen.errors import ConfigError, ContextError
from fastgen.render.contexts import gl_forks
from fastgen.render.contexts.egl import EGL_PACKAGES, Egl, EglContext, EglDevice
from fastgen.render.contexts.native_context import NativeContext
from fastgen.render.contexts.osmesa import OSMesaContext
from fastgen.render.contexts.shader_cache import spare_full_disk
from fastgen.validation import check_known

BACKENDS = ("auto", "egl", "osmesa")

MIN_VERSION = 440
"""Textures cleared in part: OpenGL 4.4 core."""


class GLContext:
    """A current OpenGL context. A context manager: leaving it releases the context.

    ctx: moderngl.Context. backend: 'egl' or 'osmesa'. renderer, vendor, version: the driver's
    own words. software: whether it is one of Mesa's rasterizers on the processor. One thread at a
    time uses it: `let_go` hands it on. Several may live at once, of both backends: call
    `make_current` before going on with one, and before freeing what was made through `ctx`.
    """

    def __init__(self, native: NativeContext, backend: str) -> None:
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
        self.software = is_software(self.renderer)
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


def is_software(renderer: str) -> bool:
    """Whether a driver of this name draws on the processor, or has one that does draw for it."""
    return any(name in renderer for name in ("llvmpipe", "softpipe"))


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
    """Raise ConfigError where `backend` has no devices to choose from."""
    if device_index is not None and backend == "osmesa":
        raise ConfigError(f"device_index: {device_index}: osmesa has no devices; use egl")


def egl_devices() -> list[EglDevice]:
    """The devices that EGL lists, in the order that `device_index` counts; [] where it cannot.

    Raises ContextError where libEGL is missing.
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
            return GLContext(EglContext(egl, device), "egl")
        except ContextError as error:
            failures.append(f"{where}: {error}")
    raise ContextError(
        f"egl: no context with OpenGL 4.4 core ({', '.join(failures)}); "
        f"for Mesa's software driver on Debian or Ubuntu: apt-get install {EGL_PACKAGES}"
    )

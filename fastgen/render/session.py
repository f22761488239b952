"""What a Generator holds on the GPU: opened when asked for, current only while it draws."""

import contextlib
import os
import threading
from collections.abc import Callable, Iterator

from fastgen.errors import ContextError, FastgenError
from fastgen.render.cuda import CudaFrames
from fastgen.render.gl import GLContext
from fastgen.render.renderer import Renderer

_Left = tuple[int, GLContext, Renderer | None, CudaFrames | None]

_left: list[_Left] = []
"""Process that used what was dropped unclosed, and what that held."""


class Opened:
    """A GL context with a renderer on it.

    open_gl, make: open the one and make the other; bound to nothing that holds this, so that what
    is dropped is gone at once. What was opened before a fork stays the parent's: the child opens
    its own. What was dropped unclosed is freed when another is opened.
    """

    def __init__(
        self, open_gl: Callable[[], GLContext], make: Callable[[GLContext], Renderer]
    ) -> None:
        self._open_gl = open_gl
        self._make = make
        self._gl: GLContext | None = None
        self._renderer: Renderer | None = None
        self._cuda: CudaFrames | None = None
        self._process = os.getpid()
        self._lock = threading.RLock()

    def renderer(self) -> Renderer:
        """The renderer, its context current. Raises ContextError without OpenGL."""
        if self._process != os.getpid():
            self.close()
        if self._renderer is None:
            self._process = os.getpid()
            for each in [each for each in _left if each[0] == self._process]:
                with contextlib.suppress(ValueError):  # another thread was quicker
                    _left.remove(each)
                    _free_quietly(*each[1:])
            self._gl = self._open_gl()
            try:
                self._renderer = self._make(self._gl)
            except BaseException:
                self.close()
                raise
        else:
            assert self._gl is not None
            self._gl.make_current()  # another generator may have been at work in between
        return self._renderer

    def context(self) -> GLContext:
        """The context, current."""
        self.renderer()
        assert self._gl is not None
        return self._gl

    def frames(self, size: tuple[int, int]) -> CudaFrames:
        """What hands frames of (width, height) = size to CUDA; always of the same size."""
        gl = self.context()
        if self._cuda is None:
            self._cuda = CudaFrames(gl, size)
        return self._cuda

    @contextlib.contextmanager
    def drawing(self) -> Iterator[Renderer]:
        """The renderer, to draw with, while other threads wait. Not to be nested. What stops that
        half way, as Ctrl-C does, closes all: nobody knows what stands on the GPU then, and the next
        draw would build on it."""
        with self._alone():
            try:
                yield self.renderer()
            except FastgenError:  # refused, not stopped
                raise
            except BaseException:
                self.close()
                raise
            finally:
                if self._gl is not None:
                    self._gl.let_go()

    def _alone(self) -> threading.RLock:
        """A lock that no other thread of this process holds."""
        if self._process != os.getpid():  # a thread that held it stayed with the parent
            self._lock = threading.RLock()
        return self._lock

    def close(self) -> None:
        """Free the renderer and its context; asked for again, they are opened again."""
        with self._alone():
            gl, held = self._gl, (self._renderer, self._cuda)
            # first, so that nothing goes on with what is freed in part
            self._cuda, self._renderer, self._gl = None, None, None
            if self._process == os.getpid() and gl is not None:
                _free_quietly(gl, *held)

    def __del__(self, left: "list[_Left]" = _left, process: Callable[[], int] = os.getpid) -> None:
        # not freed here, perhaps in the middle of another's render: that switches contexts
        gl = getattr(self, "_gl", None)
        if gl is not None and self._process == process():
            left.append((self._process, gl, self._renderer, self._cuda))


def _free_quietly(gl: GLContext, renderer: Renderer | None, cuda: CudaFrames | None) -> None:
    """Free what nobody will use again; where that fails, it goes with the process."""
    with contextlib.suppress(ContextError):
        gl.make_current()  # else what has the same names in another context is freed
        if cuda is not None:
            cuda.release()
        if renderer is not None:
            renderer.release()
        gl.release()

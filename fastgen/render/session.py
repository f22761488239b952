"""GpuSession: the GL context and renderer of a Generator, opened on first use."""

import contextlib
import os
import threading
from collections.abc import Callable, Iterator

from fastgen.errors import ContextError, FastgenError
from fastgen.render.cuda import CudaFrames
from fastgen.render.gl import GLContext
from fastgen.render.renderer import Renderer

_Abandoned = tuple[int, GLContext, Renderer | None, CudaFrames | None]

_abandoned: list[_Abandoned] = []
"""Process and GL objects of sessions that were dropped without being closed."""


class GpuSession:
    """A GL context with a renderer on it, current only while it draws.

    Threads take turns. A process that is forked off leaves its parent's context alone and opens its
    own. If a session is dropped without `close`, its GL objects are freed when the next session of
    this process opens its context.
    """

    def __init__(
        self, open_gl: Callable[[], GLContext], make: Callable[[GLContext], Renderer]
    ) -> None:
        """Prepare a session without opening it.

        Args:
            open_gl: Opens a context.
            make: Makes the renderer on it. Neither may hold a reference to this session, so that a
                dropped session is collected at once.
        """
        self._open_gl = open_gl
        self._make = make
        self._gl: GLContext | None = None
        self._renderer: Renderer | None = None
        self._cuda: CudaFrames | None = None
        self._process = os.getpid()
        self._lock = threading.RLock()

    def renderer(self) -> Renderer:
        """Return the renderer with its context current.

        Raises:
            ContextError: There is no OpenGL.
        """
        if self._process != os.getpid():
            self.close()
        if self._renderer is None:
            self._process = os.getpid()
            for each in [each for each in _abandoned if each[0] == self._process]:
                with contextlib.suppress(ValueError):  # another thread was quicker
                    _abandoned.remove(each)
                    _free_quietly(*each[1:])
            self._gl = self._open_gl()
            try:
                self._renderer = self._make(self._gl)
            except BaseException:
                self.close()
                raise
        else:
            assert self._gl is not None
            self._gl.make_current()  # another session may have drawn in between
        return self._renderer

    def context(self) -> GLContext:
        """Return the context, current."""
        self.renderer()
        assert self._gl is not None
        return self._gl

    def frames(self, size: tuple[int, int]) -> CudaFrames:
        """Return what hands frames to CUDA; (width, height) = size must not change."""
        gl = self.context()
        if self._cuda is None:
            self._cuda = CudaFrames(gl, size)
        return self._cuda

    @contextlib.contextmanager
    def drawing(self) -> Iterator[Renderer]:
        """Lend the renderer while other threads wait. Must not be nested.

        An interruption such as Ctrl-C closes the session: the state on the GPU is unknown then, and
        the next draw would build on it.
        """
        with self._exclusive():
            try:
                yield self.renderer()
            except FastgenError:  # a refused argument, not an interruption
                raise
            except BaseException:
                self.close()
                raise
            finally:
                if self._gl is not None:
                    self._gl.let_go()

    def _exclusive(self) -> threading.RLock:
        """Return a lock that no other thread of this process holds."""
        if self._process != os.getpid():  # a thread of the parent may have held the old one
            self._lock = threading.RLock()
        return self._lock

    def close(self) -> None:
        """Free renderer and context. The next use opens them again."""
        with self._exclusive():
            gl, held = self._gl, (self._renderer, self._cuda)
            # first, so that nothing uses what is already freed in part
            self._cuda, self._renderer, self._gl = None, None, None
            if self._process == os.getpid() and gl is not None:
                _free_quietly(gl, *held)

    def __del__(
        self,
        abandoned: "list[_Abandoned]" = _abandoned,
        process: Callable[[], int] = os.getpid,
    ) -> None:
        # freeing switches contexts, perhaps in the middle of another session's draw: the next
        # session that opens does it instead
        gl = getattr(self, "_gl", None)
        if gl is not None and self._process == process():
            abandoned.append((self._process, gl, self._renderer, self._cuda))


def _free_quietly(gl: GLContext, renderer: Renderer | None, cuda: CudaFrames | None) -> None:
    """Free GL objects that nobody will use again; on failure they go with the process."""
    with contextlib.suppress(ContextError):
        gl.make_current()  # objects of another context may have the same names
        if cuda is not None:
            cuda.release()
        if renderer is not None:
            renderer.release()
        gl.release()

"""What EGL's and OSMesa's contexts have in common."""

from abc import ABC, abstractmethod
from typing import Self

from fastgen.errors import ContextError


class NativeContext(ABC):
    """A context of one backend, with what moderngl asks of it; current from the start.

    backend: its name. handle: of the context, which this owns from now on.
    """

    def __init__(self, backend: str, handle: int) -> None:
        self._backend = backend
        self._handle: int | None = handle
        try:
            self.__enter__()
        except ContextError:
            self.release()
            raise

    @abstractmethod
    def load_opengl_function(self, name: str) -> int:
        """Address of a GL function, 0 where there is none."""

    @abstractmethod
    def _is_current(self, handle: int) -> bool:
        """Whether it is this thread's context."""

    @abstractmethod
    def _bind(self, handle: int) -> None:
        """Make it this thread's context."""

    @abstractmethod
    def _unbind(self) -> None:
        """Leave this thread, whose context it is, without one."""

    @abstractmethod
    def _destroy(self, handle: int) -> None:
        """Free it."""

    def __enter__(self) -> Self:
        if self._handle is None:
            raise ContextError(f"{self._backend}: the context was released; open another")
        if not self._is_current(self._handle):
            self._bind(self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        if self._handle is not None and self._is_current(self._handle):
            self._unbind()

    def release(self) -> None:
        """Free the context; a second call does nothing."""
        if self._handle is not None:
            self.__exit__()
            self._destroy(self._handle)
            self._handle = None

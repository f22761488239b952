"""Common base of EGL and OSMesa contexts."""

from abc import ABC, abstractmethod
from typing import Self

from fastgen.errors import ContextError


class NativeContext(ABC):
    """OpenGL context of one backend, with the interface that moderngl requires.

    The context is current after construction.

    Args:
        backend: Name of the backend, for error messages.
        handle: Native context; this object owns it.
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
        """Return the address of an OpenGL function, 0 if it does not exist."""

    @abstractmethod
    def _is_current(self, handle: int) -> bool:
        """Return whether the context is current in this thread."""

    @abstractmethod
    def _bind(self, handle: int) -> None:
        """Make the context current in this thread."""

    @abstractmethod
    def _unbind(self) -> None:
        """Release the context from this thread, in which it is current."""

    @abstractmethod
    def _destroy(self, handle: int) -> None:
        """Free the context."""

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

"""Caches of what was used last."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class _Releasable(Protocol):
    def release(self) -> None: ...


T = TypeVar("T")
R = TypeVar("R", bound=_Releasable)


class Recent(Generic[T]):
    """The most recently used values by key."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._items: OrderedDict[object, T] = OrderedDict()

    def get(self, key: object, make: Callable[[], T]) -> T:
        """The value of `key`, made if need be."""
        if key not in self._items:
            self._items[key] = make()
            if len(self._items) > self._capacity:
                self._dropped(self._items.popitem(last=False)[1])
        self._items.move_to_end(key)
        return self._items[key]

    def _dropped(self, value: T) -> None:
        """Called with what falls out."""


class Kept(Recent[R]):
    """GL objects; what falls out is released."""

    def _dropped(self, value: R) -> None:
        value.release()

    def release(self) -> None:
        """Free them all."""
        while self._items:
            self._items.popitem()[1].release()

"""Caches of the most recently used values."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class _Releasable(Protocol):
    def release(self) -> None: ...


T = TypeVar("T")
R = TypeVar("R", bound=_Releasable)


class RecentCache(Generic[T]):
    """Cache that drops the least recently used value when it is full.

    Args:
        capacity: Largest number of values.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._items: OrderedDict[object, T] = OrderedDict()

    def get(self, key: object, make: Callable[[], T]) -> T:
        """Return the value of a key.

        Args:
            key: Hashable key of the value.
            make: Returns the value; called if the key is not cached.
        """
        if key not in self._items:
            self._items[key] = make()
            self.shrink(self._capacity)
        self._items.move_to_end(key)
        return self._items[key]

    def shrink(self, most: int) -> None:
        """Drop the least recently used values until there are at most `most`."""
        while len(self._items) > most:
            self._dropped(self._items.popitem(last=False)[1])

    def _dropped(self, value: T) -> None:
        """Handle a value that was dropped."""


class ReleasingCache(RecentCache[R]):
    """Cache of GL objects that releases an object when it drops it."""

    def _dropped(self, value: R) -> None:
        value.release()

    def release(self) -> None:
        """Free all cached GL objects."""
        while self._items:
            self._items.popitem()[1].release()

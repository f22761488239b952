"""A cache of GL objects."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class _Releasable(Protocol):
    def release(self) -> None: ...


T = TypeVar("T", bound=_Releasable)


class Kept(Generic[T]):
    """The most recently used GL objects by key; what falls out is released."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._items: OrderedDict[object, T] = OrderedDict()

    def get(self, key: object, make: Callable[[], T]) -> T:
        """The object of `key`, made if need be."""
        if key not in self._items:
            self._items[key] = make()
            if len(self._items) > self._capacity:
                self._items.popitem(last=False)[1].release()
        self._items.move_to_end(key)
        return self._items[key]

    def release(self) -> None:
        """Free them all."""
        while self._items:
            self._items.popitem()[1].release()

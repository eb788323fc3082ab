"""What is kept for the next time it is asked for, as long as it fits."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class LRUCache(Generic[K, V]):
    """Values by key, at most ``capacity`` bytes; the least recently used go first.

    A value may grow while it is used, until another is asked for. So the one and the other are
    measured then, and no more: there may be thousands.
    """

    def __init__(self, capacity: int, size_of: Callable[[V], int]) -> None:
        self._capacity = capacity
        self._size_of = size_of
        self._values: OrderedDict[K, V] = OrderedDict()
        self._sizes: dict[K, int] = {}
        self._total = 0

    def __iter__(self) -> Iterator[K]:
        """Yield the keys, that which was used last at the end."""
        return iter(self._values)

    @property
    def nbytes(self) -> int:
        """Bytes of all values, each as it was when it was measured last."""
        return self._total

    def find(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key, made now if it is not there."""
        if self._values:
            self._measure(next(reversed(self._values)))
        if key not in self._values:
            self._values[key] = make()
        self._values.move_to_end(key)
        self._measure(key)
        return self._values[key]

    def surplus(self, least: int = 0) -> Iterator[K]:
        """Drop what does not fit, but for the ``least`` that were used last, and yield its keys."""
        while self._total > self._capacity and len(self._values) > least:
            key = next(iter(self._values))
            self.drop(key)
            yield key

    def _measure(self, key: K) -> None:
        size = self._size_of(self._values[key])
        self._total += size - self._sizes.get(key, 0)
        self._sizes[key] = size

    def drop(self, key: K) -> None:
        """Keep the value of a key no longer."""
        del self._values[key]
        self._total -= self._sizes.pop(key)

"""A cache of values by key, bounded in bytes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class LRUCache(Generic[K, V]):
    """Values by key, at most ``capacity`` bytes; the least recently used go first.

    A value may grow while it is in use, until another is looked up. So a lookup measures two
    values, the one used before and the one returned. There may be thousands of others.
    """

    def __init__(self, capacity: int, size_of: Callable[[V], int]) -> None:
        self._capacity = capacity
        self._size_of = size_of
        self._values: OrderedDict[K, V] = OrderedDict()
        self._sizes: dict[K, int] = {}
        self._total = 0
        self.evictions = 0
        """Values dropped so far to make room"""

    def __iter__(self) -> Iterator[K]:
        """Yield the keys, the most recently used last."""
        return iter(self._values)

    def get(self, key: K) -> V | None:
        """Return the value of a key, if there is one; that is no use of it."""
        return self._values.get(key)

    @property
    def nbytes(self) -> int:
        """Bytes of all values, each as measured last."""
        return self._total

    def find(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key, which ``make`` makes where the cache has none."""
        if self._values:
            self._measure(next(reversed(self._values)))
        if key not in self._values:
            self._values[key] = make()
        self._values.move_to_end(key)
        self._measure(key)
        return self._values[key]

    def put(self, key: K, value: V) -> None:
        """Add a value as the most recently used, over any that the key has."""
        self._values[key] = value
        self._values.move_to_end(key)
        self._measure(key)

    def evict(self, spare: int = 0) -> list[K]:
        """Drop values until the rest fit, but not the ``spare`` used last; return their keys."""
        evicted = []
        while self._total > self._capacity and len(self._values) > spare:
            evicted.append(next(iter(self._values)))
            self.drop(evicted[-1])
        self.evictions += len(evicted)
        return evicted

    def drop(self, key: K) -> None:
        """Remove a key and its value."""
        del self._values[key]
        self._total -= self._sizes.pop(key)

    def _measure(self, key: K) -> None:
        size = self._size_of(self._values[key])
        self._total += size - self._sizes.get(key, 0)
        self._sizes[key] = size

"""A fair queue: clients take turns, and the items of each stay in order."""

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class FairQueue(Generic[T]):
    """Waiting items by client.

    A client with many items gets no more turns than one with few.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, deque[T]] = {}  # in the order of their turns

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def has(self, client: str) -> bool:
        """Tell whether a client has an item in the queue."""
        return client in self._waiting

    def put(self, client: str, item: T) -> None:
        """Add an item behind all others of its client."""
        self._waiting.setdefault(client, deque()).append(item)

    def take(self, fits: Callable[[T], bool]) -> T | None:
        """Remove and return the first item that ``fits``, by turns of clients; None without one."""
        for client, items in self._waiting.items():
            for item in items:
                if fits(item):
                    self.remove(client, item)
                    if client in self._waiting:  # the others go first now
                        self._waiting[client] = self._waiting.pop(client)
                    return item
        return None

    def remove(self, client: str, item: T) -> None:
        """Remove an item, if it is still in the queue."""
        items = self._waiting.get(client, deque())
        if item in items:
            items.remove(item)
        if not items:
            self._waiting.pop(client, None)

    def take_all(self) -> list[T]:
        """Remove and return all items."""
        items = [item for items in self._waiting.values() for item in items]
        self._waiting.clear()
        return items

"""Who is next: clients take turns, and the requests of each keep their order."""

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class FairQueue(Generic[T]):
    """What waits, by client.

    A client that has much waiting gets no more turns than one that has little.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, deque[T]] = {}  # in the order of their turns

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def has(self, client: str) -> bool:
        """Tell whether anything of a client's waits."""
        return client in self._waiting

    def put(self, client: str, item: T) -> None:
        """Let ``item`` wait, behind all else of the same client."""
        self._waiting.setdefault(client, deque()).append(item)

    def take(self, fits: Callable[[T], bool]) -> T | None:
        """Return the first item that ``fits`` of the client whose turn it is; None for none."""
        for client, items in self._waiting.items():
            for item in items:
                if fits(item):
                    self.remove(client, item)
                    if client in self._waiting:  # the others go first now
                        self._waiting[client] = self._waiting.pop(client)
                    return item
        return None

    def remove(self, client: str, item: T) -> None:
        """Let ``item``, if it still waits, wait no longer."""
        items = self._waiting.get(client, deque())
        if item in items:
            items.remove(item)
        if not items:
            self._waiting.pop(client, None)

    def take_all(self) -> list[T]:
        """Return all that waits; nothing does then."""
        items = [item for items in self._waiting.values() for item in items]
        self._waiting.clear()
        return items

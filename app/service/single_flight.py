"""Once: who asks for what is being computed already waits for that."""

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from app.engine.interface import ProgressCallback

T = TypeVar("T")


@dataclass(eq=False)
class _Flight(Generic[T]):
    task: "asyncio.Task[T]"
    told: list[ProgressCallback] = field(default_factory=list)
    """Of those who wait, each its own"""
    share: float = 0.0
    has_begun: bool = False


class SingleFlight(Generic[T]):
    """Work under way, by name. What is over, well or badly, is forgotten."""

    def __init__(self) -> None:
        self._flights: dict[str, _Flight[T]] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._flights

    async def join(
        self,
        name: str,
        start: Callable[[ProgressCallback], Coroutine[Any, Any, T]],
        told: ProgressCallback,
    ) -> T:
        """Wait for the work ``name``, which ``start`` begins where nobody waits for it yet.

        Cancelling the call leaves; the work is cancelled when the last has left. All who wait are
        ``told`` which share of it is done.
        """
        flight = self._flights.get(name) or self._depart(name, start)
        flight.told.append(told)
        if flight.has_begun:
            told(flight.share)
        try:
            return await asyncio.shield(flight.task)
        finally:
            flight.told.remove(told)
            if not flight.told and not flight.task.done():
                flight.task.cancel()
                self._forget(name, flight)

    def _depart(
        self, name: str, start: Callable[[ProgressCallback], Coroutine[Any, Any, T]]
    ) -> _Flight[T]:
        def tell(share: float) -> None:
            flight.share, flight.has_begun = share, True
            for told in flight.told:
                told(share)

        task = asyncio.create_task(start(tell), name=name)
        flight = self._flights[name] = _Flight(task)
        task.add_done_callback(lambda _: self._forget(name, flight))
        return flight

    def _forget(self, name: str, flight: _Flight[T]) -> None:
        if self._flights.get(name) is flight:
            del self._flights[name]

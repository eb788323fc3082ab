"""Single-flight: concurrent requests for one result share one computation."""

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from app.engine.interface import ProgressCallback
from app.errors import ProblemError

T = TypeVar("T")

Start = Callable[[ProgressCallback], Coroutine[Any, Any, T]]
"""Begins a computation, which reports its progress"""


@dataclass(eq=False)
class _Flight(Generic[T]):
    task: "asyncio.Task[T]"
    listeners: list[ProgressCallback] = field(default_factory=list)
    """One for each call that waits"""
    progress: float = 0.0
    has_begun: bool = False


class SingleFlight(Generic[T]):
    """Computations under way, by name. A finished one is forgotten, whether it succeeded or not."""

    def __init__(self) -> None:
        self._flights: dict[str, _Flight[T]] = {}

    def names(self) -> list[str]:
        """Return the names of all."""
        return list(self._flights)

    async def join(
        self,
        name: str,
        start: Start[T],
        on_progress: ProgressCallback,
        *,
        is_promised: bool = False,
    ) -> T:
        """Wait for the computation ``name``; ``start`` begins it where there is none.

        Cancelling a call leaves the computation to the others that wait. It is cancelled when the
        last has left. Progress is reported to each. Where a computation that was begun without a
        promise is refused for want of room, a promised call begins it again.
        """
        while True:
            try:
                return await self._join(name, start, on_progress)
            except ProblemError as error:
                if not is_promised or error.problem.code != "queue_full":
                    raise

    async def _join(self, name: str, start: Start[T], on_progress: ProgressCallback) -> T:
        flight = self._flights.get(name) or self._start(name, start)
        flight.listeners.append(on_progress)
        if flight.has_begun:
            on_progress(flight.progress)
        try:
            return await asyncio.shield(flight.task)
        finally:
            flight.listeners.remove(on_progress)
            if not flight.listeners and not flight.task.done():
                flight.task.cancel()
                self._forget(name, flight)

    def _start(self, name: str, start: Start[T]) -> _Flight[T]:
        def report(share: float) -> None:
            flight.progress, flight.has_begun = share, True
            for on_progress in flight.listeners:
                on_progress(share)

        task = asyncio.create_task(start(report), name=name)
        flight = self._flights[name] = _Flight(task)
        task.add_done_callback(lambda _: self._forget(name, flight))
        return flight

    def _forget(self, name: str, flight: _Flight[T]) -> None:
        if self._flights.get(name) is flight:
            del self._flights[name]

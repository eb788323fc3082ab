"""Large bodies of queries: each caller has a line of its own, so that nobody waits for another's.

To read and check a body of 40 000 points on the event loop would take a tenth of a second. It is
done in a thread, and a caller has one at a time. A few bodies of a caller are in memory; the others
wait unread, and their clients with them.
"""

from asyncio import Lock, Semaphore
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial
from time import sleep, thread_time
from typing import TypeVar
from weakref import WeakValueDictionary

from anyio import CapacityLimiter, to_thread
from fastapi import Request

from app.http.dependencies import caller_of, service_of, while_connected
from app.service.time_limit import time_limit

LARGE = 2**16
"""Bytes of a body that is worth a thread: it takes some milliseconds."""
READ_AT_ONCE = 4
"""Large bodies of one caller that are in memory and not checked yet"""
CHECKED_AT_ONCE = 4
"""Callers whose bodies are checked at a time: more threads would keep others from the interpreter.

Those beyond take turns, since each caller waits with one body.
"""

T = TypeVar("T")


@dataclass(eq=False)
class _Line:
    """The large bodies of one caller."""

    places: Semaphore = field(default_factory=lambda: Semaphore(READ_AT_ONCE))
    turn: Lock = field(default_factory=Lock)


class LargeBodies:
    """The lines of all callers that have large bodies at the moment."""

    def __init__(self) -> None:
        self._lines: WeakValueDictionary[str, _Line] = WeakValueDictionary()
        self.checking = CapacityLimiter(CHECKED_AT_ONCE)
        """Threads that check bodies"""

    @asynccontextmanager
    async def reading(self, request: Request, deadline_s: float) -> AsyncIterator[None]:
        """Read and check a body inside the block, which begins once its caller has a place.

        One whose size is not declared counts as large.
        """
        declared = request.headers.get("content-length", "")
        if declared.isdigit() and int(declared) < LARGE:
            yield
            return
        line = self._line(request)
        async with time_limit(service_of(request).settings, deadline_s):
            await line.places.acquire()
        try:
            yield
        finally:
            line.places.release()

    async def check(self, request: Request, deadline_s: float, do: Callable[[], T]) -> T:
        """Run work whose time grows with the body: in a thread, where the body is large.

        A request waits for its turn no longer than its client, and no longer than ``deadline_s``.
        """
        if len(await request.body()) < LARGE:
            return do()
        working = self._in_thread(self._line(request), do)
        async with time_limit(service_of(request).settings, deadline_s):
            return await while_connected(request, working)

    async def _in_thread(self, line: _Line, do: Callable[[], T]) -> T:
        async with line.turn:
            return await to_thread.run_sync(partial(at_half_pace, do), limiter=self.checking)

    def _line(self, request: Request) -> _Line:
        return self._lines.setdefault(caller_of(request).name, _Line())


def large_bodies_of(request: Request) -> LargeBodies:
    """Return the large bodies of this application."""
    bodies: LargeBodies = request.app.state.large_bodies
    return bodies


def at_half_pace(do: Callable[[], T]) -> T:
    """Do what holds the interpreter, and rest as long, so that others get at least half of it."""
    began = thread_time()
    try:
        return do()
    finally:
        sleep(thread_time() - began)

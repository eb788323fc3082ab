"""Large bodies of queries: each caller has a queue of its own, so that nobody waits for another's.

To read and check a body of 40 000 points on the event loop would take a tenth of a second. It is
done in a thread, and a caller has one at a time. A few bodies of a caller are in memory; the others
wait unread, and their clients with them.
"""

from asyncio import Lock, Semaphore, get_running_loop
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from time import thread_time
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
class _Queue:
    """The large bodies of one caller."""

    places: Semaphore = field(default_factory=lambda: Semaphore(READ_AT_ONCE))
    turn: Lock = field(default_factory=Lock)


class LargeBodies:
    """The queues of all callers that have large bodies at the moment."""

    def __init__(self) -> None:
        self._queues: WeakValueDictionary[str, _Queue] = WeakValueDictionary()
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
        queue = self._queue(request)
        async with time_limit(service_of(request).settings, deadline_s):
            await queue.places.acquire()
        try:
            yield
        finally:
            queue.places.release()

    async def check(self, request: Request, deadline_s: float, do: Callable[[], T]) -> T:
        """Run work whose time grows with the body: in a thread, where the body is large.

        A request waits for its turn no longer than its client, and no longer than ``deadline_s``.
        """
        if len(await request.body()) < LARGE:
            return do()
        working = self._in_thread(self._queue(request), do)
        async with time_limit(service_of(request).settings, deadline_s):
            return await while_connected(request, working)

    async def _in_thread(self, queue: _Queue, do: Callable[[], T]) -> T:
        """Do work in the turn of a caller, which then rests as long as the work took.

        The work holds the interpreter, of which others get at least half in this way.
        """
        spent = 0.0

        def measured() -> T:
            nonlocal spent
            began = thread_time()
            try:
                return do()
            finally:
                spent = thread_time() - began

        await queue.turn.acquire()
        try:
            return await to_thread.run_sync(measured, limiter=self.checking)
        finally:
            get_running_loop().call_later(spent, _end_turn, queue)

    def _queue(self, request: Request) -> _Queue:
        return self._queues.setdefault(caller_of(request).name, _Queue())


def large_bodies_of(request: Request) -> LargeBodies:
    """Return the large bodies of this application."""
    bodies: LargeBodies = request.app.state.large_bodies
    return bodies


def _end_turn(queue: _Queue) -> None:
    queue.turn.release()  # the queue lives as long as its turn

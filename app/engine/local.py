"""Worker processes on this machine: one queue, several slots, each kept supplied with a worker."""

import asyncio
import logging
from collections import deque
from collections.abc import Coroutine
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from app.engine.slot import Slot, WorkerLostError
from app.engine.work import Done, Work
from app.engine.worker import WorkerConfig
from app.errors import Problem, ProblemError, over_limit, refuse
from app.settings import Settings

logger = logging.getLogger(__name__)

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0
_RETRY_AFTER = {"Retry-After": "1"}


class LocalEngine:
    """The engine of a service on one machine."""

    def __init__(self, settings: Settings, results: Path) -> None:
        self._settings = settings
        self._slots = [Slot(WorkerConfig(settings, results)) for _ in range(settings.workers)]
        self._idle: list[Slot] = []
        self._waiting: deque[asyncio.Future[Slot]] = deque()
        self._open: set[Slot] = set()
        self._is_failing = False
        self._kernels_are_compiled = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_ready(self) -> bool:
        """Whether at least one worker is warm and alive."""
        return bool(self._open)

    async def start(self) -> None:
        """Start the workers, in the background."""
        for number, slot in enumerate(self._slots):
            self._spawn(self._keep(slot, goes_first=number == 0))

    async def stop(self) -> None:
        """Kill the workers."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(slot.close() for slot in self._slots))

    async def run(self, work: Work, mesh_id: str | None = None) -> Done:
        """Do ``work`` in the next free worker, see ``Engine``."""
        start = perf_counter()
        for dead_ones_left in reversed(range(len(self._slots) + 1)):
            slot = await self._take(mesh_id)
            queued = perf_counter() - start
            try:
                outcome = await self._run_in(slot, work)
            except WorkerLostError as error:
                if error.had_begun or not dead_ones_left:
                    raise refuse("worker_died", "the worker process of this request died") from None
                continue  # it had died idle, unnoticed: nothing was tried yet
            if isinstance(outcome, Problem):
                raise ProblemError(outcome)
            return replace(outcome, seconds={"queue": queued, **outcome.seconds})
        raise AssertionError("the last try returns or raises")

    async def _run_in(self, slot: Slot, work: Work) -> Done | Problem:
        outcome = slot.begin(work)
        try:
            result = await asyncio.shield(outcome)
        except asyncio.CancelledError:
            self._spawn(self._end(slot, outcome, work))
            raise
        except WorkerLostError:
            slot.give_up()
            raise
        self._give_back(slot)
        return result

    async def _end(self, slot: Slot, outcome: "asyncio.Future[Done | Problem]", work: Work) -> None:
        """Stop work that nobody waits for: ask, if it listens, and kill where that fails."""
        slot.ask_to_stop()
        grace = self._settings.cancel_grace_s if work.stops_when_asked else 0
        await asyncio.wait({outcome}, timeout=grace)
        if outcome.done() and outcome.exception() is None:
            self._give_back(slot)
        else:
            slot.give_up()

    async def _keep(self, slot: Slot, *, goes_first: bool) -> None:
        """Keep ``slot`` supplied with a living worker, for ever."""
        pause = _FIRST_PAUSE_S
        if not goes_first:
            # One worker compiles, the others find its kernels in the cache.
            await self._kernels_are_compiled.wait()
        while True:
            try:
                await slot.open()
            except WorkerLostError:
                logger.exception("a worker could not be started; next try in %g s", pause)
                self._fail_if_none_is_open()
                await slot.close()
                await asyncio.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
                continue
            pause = _FIRST_PAUSE_S
            self._is_failing = False
            self._kernels_are_compiled.set()
            self._open.add(slot)
            self._give_back(slot)
            await slot.until_dead()
            logger.warning("a worker is gone and will be replaced")
            self._open.discard(slot)
            if slot in self._idle:
                self._idle.remove(slot)
            await slot.close()

    async def _take(self, mesh_id: str | None) -> Slot:
        """Wait for a free slot, best one that has the mesh open."""
        self._idle = [slot for slot in self._idle if slot.is_alive]
        if self._idle:
            slot = max(self._idle, key=lambda s: (mesh_id in s.known_meshes, -len(s.known_meshes)))
            self._idle.remove(slot)
        else:
            slot = await self._wait()
        if mesh_id is not None and mesh_id not in slot.known_meshes:
            slot.known_meshes.append(mesh_id)
        return slot

    async def _wait(self) -> Slot:
        if self._is_failing:
            raise _unavailable()
        size = self._settings.queue_size
        if len(self._waiting) >= size:
            waiting = len(self._waiting) + 1
            raise over_limit(
                "queue_full", "waiting requests", waiting, size, "queue_size", headers=_RETRY_AFTER
            )
        place: asyncio.Future[Slot] = asyncio.get_running_loop().create_future()
        self._waiting.append(place)
        try:
            return await place
        except asyncio.CancelledError:
            if place.done() and not place.cancelled():
                self._give_back(place.result())  # it came just as its taker left
            elif place in self._waiting:
                self._waiting.remove(place)
            raise

    def _give_back(self, slot: Slot) -> None:
        if not slot.is_alive:
            return  # its keeper replaces it and gives it back then
        while self._waiting:
            place = self._waiting.popleft()
            if not place.done():
                place.set_result(slot)
                return
        self._idle.append(slot)

    def _fail_if_none_is_open(self) -> None:
        if self._open:
            return
        self._is_failing = True
        while self._waiting:
            place = self._waiting.popleft()
            if not place.done():
                place.set_exception(_unavailable())

    def _spawn(self, coroutine: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _unavailable() -> ProblemError:
    detail = "no worker process can be started; the service's log says why"
    return refuse("engine_unavailable", detail, headers=_RETRY_AFTER)

"""Worker processes on this machine: one queue, several slots, each kept supplied with a worker."""

import asyncio
import logging
from collections.abc import Coroutine
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from app.engine.interface import Load, ProgressCallback
from app.engine.queue import FairQueue
from app.engine.slot import Slot, WorkerLostError
from app.engine.work import Outcome, Task, TaskResult, Work
from app.engine.worker import WorkerConfig
from app.errors import Problem, ProblemError, over_limit, problem
from app.settings import Settings

logger = logging.getLogger(__name__)

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0
_RETRY_AFTER = {"Retry-After": "1"}
_TELL_S = 0.1
_SMALL_S = 0.5
"""Granted to small work: ten times what it is likely to take."""


@dataclass(frozen=True, eq=False)
class _Place:
    """A place in the queue."""

    order: Task
    slot: "asyncio.Future[Slot]"


class LocalEngine:
    """The engine of a service on one machine.

    One slot more than the setting asks for takes small work only: that never waits behind long
    work. The others take it as well, but no more of it is done at once than the setting asks for,
    for more than there are cores would only keep each other waiting. What proves not to be small is
    begun anew as what it is.
    """

    def __init__(self, settings: Settings, results: Path) -> None:
        self._settings = settings
        config = WorkerConfig(settings, results)
        self._small = Slot(config)
        self._slots = [self._small, *(Slot(config) for _ in range(settings.workers))]
        self._idle: list[Slot] = []
        self._at_small: set[Slot] = set()
        self._waiting: FairQueue[_Place] = FairQueue()
        self._open: set[Slot] = set()
        self._lost = self._cancelled = 0
        self._is_failing = False
        self.is_draining = False
        self._kernels_are_compiled = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_ready(self) -> bool:
        """Whether a worker that takes any work is warm and alive."""
        return bool(self._open - {self._small})

    @property
    def load(self) -> Load:
        """What it is doing, see ``Engine``."""
        idle = sum(slot.is_alive for slot in self._idle)
        busy = sum(slot.is_alive for slot in self._open) - idle
        missing = len(self._slots) - idle - busy
        return Load(len(self._waiting), idle, busy, missing, self._lost, self._cancelled)

    async def start(self) -> None:
        """Start the workers, in the background."""
        for number, slot in enumerate(reversed(self._slots)):
            self._spawn(self._keep(slot, goes_first=number == 0))

    def drain(self) -> None:
        """Refuse new work, see ``Engine``."""
        self.is_draining = True

    async def stop(self) -> None:
        """Kill the workers."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(slot.close() for slot in self._slots))

    def refuse_when_full(self, client: str) -> None:
        """Refuse what would have to wait and has no room to, see ``Engine``."""
        self._refuse_when_draining()
        if not any(self._takes(slot, is_small=False) for slot in self._idle):
            self._refuse_to_wait(client)

    async def run(self, order: Task, told: ProgressCallback) -> TaskResult:
        """Do the work of an order in the next free worker, see ``Engine``."""
        self._refuse_when_draining()
        start = perf_counter()
        deaths = 0
        while True:
            slot = await self._take(order)
            queued = perf_counter() - start
            try:
                outcome = await self._run_in(slot, order, told)
            except WorkerLostError as error:
                deaths += 1
                if error.had_begun or deaths > len(self._slots):
                    raise problem(
                        "worker_died", "the worker process of this request died"
                    ) from None
                continue  # it had died idle, unnoticed: nothing was tried yet
            if outcome is None:  # it proved not to be small
                order = replace(order, is_small=False)
                continue
            if isinstance(outcome, Problem):
                raise ProblemError(outcome)
            return replace(outcome, seconds={"queue": queued, **outcome.seconds})

    async def _run_in(self, slot: Slot, order: Task, told: ProgressCallback) -> Outcome:
        outcome = slot.begin(order.work, is_small=order.is_small)
        began = perf_counter()
        told(0.0)
        try:
            while not outcome.done():
                await asyncio.wait({outcome}, timeout=_TELL_S)
                told(slot.progress)
                if order.is_small and perf_counter() - began > _SMALL_S:
                    slot.ask_to_stop()
            result = outcome.result()
        except asyncio.CancelledError:
            self._cancelled += 1
            self._spawn(self._end(slot, outcome, order.work))
            raise
        except WorkerLostError:
            slot.give_up()
            raise
        self._give_back(slot)
        return result

    async def _end(self, slot: Slot, outcome: "asyncio.Future[Outcome]", work: Work) -> None:
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
                if not self.is_draining:  # else the interrupt came to the new worker as well
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
            self._lost += 1
            logger.warning("a worker is gone and will be replaced")
            self._open.discard(slot)
            if slot in self._idle:
                self._idle.remove(slot)
            self._at_small.discard(slot)
            self._offer_idle()
            await slot.close()

    async def _take(self, order: Task) -> Slot:
        """Wait for a free slot, best one that knows what the order is about."""
        self._idle = [slot for slot in self._idle if slot.is_alive]
        fit = [slot for slot in self._idle if self._takes(slot, order.is_small)]
        if fit:
            slot = max(fit, key=lambda slot: self._fitness(slot, order))
            self._idle.remove(slot)
            self._note_taken(slot, order)
        else:
            slot = await self._wait(order)
        slot.affinity_keys.extend(
            topic for topic in order.affinity_keys if topic not in slot.affinity_keys
        )
        return slot

    def _fitness(self, slot: Slot, order: Task) -> tuple[Any, ...]:
        """Return what a slot has to do with an order; where nothing, the least it has with others.

        Of those that are equal the one that was used last has most in the processor's caches.
        """
        known = tuple(topic in slot.affinity_keys for topic in order.affinity_keys)
        others = 0 if any(known) else len(slot.affinity_keys)
        return *known, order.is_small and slot is self._small, -others

    def _takes(self, slot: Slot, is_small: bool) -> bool:
        if is_small:
            return len(self._at_small) < self._settings.workers
        return slot is not self._small

    def _note_taken(self, slot: Slot, order: Task) -> None:
        if order.is_small:
            self._at_small.add(slot)

    async def _wait(self, order: Task) -> Slot:
        self._refuse_to_wait(order.client)
        place = _Place(order, asyncio.get_running_loop().create_future())
        self._waiting.put(order.client, place)
        try:
            return await place.slot
        except asyncio.CancelledError:
            self._waiting.remove(order.client, place)
            if place.slot.done() and not place.slot.cancelled():
                self._give_back(place.slot.result())  # it came just as its taker left
            raise

    def _refuse_when_draining(self) -> None:
        if self.is_draining:
            raise problem("draining", "the service is about to stop", headers=_RETRY_AFTER)

    def _refuse_to_wait(self, client: str) -> None:
        if self._is_failing:
            raise _unavailable()
        size = self._settings.queue_size
        # One client cannot lock out the others: a few more places are for who has nothing waiting.
        room = size if self._waiting.has(client) else size + 1 + size // 4
        if len(self._waiting) >= room:
            waiting = len(self._waiting) + 1
            raise over_limit(
                "queue_full", "waiting requests", waiting, size, "queue_size", headers=_RETRY_AFTER
            )

    def _give_back(self, slot: Slot) -> None:
        self._at_small.discard(slot)
        if not slot.is_alive:
            return  # its keeper replaces it and gives it back then
        place = self._waiting.take(
            lambda place: not place.slot.done() and self._takes(slot, place.order.is_small)
        )
        if place is None:
            self._idle.insert(0, slot)
        else:
            self._note_taken(slot, place.order)
            place.slot.set_result(slot)

    def _offer_idle(self) -> None:
        """Offer what is idle to who waits: a worker is gone, and less small work is under way."""
        for slot in reversed(self._idle.copy()):  # so they keep their order
            self._idle.remove(slot)
            self._give_back(slot)

    def _fail_if_none_is_open(self) -> None:
        if self.is_ready:
            return
        self._is_failing = True
        for place in self._waiting.take_all():
            if not place.slot.done():
                place.slot.set_exception(_unavailable())

    def _spawn(self, coroutine: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _unavailable() -> ProblemError:
    detail = "no worker process can be started; the service's log says why"
    return problem("engine_unavailable", detail, headers=_RETRY_AFTER)

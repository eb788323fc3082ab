"""The engine of one machine: a queue, and slots that are kept supplied with worker processes."""

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter, time_ns
from typing import Any

import structlog

import geodesic_core as gc
from app.engine.interface import Load, ProgressCallback, UnclaimedCallback, ignore_unclaimed
from app.engine.queue import FairQueue
from app.engine.slot import Slot, WorkerLostError
from app.engine.work import Outcome, StoreMesh, Task, TaskResult
from app.engine.worker import WorkerConfig
from app.engine.worker_process import FIRST_KERNELS
from app.errors import Problem, ProblemError, draining, over_limit, problem
from app.settings import Settings
from app.tracing import Period, record_span

logger = structlog.get_logger(module=__name__)

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0
"""Between attempts to start a worker"""
_LONG_COMPILATION_S = 1.0
"""Seconds after which the log says that kernels are being compiled"""
_RETRY_AFTER = {"Retry-After": "1"}
_PROGRESS_PERIOD_S = 0.1
_SMALL_S = 0.5
"""Time limit of small work: ten times what it is likely to take"""


@dataclass(frozen=True, eq=False)
class _Waiter:
    """A task in the queue, and the slot that it will be given."""

    task: Task
    slot: "asyncio.Future[Slot]"


class LocalEngine:
    """The engine of a service on one machine.

    It has one slot more than the setting ``workers`` asks for. That one takes only small work,
    which therefore never waits behind long work. The other slots take small work as well, but never
    more than ``workers`` at once: beyond the number of cores, workers only delay each other. Work
    that proves not to be small is stopped and begun anew as long work.
    """

    def __init__(self, settings: Settings, results: Path) -> None:
        self._settings = settings
        config = WorkerConfig(settings, results)
        self._small = Slot(config)
        self._slots = [self._small, *(Slot(config) for _ in range(settings.workers))]
        self._idle: list[Slot] = []  # the most recently used first
        self._doing_small: set[Slot] = set()
        self._waiting: FairQueue[_Waiter] = FairQueue()
        self._open: set[Slot] = set()
        self._lost = self._cancelled = 0
        self._is_failing = False
        self.is_draining = False
        self._is_stopping = threading.Event()
        self.on_wait: Callable[[float], None] = lambda _seconds: None
        self.on_work: Callable[[str, float], None] = lambda _client, _seconds: None
        self.on_unclaimed: UnclaimedCallback = ignore_unclaimed
        self._background: set[asyncio.Task[None]] = set()

    @property
    def is_ready(self) -> bool:
        """Whether a worker that takes any work is warm and alive."""
        return bool(self._open - {self._small})

    @property
    def load(self) -> Load:
        """The present state, and totals, see ``Engine``."""
        idle = sum(slot.is_alive for slot in self._idle)
        busy = sum(slot.is_alive for slot in self._open) - idle
        missing = len(self._slots) - idle - busy
        evictions: Counter[str] = Counter()
        for slot in self._slots:
            evictions.update(slot.evictions)
        return Load(
            waiting=len(self._waiting),
            idle=idle,
            busy=busy,
            missing=missing,
            lost=self._lost,
            cancelled=self._cancelled,
            evictions=evictions,
            pids={slot.pid for slot in self._slots if slot.pid is not None},
        )

    async def start(self) -> None:
        """Compile the first kernels, then start the workers; in the background."""
        self._spawn(self._compile_and_supervise())

    def drain(self) -> None:
        """Refuse new tasks, see ``Engine``."""
        self.is_draining = True

    async def stop(self) -> None:
        """Kill the workers."""
        self._is_stopping.set()
        for background in self._background:
            background.cancel()
        await asyncio.gather(*self._background, return_exceptions=True)
        await asyncio.gather(*(slot.close() for slot in self._slots))

    def refuse_when_full(self, client: str) -> None:
        """Raise where a task would have to wait without room, see ``Engine``."""
        self._refuse_when_draining()
        if not any(self._takes(slot, is_small=False) for slot in self._idle):
            self._refuse_to_wait(client)

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        """Do the work of a task in the next free worker, see ``Engine``."""
        self._refuse_when_draining()
        start = perf_counter()
        deaths = 0
        while True:
            slot = await self._acquire(task)
            queued = perf_counter() - start
            try:
                outcome = await self._run_in(slot, task, on_progress)
            except WorkerLostError as error:
                deaths += 1
                if error.had_begun or deaths > len(self._slots):
                    raise problem(
                        "worker_died", "the worker process of this request died"
                    ) from None
                # The worker had died while idle, so that the work has not begun.
                task = replace(task, is_promised=True)  # accepted: a second wait is not refused
                continue
            if outcome is None:  # stopped, since it was not small after all
                task = replace(task, is_small=False, is_promised=True)
                continue
            if isinstance(outcome, Problem):
                raise ProblemError(outcome)
            return replace(outcome, seconds={"queue": queued, **outcome.seconds})

    async def _run_in(self, slot: Slot, task: Task, on_progress: ProgressCallback) -> Outcome:
        start, start_ns, pid = perf_counter(), time_ns(), slot.pid or 0
        parts: Mapping[str, Period] = {}
        failed = True
        try:
            outcome = await self._hand_over(slot, task, on_progress)
            failed = isinstance(outcome, Problem) and outcome.status >= 500
            parts = outcome.periods if isinstance(outcome, TaskResult) else {}
            return outcome
        finally:
            self.on_work(task.client, perf_counter() - start)
            period = Period(start_ns, time_ns())
            record_span("worker", period, parts, failed=failed, attributes={"process.pid": pid})

    async def _hand_over(self, slot: Slot, task: Task, on_progress: ProgressCallback) -> Outcome:
        outcome = slot.begin(task.work, is_small=task.is_small)
        start = perf_counter()
        on_progress(0.0)
        try:
            while not outcome.done():
                await asyncio.wait({outcome}, timeout=_PROGRESS_PERIOD_S)
                on_progress(slot.progress)
                if task.is_small and perf_counter() - start > _SMALL_S:
                    slot.ask_to_stop()
            result = outcome.result()
        except asyncio.CancelledError:
            self._cancelled += 1
            self._spawn(self._stop_work(slot, task, outcome))
            raise
        except WorkerLostError:
            slot.retire()
            raise
        self._release(slot)
        return result

    async def _stop_work(self, slot: Slot, task: Task, outcome: "asyncio.Future[Outcome]") -> None:
        """Stop work that nobody waits for: ask first, and kill the worker if that fails.

        A new worker takes a second or two to start, and its caches are empty. The steps of making a
        mesh may take seconds each, whatever a client waits: they get the time of a request.
        """
        is_mesh, settings = isinstance(task.work, StoreMesh), self._settings
        slot.ask_to_stop()
        grace_s = settings.deadline_s if is_mesh else settings.cancel_grace_s
        await asyncio.wait({outcome}, timeout=grace_s)
        if not outcome.done() or outcome.exception() is not None:
            slot.retire()
            return
        self._release(slot)
        late = outcome.result()
        if isinstance(late, TaskResult) and late.result is not None and late.result.has_files:
            await self.on_unclaimed(late.result.name)

    async def _compile_and_supervise(self) -> None:
        await self._compile(FIRST_KERNELS)
        for slot in reversed(self._slots):
            self._spawn(self._supervise(slot))
        await self._compile(None)

    async def _compile(self, workloads: Sequence[str] | None) -> None:
        """Compile kernels in processes of their own; where that fails, workers compile them."""
        compile_kernels = partial(gc.compile_kernels, workloads, cancel=self._is_stopping.is_set)
        compiling = asyncio.ensure_future(asyncio.to_thread(compile_kernels))
        start = perf_counter()
        try:
            done, _ = await asyncio.wait({compiling}, timeout=_LONG_COMPILATION_S)
            if not done:
                logger.info("compiling kernels for this machine, once", workloads=workloads)
            await asyncio.shield(compiling)
            if not done:
                logger.info("kernels compiled", seconds=round(perf_counter() - start, 1))
        except asyncio.CancelledError:
            await asyncio.gather(compiling, return_exceptions=True)  # until its processes are gone
            raise
        except (gc.errors.InternalError, OSError):
            logger.exception("kernels not compiled ahead")
        except gc.errors.Cancelled:
            pass

    async def _supervise(self, slot: Slot) -> None:
        """Supply a slot with living workers, for ever."""
        pause = _FIRST_PAUSE_S
        while True:
            try:
                await slot.open()
            except WorkerLostError:
                if not self.is_draining:  # an interrupt reaches a starting worker as well
                    logger.exception("worker not started", next_try_seconds=pause)
                self._fail_if_none_is_open()
                await slot.close()
                await asyncio.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
                continue
            pause = _FIRST_PAUSE_S
            self._is_failing = False
            self._open.add(slot)
            self._release(slot)
            await slot.wait_until_retired()
            self._lost += 1
            logger.warning("worker lost, to be replaced")
            self._open.discard(slot)
            if slot in self._idle:
                self._idle.remove(slot)
            self._doing_small.discard(slot)
            self._offer_idle()
            await slot.close()

    async def _acquire(self, task: Task) -> Slot:
        """Wait for a free slot, preferably one whose worker has cached what the task needs."""
        self._idle = [slot for slot in self._idle if slot.is_alive]
        suitable = [slot for slot in self._idle if self._takes(slot, task.is_small)]
        if not suitable and not task.is_promised:
            self._refuse_to_wait(task.client)
        with self._measured_wait():
            if suitable:
                slot = max(suitable, key=lambda slot: self._affinity(slot, task))
                self._idle.remove(slot)
                self._note_acquired(slot, task)
            else:
                slot = await self._wait(task)
        slot.affinity_keys.extend(
            key for key in task.affinity_keys if key not in slot.affinity_keys
        )
        return slot

    def _affinity(self, slot: Slot, task: Task) -> tuple[Any, ...]:
        """Score a slot's cache affinity; otherwise prefer the least used.

        Of slots with equal scores the most recently used wins: its data is in the processor's
        caches.
        """
        matches = tuple(key in slot.affinity_keys for key in task.affinity_keys)
        others = 0 if any(matches) else len(slot.affinity_keys)
        return *matches, task.is_small and slot is self._small, -others

    def _takes(self, slot: Slot, is_small: bool) -> bool:
        if is_small:
            return len(self._doing_small) < self._settings.workers
        return slot is not self._small

    def _note_acquired(self, slot: Slot, task: Task) -> None:
        if task.is_small:
            self._doing_small.add(slot)

    @contextmanager
    def _measured_wait(self) -> Iterator[None]:
        start, start_ns, failed = perf_counter(), time_ns(), True
        try:
            yield
            failed = False
        finally:
            self.on_wait(perf_counter() - start)
            record_span("queue", Period(start_ns, time_ns()), failed=failed)

    async def _wait(self, task: Task) -> Slot:
        waiter = _Waiter(task, asyncio.get_running_loop().create_future())
        self._waiting.put(task.client, waiter)
        try:
            return await waiter.slot
        except asyncio.CancelledError:
            self._waiting.remove(task.client, waiter)
            if waiter.slot.done() and not waiter.slot.cancelled():
                self._release(waiter.slot.result())  # given just as the call was cancelled
            raise

    def _refuse_when_draining(self) -> None:
        if self.is_draining:
            raise draining()

    def _refuse_to_wait(self, client: str) -> None:
        if self._is_failing:
            raise _unavailable()
        size = self._settings.queue_size
        # One client cannot lock out the others: some more places are for clients without a task.
        room = size if self._waiting.has(client) else size + 1 + size // 4
        if len(self._waiting) >= room:
            waiting = len(self._waiting) + 1
            raise over_limit(
                "queue_full", "waiting requests", waiting, size, "queue_size", headers=_RETRY_AFTER
            )

    def _release(self, slot: Slot) -> None:
        """Give a slot to the next task that it can take, or let it idle."""
        self._doing_small.discard(slot)
        if not slot.is_alive:
            return  # released again once `_supervise` has replaced its worker
        waiter = self._waiting.take(
            lambda waiter: not waiter.slot.done() and self._takes(slot, waiter.task.is_small)
        )
        if waiter is None:
            self._idle.insert(0, slot)
        else:
            self._note_acquired(slot, waiter.task)
            waiter.slot.set_result(slot)

    def _offer_idle(self) -> None:
        """Offer idle slots to waiting tasks: with a lost worker, less small work is under way."""
        for slot in reversed(self._idle.copy()):  # keeps their order
            self._idle.remove(slot)
            self._release(slot)

    def _fail_if_none_is_open(self) -> None:
        if self.is_ready:
            return
        self._is_failing = True
        for waiter in self._waiting.take_all():
            if not waiter.slot.done():
                waiter.slot.set_exception(_unavailable())

    def _spawn(self, coroutine: Coroutine[Any, Any, None]) -> None:
        background = asyncio.create_task(coroutine)
        self._background.add(background)
        background.add_done_callback(self._forget)

    def _forget(self, background: asyncio.Task[None]) -> None:
        self._background.discard(background)
        if not background.cancelled() and background.exception() is not None:
            logger.error("task of the engine failed", exc_info=background.exception())


def _unavailable() -> ProblemError:
    detail = "no worker process can be started; the log of the service has the reason"
    return problem("engine_unavailable", detail, headers=_RETRY_AFTER)

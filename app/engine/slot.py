"""One place for one worker process: a pebble pool of a single worker, replaced when it breaks."""

import asyncio
import logging
import multiprocessing
import threading
from collections import deque
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from itertools import count
from typing import Any

from pebble import ProcessPool

from app.engine import worker
from app.engine.work import Outcome, Work

logger = logging.getLogger(__name__)

# Workers are forked from a server process that has imported all they need and does nothing else:
# imports take 2 s and a fork 10 ms, and to fork this process would copy its threads' locks.
_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload([worker.__name__])
_LOOK_S = 0.1  # how often an idle worker is looked after; pebble looks as often
_TOPICS = 64  # that are remembered


class WorkerLostError(Exception):
    """The worker died, or was killed; ``had_begun`` tells whether it had taken up the work."""

    def __init__(self, *, had_begun: bool) -> None:
        super().__init__("the worker died")
        self.had_begun = had_begun


class Slot:
    """A place that has a living worker between ``open`` and ``close``, and can be opened again.

    A pool whose worker dies is given up as a whole: pebble replaces a worker that dies at work, but
    one that dies idle breaks its pool for good, and one that is killed while it writes to the
    pool's pipe leaves a lock behind.
    """

    def __init__(self, config: worker.WorkerConfig) -> None:
        self._config = config
        self._numbers = count(1)
        self._number = 0
        self._outcome: asyncio.Future[Outcome] | None = None
        self._begun: Future[Any] | None = None
        self._given_up = asyncio.Event()
        self._pool: ProcessPool | None = None
        self._closing = threading.Lock()  # close() can be called again while it is at work
        # Shared with the worker: the number of the work to stop, the worker's process id, and which
        # share of its work is done.
        self._stop_number = _CONTEXT.RawValue("q", 0)
        self._pid = _CONTEXT.RawValue("q", 0)
        self._progress = _CONTEXT.RawValue("d", 0.0)
        self.topics: deque[str] = deque(maxlen=_TOPICS)

    async def open(self) -> None:
        """Start a worker and warm its kernels; raises ``WorkerLostError`` when it cannot."""
        self._given_up.clear()
        self.topics.clear()
        self._stop_number.value = self._pid.value = 0
        self._pool = ProcessPool(
            max_workers=1,
            initializer=worker.initialize,
            initargs=(self._config, self._stop_number, self._pid, self._progress),
            context=_CONTEXT,
        )
        try:
            started = await asyncio.to_thread(self._pool.schedule, worker.warm_up)
            await asyncio.wrap_future(started)
        except Exception as error:
            raise WorkerLostError(had_begun=False) from error

    @property
    def is_alive(self) -> bool:
        """Whether work given to the slot now would be done."""
        return self._pool is not None and self._pool.active and not self._given_up.is_set()

    @property
    def progress(self) -> float:
        """Which share of the work given last is done."""
        return float(self._progress.value)

    async def until_dead(self) -> None:
        """Wait until the worker is gone or given up."""
        while self.is_alive:
            try:
                await asyncio.wait_for(self._given_up.wait(), _LOOK_S)
            except TimeoutError:
                continue

    def give_up(self) -> None:
        """Say that this worker is not to be used again, so that its keeper replaces it."""
        self._given_up.set()

    def begin(self, work: Work) -> "asyncio.Future[Outcome]":
        """Hand ``work`` to the worker; the future fails with ``WorkerLostError`` if that dies."""
        loop = asyncio.get_running_loop()
        outcome: asyncio.Future[Outcome] = loop.create_future()
        self._number, self._outcome = next(self._numbers), outcome
        self._progress.value = 0.0
        assert self._pool is not None, "only open slots are given work"  # noqa: S101
        try:
            begun = self._pool.schedule(worker.do, args=(self._number, work))
        except RuntimeError:  # the pool broke since it was looked at
            _lose(outcome, had_begun=False)
            return outcome
        self._begun = begun
        begun.add_done_callback(lambda done: loop.call_soon_threadsafe(_settle, outcome, done))
        return outcome

    def ask_to_stop(self) -> None:
        """Ask the work that is under way to stop; the sweep looks between its slices."""
        self._stop_number.value = self._number

    async def close(self) -> None:
        """Kill the worker, whatever it does."""
        self.give_up()
        await asyncio.to_thread(self._kill)
        if self._outcome is not None and not self._outcome.done():
            _lose(self._outcome, had_begun=self._begun is not None and self._begun.running())

    def _kill(self) -> None:
        with self._closing:
            pool, self._pool = self._pool, None
            if pool is None:
                return
            for child in multiprocessing.active_children():
                if child.pid == self._pid.value:
                    child.kill()  # it holds nothing that would need a farewell
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


def _settle(outcome: "asyncio.Future[Outcome]", done: Future[Any]) -> None:
    if outcome.done():
        return
    error = done.exception()
    if error is None:
        outcome.set_result(done.result())
    else:
        # A pool breaks when its worker dies idle; of one that dies at work it says that it expired.
        _lose(outcome, had_begun=not isinstance(error, BrokenProcessPool))


def _lose(outcome: "asyncio.Future[Outcome]", *, had_begun: bool) -> None:
    outcome.set_exception(WorkerLostError(had_begun=had_begun))
    outcome.exception()  # who waited may have left: that is nothing to warn of

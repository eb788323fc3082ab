"""An engine without processes of its own: it does one piece of work after the other, here."""

import asyncio
from collections.abc import Awaitable, Callable, Collection

from app.engine.interface import Load, ProgressCallback, UnclaimedCallback, ignore_unclaimed
from app.engine.work import Task, TaskResult
from app.engine.worker import Worker
from app.errors import Problem, ProblemError
from tests.support.workers import numbers


async def go_on() -> None:
    """Do nothing before the work of a task."""


class DirectEngine:
    """See ``Engine``. Each task waits for ``before_work`` once it has begun."""

    is_ready = True
    is_draining = False

    def __init__(self, worker: Worker, before_work: Callable[[], Awaitable[None]] = go_on) -> None:
        self._worker = worker
        self.before_work = before_work
        self._turn = asyncio.Lock()
        self.on_wait: Callable[[float], None] = lambda _seconds: None
        self.on_work: Callable[[str, float], None] = lambda _client, _seconds: None
        self.on_unclaimed: UnclaimedCallback = ignore_unclaimed

    @property
    def load(self) -> Load:
        pids: Collection[int] = ()
        return Load(0, 1, 0, 0, 0, 0, {}, pids)

    async def start(self) -> None:
        pass

    def drain(self) -> None:
        self.is_draining = True

    async def stop(self) -> None:
        pass

    def refuse_when_full(self, client: str) -> None:
        pass

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        async with self._turn:
            on_progress(0.0)
            await self.before_work()
            outcome = self._worker.do(next(numbers), task.work)
            self._worker._writer.submit(int).result()  # fields are on the disk by now
        if isinstance(outcome, Problem):
            raise ProblemError(outcome)
        assert outcome is not None, "nobody stops it"
        return TaskResult({"queue": 0.0, **outcome.seconds}, result=outcome.result)

"""A host: the engine of one machine in a process that Ray Serve keeps."""

import asyncio
import sys
from collections import deque
from collections.abc import AsyncIterator
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

import structlog
from structlog.contextvars import bound_contextvars

from app.engine.interface import Engine, ProgressCallback
from app.engine.ray_call import Call, Message
from app.engine.single_flight import SingleFlight
from app.engine.work import Task, TaskResult, WritesResult
from app.errors import Problem, ProblemError, problem_of
from app.queries import code_version

logger = structlog.get_logger(module=__name__)

BEAT_S = 1.0
"""A host says something at least as often while it has a task"""
_LATE_RESULTS = 100
"""Results whose names a host still tells"""


class Host:
    """Does the tasks of all services of the cluster, with the settings of its machine."""

    async def __init__(self) -> None:  # type: ignore[misc] # Ray awaits it
        # The fork server imports the main program of its parent, which would be Ray's.
        vars(sys.modules["__main__"]).pop("__file__", None)
        from app import logs
        from app.engine import fork_server
        from app.engine.local import LocalEngine
        from app.engine.supplied import SuppliedEngine
        from app.settings import Settings
        from app.store import layout
        from app.store.choice import store_of

        settings = Settings()
        logs.install(settings.log_format)
        fork_server.start()
        store = store_of(settings)
        engine: Engine = LocalEngine(settings, settings.folder / layout.RESULTS)
        if store.supply is not None:
            self._folder = ExitStack()
            self._folder.enter_context(store.supply.owned())  # as long as this process lives
            engine = SuppliedEngine(engine, store.supply)
        self._facts = {
            "workers": settings.workers,
            "queue_size": settings.queue_size,
            "code": code_version(),
            "store": store.identity(),
        }
        self._engine = engine
        self._flights: SingleFlight[TaskResult] = SingleFlight()
        self._late: deque[str] = deque(maxlen=_LATE_RESULTS)
        engine.on_unclaimed = self._note_late
        await engine.start()
        while not engine.is_ready:  # a host that is there takes work
            await asyncio.sleep(0.02)

    def record_replica_metadata(self) -> dict[str, Any]:
        """Return what does not change; Ray tells it to all that call hosts."""
        return self._facts

    def record_routing_stats(self) -> dict[str, Any]:
        """Return the load, which Ray tells them every second."""
        load = self._engine.load
        told = {**vars(load), "evictions": dict(load.evictions), "pids": ()}
        return {"load": told, "computing": self._flights.names(), "late": list(self._late)}

    async def run(self, call: Call) -> AsyncIterator[Message]:
        """Do a task; errors are values, since not every exception travels."""
        changed, share = asyncio.Event(), None

        def note(now: float) -> None:
            nonlocal share
            share = now
            changed.set()

        with bound_contextvars(**call.log_fields):
            working = asyncio.create_task(self._run(call.task, note))
        working.add_done_callback(lambda _: changed.set())
        try:
            while not working.done():
                with suppress(TimeoutError):
                    async with asyncio.timeout(BEAT_S):
                        await changed.wait()
                changed.clear()
                if not working.done():
                    yield share
            yield self._end_of(working)
        finally:
            working.cancel()  # nobody waits for it any longer

    def _end_of(self, working: "asyncio.Task[TaskResult]") -> TaskResult | Problem:
        try:
            return working.result()
        except ProblemError as error:
            return error.problem
        except Exception as error:
            logger.exception("task of a service failed")
            return problem_of(error)

    async def _run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        """Do a task; services that ask for one result at the same time share its computation."""
        run = partial(self._engine.run, task)
        if not isinstance(task.work, WritesResult):
            return await run(on_progress)
        name, is_promised = task.work.result_name, task.is_promised
        return await self._flights.join(name, run, on_progress, is_promised=is_promised)

    async def _note_late(self, name: str) -> None:
        self._late.append(name)

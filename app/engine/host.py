"""A host: the engine of one machine, behind messages of bytes and with leases."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import structlog
from structlog.contextvars import bound_contextvars

from app.engine.cluster import BEAT_S, LEASE_S, HostReport
from app.engine.interface import Engine, ProgressCallback
from app.engine.single_flight import SingleFlight
from app.engine.wire import Wire, WireError, encode
from app.engine.work import Outcome, Task, TaskResult, WritesResult
from app.errors import Problem, ProblemError, problem_of
from app.queries import code_version
from app.settings import Settings

logger = structlog.get_logger(module=__name__)


@dataclass
class _Lease:
    working: "asyncio.Task[Outcome]"
    end: float
    """By the clock of the event loop"""


class Host:
    """Does tasks that replicas send, each as long as its lease is renewed.

    ``store`` is the id of its store, see ``Store.identity``.
    """

    def __init__(self, engine: Engine, settings: Settings, store: str) -> None:
        self._engine = engine
        self._settings = settings
        self._store = store
        self._wire = Wire(settings.folder)
        self._leases: dict[str, _Lease] = {}
        self._shares: dict[str, float] = {}
        self._flights: SingleFlight[TaskResult] = SingleFlight()
        self._stopped: dict[str, float] = {}
        """Tickets that were stopped before their tasks came, and until when that counts"""
        self._expiring: asyncio.Task[None] | None = None
        self._unclaimed: list[str] = []
        engine.on_unclaimed = self._note_unclaimed

    async def start(self) -> None:
        """Start the engine; returns at once."""
        await self._engine.start()
        self._expiring = asyncio.create_task(self._expire())

    async def close(self) -> None:
        """End all work, and the engine."""
        if self._expiring is not None:
            self._expiring.cancel()
        for lease in self._leases.values():
            lease.working.cancel()
        await self._engine.stop()

    async def drain(self) -> None:
        """Refuse new work, and return when there is none left."""
        self._engine.drain()
        while self._leases:
            await asyncio.sleep(BEAT_S)

    async def run(self, ticket: str, task: bytes) -> bytes:
        """Do a task; return its outcome, or that it was stopped."""
        outcome: Outcome = None
        if ticket not in self._stopped:
            working = asyncio.create_task(self._work(ticket, task))
            self._leases[ticket] = _Lease(working, self._lease_end())
            try:
                await asyncio.wait({working})
                outcome = None if working.cancelled() else working.result()
            finally:
                working.cancel()
                del self._leases[ticket]
                self._shares.pop(ticket, None)
        return self._wire.encode_outcome(outcome)

    def stop(self, ticket: str) -> None:
        """Stop the work under a ticket, even if its task comes later."""
        if ticket in self._leases:
            self._leases[ticket].working.cancel()
        else:
            self._stopped[ticket] = self._lease_end()

    def beat(self, tickets: Sequence[str]) -> bytes:
        """Renew the leases of some tickets, and report."""
        for ticket in tickets:
            if ticket in self._leases:
                self._leases[ticket].end = self._lease_end()
        unclaimed, self._unclaimed = self._unclaimed, []
        report = HostReport(
            load=replace(self._engine.load, pids=()),
            workers=self._settings.workers,
            queue_size=self._settings.queue_size,
            is_ready=self._engine.is_ready,
            is_draining=self._engine.is_draining,
            code=code_version(),
            store=self._store,
            computing=self._flights.under_way(),
            shares={ticket: self._shares[ticket] for ticket in tickets if ticket in self._shares},
            unclaimed=unclaimed,
        )
        return encode(report)

    async def _work(self, ticket: str, data: bytes) -> Outcome:
        """Do a task; an error becomes a value, since not every exception travels."""
        try:
            message = self._wire.decode_task(data)
            with bound_contextvars(**message.log_fields):
                return await self._run(message.task, partial(self._note, ticket))
        except ProblemError as error:
            return error.problem
        except WireError as error:
            return Problem("engine_unavailable", str(error))
        except Exception as error:
            logger.exception("task of a replica failed")
            return problem_of(error)

    async def _run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        """Do a task; replicas that ask for one result at the same time share its computation."""
        run = partial(self._engine.run, task)
        if not isinstance(task.work, WritesResult):
            return await run(on_progress)
        name, is_promised = task.work.result_name, task.is_promised
        return await self._flights.join(name, run, on_progress, is_promised=is_promised)

    def _note(self, ticket: str, share: float) -> None:
        self._shares[ticket] = share

    async def _note_unclaimed(self, name: str) -> None:
        self._unclaimed.append(name)

    async def _expire(self) -> None:
        """Stop work that nobody renews, for ever."""
        while True:
            await asyncio.sleep(BEAT_S)
            now = asyncio.get_running_loop().time()
            for ticket, lease in self._leases.items():
                if lease.end < now and lease.working.cancel():
                    logger.warning("work stopped, since nobody renews it", ticket=ticket)
            self._stopped = {ticket: end for ticket, end in self._stopped.items() if end >= now}

    def _lease_end(self) -> float:
        return asyncio.get_running_loop().time() + LEASE_S

"""The engine over several machines: it places tasks on hosts, and takes care of those lost."""

import asyncio
from collections import Counter
from collections.abc import Callable, Collection, Coroutine, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from time import time_ns
from typing import Any
from uuid import uuid4

import structlog
from structlog.contextvars import get_contextvars

from app.engine.cluster import BEAT_S, LEASE_S, SILENCE_S, Cluster, HostLostError, HostReport
from app.engine.interface import Load, ProgressCallback, UnclaimedCallback, ignore_unclaimed
from app.engine.placement import Occupancy, choose
from app.engine.wire import Message, Wire, WireError, decode
from app.engine.work import MeshFromFile, Outcome, StoreMesh, Task, TaskResult, WritesResult
from app.errors import Problem, ProblemError, draining, over_limit, problem
from app.queries import code_version
from app.repeating import repeat
from app.settings import Settings, variable_of
from app.store.interface import Store
from app.tracing import Period, record_span

logger = structlog.get_logger(module=__name__)

_SEARCH_S = 1.0
"""Between two looks for hosts that have joined"""
_NOT_BEGUN = frozenset({"queue_full", "draining", "engine_unavailable"})
"""Codes of refusals by a host; another one may take the task"""
_RETRY_AFTER = {"Retry-After": "1"}


@dataclass(eq=False)
class _Flight:
    """A task at a host."""

    on_progress: ProgressCallback
    result: str | None
    """Name of the result that it ends with, if any"""
    without: Collection[str]
    """Hosts that do not take the task"""
    lost: "asyncio.Future[None]"
    """Done once the host is lost"""
    superseded: "asyncio.Future[None]"
    """Done once another host, which is preferred, computes the same result"""
    has_begun: bool = False

    def note(self, share: float) -> None:
        self.has_begun = True
        self.on_progress(share)


@dataclass(eq=False)
class _Host:
    """A host as this replica knows it."""

    flights: dict[str, _Flight] = field(default_factory=dict)
    report: HostReport | None = None
    others: int = 0
    """Tasks of other replicas there, at the time of the report"""

    def note(self, report: HostReport) -> None:
        self.report = report
        self.others = max(0, report.load.busy + report.load.waiting - len(self.flights))
        for ticket, share in report.shares.items():
            if ticket in self.flights:
                self.flights[ticket].note(share)

    def rank(self, name: str, result: str) -> tuple[bool, str] | None:
        """Return the rank of the host called ``name`` among those that compute a result.

        The least is preferred: one that has begun, and then by name, so that all replicas prefer
        the same. None where it does not compute it, or takes no work.
        """
        report = self.report
        if report is None or not report.is_ready or report.is_draining:
            return None
        if result not in report.computing:
            return None
        return not report.computing[result], name


class DistributedEngine:
    """The engine of a replica: the hosts of a cluster do its work.

    Each host has a queue and workers of its own, as on a machine that is alone: callers take turns
    there, whichever replica they asked. Work on a lost host is done once more on another one. Work
    whose worker died is not, since it may be its fault.

    One result is computed by one host, which other replicas join. Replicas that ask at the same
    time may have chosen different ones: the next beats tell, and one of the two moves.
    """

    def __init__(self, cluster: Cluster, settings: Settings, store: Store) -> None:
        self._cluster = cluster
        self._store = store
        self._store_id = ""
        self._wire = Wire(settings.folder)
        self._hosts: dict[str, _Host] = {}
        self._refused: set[str] = set()
        """Hosts of another release or store, which the log has named"""
        self.is_draining = False
        self.on_wait: Callable[[float], None] = lambda _seconds: None
        self.on_work: Callable[[str, float], None] = lambda _client, _seconds: None
        self.on_unclaimed: UnclaimedCallback = ignore_unclaimed
        self._background: set[asyncio.Task[None]] = set()
        self._stopping: set[asyncio.Task[None]] = set()

    @property
    def load(self) -> Load:
        """The sums over all hosts; see ``Engine``."""
        loads = [report.load for report in self._usable().values()]
        evictions: Counter[str] = Counter()
        for load in loads:
            evictions.update(load.evictions)
        return Load(
            waiting=sum(load.waiting for load in loads),
            idle=sum(load.idle for load in loads),
            busy=sum(load.busy for load in loads),
            missing=sum(load.missing for load in loads),
            lost=sum(load.lost for load in loads),
            cancelled=sum(load.cancelled for load in loads),
            evictions=evictions,
            pids=(),
        )

    @property
    def is_ready(self) -> bool:
        """Whether a host is ready."""
        return any(report.is_ready for report in self._usable().values())

    async def start(self) -> None:
        """Look for hosts, in the background; the store must be claimed."""
        self._store_id = self._store.identity()
        self._spawn(repeat(self._search, _SEARCH_S, "hosts not looked for"), self._background)

    def drain(self) -> None:
        """Refuse new tasks, see ``Engine``."""
        self.is_draining = True

    async def stop(self) -> None:
        """Stop all tasks; leases end what cannot be reached."""
        for background in self._background:
            background.cancel()
        await asyncio.gather(*self._background, *self._stopping, return_exceptions=True)

    def refuse_when_full(self, client: str) -> None:  # noqa: ARG002 - hosts know who waits there
        """Raise where each host has more tasks than places, see ``Engine``."""
        if self.is_draining:
            raise draining()
        usable = self._usable()
        if not usable:
            raise _no_host()
        # Idle workers do not count: one may be there for small work alone.
        fullest = [report for report in usable.values() if report.load.waiting >= report.queue_size]
        if len(fullest) == len(usable):
            report = fullest[0]
            waiting, size = report.load.waiting + 1, report.queue_size
            raise over_limit(
                "queue_full", "waiting requests", waiting, size, "queue_size", headers=_RETRY_AFTER
            )

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        """Have a host do the work of a task, see ``Engine``."""
        if self.is_draining:
            raise draining()
        work = task.work
        if isinstance(work, StoreMesh) and isinstance(work.mesh_input, MeshFromFile):
            async with self._store.lent(work.mesh_input.path):
                return await self._run(task, on_progress)
        return await self._run(task, on_progress)

    async def _run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        note = _rising(on_progress)
        waits_for_host = task.is_promised
        refusal: Problem | None = None
        without: set[str] = set()
        """Hosts that were lost with this task, or that refused it"""
        losses = 0
        while True:
            name = self._place(task, without)
            if name is None:
                if not waits_for_host:
                    raise _no_host() if refusal is None else ProblemError(refusal)
                await asyncio.sleep(_SEARCH_S)
                without.clear()
                continue
            try:
                outcome = await self._run_on(name, task, note, without)
            except HostLostError:
                losses += 1
                if losses > 1:
                    raise _lost_twice() from None
                logger.warning("host lost: its work is done once more", host=name)
                without.add(name)
                task = _once_more(task)
                continue
            if outcome is None:  # another host computes the same
                task = replace(task, is_promised=True)
                continue
            if isinstance(outcome, TaskResult):
                return outcome
            if outcome.code not in _NOT_BEGUN:
                raise ProblemError(outcome)
            refusal = outcome
            without.add(name)

    def _usable(self) -> Mapping[str, HostReport]:
        return {name: host.report for name, host in self._hosts.items() if host.report is not None}

    def _place(self, task: Task, without: set[str]) -> str | None:
        usable = {
            name: report
            for name, report in self._usable().items()
            if name not in without and not report.is_draining
        }
        ready = {name: report for name, report in usable.items() if report.is_ready}
        hosts = {
            name: Occupancy(
                self._hosts[name].others + len(self._hosts[name].flights), report.workers
            )
            for name, report in (ready or usable).items()
        }
        result = _result_of(task)
        if result is not None:
            ranks = [self._hosts[name].rank(name, result) for name in hosts]
            computing = [rank for rank in ranks if rank is not None]
            if computing:
                return min(computing)[1]  # it joins the computation, however full the host is
        # The last key is the mesh. What has none, such as an upload, may go anywhere.
        key = task.affinity_keys[-1] if task.affinity_keys else uuid4().hex
        return choose(key, hosts, is_small=task.is_small)

    async def _run_on(
        self, name: str, task: Task, on_progress: ProgressCallback, without: Collection[str]
    ) -> TaskResult | Problem | None:
        """Have a host do a task; None where it has been stopped there for another host."""
        host, ticket, loop = self._hosts[name], uuid4().hex, asyncio.get_running_loop()
        lost, superseded = loop.create_future(), loop.create_future()
        flight = _Flight(on_progress, _result_of(task), without, lost, superseded)
        host.flights[ticket] = flight
        data = self._wire.encode_task(Message(task, get_contextvars()))
        calling = asyncio.ensure_future(self._cluster.run(name, ticket, data))
        start_ns = time_ns()
        outcome: Outcome = None
        try:
            await asyncio.wait({calling, lost, superseded}, return_when=asyncio.FIRST_COMPLETED)
            if not calling.done():
                if lost.done():
                    raise HostLostError
                self._spawn(self._stop(name, ticket), self._stopping)
                return None
            outcome = self._wire.decode_outcome(calling.result())
        except asyncio.CancelledError:
            self._spawn(self._stop(name, ticket), self._stopping)
            raise
        except WireError as error:
            return _unreadable(name, error)
        finally:
            calling.cancel()
            del host.flights[ticket]
            self._account(name, task, flight, Period(start_ns, time_ns()), outcome)
        if outcome is None:  # stopped there, since no beat had come from here
            raise HostLostError
        if isinstance(outcome, TaskResult):
            on_progress(0.0)  # it may have been over before the next beat
        return outcome

    def _account(
        self, name: str, task: Task, flight: _Flight, period: Period, outcome: Outcome
    ) -> None:
        """Report the seconds of a task in the queue of a host and with a worker."""
        seconds = max(0.0, (period.end - period.start) / 1e9)  # the clock may be set back
        queued = 0.0 if flight.has_begun else seconds
        parts: Mapping[str, Period] = {}
        if isinstance(outcome, Problem):
            failed = outcome.status >= 500
        else:
            failed = outcome is None and not flight.superseded.done()
        if isinstance(outcome, TaskResult):
            # The work may have waited for longer than this replica, which joined it there.
            queued, parts = min(seconds, outcome.seconds["queue"]), outcome.periods
        begun = period.start + round(queued * 1e9)
        self.on_wait(queued)
        self.on_work(task.client, seconds - queued)
        working, host = Period(begun, period.end), {"host.id": name}
        record_span("queue", Period(period.start, begun), attributes=host)
        parts = _within(working, parts)
        record_span("worker", working, parts, failed=failed, attributes=host)

    async def _stop(self, name: str, ticket: str) -> None:
        """Stop work that nobody waits for: ask until the host answers, or the lease has ended."""
        with suppress(TimeoutError):
            async with asyncio.timeout(LEASE_S):
                while True:
                    try:
                        await asyncio.wait_for(self._cluster.stop(name, ticket), 4 * BEAT_S)
                    except (TimeoutError, HostLostError):
                        await asyncio.sleep(BEAT_S)
                    else:
                        return

    async def _search(self) -> None:
        """Look for hosts that have joined."""
        for name in await self._cluster.hosts():
            if name not in self._hosts:
                self._hosts[name] = _Host()
                self._spawn(self._attend(name), self._background)

    async def _attend(self, name: str) -> None:
        """Exchange beats with a host until it is lost."""
        host = self._hosts[name]
        try:
            while True:
                async with asyncio.timeout(SILENCE_S):
                    data = await self._cluster.beat(name, list(host.flights))
                self._note(name, host, data)
                await asyncio.sleep(BEAT_S)
        except (HostLostError, TimeoutError) as error:
            if host.report is not None:
                logger.warning("host lost", host=name, error=repr(error))
        finally:
            del self._hosts[name]
            for flight in host.flights.values():
                if not flight.lost.done():
                    flight.lost.set_result(None)

    def _note(self, name: str, host: _Host, data: bytes) -> None:
        try:
            report: HostReport = decode(data, HostReport)
            fault = self._fault_of(report)
        except WireError as error:
            fault = str(error)
        if fault is not None:
            host.report = None
            if name not in self._refused:
                self._refused.add(name)
                logger.error("host not used", host=name, error=fault)
            return
        is_new = host.report is None
        host.note(report)
        self._supersede_flights(name)
        for result in report.unclaimed:
            self._spawn(self.on_unclaimed(result), self._background)
        if is_new:
            logger.info("host joined", host=name, workers=report.workers)

    def _fault_of(self, report: HostReport) -> str | None:
        """Return why a host is not to be used; None where it is."""
        if report.code != code_version():
            return _other_release(report.code)
        if report.store != self._store_id:
            return (
                f"it has the store {report.store}, and this service {self._store_id}: give all "
                f"machines of a cluster the same {variable_of('store')}"
            )
        return None

    def _supersede_flights(self, name: str) -> None:
        """End flights to other hosts where one called ``name`` is preferred for their result."""
        for other, host in self._hosts.items():
            for flight in host.flights.values():
                if flight.result is None or other == name or name in flight.without:
                    continue
                rank = self._hosts[name].rank(name, flight.result)
                own = host.rank(other, flight.result)
                if rank and own and rank < own and not flight.superseded.done():
                    flight.superseded.set_result(None)

    def _spawn(self, coroutine: Coroutine[Any, Any, None], group: set[asyncio.Task[None]]) -> None:
        background = asyncio.create_task(coroutine)
        group.add(background)
        background.add_done_callback(partial(self._forget, group))

    def _forget(self, group: set[asyncio.Task[None]], background: asyncio.Task[None]) -> None:
        group.discard(background)
        if not background.cancelled() and background.exception() is not None:
            logger.error("task of the engine failed", exc_info=background.exception())


def _result_of(task: Task) -> str | None:
    """Return the name of the result that a task ends with; None where it has none."""
    return task.work.result_name if isinstance(task.work, WritesResult) else None


def _other_release(code: str) -> str:
    return (
        f"it runs {code}, but this machine runs {code_version()}: install the same release on all"
    )


def _rising(on_progress: ProgressCallback) -> ProgressCallback:
    """Return a callback that passes on no share that is less than one before."""
    highest = -1.0

    def note(share: float) -> None:
        nonlocal highest
        if share > highest:
            highest = share
            on_progress(share)

    return note


def _within(whole: Period, parts: Mapping[str, Period]) -> Mapping[str, Period]:
    """Return the parts of a period, moved together into it: the clock of a host may differ."""
    if not parts:
        return parts
    first = min(part.start for part in parts.values())
    last = max(part.end for part in parts.values())
    shift = max(whole.start - first, 0) or min(whole.end - last, 0)
    return {name: Period(part.start + shift, part.end + shift) for name, part in parts.items()}


def _once_more(task: Task) -> Task:
    """Return a task to be done again, which no host refuses because its queue is full.

    The host that was lost may still write where it did.
    """
    task = replace(task, is_promised=True)
    if isinstance(task.work, StoreMesh):
        folder = task.work.folder
        return replace(task, work=replace(task.work, folder=folder.with_name(f"{folder.name}-2")))
    return task


def _no_host() -> ProblemError:
    detail = "no machine of the cluster accepts work at the moment"
    return problem("engine_unavailable", detail, headers=_RETRY_AFTER)


def _lost_twice() -> ProblemError:
    return problem(
        "worker_died", "two machines failed, one after the other, while they computed this answer"
    )


def _unreadable(name: str, error: WireError) -> Problem:
    logger.error("answer of a host not readable", host=name, error=str(error))
    return Problem(
        "engine_unavailable",
        f"a machine of the cluster sent an answer that cannot be read: {error}",
    )

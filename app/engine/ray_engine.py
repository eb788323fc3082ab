"""The engine over several machines: hosts, which Ray Serve keeps, do its work."""

import asyncio
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from time import monotonic, time_ns
from typing import Any
from uuid import uuid4

import structlog
from grpc import RpcError
from ray import serve
from ray.exceptions import RayError
from ray.serve.exceptions import RayServeException
from structlog.contextvars import get_contextvars

from app.engine.interface import Load, ProgressCallback, UnclaimedCallback, ignore_unclaimed
from app.engine.placement import Occupancy, ranked
from app.engine.ray_call import HOSTS, Call
from app.engine.ray_cluster import APPLICATION, DEPLOYMENT
from app.engine.work import MeshFromFile, StoreMesh, Task, TaskResult, WritesResult
from app.errors import Problem, ProblemError, draining, over_limit, problem
from app.queries import code_version
from app.repeating import repeat
from app.store.store import Store
from app.tracing import Period, record_span

logger = structlog.get_logger(module=__name__)

SILENCE_S = 5.0
"""Seconds without a message after which a host counts as lost; it beats every second"""
_AVOIDED_S = 30.0
"""Seconds for which others are preferred to a lost host; Ray drops it sooner, unless it is well"""
_LOOK_S = 1.0
"""Between two looks for hosts, and at what they tell"""
_NOT_BEGUN = frozenset({"queue_full", "draining", "engine_unavailable"})
"""Codes of refusals by a host; another one may take the task"""
_RETRY_AFTER = {"Retry-After": "1"}


_LOSSES = (TimeoutError, RayError, RayServeException, RpcError, StopAsyncIteration)
"""What a call raises whose host is lost"""


class _HostLostError(Exception):
    """A host died, or says nothing: nobody knows what became of the work there."""


@dataclass(frozen=True)
class _Host:
    """A host as Ray told of it."""

    facts: Mapping[str, Any]
    load: Load
    computing: Collection[str]
    """Names of the results that it computes"""
    late: Collection[str]
    """Names of results that were written although nobody waits for them"""


_NO_LOAD = Load(0, 0, 0, 0, 0, 0, {}, ())


class RayEngine:
    """See ``Engine``.

    Each host has a queue and workers of its own, as on a machine that is alone: callers take turns
    there, whichever service they asked. Work on a lost host is done once more on another one. Work
    whose worker died is not, since it may be its fault.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._store_id = ""
        self._handle: Any = None
        self._flights: Counter[str] = Counter()
        """Tasks of this service at each host"""
        self._avoided: dict[str, float] = {}
        """Hosts that were lost, and until when they are avoided"""
        self._refused: set[str] = set()
        """Hosts of another release or store, which the log has named"""
        self._late: set[str] = set()
        self.is_draining = False
        self.on_wait: Callable[[float], None] = lambda _seconds: None
        self.on_work: Callable[[str, float], None] = lambda _client, _seconds: None
        self.on_unclaimed: UnclaimedCallback = ignore_unclaimed
        self._looking: asyncio.Task[None] | None = None

    @property
    def load(self) -> Load:
        """The sums over all hosts; see ``Engine``."""
        loads = [host.load for host in self._usable().values()]
        evictions: Counter[str] = Counter()
        for load in loads:
            evictions.update(load.evictions)
        numbers = ("waiting", "idle", "busy", "missing", "lost", "cancelled")
        sums = {name: sum(getattr(load, name) for load in loads) for name in numbers}
        return Load(**sums, evictions=evictions, pids=())

    @property
    def is_ready(self) -> bool:
        """Whether there is a host."""
        return bool(self._usable())

    async def start(self) -> None:
        """Get to know the hosts, in the background; the store must be claimed."""
        self._store_id = self._store.identity()
        handle = serve.get_deployment_handle(DEPLOYMENT, APPLICATION)
        self._handle = handle.options(stream=True)  # which hears of hosts from now on
        self._looking = asyncio.create_task(repeat(self._look, _LOOK_S, "hosts not looked at"))

    def drain(self) -> None:
        """Refuse new tasks, see ``Engine``."""
        self.is_draining = True

    async def stop(self) -> None:
        """End; hosts stop what nobody waits for."""
        if self._looking is not None:
            self._looking.cancel()
            await asyncio.gather(self._looking, return_exceptions=True)

    def refuse_when_full(self, client: str) -> None:  # noqa: ARG002 - hosts know who waits there
        """Raise where each host has more tasks than places, see ``Engine``."""
        if self.is_draining:
            raise draining()
        usable = self._usable()
        if not usable:
            raise _no_host()
        # Idle workers do not count: one may be there for small work alone.
        host = min(usable.values(), key=lambda host: host.load.waiting - host.facts["queue_size"])
        waiting, size = host.load.waiting, host.facts["queue_size"]
        if waiting >= size:
            raise over_limit(
                "queue_full",
                "waiting requests",
                waiting + 1,
                size,
                "queue_size",
                headers=_RETRY_AFTER,
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
        waits_for_host = task.is_promised
        refusal: Problem | None = None
        without: set[str] = set()
        """Hosts that were lost with this task, or that refused it"""
        losses = 0
        while True:
            order = self._order(task, without)
            if not order:
                if not waits_for_host:
                    raise _no_host() if refusal is None else ProblemError(refusal)
                await asyncio.sleep(_LOOK_S)
                without.clear()
                continue
            call = Call(task, get_contextvars(), order, host=order[0])
            try:
                outcome = await self._run_on_host(call, on_progress)
            except _HostLostError:
                losses += 1
                if losses > 1:
                    raise _lost_twice() from None
                logger.warning("host lost: its work is done once more", host=call.host)
                without.add(call.host)
                self._avoided[call.host] = monotonic() + _AVOIDED_S
                task = _once_more(task)
                continue
            if isinstance(outcome, TaskResult):
                return outcome
            if outcome.code not in _NOT_BEGUN:
                raise ProblemError(outcome)
            refusal = outcome
            without.add(call.host)

    def _usable(self) -> dict[str, _Host]:
        """Return the hosts that may have work."""
        ours = {"code": code_version(), "store": self._store_id}
        found = {}
        for name, replica in HOSTS.items():
            facts, stats = replica.replica_metadata, replica.routing_stats
            if {each: facts.get(each) for each in ours} != ours:
                self._name_refused(name, facts, ours)
            else:
                load = Load(**stats["load"]) if stats else _NO_LOAD
                late, computing = stats.get("late", ()), stats.get("computing", ())
                found[name] = _Host(facts, load, computing, late)
        return found

    def _name_refused(self, name: str, theirs: Mapping[str, Any], ours: Mapping[str, str]) -> None:
        if name not in self._refused:
            self._refused.add(name)
            logger.error(
                "host not used: it has another release or store",
                host=name,
                theirs=theirs,
                ours=ours,
            )

    def _order(self, task: Task, without: Collection[str]) -> list[str]:
        """Return the hosts for a task, the best one first.

        A result that is being computed is asked for there, and a host that was lost comes last.
        """
        # The last key is the mesh. What has none, such as an upload, may go anywhere.
        key = task.affinity_keys[-1] if task.affinity_keys else uuid4().hex
        result = task.work.result_name if isinstance(task.work, WritesResult) else None
        usable = {name: host for name, host in self._usable().items() if name not in without}
        occupancies = {
            name: Occupancy(
                max(self._flights[name], host.load.busy + host.load.waiting), host.facts["workers"]
            )
            for name, host in usable.items()
        }

        def is_worse(name: str) -> tuple[bool, bool]:
            is_avoided = self._avoided.get(name, 0.0) > monotonic()
            return is_avoided, result not in usable[name].computing

        return sorted(ranked(key, occupancies, is_small=task.is_small), key=is_worse)

    async def _run_on_host(self, call: Call, on_progress: ProgressCallback) -> TaskResult | Problem:
        start, begun, host = time_ns(), 0, call.host
        self._flights[host] += 1
        outcome: TaskResult | Problem | None = None
        answers = self._handle.run.remote(call)
        try:
            while outcome is None:
                async with asyncio.timeout(SILENCE_S):
                    answer = await anext(answers)
                if isinstance(answer, TaskResult | Problem):
                    outcome = answer
                elif answer is not None:
                    begun = begun or time_ns()
                    on_progress(answer)
        except _LOSSES as error:
            logger.warning("host lost", host=call.host, error=repr(error))
            raise _HostLostError from error
        finally:
            answers.cancel()  # nothing where it is over; nobody else would tell the host
            self._flights[host] -= 1
            self._account(call, start, begun, outcome)
        if isinstance(outcome, TaskResult):
            on_progress(0.0)  # it may have been over before it told a share
        return outcome

    def _account(
        self, call: Call, start: int, begun: int, outcome: TaskResult | Problem | None
    ) -> None:
        """Report the seconds of a task in the queue of a host and with a worker."""
        end = max(start, time_ns())  # the clock may be set back
        parts: Mapping[str, Period] = {}
        if isinstance(outcome, TaskResult):
            # The work may have waited for longer than this call, which joined it there.
            begun, parts = start + round(outcome.seconds["queue"] * 1e9), outcome.periods
        begun = min(begun or end, end)
        failed = outcome is None or (isinstance(outcome, Problem) and outcome.status >= 500)
        self.on_wait((begun - start) / 1e9)
        self.on_work(call.task.client, (end - begun) / 1e9)
        working, host = Period(begun, end), {"host.id": call.host}
        record_span("queue", Period(start, begun), attributes=host)
        parts = _within(working, parts)
        record_span("worker", working, parts, failed=failed, attributes=host)

    async def _look(self) -> None:
        """Note the results that hosts wrote although nobody waits for them."""
        late = {name for host in self._usable().values() for name in host.late}
        for name in late - self._late:
            await self.on_unclaimed(name)
        self._late = late


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

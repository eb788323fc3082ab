"""A cluster in this process: real hosts over engines that only sleep, and links that fail."""

import asyncio
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from app.engine.cluster import HostLostError, HostReport
from app.engine.host import Host
from app.engine.interface import Load, ProgressCallback, UnclaimedCallback, ignore_unclaimed
from app.engine.wire import decode, encode
from app.engine.work import Task, TaskResult
from app.errors import ProblemError, problem
from app.settings import Settings
from app.tracing import Period

T = TypeVar("T")

SETTINGS = Settings(store=Path("/store"), workers=1, queue_size=2)
STORE_ID = "the store of all"


class SleepingEngine:
    """See ``Engine``: each task takes some seconds, and reports its progress in quarters."""

    is_ready = True
    is_draining = False

    def __init__(self) -> None:
        self.seconds = 8.0
        self.periods: Mapping[str, Period] = {}
        """Of the phases of each task, by the clock of the host"""
        self.queue_s = 0.0
        """What results say that they have waited"""
        self.refusal: ProblemError | None = None
        self.is_full = False
        """Whether its queue takes only what was promised"""
        self.begun: list[Task] = []
        self.ended: list[str] = []
        self.running = 0
        self.on_wait: Callable[[float], None] = lambda _seconds: None
        self.on_work: Callable[[str, float], None] = lambda _client, _seconds: None
        self.on_unclaimed: UnclaimedCallback = ignore_unclaimed

    @property
    def load(self) -> Load:
        busy = min(self.running, SETTINGS.workers)
        idle = SETTINGS.workers - busy + 1  # one more for small work alone
        return Load(self.running - busy, idle, busy, 0, 0, 0, {"fields": 1}, {17})

    async def start(self) -> None:
        pass

    def drain(self) -> None:
        self.is_draining = True

    async def stop(self) -> None:
        pass

    def refuse_when_full(self, client: str) -> None:
        pass

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        if self.refusal is not None:
            raise self.refusal
        if self.is_full and not task.is_promised:
            raise problem("queue_full", "no place")
        self.begun.append(task)
        self.running += 1
        try:
            for quarter in range(4):
                on_progress(quarter / 4)
                await asyncio.sleep(self.seconds / 4)
        except asyncio.CancelledError:
            self.ended.append("stopped")
            raise
        finally:
            self.running -= 1
        self.ended.append("done")
        return TaskResult({"queue": self.queue_s, "compute": self.seconds}, self.periods)


class FakeCluster:
    """See ``Cluster``. A dead host fails each call; messages to one that is cut off wait."""

    def __init__(self, *names: str) -> None:
        self.engines = {name: SleepingEngine() for name in names}
        self.machines = {
            name: Host(engine, SETTINGS, STORE_ID) for name, engine in self.engines.items()
        }
        self.dead: set[str] = set()
        self.cut_off: set[str] = set()
        self.unanswered_stops = 0
        """Stops that get lost before one arrives"""
        self.slow_tasks = 0.0
        """Seconds that a task is on its way"""
        self.claim: Mapping[str, Any] = {}
        """What hosts claim in their reports, where it is not the truth"""
        self.stops: list[str] = []
        self._death = asyncio.Event()
        self._is_started = False

    async def start(self) -> None:
        """Start the hosts, unless they run: several replicas may share them."""
        if self._is_started:
            return
        self._is_started = True
        for machine in self.machines.values():
            await machine.start()

    async def close(self) -> None:
        for machine in self.machines.values():
            await machine.close()

    async def hosts(self) -> Collection[str]:
        return self.machines.keys() - self.dead

    def kill(self, name: str) -> None:
        """End a host, with all its work."""
        self.dead.add(name)
        for lease in self.machines[name]._leases.values():
            lease.working.cancel()
        self._death.set()

    async def run(self, host: str, ticket: str, task: bytes) -> bytes:
        async def run() -> bytes:
            await asyncio.sleep(self.slow_tasks)
            return await self.machines[host].run(ticket, task)

        return await self._reach(host, run)

    async def stop(self, host: str, ticket: str) -> None:
        self.stops.append(ticket)
        if self.unanswered_stops > 0:
            self.unanswered_stops -= 1
            await asyncio.sleep(3600)

        async def stop() -> None:
            self.machines[host].stop(ticket)

        await self._reach(host, stop)

    async def beat(self, host: str, tickets: Sequence[str]) -> bytes:
        async def beat() -> bytes:
            data = self.machines[host].beat(tickets)
            return encode(replace(decode(data, HostReport), **self.claim))

        return await self._reach(host, beat)

    async def _reach(self, host: str, call: Callable[[], Awaitable[T]]) -> T:
        """Have a host do a call, which goes on there if the caller is cancelled."""
        await self._until_connected(host)
        calling = asyncio.ensure_future(call())
        dying = asyncio.ensure_future(self._until_dead(host))
        await asyncio.wait({calling, dying}, return_when=asyncio.FIRST_COMPLETED)
        dying.cancel()
        if host in self.dead:
            calling.cancel()
        await self._until_connected(host)
        return await asyncio.shield(calling)

    async def _until_connected(self, host: str) -> None:
        """Wait while a host is cut off: messages are late then, as in TCP, not lost."""
        while host in self.cut_off and host not in self.dead:
            await asyncio.sleep(0.1)
        if host in self.dead:
            raise HostLostError

    async def _until_dead(self, host: str) -> None:
        while host not in self.dead:
            await self._death.wait()
            self._death.clear()

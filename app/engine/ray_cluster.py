"""Ray as the carrier of messages: each machine has one actor, which is a host."""

import asyncio
import sys
from collections.abc import Collection, Sequence
from contextlib import ExitStack
from typing import Any, TypeVar

import structlog

from app import logs
from app.engine import fork_server
from app.engine.cluster import HostLostError
from app.engine.host import Host
from app.engine.interface import Engine
from app.engine.local import LocalEngine
from app.engine.supplied import SuppliedEngine
from app.settings import Settings
from app.store import layout
from app.store.choice import store_of

logger = structlog.get_logger(module=__name__)

_MOST_CALLS = 100_000
"""Calls that an actor takes at the same time: those that wait in its queue too, and beats"""
_PREFIX = "host "
"""Begins the name of each host's actor"""

T = TypeVar("T")


class HostActor:
    """A host, in a process of Ray's.

    Ray starts the process anew where it died. The engine starts with the first beat.
    """

    def __init__(self, settings: Settings, store: str) -> None:
        # The fork server imports the main program of its parent, which would be Ray's.
        vars(sys.modules["__main__"]).pop("__file__", None)
        logs.install(settings.log_format)
        fork_server.start()
        engine: Engine = LocalEngine(settings, settings.folder / layout.RESULTS)
        supply = store_of(settings).supply
        if supply is not None:
            self._folder = ExitStack()
            self._folder.enter_context(supply.owned())  # as long as this process lives
            engine = SuppliedEngine(engine, supply)
        self._host = Host(engine, settings, store)
        self._is_started = False

    async def run(self, ticket: str, task: bytes) -> bytes:
        """Do a task, see ``Cluster``."""
        return await self._host.run(ticket, task)

    async def stop(self, ticket: str) -> None:
        """Stop a task, see ``Cluster``."""
        self._host.stop(ticket)

    async def beat(self, tickets: Sequence[str]) -> bytes:
        """Renew leases and report, see ``Cluster``."""
        if not self._is_started:
            self._is_started = True
            await self._host.start()
        return self._host.beat(tickets)

    async def drain(self) -> None:
        """Refuse new work, and return when there is none left."""
        await self._host.drain()

    async def close(self) -> None:
        """End all work."""
        await self._host.close()


def start_host(settings: Settings, store: str) -> Any:
    """Make a host of this machine, which has joined the cluster; return its actor.

    ``store`` is the id of the store: an actor that starts again must not wait for it.
    """
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    node = ray.get_runtime_context().get_node_id()
    options = {
        "name": _PREFIX + node,
        "num_cpus": 0,
        "max_concurrency": _MOST_CALLS,
        "max_restarts": -1,
        "scheduling_strategy": NodeAffinitySchedulingStrategy(node, soft=False),
    }
    return ray.remote(HostActor).options(**options).remote(settings, store)


class RayCluster:
    """See ``Cluster``; for a process that has joined the cluster."""

    def __init__(self) -> None:
        self._actors: dict[str, Any] = {}

    async def hosts(self) -> Collection[str]:
        """Return the names of the actors that are hosts; those known before without the head."""
        from ray.exceptions import RayError

        try:
            self._actors = await asyncio.to_thread(self._find)
        except (RayError, RuntimeError, ValueError) as error:
            logger.warning("hosts not listed", error=repr(error))
        return self._actors.keys()

    def _find(self) -> dict[str, Any]:
        import ray

        names = [name for name in ray.util.list_named_actors() if name.startswith(_PREFIX)]
        return {name: self._actors.get(name) or ray.get_actor(name) for name in names}

    async def run(self, host: str, ticket: str, task: bytes) -> bytes:
        """Do a task, see ``Cluster``."""
        outcome: bytes = await self._call(host, "run", ticket, task)
        return outcome

    async def stop(self, host: str, ticket: str) -> None:
        """Stop a task, see ``Cluster``."""
        await self._call(host, "stop", ticket)

    async def beat(self, host: str, tickets: Sequence[str]) -> bytes:
        """Renew leases, see ``Cluster``."""
        report: bytes = await self._call(host, "beat", tickets)
        return report

    async def _call(self, host: str, method: str, *arguments: object) -> Any:
        from ray.exceptions import RayError

        try:
            return await getattr(self._actors[host], method).remote(*arguments)
        except (RayError, KeyError) as error:
            raise HostLostError(host) from error

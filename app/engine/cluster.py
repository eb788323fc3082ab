"""The interface between the engine of several machines and whatever carries its messages.

A message is bytes, see ``app.engine.wire``. So another way to reach machines is one class.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.engine.interface import Load

BEAT_S = 0.25
"""Between two beats: each renews leases, and brings back shares of progress and the load"""
SILENCE_S = 5.0
"""Time without an answer to a beat after which a host counts as lost"""
LEASE_S = 6.0
"""Time after which a host stops work that nobody renews: its replica is gone, or cut off"""


class ClusterError(Exception):
    """There is no way to the cluster; the message says what to do."""


class HostLostError(Exception):
    """A host died, or does not answer: nobody knows what became of the work there."""


@dataclass(frozen=True)
class HostReport:
    """The state of a host, and the progress of the work that was asked about."""

    load: Load
    workers: int
    """Long pieces of work that it does at the same time"""
    queue_size: int
    """Tasks that may wait there"""
    is_ready: bool
    is_draining: bool
    code: str
    """Version of the code that answers there"""
    store: str
    """Id of its store, see ``Store.identity``"""
    computing: Mapping[str, bool]
    """Names of the results that it computes, with whether a worker has begun"""
    shares: Mapping[str, float]
    """Share done of the work under each ticket, for work that has begun"""
    unclaimed: Sequence[str]
    """Names of results that were written although nobody waits for them, each reported once"""


class Cluster(Protocol):
    """Reaches the hosts: the machines that do work."""

    async def hosts(self) -> Collection[str]:
        """Return the names of the hosts that are there, as far as is known."""

    async def run(self, host: str, ticket: str, task: bytes) -> bytes:
        """Have a host do a task under a new ticket, and return its outcome.

        To cancel the call stops nothing. Raises ``HostLostError`` where the host is lost.
        """

    async def stop(self, host: str, ticket: str) -> None:
        """Stop the work under a ticket, even if the task comes later than this; may be repeated."""

    async def beat(self, host: str, tickets: Sequence[str]) -> bytes:
        """Renew the leases of some tickets, and return the ``HostReport``."""

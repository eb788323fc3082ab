"""The choice of a host for a task: the one that knows its mesh, as long as it has room."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Occupancy:
    """The tasks that a host has, and those that it does at the same time."""

    pending: int
    workers: int

    def has_room(self, *, is_small: bool) -> bool:
        """Tell whether a task would begin at once; one worker more takes small work only."""
        return self.pending < self.workers + is_small


def ranked(key: str, hosts: Mapping[str, Occupancy], *, is_small: bool) -> list[str]:
    """Return the hosts for a task, the best one first.

    By rendezvous hashing each key has an order of all hosts. It is the same for every service, and
    a host that leaves or joins changes nothing in the order of the others. A task goes to the first
    in that order that has room. So the work on a mesh stays where the mesh is open, and spreads to
    as many hosts as it keeps busy, always in the same order. Where no host has room, it goes to the
    one that is the least full.

    Parameters
    ----------
    key
        What a host may have cached: the id of the mesh.
    hosts
        The occupancy of each host that may be chosen.
    is_small
        Whether the task is small.
    """

    def excess(host: str) -> float:
        occupancy = hosts[host]
        if occupancy.has_room(is_small=is_small):
            return 0.0
        return occupancy.pending / occupancy.workers

    return sorted(preference(key, hosts), key=excess)


def preference(key: str, hosts: Mapping[str, Occupancy]) -> list[str]:
    """Return all hosts in the order in which ``key`` prefers them."""
    return sorted(hosts, key=lambda host: _score(key, host), reverse=True)


def _score(key: str, host: str) -> bytes:
    return hashlib.blake2b(f"{key} {host}".encode(), digest_size=8).digest()

"""Failures of a deployment, and the refusals that are documented for them."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from tests.support.deployment import Deployment, Part, Replica
from tests.support.processes import processor_time
from tests.support.waiting import wait_until

AWAY_S = 10.0
LONG_AWAY_S = 300.0
LONG_NS = 2e8
"""Processor time by which a worker with a long question is known"""
CONTROLLER = "ServeController"
RESTART_S = 2.0
"""Seconds until whatever supervises a command runs it again"""


@dataclass(frozen=True)
class Failure:
    """Something that fails, until it is mended, or started again by whatever supervises it."""

    name: str
    happen: Callable[[Deployment, Any], None]
    """Gets what ``choose`` has returned before"""
    choose: Callable[[Deployment], Any] = lambda _: None
    refusals: Sequence[tuple[int, str]] = ()
    """Statuses and codes that clients may see because of it"""
    breaks: Callable[[Deployment], Replica | None] = field(default=lambda _: None)
    """The replica whose connections end"""
    pause_s: float = 0.0
    """Mean rest of each user between two questions; 0 for hardly any"""


def busiest(deployment: Deployment) -> tuple[Part, int]:
    """Return the node and the worker that have a long question: such work steps back."""
    nodes = {pid: node for node in deployment.nodes for pid in node.workers()}
    before = {pid: _stepping_back(pid) for pid in nodes}
    found: list[int] = []

    def is_long() -> bool:
        found[:] = [pid for pid in nodes if _stepping_back(pid) > before[pid] + LONG_NS]
        return bool(found)

    wait_until(is_long)
    return nodes[found[0]], found[0]


def _stepping_back(pid: int) -> int:
    """Return the processor time that a process has had below the usual priority."""
    return sum(taken for niceness, taken in processor_time(pid).items() if niceness > 0)


def busiest_node(deployment: Deployment) -> Part:
    """Return the node that has a long question."""
    return busiest(deployment)[0]


def kill_worker(_deployment: Deployment, chosen: tuple[Part, int]) -> None:
    """Kill a worker."""
    os.kill(chosen[1], signal.SIGKILL)


def kill_host(_deployment: Deployment, node: Part) -> None:
    """Take the power of a machine; it comes back."""
    node.kill()
    time.sleep(RESTART_S)
    node.start()


def cut_host_off(_deployment: Deployment, node: Part) -> None:
    """Pull the cable of a machine, and put it back."""
    with node.machine.cut_off():
        time.sleep(2 * AWAY_S)


def kill_controller(deployment: Deployment, _: None) -> None:
    """Kill what keeps the hosts, on the head; Ray starts another one."""
    deployment.head.named(CONTROLLER)[0].kill()
    wait_until(lambda: deployment.head.named(CONTROLLER))


def kill_controller_and_host(deployment: Deployment, node: Part) -> None:
    """Kill it, and at once the machine of a host, which only the next controller can miss."""
    deployment.head.named(CONTROLLER)[0].kill()
    kill_host(deployment, node)


def _kill_head(seconds: float) -> Callable[[Deployment, None], None]:
    def kill_head(deployment: Deployment, _: None) -> None:
        deployment.head.kill()
        time.sleep(seconds)
        deployment.head.start()

    return kill_head


def take_store_away(deployment: Deployment, _: None) -> None:
    """Have the object store answer nothing for a while."""
    with deployment.s3.away():
        time.sleep(AWAY_S)


def restart_database(deployment: Deployment, _: None) -> None:
    """Crash PostgreSQL, and start it again."""
    deployment.postgres.stop()
    time.sleep(RESTART_S)
    deployment.postgres.start()


def kill_replica(deployment: Deployment, _: None) -> None:
    """Take the power of the machine of the second replica; it comes back."""
    replica = deployment.replicas[1]
    replica.kill()
    time.sleep(AWAY_S)
    replica.start()


def stop_node(_deployment: Deployment, node: Part) -> None:
    """Stop a node, as for an upgrade, and start it again."""
    node.end()
    time.sleep(RESTART_S)
    node.start()


FAILURES = (
    Failure("nothing", lambda *_: None),
    Failure("a worker is killed", kill_worker, busiest, ((500, "worker_died"),)),
    Failure("a host is killed, and comes back", kill_host, busiest_node),
    Failure("a host is cut off for 20 s", cut_host_off, busiest_node),
    Failure("Ray Serve's controller is killed", kill_controller),
    Failure("that controller is killed, and a host", kill_controller_and_host, busiest_node),
    Failure("the head is killed, and comes back after 10 s", _kill_head(AWAY_S)),
    Failure(
        "the store does not answer for 10 s",
        take_store_away,
        refusals=((503, "store_unavailable"),),
    ),
    Failure(
        "PostgreSQL crashes, and is started again",
        restart_database,
        refusals=((503, "state_unavailable"),),
    ),
    Failure(
        "a replica is killed, and comes back after 10 s",
        kill_replica,
        breaks=lambda each: each.replicas[1],
    ),
    Failure("a node is stopped by SIGTERM", stop_node, busiest_node),
    Failure("the head is killed, and comes back after 5 minutes", _kill_head(LONG_AWAY_S)),
)
OF_RAY = ("a host is killed, and comes back", "that controller is killed, and a host")
WITH_TLS = tuple(
    replace(each, name=f"with TLS: {each.name}") for each in FAILURES if each.name in OF_RAY
)
"""Those in which machines meet again, once more where they speak TLS"""

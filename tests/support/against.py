"""The services of tests as clusters: ``--against cluster``.

Then the fixtures ``client`` and ``serve`` are two replicas, which answer requests in turn; a head
and two nodes are behind them, an S3 server, and PostgreSQL. Tests that speak HTTP do not notice.
Others are left out, by what they use: fixtures that change this process, a service that is always
in this process, or its inside.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle, repeat
from pathlib import Path
from typing import Any, NoReturn

import httpx2
import pytest

from app.engine.interface import Load
from tests.support.cluster import ProcessCluster, running_cluster
from tests.support.processes import Server
from tests.support.s3 import S3
from tests.support.waiting import LONG_S, wait_until

SERVICE, CLUSTER = "service", "cluster"
NODES = 2
IN_THIS_PROCESS = ("monkeypatch", "sweeps")
"""Fixtures that change this process, where no service is"""

_LEFT_OUT = pytest.StashKey[Counter[str]]()
_METRIC_OF_LOAD = {
    "waiting": "geodesic_queue_length",
    "idle": 'geodesic_workers{state="idle"}',
    "busy": 'geodesic_workers{state="busy"}',
    "missing": 'geodesic_workers{state="missing"}',
    "lost": "geodesic_workers_lost_total",
    "cancelled": "geodesic_cancellations_total",
}


class _InTurn(httpx2.BaseTransport):
    """Sends each request to the next replica, with the ``Host`` that it was meant for."""

    def __init__(self, replicas: list[Server]) -> None:
        self.replicas: Iterator[Server] = cycle(replicas)
        self._transport = httpx2.HTTPTransport()

    def handle_request(self, request: httpx2.Request) -> httpx2.Response:
        host, port = next(self.replicas).address
        return self._transport.handle_request(
            httpx2.Request(
                request.method,
                request.url.copy_with(host=host, port=port),
                headers=request.headers,
                stream=request.stream,
                extensions=request.extensions,
            )
        )

    def close(self) -> None:
        self._transport.close()


class ClusterClient(httpx2.Client):
    """A client of the replicas of a cluster; what it shares with ``ServiceClient`` is HTTP."""

    def __init__(self, cluster: ProcessCluster) -> None:
        self.cluster = cluster
        self._in_turn = _InTurn(cluster.servers)
        super().__init__(
            base_url="http://localhost",
            headers={"User-Agent": "testclient"},
            transport=self._in_turn,
            follow_redirects=True,
            timeout=LONG_S,
        )

    @property
    def load(self) -> Load:
        """The load of all hosts, as a replica tells it."""
        lines = self.cluster.servers[0].metrics()
        told = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
        counts = {name: int(float(told[metric])) for name, metric in _METRIC_OF_LOAD.items()}
        return Load(**counts, evictions={}, pids=())

    def workers(self) -> set[int]:
        """Return the ids of the worker processes of all hosts."""
        return set[int]().union(*(node.workers() for node in self.cluster.nodes))

    def wait_until_idle(self) -> None:
        """Wait until every worker is there and does nothing."""
        wait_until(lambda: self._is_idle(self.load))

    @contextmanager
    def staying(self) -> Iterator[None]:
        """Ask one replica only inside the block."""
        before = self._in_turn.replicas
        self._in_turn.replicas = repeat(next(before))
        yield
        self._in_turn.replicas = before

    def _is_idle(self, load: Load) -> bool:
        return load.busy == load.missing == load.waiting == 0 and load.idle == 2 * NODES

    @property
    def app(self) -> NoReturn:
        pytest.skip("looks inside the process of the service")

    engine = app


@contextmanager
def serving_cluster(
    s3: S3, store: str, state: str, folder: Path, **settings: Any
) -> Iterator[ClusterClient]:
    """Run two replicas and two nodes inside the block, on URLs of a store and of a database."""
    with running_cluster(store) as cluster:
        shared = {"store": store, "state": state} | settings
        cluster.settings |= {f"GEODESIC_{key.upper()}": str(shared[key]) for key in shared}
        cluster.settings |= s3.environment
        for _ in range(NODES):
            cluster.add_node()
        for name in ("one", "two"):
            cluster.serve(log=folder / f"{name}.log", GEODESIC_COPIES=str(folder / name))
        with ClusterClient(cluster) as client:
            client.wait_until_idle()
            yield client


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.getgroup("tiers").addoption(
        "--against",
        choices=(SERVICE, CLUSTER),
        default=SERVICE,
        help="what serves tests: a service in this process, or two replicas of a cluster",
    )


def is_against_cluster(config: pytest.Config) -> bool:
    return bool(config.option.against == CLUSTER)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests whose service may be a cluster, and count why others are left out."""
    if not is_against_cluster(config):
        return
    left_out = config.stash[_LEFT_OUT] = Counter()
    kept = []
    for item in items:
        reason = _reason_to_leave_out(item)
        if reason is None:
            kept.append(item)
        else:
            left_out[reason] += 1
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = kept


def _reason_to_leave_out(item: pytest.Item) -> str | None:
    fixtures = getattr(item, "fixturenames", ())
    if "serve" not in fixtures:
        return "start a service of their own, or none"
    changing = [name for name in IN_THIS_PROCESS if name in fixtures]
    return f"change this process ({', '.join(changing)})" if changing else None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Tell how many tests did not apply."""
    left_out = terminalreporter.config.stash.get(_LEFT_OUT, None)
    if left_out is not None:
        terminalreporter.section("not against a cluster")
        for reason, count in left_out.most_common():
            terminalreporter.write_line(f"{count} tests {reason}")

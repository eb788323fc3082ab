"""Nodes that run here, and the load on them: the real service, asked at times that are known."""

import itertools
import random
import re
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from http.client import HTTPResponse
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from benchmarks.scaling.model import Shape
from benchmarks.serving import Client, phases_of, serving_process
from tests.support.cluster import running_cluster

MIX = ((0.5, "path", 20_000), (0.3, "distances", 10_000), (0.2, "distances", 40_000))
"""Shares of questions, their kinds, and the faces of their meshes; all of them are small work"""
CLIENTS = 48
"""Connections, more than ever are in use"""
SECRET = "a-key-of-benchmarks-only"  # noqa: S105 - of no other use
"""Of a caller with a name, whose seconds of workers are in the metrics"""
SETTINGS = {"GEODESIC_QUEUE_SIZE": "1000", "GEODESIC_API_KEYS": f"bench:{SECRET}"}


class Caller(Client):
    """A client with a key."""

    def ask(
        self, path: str, body: Any = None, headers: Mapping[str, str] = {}, method: str = ""
    ) -> tuple[HTTPResponse, bytes]:
        """Send a request, and read the answer."""
        return super().ask(path, body, {"Authorization": f"Bearer {SECRET}", **headers}, method)


class Exchange(NamedTuple):
    """A question as it went, seconds."""

    at: float
    """When it was due, from the beginning of the load"""
    seconds: float
    """From then until its answer was there"""
    queue_s: float
    worker_s: float
    """Of a worker, as the answer states: loading, computing and encoding"""
    mesh: int
    """The number of the mesh in `MIX`"""

    @property
    def outside_s(self) -> float:
        """What is neither waiting for a worker nor its work."""
        return max(0.0, self.seconds - self.queue_s - self.worker_s)


@dataclass(frozen=True)
class Nodes:
    """A service that runs."""

    name: str
    port: int
    process: int
    """Id of the process of the API"""
    meshes: Sequence[str]
    """Their addresses"""
    shape: Shape
    hosts: Sequence[int] = ()
    """Ids of the processes of the nodes of a cluster"""

    def spent_s(self) -> float:
        """Return the processor seconds that the process of the API has taken."""
        times = psutil.Process(self.process).cpu_times()
        return times.user + times.system

    def occupied_s(self) -> float:
        """Return the seconds for which workers were given away, as the metrics state them."""
        client = Caller(self.port)
        text = client.get("/metrics").decode()
        client.close()
        found = re.findall(r"^geodesic_caller_worker_seconds_total\S* (\S+)", text, re.MULTILINE)
        return sum(map(float, found))

    def stored_s(self, count: int = 500) -> float:
        """Ask the same question again and again; return what each takes of the process."""
        client = Caller(self.port)
        _, path, body = self._question(random.Random(0))  # noqa: S311 - as below
        client.get(path, body)
        before = self.spent_s()
        for _ in range(count):
            client.get(path, body)
        client.close()
        return (self.spent_s() - before) / count

    def preferred_hosts(self, count: int = 20) -> Sequence[int]:
        """Return for each mesh the host that its questions go to while that is not busy."""
        if len(self.hosts) < 2:
            return [0] * len(self.meshes)
        client, draw = Caller(self.port), random.Random(1)  # noqa: S311 - as below
        found = []
        for mesh in range(len(self.meshes)):
            before = [_seconds_of(host) for host in self.hosts]
            for _ in range(count):
                client.get(*self._question_to(mesh, draw))
            spent = [
                _seconds_of(host) - then for host, then in zip(self.hosts, before, strict=True)
            ]
            found.append(spent.index(max(spent)))
        client.close()
        return found

    def load_openly(self, rate: float, seconds: float, seed: int) -> Sequence[Exchange]:
        """Ask at random times, so many a second, whether or not earlier answers are there."""
        draw = random.Random(seed)  # noqa: S311 - the same in every run, and no secret
        times: list[float] = []
        at = draw.expovariate(rate)
        while at < seconds:
            times.append(at)
            at += draw.expovariate(rate)
        asks = [self._question(draw) for _ in times]
        with self._clients() as (pool, ask):
            begin = time.perf_counter()
            pending = []
            for due, question in zip(times, asks, strict=True):
                time.sleep(max(0.0, begin + due - time.perf_counter()))
                pending.append(pool.submit(ask, begin, due, *question))
            return [each.result() for each in pending]

    def keep_busy(self, clients: int, seconds: float, seed: int) -> Sequence[Exchange]:
        """Have clients ask one question after the other."""

        def ask_on(number: int) -> list[Exchange]:
            draw, found = random.Random(100 * seed + number), []  # noqa: S311 - likewise
            while (due := time.perf_counter() - begin) < seconds:
                found.append(ask(begin, due, *self._question(draw)))
            return found

        with self._clients() as (pool, ask):
            begin = time.perf_counter()
            found = list(pool.map(ask_on, range(clients)))
        return sorted(itertools.chain.from_iterable(found))

    def _question(self, draw: random.Random) -> tuple[int, str, dict[str, Any]]:
        """Return the mesh, the address and the body of a question that was never asked before."""
        (mesh,) = draw.choices(range(len(MIX)), [share for share, _, _ in MIX])
        return mesh, *self._question_to(mesh, draw)

    def _question_to(self, mesh: int, draw: random.Random) -> tuple[str, dict[str, Any]]:
        _, kind, faces = MIX[mesh]
        source, target = draw.sample(range(2 * faces // 5), 2)  # there are some more
        if kind == "path":
            body: dict[str, Any] = {"source": {"vertex": source}, "target": {"vertex": target}}
        else:
            start = {"vertex": source, "start_distance": draw.random()}
            body = {"sources": [start], "targets": [{"vertex": target}]}
        return f"{self.meshes[mesh]}/{kind}", body

    @contextmanager
    def _clients(self) -> Iterator[tuple[ThreadPoolExecutor, Callable[..., Exchange]]]:
        kept, made = threading.local(), []

        def ask(begin: float, due: float, mesh: int, path: str, body: dict[str, Any]) -> Exchange:
            if not hasattr(kept, "client"):
                kept.client = Caller(self.port)
                made.append(kept.client)
            response, answer = kept.client.ask(path, body)
            end = time.perf_counter() - begin
            if response.status != 200:
                raise RuntimeError(f"{path} answered {response.status}: {answer[:300]!r}")
            phases = phases_of(response)
            queue = phases.pop("queue", 0.0)
            return Exchange(due, end - due, queue, sum(phases.values()), mesh)

        with ThreadPoolExecutor(CLIENTS) as pool:
            yield pool, ask
        for client in made:
            client.close()


@contextmanager
def one_machine(workers: int) -> Iterator[Nodes]:
    """Run a service with some workers."""
    with serving_process(GEODESIC_WORKERS=str(workers), **SETTINGS) as started:
        yield _ready(f"one service, workers: {workers}", *started, Shape(1, workers))


@contextmanager
def cluster(nodes: int) -> Iterator[Nodes]:
    """Run a replica, and nodes of one worker each, that Ray connects."""
    with ExitStack() as stack:
        store = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        made = stack.enter_context(running_cluster(store, **SETTINGS))
        hosts = [made.add_node().process.pid for _ in range(nodes)]
        served = stack.enter_context(serving_process(**made.settings, **made.of_services))
        yield _ready(f"a replica and nodes of one worker: {nodes}", *served, Shape(nodes, 1), hosts)


def _ready(name: str, port: int, process: int, shape: Shape, hosts: Sequence[int] = ()) -> Nodes:
    client = Caller(port)
    meshes = [client.upload_sample("sphere", faces) for _, _, faces in MIX]
    client.close()
    nodes = Nodes(name, port, process, meshes, shape, hosts)
    nodes.keep_busy(
        4 * shape.hosts * shape.workers, 5.0, seed=0
    )  # brings the meshes into each worker
    return nodes


def _seconds_of(process: int) -> float:
    """Return the processor seconds of a process and of all below it."""
    top = psutil.Process(process)
    times = [each.cpu_times() for each in (top, *top.children(recursive=True))]
    return sum(each.user + each.system for each in times)

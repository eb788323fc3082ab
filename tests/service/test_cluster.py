"""Conformance: the engine of one machine and that of a cluster go through the same cases.

The cluster is real: a head, two nodes and a service, each a process of its own with Ray's below.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.support.cluster import Node, ProcessCluster, running_cluster
from tests.support.processes import Server, is_running, refused_start, stopped, total_time
from tests.support.service import check_problem, upload_sample
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.file_slice(4),
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ray") is None, reason="needs the extra cluster"),
]

ASYNC = {"Prefer": "respond-async"}
CANCELLED, LOST = "geodesic_cancellations_total", "geodesic_workers_lost_total"
IDLE, BUSY = 'geodesic_workers{state="idle"}', 'geodesic_workers{state="busy"}'


@dataclass
class Place:
    """A service, and where its workers are."""

    server: Server
    cluster: ProcessCluster | None

    @property
    def client(self) -> Any:
        return self.server.client

    def workers(self) -> set[int]:
        if self.cluster is None:
            return self.server.workers()
        return set[int]().union(*(node.workers() for node in self.cluster.living()))

    def wait_until_idle(self) -> None:
        wait_until(lambda: self.server.is_ready() and self.server.metric(BUSY) == 0)

    def long_query(self, sweeps: int = 40) -> dict[str, Any]:
        """Return a query of so many sweeps, of a kind that reports its progress."""
        sources, targets = ([{"vertex": k * i} for i in range(sweeps)] for k in (31, 17))
        return {"sources": sources, "targets": targets}

    def submit(self, mesh_id: str, sweeps: int = 40, **members: Any) -> str:
        query = self.long_query(sweeps) | members
        response = self.client.post(f"/v1/meshes/{mesh_id}/matrix", json=query, headers=ASYNC)
        assert response.status_code == 202, response.text
        return str(response.headers["location"])

    def job(self, job: str) -> dict[str, Any]:
        document: dict[str, Any] = self.client.get(job).json()
        return document

    def wait_for_busy_worker(self, before: dict[int, int]) -> int:
        """Return the worker that has computed since; it need not have ended."""
        found: list[int] = []

        def look() -> bool:
            for pid, taken in before.items():
                if is_running(pid) and total_time([pid]) > taken + 100e6:
                    found.append(pid)
            return bool(found)

        wait_until(look)
        return found[0]

    def times(self) -> dict[int, int]:
        return {pid: total_time([pid]) for pid in self.workers()}


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    server = Server(tmp_path_factory.mktemp("local"))
    yield Place(server, None)
    server.close()


@pytest.fixture(scope="module")
def spread(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running_cluster(tmp_path_factory.mktemp("shared")) as cluster:
        cluster.add_node()
        cluster.add_node()
        place = Place(cluster.serve(), cluster)
        # Two workers a node, of which one takes small work only.
        wait_until(lambda: place.server.metric(IDLE) == 4)
        yield place


@pytest.fixture(params=["local", "spread"])
def place(request: pytest.FixtureRequest) -> Place:
    place: Place = request.getfixturevalue(request.param)
    place.wait_until_idle()
    return place


@pytest.fixture
def mesh_id(place: Place) -> str:
    return upload_sample(place.client, "sphere", 60_000)


QUERIES: dict[str, dict[str, Any]] = {
    "distances": {"sources": [{"vertex": 0}]},
    "paths": {"source": {"vertex": 0}, "targets": [{"vertex": 77}, {"vertex": 2500}]},
    "isolines": {"sources": [{"vertex": 5}], "levels": [0.3, 0.5]},
    "matrix": {"sources": [{"vertex": 1}, {"vertex": 2}], "targets": [{"vertex": 99}]},
    "nearest": {"source": {"vertex": 0}, "candidates": [{"vertex": 3}, {"vertex": 9}], "k": 1},
    "locate": {"points": [[0.1, 0.2, 0.3]]},
}


@pytest.mark.parametrize("kind", QUERIES)
def test_answers_are_the_same_to_the_bit(local: Place, spread: Place, kind: str) -> None:
    bodies = set()
    for place in (local, spread):
        mesh_id = upload_sample(place.client, "terrain", 5000)
        response = place.client.post(f"/v1/meshes/{mesh_id}/{kind}", json=QUERIES[kind])
        assert response.status_code == 200, response.text
        bodies.add(response.content)
    assert len(bodies) == 1


@pytest.mark.full
def test_all_hosts_share_a_large_matrix(spread: Place, tmp_path: Path) -> None:
    """The command has the cluster compute it; the file is that of one machine, to the bit."""
    spread.wait_until_idle()
    mesh = tmp_path / "mesh.ply"
    command = [sys.executable, "-c", "from app.cli import main; main()"]
    run = partial(subprocess.run, check=True, capture_output=True)
    run([*command, "sample", "sphere", "--faces", "6500", mesh])  # 10.6 million distances
    before = spread.times()
    matrix = [*command, "matrix", mesh, "--points", "all", "--dtype", "float32", "--out"]
    run([*matrix, tmp_path / "there.npy", "--service", str(spread.client.base_url)])
    busy = [pid for pid, taken in spread.times().items() if taken > before[pid] + 500e6]
    nodes = [node for node in spread.cluster.living() if set(busy) & node.workers()]
    assert len(nodes) == 2, "both hosts have computed"
    run([*matrix, tmp_path / "here.npy"])
    assert (tmp_path / "there.npy").read_bytes() == (tmp_path / "here.npy").read_bytes()
    assert not spread.client.get("/v1/jobs").json()["jobs"], "the service need not hold it"


def test_refusals_are_the_same(local: Place, spread: Place) -> None:
    documents = []
    for place in (local, spread):
        mesh_id = upload_sample(place.client, "terrain", 5000)
        query = {
            "source": {"position": [9e9, 0, 0], "max_distance": 1.0},
            "targets": [{"vertex": 1}],
        }
        response = place.client.post(f"/v1/meshes/{mesh_id}/paths", json=query)
        documents.append(check_problem(response, 422, "invalid_point") | {"request_id": None})
    assert documents[0] == documents[1]


def test_a_job_tells_its_progress(place: Place, mesh_id: str) -> None:
    job = place.submit(mesh_id, sweeps=400)  # for so long that it shows
    shares: list[float] = []

    def is_half_done() -> bool:
        shares.append(place.job(job)["progress"])
        return len({share for share in shares if 0 < share < 1}) >= 2

    wait_until(is_half_done)
    assert shares == sorted(shares)
    assert place.client.delete(job).status_code == 200
    place.wait_until_idle()


def test_a_cancelled_job_frees_its_worker(place: Place, mesh_id: str) -> None:
    workers, cancelled = place.workers(), place.server.metric(CANCELLED)
    before = place.times()
    job = place.submit(mesh_id, max_distance=8.0)
    place.wait_for_busy_worker(before)

    assert place.client.delete(job).status_code == 200
    wait_until(lambda: place.server.metric(CANCELLED) == cancelled + 1)
    place.wait_until_idle()
    assert place.workers() == workers


def test_a_deadline_stops_the_work(place: Place, mesh_id: str) -> None:
    workers, cancelled = place.workers(), place.server.metric(CANCELLED)

    with stopped(workers):
        response = place.client.post(
            f"/v1/meshes/{mesh_id}/matrix",
            json=place.long_query() | {"max_distance": 7.0},
            headers={"X-Timeout-Ms": "300"},
        )
    check_problem(response, 504, "deadline_exceeded")
    wait_until(lambda: place.server.metric(CANCELLED) == cancelled + 1)
    place.wait_until_idle()


def test_a_killed_worker_is_an_error_and_is_replaced(place: Place, mesh_id: str) -> None:
    before, lost = place.times(), place.server.metric(LOST)
    job = place.submit(mesh_id, max_distance=6.0)
    os.kill(place.wait_for_busy_worker(before), signal.SIGKILL)

    wait_until(lambda: place.job(job)["status"] == "failed")
    assert place.job(job)["problem"]["code"] == "worker_died"
    wait_until(lambda: place.server.metric(LOST) == lost + 1)
    place.wait_until_idle()
    assert place.client.get(f"/v1/meshes/{mesh_id}/path?from=v0&to=v9").status_code == 200


# Of the cluster alone


def node_of(cluster: ProcessCluster, worker: int) -> Node:
    (node,) = (node for node in cluster.living() if worker in node.workers())
    return node


@pytest.fixture
def cluster(spread: Place) -> ProcessCluster:
    """A cluster of two nodes that do nothing."""
    cluster = spread.cluster
    assert cluster is not None
    while len(cluster.living()) < 2:
        cluster.add_node()
    wait_until(lambda: spread.server.metric(IDLE) == 4)
    return cluster


def begin(spread: Place, **members: Any) -> tuple[str, int]:
    """Begin a job; return it, and the worker that has it."""
    mesh_id = upload_sample(spread.client, "sphere", 60_000)
    before = spread.times()
    job = spread.submit(mesh_id, **members)
    return job, spread.wait_for_busy_worker(before)


def test_work_of_a_killed_node_is_done_by_another(spread: Place, cluster: ProcessCluster) -> None:
    job, worker = begin(spread, max_distance=5.0)
    node_of(cluster, worker).kill()

    wait_until(lambda: spread.job(job)["status"] == "successful")


def test_a_host_process_that_dies_is_started_anew(spread: Place, cluster: ProcessCluster) -> None:
    job, worker = begin(spread, max_distance=4.5)
    node_of(cluster, worker).named("ServeReplica:geodesic:host").kill()

    wait_until(lambda: spread.job(job)["status"] == "successful")
    wait_until(lambda: spread.server.metric(IDLE) == 4)


def test_work_of_a_node_that_hangs_is_done_by_another(
    spread: Place, cluster: ProcessCluster
) -> None:
    job, worker = begin(spread, max_distance=4.2)
    node = node_of(cluster, worker)
    with stopped(each.pid for each in node.tree()):
        wait_until(lambda: spread.job(job)["status"] == "successful")
        # A host that says nothing gets no more work, even before Ray has dropped it.
        mesh_id = upload_sample(spread.client, "terrain", 3000)
        for vertex in range(1, 5):
            path = f"/v1/meshes/{mesh_id}/path?from=v0&to=v{vertex}"
            assert spread.client.get(path).status_code == 200
    node.kill()


def test_a_head_that_is_killed_stops_nothing_and_comes_back(
    spread: Place, cluster: ProcessCluster
) -> None:
    head = cluster.kill_head()
    mesh_id = upload_sample(spread.client, "terrain", 3000)
    assert spread.client.get(f"/v1/meshes/{mesh_id}/path?from=v0&to=v99").status_code == 200
    cluster.start_head_again(head)

    cluster.living()[0].kill()
    cluster.add_node()  # it finds the new head
    wait_until(lambda: spread.server.metric(IDLE) == 4)


def test_work_of_a_killed_service_ends(spread: Place, cluster: ProcessCluster) -> None:
    mesh_id = upload_sample(spread.client, "sphere", 200_000)
    before = spread.times()
    body = json.dumps(spread.long_query(sweeps=400)).encode()
    with spread.server.connect(f"/v1/meshes/{mesh_id}/matrix", body):
        spread.wait_for_busy_worker(before)
        spread.server.kill()

    spread.server = cluster.serve()
    wait_until(lambda: spread.server.metric(CANCELLED) >= 1)
    wait_until(lambda: spread.server.metric(IDLE) == 4)


def test_a_service_says_that_its_machine_is_in_no_cluster(
    cluster: ProcessCluster, tmp_path: Path
) -> None:
    settings = cluster.settings | {"RAY_ADDRESS": "no address"}
    said = refused_start(
        tmp_path, "--engine", "ray", **(settings | {"GEODESIC_STORE": str(tmp_path)})
    )
    assert "this machine is in no cluster" in said

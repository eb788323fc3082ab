"""One trace and one request id, from a replica over a host to its worker, on two machines."""

from collections.abc import Iterator
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import orjson
import pytest

from tests.service.test_traces import DISTANCES, Client, span_of
from tests.support.cluster import ProcessCluster, running_cluster
from tests.support.collector import Collector, collecting
from tests.support.processes import Server
from tests.support.service import NPY, distances, upload_sample
from tests.support.waiting import wait_until

pytest.importorskip("ray")
pytestmark = pytest.mark.full

OF_A_HOST = ("queue", "worker")
PHASES = ("load", "compute", "encode")


@pytest.fixture(scope="module")
def collector() -> Iterator[Collector]:
    with collecting() as collector:
        yield collector


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ProcessCluster]:
    with running_cluster(tmp_path_factory.mktemp("traced")) as cluster:
        cluster.settings["GEODESIC_LOG_FORMAT"] = "json"
        # A worker holds no field in memory, so that it reads those in the store.
        cluster.settings["GEODESIC_WORKER_FIELD_BYTES"] = "1"
        for _ in range(2):
            cluster.add_node()
        yield cluster


@pytest.fixture(scope="module")
def replica(cluster: ProcessCluster, collector: Collector) -> Server:
    traces = {"OTEL_EXPORTER_OTLP_ENDPOINT": collector.url, "OTEL_BSP_SCHEDULE_DELAY": "50"}
    cluster.settings |= traces
    server = cluster.serve()
    wait_until(lambda: server.metric('geodesic_workers{state="idle"}') == 4)
    return server


def ask(replica: Server, collector: Collector, mesh_id: str) -> tuple[Client, dict[str, Any]]:
    """Ask for distances in a trace of its own; return its client and its spans."""
    client = Client()
    assert distances(replica.client, mesh_id, client.headers).status_code == 200
    span_of(collector, client, DISTANCES)
    return client, collector.spans(client.trace_id)


def host_of(span: Any) -> str:
    """Return what the span tells of its host."""
    (host,) = (each.value.string_value for each in span.attributes if each.key == "host.id")
    return str(host)


def test_spans_of_each_machine_are_in_the_trace_of_the_request(
    replica: Server, cluster: ProcessCluster, collector: Collector
) -> None:
    seen = set()
    for number in count(1):  # meshes are spread by their ids
        mesh = {"vertices": [[0, 0, 0], [1, 0, 0], [0, number, 0]], "faces": [[0, 1, 2]]}
        mesh_id = replica.client.post("/v1/meshes", json=mesh).json()["id"]
        client, spans = ask(replica, collector, mesh_id)

        assert set(spans) == {DISTANCES, *OF_A_HOST, *PHASES}
        assert spans[DISTANCES].parent_span_id.hex() == client.span_id
        assert {spans[name].parent_span_id for name in OF_A_HOST} == {spans[DISTANCES].span_id}
        assert {spans[name].parent_span_id for name in PHASES} == {spans["worker"].span_id}
        order = [spans[name] for name in ("queue", *PHASES)]
        for earlier, later in pairwise(order):
            assert earlier.end_time_unix_nano <= later.start_time_unix_nano
        for part in PHASES:
            assert spans[part].start_time_unix_nano >= spans["worker"].start_time_unix_nano
            assert spans[part].end_time_unix_nano <= spans["worker"].end_time_unix_nano
        (host,) = {host_of(spans[name]) for name in OF_A_HOST}
        seen.add(host)
        if len(seen) == len(cluster.nodes):
            return


def test_a_worker_elsewhere_logs_the_ids_of_the_request_and_of_its_trace(
    replica: Server, cluster: ProcessCluster
) -> None:
    mesh_id = upload_sample(replica.client, "sphere", 60_000)
    assert distances(replica.client, mesh_id).status_code == 200
    fields = replica.store / "fields" / mesh_id
    wait_until(lambda: list(fields.glob("*.npz")))
    (field,) = fields.glob("*.npz")
    field.write_bytes(field.read_bytes()[:-9])

    # Another form of the answer: another result, and the same field, which is found damaged.
    client = Client()
    headers = NPY | client.headers | {"X-Request-ID": "of-a-damaged-field"}
    assert distances(replica.client, mesh_id, headers).status_code == 200
    wait_until(lambda: lines_of(cluster, request_id="of-a-damaged-field"))
    (line,) = lines_of(cluster, request_id="of-a-damaged-field")
    assert (line["trace_id"], line["path"]) == (client.trace_id, str(field))


def lines_of(cluster: ProcessCluster, **fields: str) -> list[dict[str, Any]]:
    """Return the lines with these fields in the logs of the nodes."""
    found = []
    for number in range(len(cluster.nodes)):
        logs: Path = cluster.folder / f"n{number}" / "session_latest" / "logs"
        for file in logs.glob("worker-*"):
            for text in file.read_text().splitlines():
                line = orjson.loads(text) if text.startswith("{") else {}
                if fields.items() <= line.items():
                    found.append(line)
    return found

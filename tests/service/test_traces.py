"""Traces as a collector receives them from a service as a process of its own."""

import os
import secrets
import signal
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from typing import Any

import orjson
import pytest
from opentelemetry.proto.trace.v1.trace_pb2 import Span, Status

from tests.support.collector import Collector, collecting
from tests.support.fresh import told_by
from tests.support.processes import Server, total_time
from tests.support.service import SLOW_FACES, distances, upload_sample
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(4)

DISTANCES = "POST /v1/meshes/{mesh_id}/distances"
KEY = "alice/0123456789+abcdef"


@pytest.fixture(scope="module")
def collector() -> Iterator[Collector]:
    with collecting() as collector:
        yield collector


@pytest.fixture(scope="module")
def server(collector: Collector, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("traced")
    settings = {"OTEL_EXPORTER_OTLP_ENDPOINT": collector.url, "OTEL_BSP_SCHEDULE_DELAY": "50"}
    settings |= {"GEODESIC_API_KEYS": f"alice:{KEY}", "GEODESIC_LOG_FORMAT": "json"}
    with closing(Server(folder / "store", log=folder / "log", **settings)) as server:
        server.client.headers["Authorization"] = f"Bearer {KEY}"
        yield server


class Client:
    """A client in the middle of a trace of its own."""

    def __init__(self) -> None:
        self.trace_id, self.span_id = secrets.token_hex(16), secrets.token_hex(8)
        self.headers = {"traceparent": f"00-{self.trace_id}-{self.span_id}-01"}


def span_of(collector: Collector, client: Client, name: str) -> Any:
    """Return a span of a client's trace, once it has arrived."""
    wait_until(lambda: name in collector.spans(client.trace_id))
    return collector.spans(client.trace_id)[name]


def log_lines(server: Server, **fields: Any) -> list[dict[str, Any]]:
    log = server.store.parent / "log"
    lines = [orjson.loads(line) for line in log.read_bytes().splitlines()]
    return [line for line in lines if fields.items() <= line.items()]


def test_a_query_has_spans_from_its_request_to_its_encoding(
    server: Server, collector: Collector
) -> None:
    client, mesh_id = Client(), upload_sample(server.client, "plane", 200)
    assert distances(server.client, mesh_id, client.headers).status_code == 200

    request = span_of(collector, client, DISTANCES)
    spans = collector.spans(client.trace_id)
    assert set(spans) == {DISTANCES, "queue", "worker", "load", "compute", "encode"}
    assert request.kind == Span.SPAN_KIND_SERVER
    assert request.parent_span_id.hex() == client.span_id
    for inner, outer in [("queue", DISTANCES), ("worker", DISTANCES)] + [
        (phase, "worker") for phase in ("load", "compute", "encode")
    ]:
        assert spans[inner].parent_span_id == spans[outer].span_id
        assert spans[inner].start_time_unix_nano >= spans[outer].start_time_unix_nano
        assert spans[inner].end_time_unix_nano <= spans[outer].end_time_unix_nano
    order = [spans[name] for name in ("queue", "load", "compute", "encode")]
    for earlier, later in pairwise(order):
        assert earlier.end_time_unix_nano <= later.start_time_unix_nano
    (pid,) = (each.value.int_value for each in spans["worker"].attributes)
    assert pid in server.workers()
    assert {span.status.code for span in spans.values()} == {Status.STATUS_CODE_UNSET}


def test_the_log_names_the_trace(server: Server) -> None:
    client = Client()
    assert server.client.get("/v1", headers=client.headers).status_code == 200

    wait_until(lambda: log_lines(server, event="request", trace_id=client.trace_id))


def test_a_stored_answer_has_the_span_of_its_request_only(
    server: Server, collector: Collector
) -> None:
    client, mesh_id = Client(), upload_sample(server.client, "plane", 300)
    for headers in ({}, client.headers):
        assert distances(server.client, mesh_id, headers).status_code == 200

    span_of(collector, client, DISTANCES)
    assert set(collector.spans(client.trace_id)) == {DISTANCES}


def test_a_job_belongs_to_the_trace_of_its_request(server: Server, collector: Collector) -> None:
    client, mesh_id = Client(), upload_sample(server.client, "plane", 400)
    answer = distances(server.client, mesh_id, client.headers | {"Prefer": "respond-async"})
    assert answer.status_code == 202

    request, worker = (span_of(collector, client, name) for name in (DISTANCES, "worker"))
    assert worker.parent_span_id == request.span_id


def test_the_span_of_a_worker_that_died_says_so(server: Server, collector: Collector) -> None:
    client, mesh_id = Client(), upload_sample(server.client, "sphere", SLOW_FACES)
    body = orjson.dumps({"sources": [{"vertex": 0}], "targets": [{"vertex": 1}]})
    headers = client.headers | {"Authorization": f"Bearer {KEY}"}
    workers = server.both_workers()
    before = total_time(workers)
    with server.connect(f"/v1/meshes/{mesh_id}/distances", body, headers=headers) as connection:
        wait_until(lambda: total_time(workers) - before > 20e6)  # it has begun
        for pid in workers:
            os.kill(pid, signal.SIGKILL)
        assert connection.recv(20).startswith(b"HTTP/1.1 500")

    request, worker = (span_of(collector, client, name) for name in (DISTANCES, "worker"))
    assert request.status.code == worker.status.code == Status.STATUS_CODE_ERROR
    server.both_workers()


def test_probes_have_no_spans(server: Server, collector: Collector) -> None:
    client = Client()
    for probe in ("/livez", "/readyz"):
        server.client.get(probe, headers=client.headers)
    assert server.client.get("/v1", headers=client.headers).status_code == 200

    span_of(collector, client, "GET /v1")
    assert set(collector.spans(client.trace_id)) == {"GET /v1"}
    assert not {"GET /livez", "GET /readyz"} & set(collector.spans())


def test_no_key_is_sent_to_the_collector(server: Server, collector: Collector) -> None:
    client = Client()
    for key in (KEY, "wrong/" + KEY):
        headers = client.headers | {"Authorization": f"Bearer {key}"}
        server.client.get("/v1/meshes", headers=headers)

    span_of(collector, client, "GET /v1/meshes")
    wait_until(lambda: "GET" in collector.spans(client.trace_id))  # refused: it has no route
    assert not any(b"0123456789+abcdef" in body for body in collector.bodies)


STARTED = """
import os, sys
from pathlib import Path
from tempfile import TemporaryDirectory
from starlette.testclient import TestClient
from app import logs
from app.main import create_app
from app.settings import Settings

def start():
    logs.install("json", sys.stdout)
    with TemporaryDirectory() as folder:
        app = create_app(Settings(store=Path(folder), workers=1))
        with TestClient(app) as client:
            assert client.get("/v1").status_code == 200
"""


def test_the_exporter_is_not_imported_unless_it_is_asked_for() -> None:
    script = f"{STARTED}\nstart()\nprint('opentelemetry.sdk' in sys.modules)"
    assert told_by(script).splitlines()[-1] == "False"


def test_traces_that_are_asked_for_without_the_extra_are_missed_in_the_log() -> None:
    script = f"""{STARTED}
os.environ["OTEL_EXPORTER_OTLP_ENDPOINT"] = "http://127.0.0.1:9"
sys.modules["opentelemetry.sdk"] = None
start()
"""
    lines = [orjson.loads(line) for line in told_by(script).splitlines()]
    warnings = [line["event"] for line in lines if line["level"] == "warning"]
    assert len([each for each in warnings if "telemetry configuration failed" in each]) == 1
    assert [line["status"] for line in lines if line["event"] == "request"] == [200]

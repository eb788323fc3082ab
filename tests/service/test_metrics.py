"""Metrics as Prometheus reads them, against what was done."""

import os
import resource
import shutil
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_open
from prometheus_client.parser import text_string_to_metric_families as parse
from starlette.testclient import TestClient

from app.main import create_app
from app.settings import MIB, Settings
from tests.support.postgres import Server as Postgres
from tests.support.processes import stopped
from tests.support.service import (
    ServiceClient,
    check_problem,
    distances,
    serving,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until

Values = dict[tuple[str, frozenset[tuple[str, str]]], float]


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    with serving(tmp_path_factory.mktemp("metrics"), queue_size=3, cancel_grace_s=LONG_S) as client:
        wait_until(lambda: value(scrape(client), "workers", state="idle") == 2)
        yield client


def scrape(client: TestClient) -> Values:
    response = client.get("/metrics")
    assert response.status_code == 200
    assert response.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    assert response.headers["cache-control"] == "no-store"
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in parse(response.text)
        for sample in family.samples
    }


def value(values: Values, name: str, **labels: str) -> float:
    return values.get((f"geodesic_{name}", frozenset(labels.items())), 0.0)


def grown(before: Values, after: Values, name: str, **labels: str) -> float:
    return value(after, name, **labels) - value(before, name, **labels)


def test_every_name_begins_alike_and_every_family_says_what_it_is(watched: TestClient) -> None:
    families = list(parse(watched.get("/metrics").text))

    assert all(family.name.startswith("geodesic_") for family in families)
    assert all(family.documentation for family in families)
    assert len({family.name for family in families}) == len(families)


def test_open_metrics_as_well(watched: TestClient) -> None:
    accept = {"Accept": "application/openmetrics-text; version=1.0.0"}
    response = watched.get("/metrics", headers=accept)

    assert response.headers["content-type"].startswith("application/openmetrics-text")
    assert {"geodesic_requests", "geodesic_jobs"} <= {f.name for f in parse_open(response.text)}


def test_requests_are_counted_and_timed_by_operation(watched: TestClient) -> None:
    mesh_id = upload_sample(watched, "plane", 200)
    before, start = scrape(watched), perf_counter()
    for _ in range(2):
        assert distances(watched, mesh_id).status_code == 200
    check_problem(distances(watched, mesh_id, sources=[]), 422, "invalid_request")
    elapsed = perf_counter() - start
    check_problem(watched.get("/nowhere"), 404, "not_found")
    check_problem(watched.put("/v1/meshes"), 405, "method_not_allowed")
    after = scrape(watched)

    operation = {"operation": "computeDistances"}
    assert grown(before, after, "requests_total", status="200", **operation) == 2
    assert grown(before, after, "requests_total", status="422", **operation) == 1
    assert grown(before, after, "request_seconds_count", **operation) == 3
    assert 0 < grown(before, after, "request_seconds_sum", **operation) < elapsed
    assert grown(before, after, "requests_total", status="404", operation="none") == 1
    assert grown(before, after, "requests_total", status="200", operation="getMetrics") == 1


def test_labels_are_bounded(watched: TestClient) -> None:
    before = {labels for _, labels in scrape(watched)}
    for number in range(20):
        watched.get(f"/v1/meshes/{number:032x}")
        watched.get(f"/nowhere/{number}")
        watched.request(f"METHOD{number}", "/v1/meshes")
    documented = watched.get("/openapi.json").json()["paths"].values()
    operations = {op["operationId"] for path in documented for op in path.values()}
    named = [dict(labels) for labels in {labels for _, labels in scrape(watched)} - before]

    assert {labels["operation"] for labels in named} <= operations | {"none"}
    assert len(named) <= 3 * 20, "a bucket each of three histograms"


def test_answers_kept_and_solved(watched: TestClient) -> None:
    mesh_id = upload_sample(watched, "plane", 45_000)
    before = scrape(watched)
    for _ in range(3):
        assert distances(watched, mesh_id).status_code == 200
    after = scrape(watched)

    assert grown(before, after, "results_lookups_total", outcome="miss") == 1
    assert grown(before, after, "results_lookups_total", outcome="hit") == 2
    assert grown(before, after, "solves_total", kind="distances") == 1
    assert grown(before, after, "solve_seconds_total", kind="distances") > 0
    sent = distances(watched, mesh_id).headers["content-length"]
    assert grown(before, after, "results_bytes") == int(sent)


def test_meshes_and_their_bytes(watched: TestClient) -> None:
    before = scrape(watched)
    mesh_id = upload_sample(watched, "plane", 400)
    after = scrape(watched)
    folder = watched.app.state.service.settings.store / "meshes" / mesh_id

    assert grown(before, after, "meshes") == 1
    size = sum(file.stat().st_size for file in folder.iterdir())
    assert grown(before, after, "meshes_bytes") == size
    watched.delete(f"/v1/meshes/{mesh_id}")
    assert grown(before, scrape(watched), "meshes_bytes") == 0


def submit(client: TestClient, mesh_id: str, vertex: int) -> str:
    body: Any = {"sources": [{"vertex": vertex}], "targets": [{"vertex": 1}]}
    link = f"/v1/meshes/{mesh_id}/distances"
    response = client.post(link, json=body, headers={"Prefer": "respond-async"})
    assert response.status_code == 202
    return str(response.headers["location"])


def test_jobs_queue_workers_and_cancellations(watched: ServiceClient) -> None:
    large = upload_sample(watched, "sphere", 80_000)
    before = scrape(watched)
    with stopped(watched.workers()):
        first, second = submit(watched, large, 7), submit(watched, large, 8)
        wait_until(lambda: watched.get(first).json()["status"] == "running")
        during = scrape(watched)
        watched.post(f"{second}/cancel")
        watched.post(f"{first}/cancel")

    assert value(during, "jobs", status="running") == value(during, "jobs", status="accepted") == 1
    assert value(during, "queue_length") == 1
    assert (value(during, "workers", state="busy"), value(during, "workers", state="idle")) == (
        1,
        1,
    )

    wait_until(lambda: value(scrape(watched), "workers", state="idle") == 2)
    after = scrape(watched)
    assert grown(before, after, "jobs", status="dismissed") == 2
    assert value(after, "jobs", status="running") == value(after, "queue_length") == 0
    assert grown(before, after, "cancellations_total") == 1, "the other had not begun"

    for job in (first, second):
        watched.delete(job)
    assert grown(before, scrape(watched), "jobs", status="dismissed") == 0


def test_jobs_are_those_of_before_while_the_database_is_away(
    postgres: Postgres, tmp_path: Path
) -> None:
    with serving(tmp_path, state=postgres.new_database()) as client:
        job = submit(client, upload_sample(client, "plane", 200), 0)
        wait_until(lambda: client.get(job).json()["status"] == "successful")
        assert value(scrape(client), "jobs", status="successful") == 1
        postgres.stop()
        try:
            check_problem(client.get(job), 503, "state_unavailable")
            away = scrape(client)
        finally:
            postgres.start()

    assert value(away, "jobs", status="successful") == 1
    assert value(away, "requests_total", operation="getJob", status="503") == 1


def test_workers_that_are_lost(watched: ServiceClient) -> None:
    before = scrape(watched)
    os.kill(min(watched.workers()), signal.SIGKILL)

    wait_until(lambda: grown(before, scrape(watched), "workers_lost_total") == 1)
    wait_until(lambda: value(scrape(watched), "workers", state="idle") == 2)
    assert grown(before, scrape(watched), "workers_lost_total") == 1


# Resources


def resident_bytes(pid: int) -> int:
    """Return what the system says of a process."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmRSS:")).split()[1])


def test_memory_by_kind_of_process(watched: ServiceClient) -> None:
    with stopped(watched.workers()):
        values = scrape(watched)
        workers = sum(map(resident_bytes, watched.workers()))

    kinds = ("api", "worker", "other")
    memory = {kind: value(values, "resident_memory_bytes", process=kind) for kind in kinds}
    assert memory["worker"] == pytest.approx(workers, rel=0.01)
    assert memory["api"] == pytest.approx(resident_bytes(os.getpid()), rel=0.2)
    assert memory["other"] > 10 * MIB, "the process that workers are forked from"


def test_open_descriptors_and_their_limit(watched: ServiceClient) -> None:
    before = scrape(watched)
    pipes = [end for _ in range(50) for end in os.pipe()]
    after = scrape(watched)
    for end in pipes:
        os.close(end)

    assert grown(before, after, "open_fds") == pytest.approx(len(pipes), abs=20)
    assert value(after, "max_fds") == resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def test_room_on_the_disk(watched: ServiceClient) -> None:
    free = shutil.disk_usage(watched.app.state.service.settings.store).free

    assert value(scrape(watched), "store_free_bytes") == pytest.approx(free, rel=0.2)


def test_a_blocked_event_loop_lags(watched: ServiceClient) -> None:
    assert watched.portal is not None
    name = "event_loop_lag_seconds"

    def late(values: Values) -> float:
        return value(values, f"{name}_count") - value(values, f"{name}_bucket", le="0.25")

    before = scrape(watched)
    watched.portal.call(time.sleep, 0.6)  # a quarter of it may be over before it is noticed

    wait_until(lambda: late(scrape(watched)) > late(before))


def test_the_wait_for_a_worker(watched: ServiceClient) -> None:
    large = upload_sample(watched, "sphere", 80_000)
    before = scrape(watched)
    with stopped(watched.workers()):
        first, second = submit(watched, large, 7), submit(watched, large, 8)
        wait_until(lambda: value(scrape(watched), "queue_length") == 1)
        time.sleep(0.3)
        watched.delete(second)  # it gives up
        watched.delete(first)
    wait_until(lambda: value(scrape(watched), "workers", state="idle") == 2)
    after = scrape(watched)

    assert grown(before, after, "queue_wait_seconds_count") == 2
    assert grown(before, after, "queue_wait_seconds_bucket", le="0.25") == 1
    assert grown(before, after, "queue_wait_seconds_sum") > 0.3


def test_evictions_from_each_store_and_cache(tmp_path: Path) -> None:
    small = {"store_evict": "lru", "store_bytes": 300_000, "results_memory_bytes": 20_000}
    small |= {"worker_mesh_bytes": 1, "worker_field_bytes": 1, "results_bytes": 100}
    with serving(tmp_path, **small) as client:
        for faces in (200, 300, 400):
            mesh_id = upload_sample(client, "plane", faces)
            for vertex in range(3):
                sources = [{"vertex": vertex}]
                assert distances(client, mesh_id, sources=sources).status_code == 200
        held = client.get("/v1/meshes").json()["meshes"]
        job = submit(client, mesh_id, 0)
        wait_until(lambda: client.get(job).json()["status"] not in ("accepted", "running"))
        values = scrape(client)

    evicted = lambda cache: value(values, "evictions_total", cache=cache)  # noqa: E731
    assert evicted("meshes") == 3 - len(held) > 0
    assert evicted("results") > 0, "at least that of the job, which finds no room"
    assert evicted("results_memory") > 0
    assert evicted("worker_meshes") > 0
    assert evicted("worker_fields") > 0
    assert evicted("fields") == 0


# Callers


def test_use_is_counted_by_the_name_of_the_key(tmp_path: Path) -> None:
    keys = {"alice": "alice-0123456789", "bob": "bob-0123456789ab"}
    listed = ",".join(f"{name}:{secret}" for name, secret in keys.items())
    with serving(tmp_path, api_keys=listed) as client:
        assert client.get("/v1").status_code == 401
        client.headers["Authorization"] = f"Bearer {keys['alice']}"
        before = scrape(client)
        mesh_id = upload_sample(client, "plane", 200)
        check_problem(distances(client, mesh_id, sources=[]), 422, "invalid_request")
        assert distances(client, mesh_id).status_code == 200
        middle = scrape(client)
        assert distances(client, mesh_id).status_code == 200
        after = scrape(client)

    assert grown(before, middle, "caller_requests_total", caller="alice") == 4, "a scrape is one"
    assert grown(middle, after, "caller_requests_total", caller="alice") == 2
    assert grown(middle, after, "caller_worker_seconds_total", caller="alice") == 0, "it was stored"
    assert grown(before, middle, "caller_worker_seconds_total", caller="alice") > 0
    for name in ("caller_requests_total", "caller_worker_seconds_total"):
        callers = {dict(labels)["caller"] for each, labels in after if each == f"geodesic_{name}"}
        assert callers == {"alice", "bob"}
        assert value(after, name, caller="bob") == 0


def test_without_keys_callers_are_not_counted(watched: ServiceClient) -> None:
    assert upload_sample(watched, "plane", 200)

    assert not [name for name, _ in scrape(watched) if name.startswith("geodesic_caller_")]


def test_two_services_in_one_process_count_apart(watched: TestClient, tmp_path: Path) -> None:
    with TestClient(create_app(Settings(store=tmp_path, workers=1))) as other:
        before = scrape(watched)
        other.get("/v1")
        assert value(scrape(other), "requests_total", status="200", operation="getAbout") == 1
        assert (
            grown(before, scrape(watched), "requests_total", operation="getAbout", status="200")
            == 0
        )

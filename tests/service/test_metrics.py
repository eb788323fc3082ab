"""Metrics as Prometheus reads them, against what was done."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_open
from prometheus_client.parser import text_string_to_metric_families as parse
from starlette.testclient import TestClient

from app.main import create_app
from app.settings import Settings
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
        watched.delete(second)
        watched.delete(first)

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


def test_workers_that_are_lost(watched: ServiceClient) -> None:
    before = scrape(watched)
    os.kill(min(watched.workers()), signal.SIGKILL)

    wait_until(lambda: grown(before, scrape(watched), "workers_lost_total") == 1)
    wait_until(lambda: value(scrape(watched), "workers", state="idle") == 2)
    assert grown(before, scrape(watched), "workers_lost_total") == 1


def test_two_services_in_one_process_count_apart(watched: TestClient, tmp_path: Path) -> None:
    with TestClient(create_app(Settings(store=tmp_path, workers=1))) as other:
        before = scrape(watched)
        other.get("/v1")
        assert value(scrape(other), "requests_total", status="200", operation="getAbout") == 1
        assert (
            grown(before, scrape(watched), "requests_total", operation="getAbout", status="200")
            == 0
        )

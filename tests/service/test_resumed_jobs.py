"""Jobs that a service left when it stopped, as the next one on the same store runs them."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.queries import KINDS
from tests.support.processes import stopped
from tests.support.service import ServiceClient, check_problem, serving, upload_sample
from tests.support.waiting import LONG_S, wait_until

ASYNC = {"Prefer": "respond-async"}
VERTEX = {"vertex": 0}
INSIDE = {"face": 7, "barycentric": [0.2, 0.3, 0.5]}

QUERIES: dict[str, dict[str, Any]] = {
    "distances": {"sources": [INSIDE], "barriers": [3]},
    "path": {"source": VERTEX, "target": INSIDE},
    "paths": {"source": INSIDE, "targets": [{"vertex": 9}, VERTEX]},
    "isolines": {"sources": [INSIDE], "count": 3},
    "borders": {"sources": [INSIDE, {"vertex": 9}]},
    "boundaries": {"barriers": [3]},
    "cut": {"curves": [{"polyline": [INSIDE]}]},
    "samples": {"count": 4, "starts": [INSIDE], "iterations": 1},
    "cells": {"sources": [INSIDE, {"vertex": 9}]},
    "mean": {"points": [INSIDE, {"vertex": 9}]},
    "loop": {"curves": [{"polyline": [INSIDE]}]},
    "matrix": {"sources": [VERTEX, INSIDE], "targets": [{"vertex": 9}]},
    "nearest": {"source": INSIDE, "candidates": [{"vertex": 9}, VERTEX], "k": 2},
    "log_map": {"source": INSIDE, "x_axis": [1, 0, 0]},
    "trace": {"starts": [INSIDE], "directions": [[1, 0, 0]], "lengths": [0.3]},
    "locate": {"points": [[0.1, 0.2, 0.3]]},
    "steps": {"source": VERTEX, "target": INSIDE},
    "sweep": {"sources": [INSIDE], "steps": 9},
}
"""A query of each kind"""
LINKS = {kind: kind for kind in QUERIES} | {"steps": "path/steps", "log_map": "log-map"}


@contextmanager
def held(store: Path, **settings: Any) -> Iterator[tuple[ServiceClient, str]]:
    """Run a service whose workers get no further, so that all jobs are under way at its end.

    Yield it, and the path of a mesh. The workers stay stopped until the service's end kills them:
    one that went on before would finish its job.
    """
    with (
        ExitStack() as until_the_end,
        serving(store, cancel_grace_s=LONG_S, **settings) as client,
    ):
        client.wait_until_idle()
        mesh_id = upload_sample(client, "terrain", 200)
        until_the_end.enter_context(stopped(client.workers()))
        yield client, f"/v1/meshes/{mesh_id}"


def submit(client: TestClient, link: str, body: Any, headers: Any = ()) -> str:
    response = client.post(link, json=body, headers={**ASYNC, **dict(headers)})
    assert response.status_code == 202, response.text
    return str(response.headers["location"])


def end_of(client: TestClient, job: str) -> Any:
    """Return the last state of a job."""
    wait_until(lambda: client.get(job).json()["finished"] is not None)
    return client.get(job).json()


@pytest.mark.parametrize("media_type", ["application/json", "application/octet-stream"])
def test_each_kind_of_query_has_the_same_answer(
    tmp_path: Path, client: ServiceClient, media_type: str
) -> None:
    """That of a service which has never heard of the job, to the bit."""
    assert set(QUERIES) == set(KINDS)
    accept = {"Accept": media_type}
    asked = {
        kind: body
        for kind, body in QUERIES.items()
        if media_type == "application/json" or kind in ("distances", "matrix")
    }
    with held(tmp_path) as (first, mesh):
        jobs = {
            kind: submit(first, f"{mesh}/{LINKS[kind]}", body, accept)
            for kind, body in asked.items()
        }

    assert mesh == f"/v1/meshes/{upload_sample(client, 'terrain', 200)}"
    with serving(tmp_path) as second:
        for kind, job in jobs.items():
            document = end_of(second, job)
            assert (document["status"], document["kind"]) == ("successful", kind)
            answer = second.get(f"{job}/results")
            expected = client.post(f"{mesh}/{LINKS[kind]}", json=asked[kind], headers=accept)
            assert expected.status_code == (201 if kind == "cut" else 200)
            assert answer.content == expected.content
            assert answer.headers["etag"] == expected.headers["etag"]


def test_more_jobs_than_the_queue_holds(tmp_path: Path) -> None:
    with held(tmp_path, queue_size=20) as (first, mesh):
        bodies = [{"sources": [{"vertex": vertex}]} for vertex in range(12)]
        jobs = [submit(first, f"{mesh}/distances", body) for body in bodies]
        listed = [job["id"] for job in first.get("/v1/jobs").json()["jobs"]]

    with serving(tmp_path, queue_size=1) as second:
        assert [job["id"] for job in second.get("/v1/jobs").json()["jobs"]] == listed
        for vertex, job in enumerate(jobs):
            assert end_of(second, job)["status"] == "successful"
            assert second.get(f"{job}/results").json()["distances"][vertex] == 0.0


def test_a_limit_that_was_lowered_meanwhile(tmp_path: Path) -> None:
    with held(tmp_path) as (first, mesh):
        within, beyond = (
            submit(first, f"{mesh}/distances", {"sources": [{"vertex": v} for v in range(count)]})
            for count in (2, 3)
        )

    with serving(tmp_path, max_sources=2) as second:
        problem = end_of(second, beyond)["problem"]
        assert (problem["code"], problem["limit"], problem["actual"]) == ("limit_exceeded", 2, 3)
        assert problem["setting"] == "max_sources"
        check_problem(second.get(f"{beyond}/results"), 422, "limit_exceeded")
        assert end_of(second, within)["status"] == "successful"


@pytest.mark.parametrize("is_served", [True, False])
def test_a_mesh_that_is_gone(tmp_path: Path, is_served: bool) -> None:
    """Deleted while a service ran on the store, or from the disk while none did."""
    with held(tmp_path) as (first, mesh):
        job = submit(first, f"{mesh}/distances", {"sources": [VERTEX]})
        if is_served:
            assert first.delete(mesh).status_code == 204
    if not is_served:
        (tmp_path / "meshes" / mesh.rpartition("/")[2]).rename(tmp_path / "elsewhere")

    with serving(tmp_path) as second:
        document = end_of(second, job)
        assert (document["status"], document["problem"]["code"]) == ("failed", "mesh_not_found")
        check_problem(second.get(f"{job}/results"), 404, "mesh_not_found")
        upload_sample(second, "terrain", 200)
        again = submit(second, f"{mesh}/distances", {"sources": [VERTEX]})
        assert end_of(second, again)["status"] == "successful"

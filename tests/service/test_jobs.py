"""Queries that are answered whether their client waits or not."""

import errno
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.jobs import Job, read_jobs
from app.jobs.repository import JobRepository
from app.state import Database
from tests.support.clocks import Clock
from tests.support.processes import stopped
from tests.support.service import (
    SLOW_FACES,
    Serve,
    ServiceClient,
    check_problem,
    serving,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until

ASYNC = {"Prefer": "respond-async"}


@pytest.fixture(scope="module")
def one(serve: Serve, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    with serve(tmp_path_factory.mktemp("jobs"), queue_size=4, cancel_grace_s=LONG_S) as client:
        client.wait_until_idle()
        yield client


@pytest.fixture(scope="module")
def small(one: ServiceClient) -> str:
    return upload_sample(one, "plane", 200)


@pytest.fixture(scope="module")
def medium(one: ServiceClient) -> str:
    """The id of a mesh on which distances take a few tenths of a second."""
    return upload_sample(one, "sphere", 80_000)


@pytest.fixture(scope="module")
def slow(one: ServiceClient) -> str:
    return upload_sample(one, "sphere", SLOW_FACES)


@pytest.fixture
def held_workers(one: ServiceClient) -> Iterator[None]:
    """Workers that get no further; what they have been given is running all the same."""
    with stopped(one.workers()):
        yield


@pytest.fixture(autouse=True)
def dismiss_what_runs(one: ServiceClient) -> Iterator[None]:
    yield
    for job in one.get("/v1/jobs").json()["jobs"]:
        if job["finished"] is None:
            one.delete(f"/v1/jobs/{job['id']}")
    one.wait_until_idle()


start_distances = count()


def submit(client: TestClient, mesh_id: str, headers: Any = (), **body: Any) -> Any:
    """Submit a query that was not asked before."""
    body = {"sources": [{"vertex": 0, "start_distance": next(start_distances)}]} | body
    headers = {**ASYNC, **dict(headers)}
    return client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=headers)


def job_of(response: Any) -> str:
    assert response.status_code == 202, response.text
    return f"/v1/jobs/{response.json()['id']}"


def wait_for(client: TestClient, job: str, status: str) -> dict[str, Any]:
    wait_until(lambda: client.get(job).json()["status"] == status)
    document: dict[str, Any] = client.get(job).json()
    return document


def test_a_job_from_its_beginning_to_its_end(one: ServiceClient, small: str) -> None:
    body = {"sources": [{"vertex": 5}], "targets": [{"vertex": 9}]}
    response = one.post(f"/v1/meshes/{small}/distances", json=body, headers=ASYNC)

    assert response.headers["preference-applied"] == "respond-async"
    assert response.headers["location"] == job_of(response)
    job = wait_for(one, job_of(response), "successful")
    assert job["progress"] == 1.0
    assert job["created"] <= job["started"] <= job["finished"]
    assert (job["kind"], job["mesh_id"]) == ("distances", small)
    assert "problem" not in job
    answer = one.get(job["links"]["results"])
    assert answer.status_code == 200
    assert answer.json() == one.post(f"/v1/meshes/{small}/distances", json=body).json()


def test_every_query_can_be_a_job(one: ServiceClient, small: str) -> None:
    ends = {"source": {"vertex": 0}, "target": {"vertex": 9}}
    bodies = {
        "distances": {"sources": [{"vertex": 0}]},
        "path": ends,
        "paths": {"source": {"vertex": 0}, "targets": [{"vertex": 9}]},
        "isolines": {"sources": [{"vertex": 0}], "count": 2},
        "matrix": {"sources": [{"vertex": 0}], "targets": [{"vertex": 9}]},
        "nearest": {"source": {"vertex": 0}, "candidates": [{"vertex": 9}]},
        "locate": {"points": [[0.1, 0.1, 0.0]]},
    }
    for kind, body in bodies.items():
        job = job_of(one.post(f"/v1/meshes/{small}/{kind}", json=body, headers=ASYNC))
        assert wait_for(one, job, "successful")["kind"] == kind
        now = one.post(f"/v1/meshes/{small}/{kind}", json=body).json()
        assert one.get(f"{job}/results").json() == now

    job = job_of(one.get(f"/v1/meshes/{small}/path?from=v0&to=v9", headers=ASYNC))
    wait_for(one, job, "successful")
    assert one.get(f"{job}/results").json()["length"] > 0


def test_a_job_answers_in_the_format_that_was_asked_for(one: ServiceClient, small: str) -> None:
    job = job_of(submit(one, small, {"Accept": "application/x-npy"}))
    wait_for(one, job, "successful")

    answer = one.get(f"{job}/results")
    assert answer.headers["content-type"] == "application/x-npy"
    assert answer.headers["geodesic-dtype"] == "<f8"
    again = one.get(f"{job}/results", headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304


def test_a_wrong_query_is_refused_at_once(one: ServiceClient, small: str) -> None:
    check_problem(submit(one, small, sources=[{"vertex": 10**6}]), 422, "invalid_point")
    check_problem(submit(one, "0" * 32), 404, "mesh_not_found")


def test_a_failed_job_answers_with_its_own_problem(one: ServiceClient, small: str) -> None:
    far = {"position": [99, 99, 99], "max_distance": 0.1}
    job = job_of(submit(one, small, sources=[far]))
    document = wait_for(one, job, "failed")

    assert document["problem"]["code"] == "invalid_point"
    problem = check_problem(one.get(f"{job}/results"), 422, "invalid_point")
    assert problem["errors"] == document["problem"]["errors"]


@pytest.mark.usefixtures("held_workers")
def test_an_answer_that_is_not_there_yet(one: ServiceClient, small: str) -> None:
    job = job_of(submit(one, small))

    response = one.get(f"{job}/results")
    check_problem(response, 409, "job_not_finished")
    assert int(response.headers["retry-after"]) > 0


def test_progress_never_falls(one: ServiceClient, medium: str) -> None:
    job = job_of(submit(one, medium))
    seen: list[dict[str, Any]] = []

    def has_finished() -> bool:
        seen.append(one.get(job).json())
        return seen[-1]["finished"] is not None

    wait_until(has_finished)

    shares = [document["progress"] for document in seen]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert seen[-1]["status"] == "successful"


def test_dismissing_stops_running_work(one: ServiceClient, slow: str) -> None:
    workers, cancelled = one.workers(), one.load.cancelled
    with stopped(workers):  # else it may end before another replica, which runs it, knows
        job = job_of(submit(one, slow))
        wait_for(one, job, "running")
        response = one.post(f"{job}/cancel")
        wait_until(lambda: one.load.cancelled == cancelled + 1)
    one.wait_until_idle()

    assert one.workers() == workers, "it was asked to stop, not killed"
    assert (response.status_code, response.json()["status"]) == (200, "dismissed")
    assert one.get(job).json()["status"] == "dismissed"
    check_problem(one.get(f"{job}/results"), 410, "job_dismissed")


def test_cancelling_a_finished_job_leaves_it_its_answer(one: ServiceClient, small: str) -> None:
    """A client that only wanted to stop it comes too late now and then, or asks twice."""
    job = job_of(submit(one, small))
    last = wait_for(one, job, "successful")
    for _ in range(2):
        answer = one.post(f"{job}/cancel")
        assert (answer.status_code, answer.json()) == (200, last)
    assert one.get(f"{job}/results").status_code == 200
    check_problem(one.post("/v1/jobs/none/cancel"), 404, "job_not_found")


def test_cancelling_twice_leaves_the_record(one: ServiceClient, slow: str) -> None:
    with stopped(one.workers()):
        job = job_of(submit(one, slow))
        for _ in range(2):
            assert one.post(f"{job}/cancel").json()["status"] == "dismissed"
        assert one.get(job).json()["status"] == "dismissed"


def test_deleting_a_job_that_runs_stops_and_removes_it(one: ServiceClient, slow: str) -> None:
    cancelled = one.load.cancelled
    with stopped(one.workers()):
        job = job_of(submit(one, slow))
        wait_for(one, job, "running")
        assert one.delete(job).json()["status"] == "dismissed"
        check_problem(one.get(job), 404, "job_not_found")
        wait_until(lambda: one.load.cancelled == cancelled + 1)


def test_deleting_a_finished_job_removes_it(one: ServiceClient, small: str) -> None:
    job = job_of(submit(one, small))
    wait_for(one, job, "successful")

    assert one.delete(job).status_code == 200
    for response in (one.get(job), one.delete(job), one.get(f"{job}/results")):
        check_problem(response, 404, "job_not_found")


@pytest.mark.parametrize("job_id", ["0" * 32, "x", "\u1234", "9" * 999])
def test_jobs_that_are_not_there(one: ServiceClient, job_id: str) -> None:
    for path in (f"/v1/jobs/{job_id}", f"/v1/jobs/{job_id}/results", f"/v1/jobs/{job_id}/events"):
        assert one.get(path).json()["code"] in ("job_not_found", "not_found")


def test_a_key_where_no_job_is_made_is_refused(one: ServiceClient, small: str) -> None:
    key = {"Idempotency-Key": "unused"}
    body = {"sources": [{"vertex": 0}]}
    for refused in (
        one.post(f"/v1/meshes/{small}/distances", json=body, headers=key),
        one.get(f"/v1/meshes/{small}/path?from=0&to=1", headers=key),
        one.post("/v1/meshes?sample=plane", headers=key),
    ):
        problem = check_problem(refused, 400, "idempotency_key_unused")
        assert "Prefer: respond-async" in problem["detail"]


def test_jobs_are_listed_the_newest_first(one: ServiceClient, small: str) -> None:
    ids = [job_of(submit(one, small)).rpartition("/")[2] for _ in range(5)]
    found, cursor = [], None
    while len(found) < 5:
        page = one.get("/v1/jobs", params={"limit": 2} | ({"cursor": cursor} if cursor else {}))
        found += [job["id"] for job in page.json()["jobs"]]
        cursor = page.json()["next_cursor"]

    assert found[:5] == ids[::-1]
    check_problem(one.get("/v1/jobs?cursor=x"), 422, "invalid_request")


def test_one_key_is_one_job(one: ServiceClient, small: str) -> None:
    body = {"sources": [{"vertex": 3}]}
    with ThreadPoolExecutor(4) as pool:
        keyed = {"Idempotency-Key": "k1"}
        jobs = {job_of(r) for r in pool.map(lambda _: submit(one, small, keyed, **body), range(8))}

    (job,) = jobs
    wait_for(one, job, "successful")
    assert job_of(submit(one, small, keyed, **body)) == job
    problem = check_problem(submit(one, small, keyed), 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/header/Idempotency-Key"
    assert job_of(submit(one, small, {"Idempotency-Key": "k2"}, **body)) != job


@pytest.mark.usefixtures("held_workers")
def waiting(seconds: Any) -> dict[str, str]:
    """Return the header of a client that prefers a job to a longer wait."""
    return {"Prefer": f"respond-async, wait={seconds}"}


def test_an_answer_that_is_there_within_the_wait_is_no_job(one: ServiceClient, small: str) -> None:
    link = f"/v1/meshes/{small}/path?from=v17&to=v40"
    before = one.get("/v1/jobs").json()
    answer = one.get(link, headers=waiting(600))
    part = one.get(link, headers=waiting(600) | {"Range": "bytes=0-99"})
    known = one.get(link, headers=waiting(600) | {"If-None-Match": answer.headers["etag"]})
    wrong = one.get(f"{link}00000", headers=waiting(600))

    assert answer.status_code == 200
    assert answer.content == one.get(link).content
    assert (part.status_code, part.content) == (206, answer.content[:100])
    assert known.status_code == 304
    check_problem(wrong, 422, "invalid_point")
    assert one.get("/v1/jobs").json() == before


def test_what_takes_longer_than_the_wait_goes_on_as_a_job(one: ServiceClient, small: str) -> None:
    solves = one.app.state.service.answering.solves
    before = solves["distances"]
    with stopped(one.workers()):
        response = submit(one, small, waiting(1))
        assert response.headers["preference-applied"] == "respond-async"

    job = wait_for(one, job_of(response), "successful")

    assert one.get(job["links"]["results"]).status_code == 200
    assert solves["distances"] == before + 1


def test_a_job_that_began_as_a_wait_is_stopped_like_any_other(
    one: ServiceClient, small: str
) -> None:
    one.wait_until_idle()  # only what a worker has begun counts, and nothing of tests before
    engine = one.app.state.service.engine
    before = engine.load.cancelled
    with stopped(one.workers()):
        job = job_of(submit(one, small, waiting(1)))
        assert one.post(f"{job}/cancel").json()["status"] == "dismissed"
        # While the worker is held: it would otherwise be done before the news reaches the engine.
        wait_until(lambda: engine.load.cancelled == before + 1)


@pytest.mark.usefixtures("held_workers")
def test_a_key_stands_for_the_job_that_has_it_after_a_wait_too(
    one: ServiceClient, small: str
) -> None:
    key, body = {"Idempotency-Key": "waits"}, {"sources": [{"vertex": 1, "start_distance": 0.3}]}
    first, again = (submit(one, small, waiting(wait) | key, **body) for wait in (0, 1))
    assert job_of(first) == job_of(again)


@pytest.mark.usefixtures("held_workers")
@pytest.mark.parametrize("seconds", ["", "x", "-1", "1.5", "9" * 30])
def test_a_wait_that_is_no_number_of_seconds_is_ignored(
    one: ServiceClient, small: str, seconds: str
) -> None:
    assert submit(one, small, waiting(seconds)).status_code == 202


@pytest.mark.usefixtures("held_workers")
def test_the_key_of_a_dismissed_job_can_be_sent_again(one: ServiceClient, small: str) -> None:
    body = {"sources": [{"vertex": 3, "start_distance": 0.7}]}
    job = job_of(submit(one, small, {"Idempotency-Key": "k3"}, **body))
    one.post(f"{job}/cancel")

    assert job_of(submit(one, small, {"Idempotency-Key": "k3"}, **body)) != job


@pytest.mark.usefixtures("held_workers")
def test_a_full_queue_takes_no_jobs(one: ServiceClient, medium: str) -> None:
    jobs = []
    while (response := submit(one, medium)).status_code == 202:
        jobs.append(job_of(response))
        if isinstance(one, ServiceClient):  # the runner takes each from the table soon after
            wait_until(lambda: one.load.busy + one.load.waiting == len(jobs))
    # One runs and four wait; on each host of a cluster, whose replicas learn of it soon after.
    assert len(jobs) == 5 if isinstance(one, ServiceClient) else len(jobs) >= 10
    assert one.get(jobs[-1]).json()["status"] == "accepted"

    check_problem(response, 503, "queue_full")
    assert int(response.headers["retry-after"]) > 0
    # Replicas accept a few jobs too many, until hosts report that they are full.
    waiting = jobs[-1:] if isinstance(one, ServiceClient) else jobs[2:]
    for job in waiting:
        one.delete(job)
    wait_until(lambda: submit(one, medium).status_code == 202)


def events_of(client: TestClient, job: str, **headers: str) -> list[tuple[int, dict[str, Any]]]:
    """Return the ids and documents of all events until the stream ends."""
    found, data = [], None
    with client.stream("GET", f"{job}/events", headers=headers) as response:
        assert response.status_code == 200
        assert response.headers["content-type"].startswith("text/event-stream")
        for line in response.iter_lines():
            if line.startswith("data: "):
                data = json.loads(line[6:])
            elif line.startswith("id: ") and data is not None:
                found.append((int(line[4:]), data))
    return found


def test_events_lead_to_the_end(one: ServiceClient, medium: str) -> None:
    job = job_of(submit(one, medium))
    events = events_of(one, job)

    ids = [number for number, _ in events]
    assert ids == sorted(set(ids))
    assert [document["status"] for _, document in events][-1] == "successful"
    assert events[-1][1] == one.get(job).json()


def test_events_go_on_where_a_client_left(one: ServiceClient, small: str) -> None:
    job = job_of(submit(one, small))
    wait_for(one, job, "successful")
    ((last, document),) = events_of(one, job)

    assert events_of(one, job, **{"Last-Event-ID": str(last)}) == []
    assert events_of(one, job, **{"Last-Event-ID": str(last - 1)}) == [(last, document)]
    assert events_of(one, job, **{"Last-Event-ID": "none of ours"}) == [(last, document)]


def test_a_client_that_waits_shares_the_computation_of_a_job(
    one: ServiceClient, medium: str
) -> None:
    """A client that waits for what a job computes gets the same, and the job goes on without it."""
    body = {"sources": [{"vertex": 77}], "targets": [{"vertex": 5}]}
    link = f"/v1/meshes/{medium}/distances"
    with stopped(one.workers()):
        job = job_of(submit(one, medium, **body))
        wait_for(one, job, "running")
        response = one.post(link, json=body, headers={"X-Timeout-Ms": "100"})
        check_problem(response, 504, "deadline_exceeded")
        assert one.get(job).json()["status"] == "running"
    answer = one.post(link, json=body).json()

    wait_for(one, job, "successful")
    assert one.get(f"{job}/results").json() == answer


def test_a_job_has_a_deadline_of_its_own(tmp_path: Path) -> None:
    with serving(tmp_path, job_deadline_s=0.3) as client:
        client.wait_until_idle()
        mesh_id = upload_sample(client, "plane", 50)
        with stopped(client.workers()):
            job = job_of(submit(client, mesh_id))
            problem = wait_for(client, job, "failed")["problem"]

        assert problem["code"] == "deadline_exceeded"
        assert (problem["limit"], problem["setting"]) == (0.3, "job_deadline_s")


def test_jobs_are_forgotten_after_a_while(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr("app.jobs.retention.monotonic", clock)
    with serving(tmp_path, job_ttl=0.1, results_bytes=300) as client:
        mesh_id = upload_sample(client, "plane", 50)  # 36 distances, in JSON larger than expected
        job = job_of(submit(client, mesh_id))
        assert wait_for(client, job, "failed")["problem"]["code"] == "storage_full"
        check_problem(submit(client, upload_sample(client, "plane", 200)), 507, "storage_full")
        clock.now += 1
        wait_until(lambda: client.get(job).status_code == 404)


def test_the_end_of_a_job_is_recorded_once_the_disk_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    update, is_read_only = JobRepository.update, True

    async def update_later(repository: JobRepository, job: Job, version: int) -> bool:
        if is_read_only:
            refused.append(job.status)
            raise OSError(errno.EROFS, "attempt to write a readonly database")
        return await update(repository, job, version)

    refused: list[str] = []
    monkeypatch.setattr(JobRepository, "update", update_later)
    with serving(tmp_path) as client:
        job = job_of(submit(client, upload_sample(client, "plane", 50)))
        wait_until(lambda: refused)
        (stored,) = read_jobs(Database(tmp_path / "jobs.sqlite3"))
        assert stored.status == "accepted"
        is_read_only = False
        wait_for(client, job, "successful")
        assert client.get(f"{job}/results").status_code == 200


def test_answers_of_jobs_outlive_those_that_are_only_kept(tmp_path: Path) -> None:
    with serving(tmp_path, results_bytes=20_000, results_memory_bytes=1) as client:
        mesh_id = upload_sample(client, "plane", 200)
        job = job_of(submit(client, mesh_id))
        wait_for(client, job, "successful")
        answer = client.get(f"{job}/results").content
        for vertex in range(20):
            client.post(f"/v1/meshes/{mesh_id}/distances", json={"sources": [{"vertex": vertex}]})
        assert client.delete(f"/v1/meshes/{mesh_id}").status_code == 204

        assert client.get(f"{job}/results").content == answer
        (found,) = (tmp_path / "results").rglob("*.body")
        found.write_bytes(b"other")
        check_problem(client.get(f"{job}/results"), 500, "mesh_damaged")

"""Two services that share a store and a database: each answers for both."""

import os
import subprocess
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.support.postgres import SECRET
from tests.support.postgres import Server as Postgres
from tests.support.processes import COMMAND_LINE, Server, stopped
from tests.support.service import SLOW_FACES, check_problem, upload_sample
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(3)

ASYNC = {"Prefer": "respond-async"}

Pair = tuple[Server, Server]


def pair_of(stack: ExitStack, postgres: Postgres, store: Path, **settings: str) -> Pair:
    shared = {"GEODESIC_STATE": postgres.new_database()} | settings
    # One after the other: the second one finds the first at work.
    first, second = (stack.enter_context(closing(Server(store, **shared))) for _ in range(2))
    return first, second


@pytest.fixture(scope="module")
def pair(postgres: Postgres, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    with ExitStack() as stack:
        yield pair_of(stack, postgres, tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="module")
def small(pair: Pair) -> str:
    return upload_sample(pair[0].client, "plane", 200)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def slow(pair: Pair) -> str:
    return upload_sample(pair[0].client, "sphere", SLOW_FACES)  # type: ignore[arg-type]


def submit(server: Server, mesh_id: str, start: float = 0.0, **headers: str) -> Any:
    body = {"sources": [{"vertex": 0, "start_distance": start}]}
    return server.client.post(f"/v1/meshes/{mesh_id}/distances", json=body, headers=ASYNC | headers)


def job_of(response: Any) -> str:
    assert response.status_code == 202, response.text
    return str(response.headers["location"])


def status_of(server: Server, job: str) -> str:
    return str(server.client.get(job).json()["status"])


def test_a_job_of_one_is_read_watched_and_removed_by_the_other(pair: Pair, small: str) -> None:
    first, second = pair
    job = job_of(submit(first, small, 1.0))
    assert second.client.get(job).status_code == 200
    states = second.client.get(f"{job}/events").text
    assert '"status":"successful"' in states.replace(" ", "")
    assert status_of(second, job) == "successful"
    answers = [server.client.get(f"{job}/results") for server in pair]
    assert [answer.status_code for answer in answers] == [200, 200]
    assert answers[0].content == answers[1].content
    assert second.client.delete(job).status_code == 200
    for server in pair:
        check_problem(server.client.get(job), 404, "job_not_found")


def test_a_job_of_one_is_stopped_by_the_other(pair: Pair, slow: str) -> None:
    first, second = pair
    with stopped(first.both_workers()):
        job = job_of(submit(first, slow, 2.0))
        wait_until(lambda: status_of(first, job) == "running")
        assert second.client.post(f"{job}/cancel").json()["status"] == "dismissed"
        wait_until(lambda: status_of(first, job) == "dismissed")
        check_problem(first.client.get(f"{job}/results"), 410, "job_dismissed")
    wait_until(lambda: first.metric('geodesic_workers{state="busy"}') == 0)


def test_progress_of_one_is_seen_by_the_other(pair: Pair, slow: str) -> None:
    first, second = pair
    job = job_of(submit(first, slow, 3.0))
    wait_until(lambda: status_of(second, job) in ("running", "successful"))
    wait_until(lambda: status_of(second, job) == "successful")
    assert second.client.get(job).json()["progress"] == 1.0


def test_one_key_is_one_job_wherever_it_is_sent(pair: Pair, small: str) -> None:
    with ThreadPoolExecutor(8) as pool:
        asked = [
            pool.submit(submit, pair[n % 2], small, 4.0, **{"Idempotency-Key": "a key"})
            for n in range(8)
        ]
    jobs = {job_of(each.result()) for each in asked}
    assert len(jobs) == 1
    wrong = submit(pair[1], small, 5.0, **{"Idempotency-Key": "a key"})
    check_problem(wrong, 422, "invalid_request")


def test_lists_have_the_jobs_of_both(pair: Pair, small: str) -> None:
    jobs = [job_of(submit(server, small, 6.0 + n)) for n, server in enumerate(pair)]
    for server in pair:
        found = [each["links"]["self"] for each in server.client.get("/v1/jobs").json()["jobs"]]
        assert found[:2] == jobs[::-1]


@pytest.mark.full
def test_the_quota_of_jobs_holds_for_both(postgres: Postgres, tmp_path: Path) -> None:
    with ExitStack() as stack:
        pair = pair_of(stack, postgres, tmp_path, GEODESIC_QUOTA_JOBS="5")
        mesh_id = upload_sample(pair[0].client, "plane", 50)  # type: ignore[arg-type]
        with ThreadPoolExecutor(12) as pool:
            asked = list(pool.map(lambda n: submit(pair[n % 2], mesh_id, 1.0 + n), range(12)))
        assert sorted(each.status_code for each in asked) == [202] * 5 + [429] * 7
        refused = next(each for each in asked if each.status_code == 429)
        check_problem(refused, 429, "quota_exceeded")
        assert pair[0].client.delete(_first_finished(pair[0])).status_code == 200
        job_of(submit(pair[1], mesh_id, 99.0))


def _first_finished(server: Server) -> str:
    jobs: list[Any] = []
    while not jobs:
        listed = server.client.get("/v1/jobs").json()["jobs"]
        jobs = [job for job in listed if job["status"] == "successful"]
    return str(jobs[0]["links"]["self"])


@pytest.mark.parametrize("end", ["kill", "terminate"])
def test_jobs_of_a_replica_that_ends_are_run_by_the_other(
    postgres: Postgres, tmp_path: Path, end: str
) -> None:
    with ExitStack() as stack:
        first, second = pair_of(stack, postgres, tmp_path, GEODESIC_DRAIN_S="1")
        mesh_id = upload_sample(first.client, "plane", 50)  # type: ignore[arg-type]
        with stopped(first.both_workers()):
            jobs = [job_of(submit(first, mesh_id, 1.0 + n)) for n in range(3)]
            if end == "kill":
                first.kill()
            else:
                first.process.terminate()
                first.process.wait()
        for job in jobs:
            wait_until(lambda job=job: status_of(second, job) == "successful")
            assert second.client.get(f"{job}/results").status_code == 200


def test_a_replica_that_was_held_up_gives_its_jobs_away(pair: Pair, small: str) -> None:
    """It is taken for dead, and finds out once it goes on."""
    first, second = pair
    with stopped(first.both_workers()):
        job = job_of(submit(first, small, 7.0))
        with stopped([first.process.pid]):
            wait_until(lambda: status_of(second, job) == "successful")
        wait_until(lambda: status_of(first, job) == "successful")
        wait_until(lambda: first.metric('geodesic_workers{state="busy"}') == 0)
    answers = {server.client.get(f"{job}/results").content for server in pair}
    assert len(answers) == 1


@pytest.mark.full
def test_a_database_that_restarts_under_load(postgres: Postgres, tmp_path: Path) -> None:
    """Each request is answered rightly or with 503, and nothing that was accepted is lost."""
    accepted: dict[str, str] = {}
    refused: list[Any] = []
    is_over = threading.Event()

    def load(client: httpx2.Client, mesh_id: str, number: int) -> None:
        for n in range(100_000):
            if is_over.is_set():
                return
            key = f"{number}-{n}"
            body = {"sources": [{"vertex": 0, "start_distance": number * 1000 + n}]}
            link = f"/v1/meshes/{mesh_id}/distances"
            headers = ASYNC | {"Idempotency-Key": key}
            response = client.post(link, json=body, headers=headers)
            if response.status_code == 202:
                accepted[key] = response.headers["location"]
            else:
                refused.append(response)
            direct = client.post(link, json=body)
            assert direct.status_code == 200, direct.text

    with ExitStack() as stack:
        pair = pair_of(stack, postgres, tmp_path, GEODESIC_QUEUE_SIZE="1000")
        mesh_id = upload_sample(pair[0].client, "plane", 50)  # type: ignore[arg-type]
        with ThreadPoolExecutor(4) as pool:
            loads = [
                pool.submit(load, pair[number % 2].client, mesh_id, number) for number in range(4)
            ]
            wait_until(lambda: len(accepted) > 20)
            postgres.stop()
            wait_until(lambda: len(refused) > 4)
            before = len(accepted)
            postgres.start()
            wait_until(lambda: len(accepted) > before + 20)
            is_over.set()
        for each in loads:
            each.result()
        for response in refused:
            problem = check_problem(response, 503, "state_unavailable")
            assert response.headers["retry-after"] == "1", problem
        for job in accepted.values():
            wait_until(partial(_is_successful, pair, job))
        wait_until(lambda: all(not _has_unfinished(server) for server in pair))


def _is_successful(pair: Pair, job: str) -> bool:
    return all(status_of(server, job) == "successful" for server in pair)


def _has_unfinished(server: Server) -> bool:
    cursor, unfinished = "", False
    while True:
        page = server.client.get("/v1/jobs", params={"limit": 100, "cursor": cursor}).json()
        unfinished |= any(job["finished"] is None for job in page["jobs"])
        cursor = page["next_cursor"]
        if cursor is None:
            return unfinished


def refused_start(store: Path, *options: str, **settings: str) -> str:
    ran = subprocess.run(  # noqa: S603 - this Python
        [*COMMAND_LINE, "serve", "--port", "0", *options],
        env=os.environ | {"GEODESIC_STORE": str(store)} | settings,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1, ran.stderr
    assert "Traceback" not in ran.stderr
    assert SECRET not in ran.stderr
    return " ".join(ran.stderr.split())


def test_starts_that_are_refused(postgres: Postgres, tmp_path: Path) -> None:
    wrong = postgres.url("postgres", "wrong")
    assert "password authentication failed" in refused_start(tmp_path, "--state", wrong)
    assert "password authentication failed" in refused_start(tmp_path, GEODESIC_STATE=wrong)
    with closing(Server(tmp_path)):
        assert "GEODESIC_STATE" in refused_start(tmp_path), "it says what two services need"
        assert "in use" in refused_start(tmp_path, "--state", postgres.new_database())
    with closing(Server(tmp_path, GEODESIC_STATE=postgres.new_database())):
        assert "in use" in refused_start(tmp_path)


def test_a_mesh_of_one_is_known_to_the_other(pair: Pair) -> None:
    first, second = pair
    mesh_id = upload_sample(first.client, "plane", 300)  # type: ignore[arg-type]
    link = f"/v1/meshes/{mesh_id}"
    assert upload_sample(second.client, "plane", 300) == mesh_id  # type: ignore[arg-type]
    answers = {server.client.get(f"{link}/path?from=v0&to=v9").text for server in pair}
    assert len(answers) == 1
    assert second.client.delete(link).status_code == 204
    for server in pair:
        check_problem(server.client.get(link), 404, "mesh_not_found")
    assert upload_sample(first.client, "plane", 300) == mesh_id  # type: ignore[arg-type]


def test_a_long_answer_of_one_is_found_by_the_other(pair: Pair, slow: str) -> None:
    body = {"sources": [{"vertex": 3, "start_distance": 11.0}]}
    link = f"/v1/meshes/{slow}/distances"
    first, second = (server.client.post(link, json=body) for server in pair)
    assert first.headers["server-timing"] != "kept"
    assert (second.content, second.headers["server-timing"]) == (first.content, "kept")


def test_limits_of_a_caller_hold_for_both(postgres: Postgres, tmp_path: Path) -> None:
    with ExitStack() as stack:
        limits = {"GEODESIC_RATE_LIMIT": "30", "GEODESIC_QUOTA_UPLOADS": "1"}
        first, second = pair_of(stack, postgres, tmp_path, **limits)
        sample = {"sample": "plane", "faces": 50}
        with ThreadPoolExecutor(1) as pool:
            with stopped(first.both_workers()):
                waiting = pool.submit(_upload_at_last, first, sample)
                wait_until(lambda: _is_over_quota(second, sample))
            assert waiting.result() in (200, 201)
        wait_until(lambda: second.client.get("/v1/jobs").status_code == 429)
        wait_until(lambda: first.client.get("/v1/jobs").status_code == 429)


def _upload_at_last(server: Server, sample: dict[str, Any]) -> int:
    """Upload once the rate and the uploads of the other replica allow it."""
    answers = [429]

    def is_let_in() -> bool:
        answers.append(server.client.post("/v1/meshes", params=sample).status_code)
        return answers[-1] != 429

    wait_until(is_let_in)
    return answers[-1]


def _is_over_quota(server: Server, sample: dict[str, Any]) -> bool:
    refused = server.client.post("/v1/meshes", params=sample)
    return bool(refused.json().get("code") == "quota_exceeded")

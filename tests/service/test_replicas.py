"""Two services of a cluster that share a store and a database: each answers for both."""

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.util import find_spec
from typing import Any

import httpx2
import pytest

from tests.support.cluster import ProcessCluster, running_cluster
from tests.support.postgres import Server as Postgres
from tests.support.processes import Server, stopped
from tests.support.service import SLOW_FACES, check_problem, upload_sample
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.file_slice(3),
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ray") is None, reason="needs the extra cluster"),
]

ASYNC = {"Prefer": "respond-async"}
LIMITS = {"GEODESIC_QUOTA_UPLOADS": "1", "GEODESIC_QUEUE_SIZE": "1000"}

Pair = tuple[Server, Server]


@pytest.fixture(scope="module")
def cluster(
    postgres: Postgres, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[ProcessCluster]:
    state = {"GEODESIC_STATE": postgres.new_database()}
    with running_cluster(tmp_path_factory.mktemp("store"), **state, **LIMITS) as cluster:
        cluster.add_node()
        yield cluster


@pytest.fixture(scope="module")
def pair(cluster: ProcessCluster) -> Pair:
    return cluster.serve(), cluster.serve()


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
    states = second.client.get(f"{job}/events").text
    assert '"status":"successful"' in states.replace(" ", "")
    answers = [server.client.get(f"{job}/results") for server in pair]
    assert [answer.status_code for answer in answers] == [200, 200]
    assert answers[0].content == answers[1].content
    assert second.client.delete(job).status_code == 200
    for server in pair:
        check_problem(server.client.get(job), 404, "job_not_found")


def test_a_job_of_one_is_stopped_by_the_other(
    cluster: ProcessCluster, pair: Pair, slow: str
) -> None:
    first, second = pair
    with stopped(cluster.nodes[0].workers()):
        job = job_of(submit(first, slow, 2.0))
        wait_until(lambda: status_of(first, job) == "running")
        assert second.client.post(f"{job}/cancel").json()["status"] == "dismissed"
        check_problem(first.client.get(f"{job}/results"), 410, "job_dismissed")
    wait_until(lambda: first.metric('geodesic_workers{state="busy"}') == 0)


def test_a_question_that_takes_long_becomes_a_job(
    cluster: ProcessCluster, pair: Pair, slow: str
) -> None:
    first, second = pair
    with stopped(cluster.nodes[0].workers()):
        job = job_of(submit(first, slow, 3.0, Prefer="respond-async, wait=0.2"))
    wait_until(lambda: status_of(second, job) == "successful")


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


def test_a_mesh_of_one_is_known_to_the_other(pair: Pair) -> None:
    first, second = pair
    mesh_id = upload_sample(first.client, "plane", 300)  # type: ignore[arg-type]
    link = f"/v1/meshes/{mesh_id}"
    answers = {server.client.get(f"{link}/path?from=v0&to=v9").text for server in pair}
    assert len(answers) == 1
    assert second.client.delete(link).status_code == 204
    for server in pair:
        check_problem(server.client.get(link), 404, "mesh_not_found")


@pytest.mark.full
def test_a_database_that_restarts_under_load(postgres: Postgres, pair: Pair, small: str) -> None:
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

    with ThreadPoolExecutor(4) as pool:
        loads = [pool.submit(load, pair[number % 2].client, small, number) for number in range(4)]
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


def test_jobs_go_on_without_the_process_that_runs_them_and_without_services(
    cluster: ProcessCluster, pair: Pair, small: str
) -> None:
    """It is started anew, and runs again what had not ended; no service need be there."""
    first, second = pair
    with stopped(cluster.nodes[0].workers()):
        jobs = [job_of(submit(first, small, 10.0 + n)) for n in range(3)]
        wait_until(lambda: "running" in {status_of(second, job) for job in jobs})
        cluster.named("ray::JobsProcess").kill()
        first.kill()
    for job in jobs:
        wait_until(lambda job=job: status_of(second, job) == "successful")
        assert second.client.get(f"{job}/results").status_code == 200

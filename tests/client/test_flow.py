"""Conversations of the client, without a service: retries, jobs, errors, and stopping."""

import asyncio
import json
import pickle
from inspect import signature

import httpx2
import numpy as np
import pytest
from geodesic_client import (
    AsyncClient,
    Client,
    Distances,
    ErrorBound,
    GeodesicClientError,
    Job,
    ProblemError,
    StoredMatrix,
    UnreachableError,
    connection,
)
from geodesic_client.flow import JOB_AFTER_S

JOB = {"id": "7", "kind": "nearest", "mesh_id": "m", "status": "running", "progress": 0.5}
ANSWER = {"nearest": [{"candidate": 1, "distance": 2.5}]}
SETTINGS = connection.settings("http://service", None)


def problem(status: int, code: str, **headers: str) -> httpx2.Response:
    document = {"code": code, "detail": "no", "hint": "wait"}
    return httpx2.Response(status, json=document, headers=headers)


class Service:
    """A service that answers with some replies, one after the other, and keeps the requests."""

    def __init__(self, *replies: httpx2.Response | Exception) -> None:
        self._replies = iter(replies)
        self.requests: list[httpx2.Request] = []

    def __call__(self, request: httpx2.Request) -> httpx2.Response:
        request.read()
        self.requests.append(request)
        reply = next(self._replies)
        if isinstance(reply, Exception):
            raise reply
        return reply

    async def answer(self, request: httpx2.Request) -> httpx2.Response:
        await request.aread()
        self.requests.append(request)
        reply = next(self._replies)
        if isinstance(reply, Exception):
            raise reply
        return reply

    @property
    def sent(self) -> list[str]:
        return [f"{each.method} {each.url.path}" for each in self.requests]

    def client(self) -> Client:
        transport = httpx2.MockTransport(self)
        return Client(http=httpx2.Client(transport=transport, **SETTINGS))

    def async_client(self) -> AsyncClient:
        transport = httpx2.MockTransport(self.answer)
        return AsyncClient(http=httpx2.AsyncClient(transport=transport, **SETTINGS))


@pytest.fixture(autouse=True)
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pauses that were made, without making them."""
    made: list[float] = []

    async def pause(seconds: float) -> None:
        made.append(seconds)

    monkeypatch.setattr("geodesic_client.client.time.sleep", made.append)
    monkeypatch.setattr("geodesic_client.async_client.anyio.sleep", pause)
    return made


def test_what_takes_little_is_one_request() -> None:
    service = Service(httpx2.Response(200, json=ANSWER))
    shares: list[float] = []
    (found,) = service.client().nearest("m", 0, [1, 2], progress=shares.append)
    assert shares == [1.0]
    assert (found.candidate, found.distance) == (1, 2.5)
    (request,) = service.requests
    assert request.headers["prefer"] == f"respond-async, wait={JOB_AFTER_S}"
    assert json.loads(request.content)["candidates"] == [1, 2]


def long_replies() -> list[httpx2.Response | Exception]:
    half = httpx2.Response(202, json=JOB)
    done = httpx2.Response(200, json=JOB | {"status": "successful", "progress": 1.0})
    return [half, done, httpx2.Response(200, json=ANSWER), done]


def removed() -> httpx2.Response:
    """The reply to the request that removes a job under way."""
    return httpx2.Response(200, json=JOB | {"status": "dismissed"})


def check_long(service: Service, progress: list[float], pauses: list[float]) -> None:
    assert service.sent == [
        "POST /v1/meshes/m/nearest",
        "GET /v1/jobs/7",
        "GET /v1/jobs/7/results",
        "DELETE /v1/jobs/7",
    ]
    assert service.requests[0].headers["idempotency-key"]
    assert progress == [0.5, 1.0]
    assert len(pauses) == 1


def test_what_takes_long_runs_as_a_job(pauses: list[float]) -> None:
    service, progress = Service(*long_replies()), []  # type: ignore[var-annotated]
    assert service.client().nearest("m", 0, [1], progress=progress.append)[0].candidate == 1
    check_long(service, progress, pauses)


def test_coroutines_have_the_same_conversation(pauses: list[float]) -> None:
    service, progress = Service(*long_replies()), []  # type: ignore[var-annotated]
    ask = service.async_client().nearest("m", 0, [1], progress=progress.append)
    assert asyncio.run(ask)[0].candidate == 1
    check_long(service, progress, pauses)


@pytest.mark.parametrize(
    "reply",
    [
        problem(503, "draining", **{"Retry-After": "1"}),
        problem(404, "job_not_found"),
        httpx2.ConnectError("refused"),
    ],
)
def test_an_answer_does_not_wait_for_the_removal_of_its_job(
    reply: httpx2.Response | Exception, pauses: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tenacity.nap.time.sleep", pauses.append)
    service = Service(*long_replies()[:3], reply)
    assert service.client().nearest("m", 0, [1])[0].candidate == 1
    assert service.sent.count("DELETE /v1/jobs/7") == 1
    assert len(pauses) == 1, "before it looked at the job"


def test_a_job_that_fails_is_removed() -> None:
    failed = JOB | {"status": "failed"}
    service = Service(
        httpx2.Response(202, json=JOB),
        httpx2.Response(200, json=failed),
        problem(504, "deadline_exceeded"),
        httpx2.Response(200, json=failed),
    )
    with pytest.raises(ProblemError, match="deadline_exceeded"):
        service.client().store_matrix("m", [0], [1])
    assert service.sent[2:] == ["GET /v1/jobs/7/results", "DELETE /v1/jobs/7"]


def test_a_callback_that_raises_stops_and_removes_the_job() -> None:
    def stop(_share: float) -> None:
        raise KeyboardInterrupt

    service = Service(*long_replies()[:1], removed())
    with pytest.raises(KeyboardInterrupt):
        service.client().nearest("m", 0, [1], progress=stop)
    assert service.sent[1:] == ["DELETE /v1/jobs/7"]


@pytest.mark.parametrize("kind", ["client", "async_client"])
def test_a_call_that_is_stopped_waits_for_seconds_only(kind: str) -> None:
    """A service that hangs may be the reason why it is stopped."""

    def stop(_share: float) -> None:
        raise KeyboardInterrupt

    service = Service(*long_replies()[:1], httpx2.ReadTimeout("late"))
    with pytest.raises(KeyboardInterrupt):
        asyncio.run(getattr(service, kind)().nearest("m", 0, [1], progress=stop))
    query, removal = (max(each.extensions["timeout"].values()) for each in service.requests)
    assert (query, removal) == (connection.TIMEOUT_S, connection.OPTIONAL_TIMEOUT_S)


def test_a_cancelled_task_stops_and_removes_its_job(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Service(*long_replies()[:1], removed())

    async def cancel_while_it_waits() -> None:
        waiting = asyncio.Event()

        async def wait(_seconds: float) -> None:
            waiting.set()
            await asyncio.Event().wait()

        monkeypatch.setattr("geodesic_client.async_client.anyio.sleep", wait)
        task = asyncio.ensure_future(service.async_client().nearest("m", 0, [1]))
        await waiting.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cancel_while_it_waits())
    assert service.sent[1:] == ["DELETE /v1/jobs/7"]


@pytest.mark.parametrize(("status", "code"), [(429, "rate_limited"), (503, "queue_full")])
def test_a_busy_service_is_asked_again_when_it_says(
    status: int, code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    monkeypatch.setattr("tenacity.nap.time.sleep", waits.append)
    busy = problem(status, code, **{"Retry-After": "7"})
    service = Service(busy, busy, httpx2.Response(200, json={"version": "1"}))
    assert service.client().about() == {"version": "1"}
    assert waits == [7.0, 7.0]


def test_a_call_does_not_wait_for_hours(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a proxy with limits of its own may ask it to."""
    waits: list[float] = []
    monkeypatch.setattr("tenacity.nap.time.sleep", waits.append)
    full = problem(429, "quota_exceeded", **{"Retry-After": "86000"})
    service = Service(full)
    with pytest.raises(ProblemError, match="quota_exceeded") as caught:
        service.client().nearest("m", 0, [1])
    assert caught.value.retry_after == 86000.0
    assert (len(service.requests), waits) == (1, [])


@pytest.mark.parametrize(
    "broken", [httpx2.ReadError("reset"), httpx2.RemoteProtocolError("disconnected")]
)
def test_what_a_service_may_have_removed_is_not_removed_again(
    broken: httpx2.TransportError, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would not be found."""
    monkeypatch.setattr("tenacity.nap.time.sleep", lambda _: None)
    done = httpx2.Response(200, json=JOB)
    for name in ("delete_mesh", "delete_job"):
        once = Service(broken, done)
        with pytest.raises(UnreachableError, match="no answer"):
            getattr(once.client(), name)("7")
        unsent = Service(httpx2.ConnectError("refused"), problem(503, "draining"), done)
        getattr(unsent.client(), name)("7")
        assert (len(once.requests), len(unsent.requests)) == (1, 3)
    query = Service(broken, httpx2.Response(200, json=ANSWER))
    assert query.client().nearest("m", 0, [1])[0].candidate == 1


def test_a_broken_connection_is_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tenacity.nap.time.sleep", lambda _: None)
    broken = httpx2.ConnectError("refused")
    service = Service(broken, httpx2.Response(200, json={}))
    assert service.client().about() == {}
    late = Service(httpx2.ReadTimeout("late"))
    with pytest.raises(UnreachableError, match="no answer from http://service/v1: late"):
        late.client().about()
    assert len(late.requests) == 1


def test_a_problem_is_an_error_with_all_that_it_says() -> None:
    service = Service(problem(404, "mesh_not_found"))
    with pytest.raises(ProblemError, match=r"^mesh_not_found: no \(wait\)$") as caught:
        service.client().mesh("m")
    error = caught.value
    assert (error.status, error.code) == (404, "mesh_not_found")
    assert (error.detail, error.hint) == ("no", "wait")


@pytest.mark.parametrize("text", ["<html>", "", "null", '"bad gateway"'])
def test_an_error_that_is_no_document_is_a_problem(text: str) -> None:
    with pytest.raises(ProblemError, match="status 502") as caught:
        Service(httpx2.Response(502, text=text)).client().about()
    assert caught.value.code == "unknown"


def test_a_redirection_is_a_problem_that_names_the_address() -> None:
    moved = httpx2.Response(301, headers={"Location": "https://service/v1"})
    with pytest.raises(ProblemError, match="another address: https://service/v1"):
        Service(moved).client().about()


@pytest.mark.parametrize(
    "error",
    [
        ProblemError(429, {"code": "rate_limited", "detail": "no", "hint": "wait"}, 7.0),
        UnreachableError("no answer", may_retry=True),
    ],
)
def test_errors_pass_between_processes(error: GeodesicClientError) -> None:
    copy = pickle.loads(pickle.dumps(error))  # noqa: S301 - of this test
    assert (type(copy), str(copy), vars(copy)) == (type(error), str(error), vars(error))


def test_lists_are_read_to_their_end() -> None:
    jobs = [JOB | {"id": str(i)} for i in range(3)]
    service = Service(
        httpx2.Response(200, json={"jobs": jobs[:2], "next_cursor": "2"}),
        httpx2.Response(200, json={"jobs": jobs[2:], "next_cursor": None}),
    )
    assert [job.id for job in service.client().jobs()] == ["0", "1", "2"]
    assert service.requests[1].url.params["cursor"] == "2"


def test_rows_of_a_matrix_can_be_changed() -> None:
    table = np.arange(6, dtype=np.float32).reshape(3, 2)
    bound = ErrorBound("relative", 0.0, "guaranteed")
    size = 128 + table.nbytes
    matrix = StoredMatrix("7", "dense", table.shape, table.dtype, "exact", bound, size, "e")
    service = Service(httpx2.Response(206, content=table[1:].tobytes()))
    rows = service.client().matrix_rows(matrix, 1, 3)
    rows += 1
    np.testing.assert_array_equal(rows, table[1:] + 1)
    assert service.requests[0].headers["range"] == "bytes=136-151"


@pytest.mark.parametrize("name", ["distances", "upload", "path"])
def test_methods_are_documented(name: str) -> None:
    assert getattr(Client, name).__doc__
    assert getattr(Service().client(), name).__name__ == name


def test_help_tells_what_a_method_returns():
    assert signature(Client.job).return_annotation is Job
    assert signature(Client.distances).return_annotation is Distances
    assert str(signature(Client.job)).startswith("(self, /, job_id: str) -> ")  # for `help`
    assert str(signature(AsyncClient("http://127.0.0.1").job)).startswith("(job_id: str) -> ")
    with pytest.raises(TypeError, match="job is called on a client"):
        Client.job("id")

"""Conversations with the service, without a connection: a generator yields what is to be done.

`Client` and `AsyncClient` do it, each in its way, and send back the responses. So each question is
written once for both.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar
from uuid import uuid4

import httpx2

from geodesic_client.answers import Job, to_job
from geodesic_client.errors import GeodesicClientError

T = TypeVar("T")

JOB_AFTER_S = 1
"""Seconds of work after which a query goes on as a job"""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.05, 2.0
"""Seconds between two looks at a job, which grow from the first to the longest"""

Progress = Callable[[float], object]
"""Is called with the share of the work that is done, 0 to 1; what it raises stops the work."""


@dataclass(frozen=True)
class Request:
    """A request that is to be sent."""

    method: str
    path: str
    params: Mapping[str, str | int] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    content: bytes | Callable[[], Iterator[bytes]] = b""
    """The body, or what begins to read it: it is read again for each attempt"""
    is_optional: bool = False
    """Whether it may fail without harm; it is then sent only once, and not waited for long"""


@dataclass(frozen=True)
class Pause:
    """A time to wait."""

    seconds: float


Flow = Generator[Request | Pause, Any, T]


@dataclass(frozen=True)
class Query(Generic[T]):
    """A request for work, and how its answer is decoded."""

    request: Request
    decode: Callable[[httpx2.Response], T]


def ignore_progress(_share: float) -> None:
    """Do nothing."""


def send(request: Request) -> Flow[httpx2.Response]:
    """Send a request, and return its response, which is no problem."""
    response: httpx2.Response = yield request
    return response


def answer(query: Query[T], progress: Progress) -> Flow[T]:
    """Return the answer to a query, which becomes a job of the service if it takes long.

    The job is removed in the end. Otherwise it would take up space and quota for a day.
    """
    prefer = f"respond-async, wait={JOB_AFTER_S}"
    headers = {**query.request.headers, "Prefer": prefer, "Idempotency-Key": uuid4().hex}
    response = yield from send(replace(query.request, headers=headers))
    if response.status_code == httpx2.codes.ACCEPTED:
        job = to_job(response.json())
        response = yield from result_of(job, progress)
        yield from remove(job)
    progress(1.0)
    return query.decode(response)


def result_of(
    job: Job, progress: Progress, headers: Mapping[str, str] | None = None
) -> Flow[httpx2.Response]:
    """Wait for a job, and return its result. If anything prevents that, remove the job."""
    try:
        yield from end_of(job, progress)
        return (yield from send(Request("GET", f"{_link(job)}/results", headers=headers or {})))
    except GeneratorExit:
        raise
    except BaseException:
        yield from remove(job)
        raise


def end_of(job: Job, progress: Progress) -> Flow[None]:
    """Wait for a job."""
    pause = FIRST_PAUSE_S
    while not job.is_finished:
        progress(job.progress)
        yield Pause(pause)
        pause = min(1.5 * pause, LONGEST_PAUSE_S)
        job = to_job((yield from send(Request("GET", _link(job)))).json())


def remove(job: Job) -> Flow[None]:
    """Remove a job, if the service can do so now; that stops it as well."""
    with suppress(GeodesicClientError):
        yield from send(Request("DELETE", _link(job), is_optional=True))


def _link(job: Job) -> str:
    return f"/v1/jobs/{job.id}"

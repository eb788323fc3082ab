"""The traffic of a soak: users of several kinds, who check every answer.

Runs in a process of its own, ``python -m benchmarks.soak.traffic``, since Locust puts gevent's
versions into Python's modules for sockets and threads. Each request becomes a line of the record.
"""

import argparse
import json
import pickle
import socket
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from random import Random
from typing import Any, ClassVar
from urllib.parse import urlsplit

import gevent
import locust
from gevent.pool import Pool
from locust.contrib.fasthttp import FastResponse
from locust.env import Environment

from benchmarks.soak.plan import (
    HOARD,
    MAX_CONCURRENT,
    SECRETS,
    Plan,
    Request,
    Upload,
    digest_of,
)

DICE = Random(21)  # noqa: S311 - no secret
LIMITS = {(429, "rate_limited"), (503, "queue_full")}
"""Refusals that anybody may meet, since others take what there is"""
ASYNC = {"Prefer": "respond-async"}
LONG_S = 300.0
"""Longer than any answer takes"""


class User(locust.FastHttpUser):
    """A user with a key, who sends requests of the plan and records what comes back."""

    abstract = True
    network_timeout = connection_timeout = LONG_S
    wait_time = locust.between(0.0, 0.1)
    callers: ClassVar[Sequence[str]] = ("alice", "bob")
    refusals: ClassVar[Collection[tuple[int, str]]] = LIMITS
    """Statuses and codes that are right answers to anything"""
    plan: ClassVar[Plan]
    numbers: ClassVar = count()

    def __init_subclass__(cls) -> None:
        """Give each kind of user its own numbers."""
        cls.numbers = count()

    def __init__(self, environment: Environment) -> None:
        super().__init__(environment)
        self.caller = self.callers[next(self.numbers) % len(self.callers)]

    def send(self, request: Request, headers: Mapping[str, str] = {}) -> FastResponse:
        """Send a request, check its answer, and return that."""
        return self.exchange(
            request.operation,
            request.method,
            request.path,
            request.expected.status,
            request=request,
            data=request.body,
            headers={**request.headers, **headers},
        )

    def exchange(
        self,
        operation: str,
        method: str,
        path: str,
        *statuses: int,
        request: Request | None = None,
        headers: Mapping[str, str] = {},
        data: bytes | None = None,
    ) -> FastResponse:
        """Send something, and record a fault unless its answer is a right one."""
        own = {"Authorization": f"Bearer {SECRETS[self.caller]}", **headers}
        response = self.client.request(
            method,
            path,
            name=operation,
            data=data,  # type: ignore[arg-type] # Locust sends bytes as well
            headers=own,
            catch_response=True,
        )
        with response:
            fault = fault_of(response, statuses, request, self.refusals)
            if fault:
                response.failure(f"{method} {path}: {fault}")
            else:
                response.success()
        return response


class Founder(User):
    """The user who uploads the meshes that are there from the beginning."""

    abstract = True
    callers = ("alice",)


class Reader(User):
    """A user who asks questions, one after the other."""

    fixed_count = 10

    @locust.task(12)
    def ask(self) -> None:
        """Ask a question, with or without compression on the way."""
        codings = {"Accept-Encoding": DICE.choice(("identity", "gzip"))}
        self.send(DICE.choice(self.plan.queries), codings)

    @locust.task(3)
    def look(self) -> None:
        """Ask for something that needs no worker."""
        self.send(DICE.choice(self.plan.others))

    @locust.task(2)
    def ask_again(self) -> None:
        """Ask whether something has changed."""
        asked = [each for each in self.plan.queries if each.operation == "getPath"]
        asked += [each for each in self.plan.others if each.operation.startswith("getMesh")]
        request = DICE.choice(asked)
        response = self.send(request)
        if response.status_code == 200:
            known = {**request.headers, "If-None-Match": header_of(response, "etag")}
            self.exchange(request.operation, "GET", request.path, 304, headers=known)


class Uploader(User):
    """A user who uploads meshes, asks about them, and deletes some."""

    fixed_count = 2

    @locust.task
    def upload(self) -> None:
        """Upload a mesh that no other user uploads, ask about it, and perhaps delete it."""
        upload = DICE.choice(self.plan.variants[self.callers.index(self.caller) :: 2])
        if not store(self, upload):
            return
        self.send(upload.query)
        if DICE.random() < 0.3:
            link = f"/v1/meshes/{upload.mesh_id}"
            self.exchange("deleteMesh", "DELETE", link, 204)
            self.exchange("getMesh", "GET", link, 404)


class Client(User):
    """A user of jobs."""

    fixed_count = 3

    @locust.task(3)
    def wait(self) -> None:
        """Send a query as a job, watch it, fetch its answer, and mostly remove it."""
        request = self._question()
        link = submit(self, request)
        if link is None:
            return
        self.exchange("watchJob", "GET", f"{link}/events", 200)  # until the job has ended
        results = Request("getJobResults", "GET", f"{link}/results", expected=request.expected)
        self.send(results)
        if DICE.random() < 0.9:  # the others are removed when they have expired
            self.exchange("deleteJob", "DELETE", link, 200)
            self.exchange("getJob", "GET", link, 404)

    @locust.task(1)
    def cancel(self) -> None:
        """Stop a job under way."""
        link = submit(self, long_query(self.plan))
        if link is None:
            return
        gevent.sleep(DICE.uniform(0, 0.2))
        stopped = self.exchange("cancelJob", "POST", f"{link}/cancel", 200)
        if stopped.status_code == 200 and stopped.json()["status"] == "dismissed":
            self.exchange("getJobResults", "GET", f"{link}/results", 410)
        self.exchange("deleteJob", "DELETE", link, 200)

    def _question(self) -> Request:
        return DICE.choice([each for each in self.plan.queries if each.method == "POST"])


class Wrong(User):
    """A user who asks wrong questions."""

    fixed_count = 1
    callers = ("bob",)

    @locust.task
    def ask(self) -> None:
        """Ask one that must be refused."""
        self.send(DICE.choice(self.plan.wrong))


class Impatient(User):
    """A user who does not wait for answers."""

    fixed_count = 2

    @locust.task(2)
    def hang_up(self) -> None:
        """Send a long query, and close the connection while it runs."""
        query, start = long_query(self.plan), time.perf_counter()
        head = {
            "Host": "localhost",
            "Authorization": f"Bearer {SECRETS[self.caller]}",
            "Content-Length": str(len(query.body or b"")),
            **query.headers,
        }
        lines = "".join(f"{name}: {value}\r\n" for name, value in head.items())
        url = urlsplit(self.client.base_url or "")
        with socket.create_connection((url.hostname, url.port)) as connection:
            connection.sendall(
                f"POST {query.path} HTTP/1.1\r\n{lines}\r\n".encode() + (query.body or b"")
            )
            gevent.sleep(DICE.uniform(0, 0.2))
        self.environment.events.request.fire(
            request_type="POST",
            name=query.operation,
            response_time=1e3 * (time.perf_counter() - start),
            response_length=0,
            response=None,
            context={"outcome": "client left"},
            exception=None,
        )

    @locust.task(1)
    def run_out_of_time(self) -> None:
        """Send a long query with little time."""
        query = long_query(self.plan)
        headers = {**query.headers, "X-Timeout-Ms": "1"}
        self.exchange(query.operation, "POST", query.path, 504, headers=headers, data=query.body)


class Greedy(User):
    """A user who asks more at once than it may."""

    fixed_count = 1
    callers = ("greedy",)
    concurrency = 2 * MAX_CONCURRENT
    wait_time = locust.between(5.0, 10.0)

    @locust.task
    def ask_all_at_once(self) -> None:
        """Send queries in all its connections."""
        pool = Pool(self.concurrency)
        for request in DICE.choices(self.plan.queries, k=self.concurrency):
            pool.spawn(self.send, request)
        pool.join()


class Hoarder(User):
    """A user who never looks at its jobs."""

    fixed_count = 1
    callers = ("carol",)
    wait_time = locust.between(5.0, 10.0)

    @locust.task
    def hoard(self) -> None:
        """Send jobs without looking at them, and remove them all."""
        question = next(each for each in self.plan.queries if each.operation == "locatePoints")
        links: list[str] = []
        while len(links) < HOARD:
            link = submit(self, question)
            if link is None:
                gevent.sleep(0.1)
            else:
                links.append(link)
        for link in links:
            self.exchange("deleteJob", "DELETE", link, 200)


def store(user: User, upload: Upload) -> bool:
    """Upload a mesh; return whether it is in the store now, under its id."""
    sent = upload.request
    response = user.exchange(
        sent.operation,
        "POST",
        sent.path,
        *(200, 201),  # it may have been there
        request=sent,
        data=sent.body,
        headers=sent.headers,
    )
    return response.status_code in (200, 201)


def submit(user: User, request: Request) -> str | None:
    """Send a query as a job; return its link, or None where it was refused, as anybody may be.

    Where the answer is a fault, which is recorded, the user turns to something else.
    """
    headers = {**request.headers, **ASYNC}
    response = user.exchange(
        request.operation, "POST", request.path, 202, data=request.body, headers=headers
    )
    if response.status_code == 202:
        return header_of(response, "location")
    if (response.status_code, code_of(response)) in user.refusals:
        return None
    raise locust.exception.RescheduleTask


def header_of(response: FastResponse, name: str) -> str:
    """Return a header that an answer must have, once."""
    value = None if response.headers is None else response.headers[name]
    if not isinstance(value, str):
        raise TypeError(f"{name} is {value!r}")
    return value


def long_query(plan: Plan) -> Request:
    """Return a query that nobody has asked before."""
    body = {"sources": [{"vertex": 0, "start_distance": DICE.random()}]}
    path, headers = f"/v1/meshes/{plan.large}/distances", {"Content-Type": "application/json"}
    return Request(
        "computeDistances", "POST", f"{path}?format=npy", json.dumps(body).encode(), headers
    )


def fault_of(
    response: Any,
    statuses: tuple[int, ...],
    request: Request | None,
    refusals: Collection[tuple[int, str]],
) -> str:
    """Return what is wrong with an answer; nothing where it is right, or one of the refusals."""
    status, code = response.status_code, code_of(response)
    if (status, code) in refusals:
        says_when = status not in (429, 503) or "retry-after" in response.headers
        return "" if says_when else f"{code} without Retry-After"
    if status not in statuses:
        what = (response.content or b"")[:300] if status else getattr(response, "error", "")
        return f"{status} instead of {statuses}: {what!r}"
    if request is None:
        return ""
    expected = request.expected
    if code != expected.code:
        return f"{code!r} instead of {expected.code!r}"
    if expected.digest and digest_of(response.content) != expected.digest:
        return f"another answer to {(request.body or b'')[:300]!r}"
    for name, value in expected.headers.items():
        if response.headers.get(name) != value:
            return f"{name} is {response.headers.get(name)!r} instead of {value!r}"
    return ""


def code_of(response: FastResponse) -> str:
    """Return the code of a problem; nothing for other answers."""
    headers = response.headers
    is_problem = headers and headers.get("content-type") == "application/problem+json"
    return str(json.loads(response.content)["code"]) if is_problem else ""


def main() -> None:
    """Send traffic to a service, for some seconds or until some number of requests."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak.traffic", description=__doc__)
    parser.add_argument("plan", type=Path, help="a pickled Plan")
    parser.add_argument("record", type=Path, help="where each request becomes a line of JSON")
    parser.add_argument("url")
    bound = parser.add_mutually_exclusive_group(required=True)
    bound.add_argument("--seconds", type=float)
    bound.add_argument("--requests", type=int)
    arguments = parser.parse_args()
    User.plan = pickle.loads(arguments.plan.read_bytes())  # noqa: S301 - written by our parent
    kinds: list[type[locust.User]] = [Reader, Uploader, Client, Wrong, Impatient, Greedy, Hoarder]
    User.host = arguments.url
    environment = Environment(user_classes=kinds, stop_timeout=LONG_S)
    runner = environment.create_local_runner()
    sent = count(1)

    def end_in_time() -> None:
        if next(sent) == arguments.requests:
            gevent.spawn(runner.quit)

    with recording(environment, arguments.record, end_in_time):
        founder = Founder(environment)
        for mesh in User.plan.meshes:
            store(founder, mesh)
        users = sum(kind.fixed_count for kind in kinds)
        runner.start(users, spawn_rate=users)
        if arguments.seconds:
            gevent.spawn_later(arguments.seconds, runner.quit)
        runner.greenlet.join()


@contextmanager
def recording(
    environment: Environment, path: Path, on_request: Callable[[], None] = lambda: None
) -> Iterator[None]:
    """Write a line of JSON into a file for each request inside the block."""
    with path.open("w", buffering=1) as record:

        def note(
            name: str, response_time: float, response: Any, context: Any, exception: Any, **_: Any
        ) -> None:
            line = {
                "time": time.monotonic(),
                "operation": name,
                "outcome": context.get("outcome") or outcome_of(response),
                "seconds": response_time / 1e3,
                "fault": str(exception or ""),
            }
            record.write(json.dumps(line) + "\n")
            on_request()

        def note_error(exception: Exception, **_: Any) -> None:
            note("none", 0.0, None, {"outcome": "failure of a user"}, repr(exception))

        environment.events.request.add_listener(note)
        environment.events.user_error.add_listener(note_error)
        yield


def outcome_of(response: FastResponse) -> str:
    """Return the status of an answer, with its code where it is a problem."""
    return f"{response.status_code} {code_of(response)}".strip()


if __name__ == "__main__":
    main()

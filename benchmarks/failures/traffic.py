"""The traffic of a trial: users who check every answer, and note what they were promised.

Runs in a process of its own, ``python -m benchmarks.failures.traffic``, until it is terminated.
"""

import argparse
import json
import pickle
import signal
from itertools import count
from pathlib import Path
from typing import Any, ClassVar, TextIO
from uuid import uuid4

import gevent
import locust
from locust.contrib.fasthttp import FastResponse
from locust.env import Environment

from benchmarks.failures.plan import LongQuestion
from benchmarks.soak.plan import Request
from benchmarks.soak.traffic import (
    ASYNC,
    DICE,
    LIMITS,
    LONG_S,
    Founder,
    User,
    header_of,
    recording,
    store,
)

NO_CONNECTION = (0, "")
LOOK_S = 0.2
RECONNECT_S = 1.0
LONG = 20
"""How many times longer a user with long questions pauses than others do"""
ENDED = ("successful", "failed", "dismissed")


class Client(User):
    """A user of one of the replicas."""

    abstract = True
    hosts: ClassVar[list[str]]
    places: ClassVar = count()
    promises: ClassVar[TextIO]
    """A file with a line of JSON for each"""

    def __init__(self, environment: Environment) -> None:
        self.host = self.hosts[next(Client.places) % len(self.hosts)]
        super().__init__(environment)

    def note_promise(self, **promise: object) -> None:
        """Note a job or a mesh that was answered with 2xx, or that such a job was kept."""
        self.promises.write(json.dumps({"caller": self.caller} | promise) + "\n")

    def exchange(self, *arguments: Any, **options: Any) -> FastResponse:
        """Send something; where nobody listens, wait before anything else is sent."""
        response = super().exchange(*arguments, **options)
        if response.status_code == 0:
            gevent.sleep(RECONNECT_S)
        return response

    def is_refused(self, response: FastResponse) -> bool:
        """Whether an answer is a refusal that may come, after which one asks again."""
        return response.status_code == 0 or response.status_code >= 429


class Asker(Client):
    """A user who asks small questions, one after the other."""

    fixed_count = 4

    @locust.task
    def ask(self) -> None:
        """Ask for an answer of some milliseconds."""
        self.send(DICE.choice(self.plan.queries))


class LongAsker(Client):
    """A user who asks long questions, one after the other."""

    fixed_count = 2
    wait_time = locust.constant(0)
    question: ClassVar[LongQuestion]

    @locust.task
    def ask(self) -> None:
        """Ask for an answer of some seconds."""
        self.send(self.question.shuffled(DICE))


class Worker(Client):
    """A user of jobs."""

    fixed_count = 2

    @locust.task
    def work(self) -> None:
        """Send a query as a job until that is accepted, look at it until it ends, and read it."""
        request = DICE.choice([each for each in self.plan.queries if each.method == "POST"])
        headers = {**request.headers, **ASYNC, "Idempotency-Key": uuid4().hex}
        response = self.submit(request, headers)
        while self.is_refused(response):  # the same key: it may have been accepted
            gevent.sleep(LOOK_S)
            response = self.submit(request, headers)
        link = header_of(response, "location")
        self.note_promise(job=link, digest=request.expected.digest)
        status = ""
        while status not in ENDED:
            gevent.sleep(LOOK_S)
            looked = self.exchange("getJob", "GET", link, 200)
            if looked.status_code == 200:
                status = looked.json()["status"]
        if status == "successful":  # how others ended is seen afterwards
            results = Request("getJobResults", "GET", f"{link}/results", expected=request.expected)
            if self.send(results).status_code == 200:
                self.note_promise(kept=link)
                self.exchange("deleteJob", "DELETE", link, 200, 404)  # or an answer went astray

    def submit(self, request: Request, headers: dict[str, str]) -> FastResponse:
        """Send a query as a job; return the answer."""
        return self.exchange(
            request.operation, "POST", request.path, 202, data=request.body, headers=headers
        )


class Uploader(Client):
    """A user who uploads meshes, and asks about them."""

    fixed_count = 1

    @locust.task
    def upload(self) -> None:
        """Upload a mesh, and ask about it."""
        upload = DICE.choice(self.plan.variants)
        if store(self, upload):
            self.note_promise(mesh=upload.mesh_id)
            self.send(upload.query)


def main() -> None:
    """Send traffic to replicas until terminated."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.failures.traffic")
    parser.add_argument("load", type=Path, help="a pickled Load")
    parser.add_argument("record", type=Path, help="where each request becomes a line of JSON")
    parser.add_argument("promises", type=Path, help="where each promise becomes a line of JSON")
    parser.add_argument("urls", nargs="+", help="of the replicas")
    parser.add_argument("--refusal", action="append", default=[], metavar="STATUS,CODE")
    parser.add_argument("--pause", type=float, help="mean seconds between questions of a user")
    parser.add_argument("--breaks", action="store_true", help="connections may end")
    arguments = parser.parse_args()
    load = pickle.loads(arguments.load.read_bytes())  # noqa: S301 - written by our parent
    User.plan, LongAsker.question = load.plan, load.long
    refusals = {(int(each[:3]), each[4:]) for each in arguments.refusal}
    User.refusals = LIMITS | refusals | ({NO_CONNECTION} if arguments.breaks else set())
    Client.hosts, User.host = arguments.urls, arguments.urls[0]
    kinds: list[type[locust.User]] = [Asker, LongAsker, Worker, Uploader]
    if arguments.pause:
        Client.wait_time = locust.between(0.0, 2 * arguments.pause)
        LongAsker.wait_time = locust.between(0.0, 2 * LONG * arguments.pause)
    environment = Environment(user_classes=kinds, stop_timeout=LONG_S)
    runner = environment.create_local_runner()
    gevent.signal_handler(signal.SIGTERM, lambda: gevent.spawn(runner.quit))
    with (
        recording(environment, arguments.record),
        arguments.promises.open("w", buffering=1) as file,
    ):
        Client.promises = file
        founder = Founder(environment)
        for mesh in User.plan.meshes:
            store(founder, mesh)
        users = sum(kind.fixed_count for kind in kinds)
        runner.start(users, spawn_rate=users)
        runner.greenlet.join()


if __name__ == "__main__":
    main()

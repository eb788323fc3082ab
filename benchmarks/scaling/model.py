"""The model: replicas that take questions, hosts whose workers answer them, and the waiting.

It is a simulation of events by SimPy. Where a question goes is decided by the service's own
`app.engine.placement`; a host gives its slots to waiting questions as `app.engine.local` does, to
those of one caller.
"""

import itertools
import random
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import simpy

from app.engine.placement import Occupancy, ranked

BEAT_S = 0.25
"""Seconds between two exchanges of a replica with a host, as in `app.engine.cluster`"""

Steps = Generator[simpy.Event, Any, None]
"""What a process of the simulation waits for, one after the other"""


class Question(NamedTuple):
    """A question, and what it takes."""

    arrival: float
    worker_s: float
    """Seconds of a worker"""
    mesh: int = 0
    is_small: bool = False
    is_stored: bool = False
    """Whether the replica knows the answer"""
    pull_s: float = 0.0
    """Seconds until a host has the mesh, if it has not"""
    outside_s: float = 0.0
    """Seconds that neither a replica nor a worker is busy with it"""


class Answer(NamedTuple):
    """A question that was answered."""

    arrival: float
    seconds: float
    waited_s: float
    """For a replica and for a worker"""


@dataclass(frozen=True)
class Shape:
    """What there is."""

    hosts: int
    workers: int
    """Of each host, beside the one for small work"""
    replicas: int = 1


@dataclass(frozen=True)
class ReplicaTimes:
    """What the one core of a replica is busy with, seconds."""

    request_s: float = 0.0
    """For each question"""
    place_s: float = 0.0
    """To choose a host for one"""
    beat_s: float = 0.0
    """For each exchange with a host"""


class Host:
    """A host: slots, those who wait for one, and the meshes that are there."""

    def __init__(self, environment: simpy.Environment, workers: int) -> None:
        self._environment = environment
        self._workers = workers
        self._idle, self._small_is_idle = workers, True
        self._doing_small = 0
        self._waiting: list[tuple[simpy.Event, bool]] = []
        self.pending = 0
        self.busy_s = 0.0
        self.meshes: dict[int, simpy.Event | None] = {}
        """None where the mesh is there, else the end of its pull"""

    def answer(
        self, question: Question, has_mesh: Callable[[int], bool]
    ) -> Generator[simpy.Event, Any, float]:
        """Pull the mesh unless it is there, wait for a slot, and keep it for a while.

        Returns the seconds until the mesh was there.
        """
        self.pending += 1
        begin = self._environment.now
        yield from self._bring(question, has_mesh)
        pulled_s = self._environment.now - begin
        slot: str | None = self._take(is_small=question.is_small)
        if slot is None:
            granted = self._environment.event()
            self._waiting.append((granted, question.is_small))
            slot = yield granted
        yield self._environment.timeout(question.worker_s)
        self.busy_s += question.worker_s
        self._release(slot, is_small=question.is_small)
        self.pending -= 1
        return pulled_s

    def _bring(self, question: Question, has_mesh: Callable[[int], bool]) -> Steps:
        if question.mesh not in self.meshes and has_mesh(question.mesh):
            self.meshes[question.mesh] = None
        if question.mesh not in self.meshes:
            pull = self._environment.timeout(question.pull_s)
            self.meshes[question.mesh] = pull
            yield pull
            self.meshes[question.mesh] = None
        elif (pulled := self.meshes[question.mesh]) is not None:
            yield pulled

    def _take(self, *, is_small: bool) -> str | None:
        if is_small and self._doing_small == self._workers:
            return None
        if is_small and self._small_is_idle:
            self._small_is_idle = False
            self._doing_small += 1
            return "small"
        if self._idle:
            self._idle -= 1
            self._doing_small += is_small
            return "any"
        return None

    def _release(self, slot: str, *, is_small: bool) -> None:
        self._doing_small -= is_small
        if slot == "small":
            self._small_is_idle = True
        else:
            self._idle += 1
        for i, (granted, next_is_small) in enumerate(self._waiting):
            free = self._take(is_small=next_is_small)
            if free is not None:
                del self._waiting[i]
                granted.succeed(free)
                return


@dataclass
class Replica:
    """A replica: a core, and what it knows of the hosts."""

    environment: simpy.Environment
    core: simpy.Resource
    own: list[int]
    """Its questions at each host"""
    others: list[int]
    """Those of others, as the last beat said"""
    busy_s: float = 0.0

    def work(self, seconds: float) -> Steps:
        """Keep the core busy for a while, once it is free."""
        if seconds:
            with self.core.request() as turn:
                yield turn
                yield self.environment.timeout(seconds)
            self.busy_s += seconds


@dataclass
class Model:
    """A service of some shape, which answers questions as time goes by."""

    shape: Shape
    times: ReplicaTimes = ReplicaTimes()
    has_mesh: Callable[[int], bool] = lambda _mesh: True
    """Whether a mesh is at a host that is asked for it for the first time"""
    seed: int = 0
    answers: list[Answer] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)  # noqa: S311 - a simulation
        self.environment = env = simpy.Environment()
        shape = self.shape
        self.hosts = [Host(env, shape.workers) for _ in range(shape.hosts)]
        self.replicas = [
            Replica(env, simpy.Resource(env), [0] * shape.hosts, [0] * shape.hosts)
            for _ in range(shape.replicas)
        ]
        self._names = {f"host {i}": i for i in range(shape.hosts)}
        if shape.hosts > 1:
            for replica in self.replicas:
                for host in range(shape.hosts):
                    env.process(self._attend(replica, host))

    def meshes_of(self, host: int) -> Iterator[int]:
        """Yield the meshes whose questions go to a host while that is not busy."""
        idle = dict.fromkeys(self._names, Occupancy(0, self.shape.workers))
        for mesh in itertools.count():
            if ranked(str(mesh), idle, is_small=True)[0] == f"host {host}":
                yield mesh

    def answer_all(self, questions: Iterable[Question]) -> Sequence[Answer]:
        """Let questions arrive, in order; return the answers."""
        env = self.environment
        asked: list[simpy.Event] = []
        env.run(env.process(self._arrive(questions, asked)))
        env.run(env.all_of(asked))
        return self.answers

    def keep_busy(self, clients: int, questions: Iterable[Question]) -> Sequence[Answer]:
        """Have clients ask one question after the other, until there is none; return the answers.

        When a question arrives does not count.
        """
        env, left = self.environment, iter(questions)
        env.run(env.all_of([env.process(self._ask_on(left)) for _ in range(clients)]))
        return self.answers

    def _arrive(self, questions: Iterable[Question], asked: list[simpy.Event]) -> Steps:
        env = self.environment
        for question in questions:
            yield env.timeout(max(0.0, question.arrival - env.now))
            asked.append(env.process(self._answer(question)))

    def _ask_on(self, questions: Iterator[Question]) -> Steps:
        for question in questions:
            yield from self._answer(question)

    def _answer(self, question: Question) -> Steps:
        env, arrival = self.environment, self.environment.now
        replica = self._random.choice(self.replicas)
        place_s = 0.0 if question.is_stored or len(self.hosts) == 1 else self.times.place_s
        yield from replica.work(self.times.request_s + place_s)
        busy_s = self.times.request_s + place_s + question.outside_s
        if not question.is_stored:
            host = self._place(replica, question)
            replica.own[host] += 1
            pulled_s = yield from self.hosts[host].answer(question, self.has_mesh)
            replica.own[host] -= 1
            busy_s += question.worker_s + pulled_s
        if question.outside_s:
            yield env.timeout(question.outside_s)
        seconds = env.now - arrival
        self.answers.append(Answer(arrival, seconds, seconds - busy_s))

    def _place(self, replica: Replica, question: Question) -> int:
        if len(self.hosts) == 1:
            return 0
        known = {
            name: Occupancy(replica.own[i] + replica.others[i], self.shape.workers)
            for name, i in self._names.items()
        }
        chosen = ranked(str(question.mesh), known, is_small=question.is_small)[0]
        assert chosen is not None, "there are hosts"  # noqa: S101
        return self._names[chosen]

    def _attend(self, replica: Replica, host: int) -> Steps:
        env = self.environment
        yield env.timeout(self._random.uniform(0, BEAT_S))
        while True:
            replica.others[host] = max(0, self.hosts[host].pending - replica.own[host])
            yield from replica.work(self.times.beat_s)
            yield env.timeout(BEAT_S)

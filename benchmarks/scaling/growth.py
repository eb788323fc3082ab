"""From one machine to a billion meshes and a million questions a second."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.scaling.figures import Figures
from benchmarks.scaling.model import BEAT_S, Model, ReplicaTimes, Shape
from benchmarks.scaling.traffic import Assumed, Cache, Traffic, cell_of
from geodesic_core.arrays import Floats

RATE, MESHES = 1_000_000.0, 1_000_000_000
"""The aim: questions a second, meshes"""
WAIT_S = 0.1
"""What 99 of 100 questions may wait for a replica and a worker together, seconds"""
LOADS = (0.3, 0.5, 0.7, 0.8, 0.9, 1.0)
"""Shares of the rate at which all workers, or all replicas, would always be busy"""
QUESTIONS = 60_000
"""In each run"""
CELL = Shape(hosts=4, workers=64, replicas=64)
BUSY = 0.7
"""Of a part that is not to keep others waiting"""
HOT = 0.1
"""Share of a cell's questions from which on a mesh is served by all cells"""
MONTH_S = 365.25 / 12 * 86_400


@dataclass(frozen=True)
class Step:
    """A service on the way."""

    name: str
    shape: Shape
    meshes: int


STEPS = (
    Step("one machine of 16 cores", Shape(hosts=1, workers=16), 10_000),
    Step("4 such hosts, one replica", Shape(hosts=4, workers=16), 100_000),
    Step("4 such hosts, 16 replicas", Shape(hosts=4, workers=16, replicas=16), 1_000_000),
    Step("a cell: 4 hosts of 64 cores, 64 replicas", CELL, 30_000_000),
)


@dataclass(frozen=True)
class Point:
    """What the model says of a step at a rate."""

    rate: float
    answered: float
    """A second"""
    p50_s: float
    p99_s: float
    wait_p99_s: float
    """Of waiting for a replica and a worker"""
    workers_busy: float
    replicas_busy: float
    copies_hit: float
    """Share of questions whose mesh the host of their mesh has"""


@dataclass(frozen=True)
class Replicas:
    """Measured processor seconds of a replica."""

    local_s: float
    """For each question, beside its own workers"""
    ray_s: float
    """For each question to hosts"""
    stored_s: float
    """For each question whose answer it knows"""
    beat_s: float
    """For each exchange with a host"""


class Growth:
    """The model on figures measured here."""

    def __init__(self, figures: Figures, assumed: Assumed, replicas: Replicas) -> None:
        self.figures, self.assumed, self.replicas = figures, assumed, replicas
        self.mesh_bytes = assumed.mean_faces * figures.bytes_a_face
        self.question_s = self._question_s()

    def _question_s(self) -> float:
        """Return the seconds of a worker for a question whose answer is not known, on average."""
        faces = self.assumed.faces_of(np.arange(1, 20_001))
        return sum(
            share * float((solve.seconds(faces)).mean() * solve.ratios.mean())
            for kind, share in self.assumed.kinds.items()
            for solve in [self.figures.solves[kind]]
        )

    def nominal(self, shape: Shape) -> float:
        """Return the questions a second that keep all workers busy, or all replicas."""
        workers = shape.hosts * shape.workers / (self.question_s * (1 - self.assumed.repeated))
        times = self.times(shape)
        asked_s = times.request_s + (shape.hosts > 1) * times.place_s
        beats = (shape.hosts > 1) * shape.hosts / BEAT_S * times.beat_s
        return min(workers, shape.replicas * (1 - beats) / asked_s)

    def times(self, shape: Shape) -> ReplicaTimes:
        """Return what a replica's core is busy with, in a service of this shape."""
        replicas, share = self.replicas, self.assumed.repeated
        asked_s = replicas.local_s if shape.hosts == 1 else replicas.ray_s
        request_s = share * replicas.stored_s + (1 - share) * asked_s
        return ReplicaTimes(request_s, self.figures.place_s_among(shape.hosts), replicas.beat_s)

    def sweep(self, step: Step) -> Sequence[Point]:
        """Return what the model says of a step at some loads."""
        rates = [load * self.nominal(step.shape) for load in LOADS]
        return [self.point(step.shape, step.meshes, rate) for rate in rates]

    def capacity(self, points: Sequence[Point]) -> Point:
        """Return the largest of the loads at which few questions wait for long."""
        good = [each for each in points if each.wait_p99_s <= WAIT_S]
        return good[-1] if good else points[0]

    def point(
        self,
        shape: Shape,
        meshes: int,
        rate: float,
        draw: Callable[[int], NDArray[np.int64]] | None = None,
        cells: int = 1,
    ) -> Point:
        """Simulate a service of some shape, one of some cells, at a rate of questions."""
        assumed, size = self.assumed, self.mesh_bytes
        rng = np.random.default_rng(1)
        whole = rate * cells
        hosts = shape.hosts * cells
        copies = Cache.of(assumed, meshes, whole, hosts, assumed.copies_bytes, size)
        room = shape.workers * assumed.open_bytes
        opened = Cache.of(assumed, meshes, whole, hosts, room, size)
        seconds = QUESTIONS / rate
        ranks = (
            assumed.ranks(meshes, rng.uniform(size=QUESTIONS)) if draw is None else draw(QUESTIONS)
        )
        there = dict(zip(ranks.tolist(), copies.has(ranks.astype(float)).tolist(), strict=True))

        def has_mesh(rank: int) -> bool:
            return bool(rng.random() < there[rank])

        traffic = Traffic(self.figures, assumed, meshes, whole, opened)
        model = Model(shape, self.times(shape), has_mesh)
        answers = model.answer_all(traffic.questions(ranks, seconds))
        late = [each for each in answers if each.arrival > seconds / 5]  # the first find all idle
        times = np.array([each.seconds for each in late])
        waits = np.array([each.waited_s for each in late])
        return Point(
            rate,
            sum(each.arrival + each.seconds <= seconds for each in late) / (0.8 * seconds),
            float(np.percentile(times, 50)),
            float(np.percentile(times, 99)),
            float(np.percentile(waits, 99)),
            sum(host.busy_s for host in model.hosts) / seconds / shape.hosts / shape.workers,
            sum(each.busy_s for each in model.replicas) / seconds / shape.replicas,
            float(copies.has(ranks.astype(float)).mean()),
        )

    def copies_hit(self, meshes: int, rate: float, hosts: int, mesh_bytes: float) -> float:
        """Return the share of questions whose mesh its host has, for meshes of some bytes."""
        room = self.assumed.copies_bytes
        copies = Cache.of(self.assumed, meshes, rate, hosts, room, mesh_bytes)
        ranks = self.assumed.ranks(meshes, (np.arange(10_000) + 0.5) / 10_000)
        return float(copies.has(ranks.astype(float)).mean())

    # The whole

    def cells(self, rate_of_cell: float) -> int:
        """Return how many cells the aim needs."""
        return math.ceil(RATE / rate_of_cell)

    def in_cells(self, cells: int) -> Iterator[tuple[str, float, Point]]:
        """Yield the share of all questions that cells get, and what the model says of each."""
        for name, spread in (("each mesh in one cell", False), ("hot meshes in all", True)):
            hot = self.hot_ranks(cells) if spread else 0
            shares = self._shares(cells, hot)
            for which, cell in (
                ("the fullest", int(shares.argmax())),
                ("a usual one", int(np.argsort(shares)[cells // 2])),
            ):
                rate = RATE * float(shares[cell])
                draw = self._draw(cells, cell, hot)
                point = self.point(CELL, MESHES, rate, draw, cells)
                yield f"{name}: {which}", float(shares[cell]), point

    def hot_ranks(self, cells: int) -> int:
        """Return how many meshes are too hot for one cell."""
        ranks = np.arange(1, 10_001)
        shares = self.assumed.share_of(ranks.astype(float), MESHES)
        return int((shares > HOT / cells).sum())

    def _shares(self, cells: int, hot: int) -> Floats:
        """Return the share of all questions that each cell gets."""
        ranks = np.arange(1, 1_000_001)
        shares = self.assumed.share_of(ranks.astype(float), MESHES)
        where = cell_of(ranks, cells)
        found = np.bincount(where[hot:], shares[hot:], minlength=cells)
        rest = 1.0 - shares[hot:].sum()  # spread evenly: hot ones, and a billion others
        return np.asarray(found + rest / cells)

    def _draw(self, cells: int, cell: int, hot: int) -> Callable[[int], NDArray[np.int64]]:
        def draw(count: int) -> NDArray[np.int64]:
            rng, parts, size = np.random.default_rng(2), [], 0
            while size < count:
                ranks = self.assumed.ranks(MESHES, rng.uniform(size=500_000))
                where = cell_of(ranks, cells)
                where[ranks <= hot] = rng.integers(0, cells, int((ranks <= hot).sum()))
                parts.append(ranks[where == cell])
                size += len(parts[-1])
            return np.concatenate(parts)[:count]

        return draw


@dataclass(frozen=True)
class Limit:
    """Where a part breaks, and what then."""

    part: str
    measured: str
    breaks: str
    then: str


def limits(growth: Growth, cell: Point) -> Sequence[Limit]:
    """Return where the parts break, the first one first."""
    figures, assumed, replicas = growth.figures, growth.assumed, growth.replicas
    local_s, ray_s = (growth.times(step.shape).request_s for step in STEPS[:2])
    worker_s = growth.question_s * (1 - assumed.repeated)
    copies = assumed.copies_bytes / growth.mesh_bytes
    hottest = float(assumed.share_of(np.array([1.0]), MESHES)[0])
    most_hosts = 0.2 * BEAT_S / replicas.beat_s
    hosts = growth.cells(cell.rate) * CELL.hosts
    kept, kept_plain = (
        growth.copies_hit(MESHES, RATE, hosts, assumed.mean_faces * size)
        for size in (figures.bytes_a_face, figures.plain_bytes_a_face)
    )
    stored = MESHES * growth.mesh_bytes
    plain = MESHES * assumed.mean_faces * figures.plain_bytes_a_face
    month = RATE * MONTH_S / 1e6
    dollars = stored / 1e9 * assumed.stored_dollars
    return [
        Limit(
            "copies that a host has",
            f"{1e6 * figures.copy_s:.0f} µs a copy, at each pull",
            f"{WAIT_S / figures.copy_s:,.0f} copies: {1e3 * WAIT_S:.0f} ms longer; a disk of "
            f"{assumed.copies_bytes / 1e12:g} TB has room for {copies:,.0f}",
            "count the bytes once, and remember the order of use",
        ),
        Limit(
            "the table of meshes that replicas share",
            f"{1e6 * figures.record_s:.1f} µs and {figures.record_bytes:.0f} bytes a mesh, read "
            "by each replica every 2 s, when it answers nobody",
            f"{WAIT_S / figures.record_s:,.0f} meshes: the others wait {1e3 * WAIT_S:.0f} ms; "
            f"{2 / figures.record_s:,.0f}: nothing else is done",
            "ask for the mesh of a question, and keep what was asked lately",
        ),
        Limit(
            "the one core of the API",
            f"{1e3 * local_s:.2f} ms a question, stored answers included",
            f"{BUSY / local_s:,.0f} questions a second, {BUSY:.0%} busy; the other 16 cores could "
            f"answer {16 * BUSY / worker_s:,.0f}",
            "replicas behind a balancer",
        ),
        Limit(
            "cores of one machine",
            f"{1e3 * worker_s:.1f} ms a question, stored answers included",
            f"{16 * BUSY / worker_s:,.0f} questions a second on 16 cores, {BUSY:.0%} busy",
            f"hosts; a replica for every {worker_s / ray_s:.1f} of their cores",
        ),
        Limit(
            "beats: each replica with each host",
            f"{1e3 * replicas.beat_s:.2f} ms, every {BEAT_S:g} s",
            f"{most_hosts:,.0f} hosts take a fifth of each replica",
            "cells, each with its own head and replicas; a mesh belongs to one",
        ),
        Limit(
            "one hot mesh",
            f"{hottest:.1%} of all questions, by Zipf's law",
            f"{cell.rate / hottest:,.0f} questions a second in all: it fills a cell",
            f"a mesh that is more than {HOT:.0%} of a cell's questions is served by all cells",
        ),
        Limit(
            "disks of hosts",
            f"{growth.mesh_bytes / 1e6:.1f} MB a mesh",
            f"a billion meshes: {kept:.0%} of questions find their mesh at its host, the others "
            "wait for a pull",
            f"copies of vertices and corners: {kept_plain:.0%}; the rest is made when a worker "
            f"opens one, in {1e3 * figures.build_s_a_face * assumed.mean_faces:.0f} ms",
        ),
        Limit(
            "the bill for storage",
            f"{figures.bytes_a_face:.0f} bytes a face, {growth.mesh_bytes / 1e6:.1f} MB a mesh",
            f"{stored / 1e15:.1f} PB of a billion meshes: ${dollars:,.0f} a month, "
            f"${dollars / month:.2f} a million questions",
            f"store vertices and corners alone: {plain / 1e15:.1f} PB",
        ),
    ]


def dollars(growth: Growth, shape: Shape, rate: float) -> float:
    """Return the dollars for the cores of a million questions."""
    cores = shape.hosts * shape.workers + shape.replicas
    return cores * growth.assumed.core_dollars / 3600 / rate * 1e6

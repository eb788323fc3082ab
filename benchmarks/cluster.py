"""A cluster on this machine: what a second node adds, and what a small question pays for it."""

import json
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack
from itertools import count
from multiprocessing import get_context
from statistics import median, quantiles
from typing import Any

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.scaling.nodes import Caller, Nodes, cluster, one_machine
from benchmarks.tables import Section, rated
from benchmarks.timing import timed

LONG_FACES = 500_000
SECONDS, TURNS = 15.0, 3
"""Seconds of long questions, for each number of nodes and in each turn"""
PATHS = 300
"""Small questions to each engine"""
MATRIX_FACES = 10_000
"""Faces of the sphere of the first turn, all distances of which are computed in parts"""
_STARTS = count()
"""Start distances, each of which makes another question"""


def run(_inputs: Inputs, _runs: int) -> Section:
    """Keep one node and two busy by turns with long questions; ask small ones of both engines.

    Between them, processes without a service solve the same questions. They show what the machine
    allows: its cores share memory, and their pace changes from minute to minute.
    """
    rates: list[list[float]] = [[], []]
    matrices: list[list[float]] = [[], []]
    bare: list[list[float]] = [[], []]
    with ExitStack() as stack:
        clusters = [stack.enter_context(cluster(nodes)) for nodes in (1, 2)]
        for turn in range(TURNS):
            for nodes, running in enumerate(clusters, start=1):
                bare[nodes - 1].append(_bare_rate(nodes))
                rates[nodes - 1].append(_long_rate(running, clients=2 * nodes))
            for nodes, running in enumerate(clusters, start=1):
                matrices[nodes - 1].append(_matrix_s(running, MATRIX_FACES + 1000 * turn))
    with ExitStack() as stack:
        local, ray = (stack.enter_context(each) for each in (one_machine(1), cluster(1)))
        times = _path_times([local, ray])
    rows = [
        [f"distances, nodes: {nodes}", f"{median(each):.2f}", "", ""]
        for nodes, each in enumerate(rates, start=1)
    ]
    rows += [
        [f"distances, processes without a service: {number}", f"{median(each):.2f}", "", ""]
        for number, each in enumerate(bare, start=1)
    ]
    rows += [
        [f"all distances of a sphere, nodes: {nodes}", f"1 in {median(each):.1f} s", "", ""]
        for nodes, each in enumerate(matrices, start=1)
    ]
    rows += [
        [f"path, engine {name}", "", f"{1e3 * median(each):.2f}", f"{1e3 * quantiles(each)[2]:.2f}"]
        for name, each in zip(("local", "ray"), times, strict=True)
    ]
    ratio = rated(_ratio(rates[1], rates[0]), 1.8, at_least=True)
    faster = rated(_ratio(*matrices), 1.8, at_least=True)
    more_s = median(there - here for here, there in zip(*times, strict=True))
    more = rated(1e3 * more_s, 6.0, at_least=False)
    return Section(
        "Cluster",
        f"Head, replica and nodes of one worker each on this machine, which has as many cores as "
        f"there are nodes: exact distances on a sphere of {LONG_FACES:,} faces, asked for "
        f"{SECONDS:g} s by two clients a node, {TURNS} times by turns. Two nodes answer {ratio} "
        f"times as many questions as one, and compute all distances of a sphere of "
        f"{MATRIX_FACES:,} faces and more {faster} times as fast; two processes without a service "
        f"solve {_ratio(bare[1], bare[0]):.2f} times as much as one, in the same minutes. Paths on "
        f"a sphere of 20,000 faces, one after the other, the same {PATHS} to both engines by "
        f"turns: by the cluster they take {more} ms more at the median of the differences.",
        ["questions", "a second", "p50, ms", "p75, ms"],
        rows,
    )


def _ratio(more: Sequence[float], less: Sequence[float]) -> float:
    """Return the median of the ratios of the turns."""
    return median(a / b for a, b in zip(more, less, strict=True))


def _bare_rate(processes: int) -> float:
    """Return how many of the long questions processes of their own solve a second."""
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        return sum(pool.map(_solve_for, [SECONDS] * processes))


def _solve_for(seconds: float) -> float:
    """Return the solves a second of this process."""
    solver, solved = gc.Solver(gc.samples.sphere(LONG_FACES)), 0
    solver.exact_distance(0, targets=[1], retain="distances")
    begin = time.perf_counter()
    while (taken := time.perf_counter() - begin) < seconds:
        solver.exact_distance(0, targets=[1], retain="distances")
        solved += 1
    return solved / taken


def _long_rate(nodes: Nodes, clients: int) -> float:
    """Return how many long questions are answered a second."""
    caller = Caller(nodes.port)
    mesh = caller.upload_sample("sphere", LONG_FACES)
    caller.close()

    def ask_until(end: float) -> list[float]:
        """Return when each answer was there."""
        own, answered = Caller(nodes.port), []
        while time.perf_counter() < end:
            start = {"vertex": 0, "start_distance": next(_STARTS)}
            own.get(f"{mesh}/distances", {"sources": [start], "targets": [{"vertex": 1}]})
            answered.append(time.perf_counter())
        own.close()
        return answered

    with ThreadPoolExecutor(clients) as pool:

        def keep_busy(seconds: float) -> Iterator[float]:
            end = time.perf_counter() + seconds
            for each in [pool.submit(ask_until, end) for _ in range(clients)]:
                yield from each.result()

        list(keep_busy(3.0))  # brings the mesh to each worker
        answered = sorted(keep_busy(SECONDS))
    return (len(answered) - 1) / (answered[-1] - answered[0])


def _matrix_s(nodes: Nodes, faces: int) -> float:
    """Return how long a matrix takes as a job; one of the same faces is known."""
    caller = Caller(nodes.port)
    mesh = caller.upload_sample("sphere", faces)
    body = {"sources": "all", "targets": "all"}
    begin = time.perf_counter()
    response, answer = caller.ask(
        f"{mesh}/matrix?format=npy", body, {"Prefer": "respond-async"}, "POST"
    )
    if response.status != 202:
        raise RuntimeError(f"the matrix was answered with {response.status}: {answer[:300]!r}")
    job = response.headers["Location"]
    while (status := json.loads(caller.get(job))["status"]) in ("accepted", "running"):
        time.sleep(0.1)
    seconds = time.perf_counter() - begin
    caller.close()
    if status != "successful":
        raise RuntimeError(f"the matrix is {status}")
    return seconds


def _path_times(engines: list[Nodes]) -> list[list[float]]:
    """Return the seconds of the same paths by each engine, which take turns."""
    callers = [Caller(nodes.port) for nodes in engines]
    times: list[list[float]] = [[] for _ in engines]
    for number in range(PATHS):
        body: dict[str, Any] = {"source": {"vertex": number}, "target": {"vertex": 9000 - number}}
        for nodes, caller, its in zip(engines, callers, times, strict=True):
            path = f"{nodes.meshes[0]}/path"
            its.append(timed(lambda: caller.get(path, body))[0])  # noqa: B023 - called at once
    for caller in callers:
        caller.close()
    return times

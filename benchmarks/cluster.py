"""A cluster on this machine: what a second node adds, and what a small question pays for it."""

import json
import time
from collections.abc import Iterator
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
SECONDS = 30.0
"""Seconds of long questions, for each number of nodes"""
PATHS = 300
"""Small questions to each engine"""
MATRIX_FACES = 10_000
"""Faces of a sphere, between all vertices of which the distances are computed in parts"""


def run(_inputs: Inputs, _runs: int) -> Section:
    """Keep one node and two busy with long questions; ask small ones of both engines by turns.

    Before each, processes without a service solve the same questions. They show what the machine
    allows: its cores share memory, so that two processes seldom reach twice the rate of one.
    """
    rates, matrices, bare = [], [], []
    for nodes in (1, 2):
        bare.append(_bare_rate(nodes))
        with cluster(nodes) as running:
            rates.append(_long_rate(running, clients=2 * nodes))
            matrices.append(_matrix_s(running))
    with ExitStack() as stack:
        local, ray = (stack.enter_context(each) for each in (one_machine(1), cluster(1)))
        times = _path_times([local, ray])
    rows = [
        [f"distances, nodes: {nodes}", f"{rate:.2f}", "", ""]
        for nodes, rate in enumerate(rates, start=1)
    ]
    rows += [
        [f"distances, processes without a service: {number}", f"{rate:.2f}", "", ""]
        for number, rate in enumerate(bare, start=1)
    ]
    rows += [
        [f"all distances of {MATRIX_FACES:,} faces, nodes: {nodes}", f"1 in {each:.1f} s", "", ""]
        for nodes, each in enumerate(matrices, start=1)
    ]
    rows += [
        [f"path, engine {name}", "", f"{1e3 * median(each):.2f}", f"{1e3 * quantiles(each)[2]:.2f}"]
        for name, each in zip(("local", "ray"), times, strict=True)
    ]
    ratio = rated(rates[1] / rates[0], 1.8, at_least=True)
    faster = rated(matrices[0] / matrices[1], 1.8, at_least=True)
    more_s = median(there - here for here, there in zip(*times, strict=True))
    more = rated(1e3 * more_s, 6.0, at_least=False)
    return Section(
        "Cluster",
        f"Head, replica and nodes of one worker each on this machine, which has as many cores as "
        f"there are nodes: exact distances on a sphere of {LONG_FACES:,} faces, asked for "
        f"{SECONDS:g} s by two clients a node. Two nodes answer {ratio} times as many questions as "
        f"one, and compute a matrix {faster} times as fast; two processes without a service solve "
        f"{bare[1] / bare[0]:.2f} times as much as one, in the same minutes. Paths on a "
        f"sphere of 20,000 faces, one after the other, the same {PATHS} to both engines by turns: "
        f"by the cluster they take {more} ms more at the median of the differences.",
        ["questions", "a second", "p50, ms", "p75, ms"],
        rows,
    )


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
    starts = count()

    def ask_until(end: float) -> list[float]:
        """Return when each answer was there."""
        own, answered = Caller(nodes.port), []
        while time.perf_counter() < end:
            start = {"vertex": 0, "start_distance": next(starts)}
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


def _matrix_s(nodes: Nodes) -> float:
    """Return how long a matrix takes as a job."""
    caller = Caller(nodes.port)
    mesh = caller.upload_sample("sphere", MATRIX_FACES)
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

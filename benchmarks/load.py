"""Latency of small queries: alone, many at once, and beside long ones."""

import json
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from gc import freeze
from itertools import count
from random import Random
from statistics import median, quantiles

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.serving import Client, phases_of, serving
from benchmarks.tables import Section, rated
from benchmarks.timing import timed

SMALL_FACES, LONG_FACES = 5_000, 1_000_000
SECONDS = 8.0
"""Seconds of requests, for each row."""
WORKERS = 2
HEAVY = 120
"""Long queries at once."""


def run(_inputs: Inputs, _runs: int) -> Section:
    """Ask for paths on a small mesh, by one client and by four."""
    gc.warm_up()
    rows: list[list[str]] = []
    with serving(GEODESIC_WORKERS=str(WORKERS)) as port, ProcessPoolExecutor(4) as pool:
        client = Client(port)
        small = client.upload_sample("sphere", SMALL_FACES)
        long = client.upload_sample("sphere", LONG_FACES)
        solve_s = _solve_seconds()
        for clients in (1, 4):
            asked = partial(_ask_from, pool, clients, port, small)
            asked()  # brings the mesh into each worker
            alone = asked()
            rows.append(_row("alone", clients, alone, solve_s, alone))
            if clients == 1:
                rested_s = _solve_seconds(rest_s=median(alone) - solve_s)
            for busy in range(1, WORKERS + 1):
                with _busy_workers(port, long, busy):
                    rows.append(_row(f"while {busy} long", clients, asked(), solve_s, alone))
        rows.append(_cached_path(Client(port), small))
        stopping = _stopping(Client(port), long)
        heavy = _many_heavy(port, long, pool)
    return Section(
        "Load",
        f"Exact paths between random vertices of a sphere of {SMALL_FACES:,} faces, asked for "
        f"{SECONDS:g} s by clients that each wait for their answer, in processes of their own; "
        f"long questions are exact distances on a sphere of {LONG_FACES:,} faces. "
        f"{WORKERS} workers and the one for small work. The solve alone takes "
        f"{1e3 * solve_s:.2f} ms, one after the other, and a request so much more at the median; "
        f"it takes {1e3 * rested_s:.2f} ms where the processor rests before each as long as it "
        f"does for one client. {stopping} {heavy}",
        ["paths", "clients", "a second", "p50, ms", "p99, ms", "over the solve, ms", "p99 : p50"],
        rows,
    )


def _row(
    name: str, clients: int, times: Sequence[float], solve_s: float, alone: Sequence[float]
) -> list[str]:
    p50, p99 = median(times), quantiles(times, n=100)[98]
    is_alone = times is alone
    rate, over = len(times) / SECONDS, 1e3 * (p50 - solve_s)
    return [
        name,
        str(clients),
        rated(rate, 400 if is_alone and clients == 4 else None, at_least=True, digits=0),
        f"{1e3 * p50:.2f}",
        f"{1e3 * p99:.2f}",
        rated(over, 2.5 if is_alone and clients == 1 else None, at_least=False),
        rated(p99 / median(alone), None if is_alone else 3.0, at_least=False),
    ]


def _solve_seconds(rest_s: float = 0.0) -> float:
    solver = gc.Solver(gc.samples.sphere(SMALL_FACES))
    pairs = _pairs(0)

    def solve_rested() -> float:
        time.sleep(rest_s)
        return timed(partial(solver.shortest_path, *next(pairs)))[0]

    return median(solve_rested() for _ in range(200))


def _pairs(seed: int) -> Iterator[tuple[int, int]]:
    random = Random(seed)  # noqa: S311 - the same in every run, and no secret
    while True:
        yield tuple(random.sample(range(SMALL_FACES // 2), 2))  # type: ignore[misc]


_seeds = count()


def _ask_from(pool: ProcessPoolExecutor, clients: int, port: int, mesh: str) -> list[float]:
    """Return the seconds of each request, of some clients at once."""
    asking = [pool.submit(_ask_paths, port, mesh, next(_seeds)) for _ in range(clients)]
    return [seconds for task in asking for seconds in task.result()]


def _ask_paths(port: int, mesh: str, seed: int) -> list[float]:
    client, pairs, times = Client(port), _pairs(seed), []
    end = time.perf_counter() + SECONDS
    while (start := time.perf_counter()) < end:
        source, target = next(pairs)
        client.get(f"{mesh}/path", {"source": {"vertex": source}, "target": {"vertex": target}})
        times.append(time.perf_counter() - start)
    client.close()
    return times


_starts = count()


def _long_question() -> dict[str, object]:
    """Return a query that has no stored answer."""
    start = {"vertex": 0, "start_distance": next(_starts)}
    return {"sources": [start], "targets": [{"vertex": 1}]}


@contextmanager
def _busy_workers(port: int, mesh: str, count: int) -> Iterator[None]:
    """Keep some workers busy with long queries."""
    over = threading.Event()

    def ask() -> None:
        client = Client(port)
        while not over.is_set():
            client.ask(f"{mesh}/distances", _long_question(), {"X-Timeout-Ms": "60000"})
        client.close()

    threads = [threading.Thread(target=ask) for _ in range(count)]
    for thread in threads:
        thread.start()
    time.sleep(1.0)
    yield
    over.set()
    for thread in threads:
        thread.join()


def _cached_path(client: Client, mesh: str) -> list[str]:
    """Ask for paths to vertices from a source whose field is cached."""
    client.get(f"{mesh}/distances", {"sources": [{"vertex": 0}]})
    times = []
    for vertex in range(1, 301):
        body = {"source": {"vertex": 0}, "targets": [{"vertex": vertex}]}
        times.append(timed(partial(client.get, f"{mesh}/paths", body))[0])
    p50, p99 = median(times), quantiles(times, n=100)[98]
    cells = ["of a field that is known", "1", "", rated(1e3 * p50, 3.0, at_least=False)]
    return [*cells, f"{1e3 * p99:.2f}", "", ""]


def _stopping(client: Client, mesh: str) -> str:
    """Dismiss jobs on all workers; return the seconds that other work then waits for one."""
    times = []
    medium = client.upload_sample("sphere", 100_000)
    for _ in range(10):
        jobs = []
        for _ in range(WORKERS):
            wish = {"Prefer": "respond-async"}
            response, _ = client.ask(f"{mesh}/distances", _long_question(), wish)
            jobs.append(response.headers["location"])
        time.sleep(0.5)
        for job in jobs:
            client.ask(job, method="DELETE")
        response, _ = client.ask(f"{medium}/distances", _long_question())
        times.append(phases_of(response)["queue"])
    slowest = rated(1e3 * max(times), 200.0, at_least=False, digits=0)
    return (
        f"After long jobs were dismissed on all workers, the next question waited {slowest} ms for "
        f"one at most, in {len(times)} trials."
    )


def _many_heavy(port: int, mesh: str, pool: Executor) -> str:
    """Ask many long queries at once; return their outcomes, and that of a small one meanwhile.

    They are asked in another process, whose threads would keep this one from looking at its clock.
    """
    asked = pool.submit(_ask_heavy, port, mesh, [_long_question() for _ in range(HEAVY)])
    client, times = Client(port), []
    freeze()  # to look through Numba for garbage takes this process 75 ms
    while not asked.done():
        times.append(timed(partial(client.get, "/v1"))[0])
        time.sleep(0.01)
    found = asked.result()
    statuses = Counter(status for status, _ in found)
    told = ", ".join(f"{statuses[status]} × {status}" for status in sorted(statuses))
    right = "each as it should be" if all(fine for _, fine in found) else "**some malformed**"
    slowest = rated(1e3 * max(times), 50.0, at_least=False, digits=1)
    return (
        f"{HEAVY} long questions at once were answered {told}, {right}; `GET /v1` meanwhile took "
        f"{slowest} ms at most, {1e3 * median(times):.1f} ms at the median of {len(times)}."
    )


def _ask_heavy(
    port: int, mesh: str, questions: Sequence[dict[str, object]]
) -> list[tuple[int, bool]]:
    """Return the status of each answer, and whether it is an expected one."""

    def ask(question: dict[str, object]) -> tuple[int, bool]:
        client = Client(port)
        headers = {"X-Timeout-Ms": "20000"}
        response, answer = client.ask(f"{mesh}/distances", question, headers)
        client.close()
        status = response.status
        code = json.loads(answer).get("code")
        known = status == 200 or code in ("queue_full", "rate_limited", "deadline_exceeded")
        return status, known and (status not in (429, 503) or "retry-after" in response.headers)

    with ThreadPoolExecutor(HEAVY) as threads:
        return list(threads.map(ask, questions))

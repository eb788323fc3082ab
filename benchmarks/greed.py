"""One greedy caller: what it takes from others, and what little of its own that costs it."""

import http.client
import json
import re
import socket
import time
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import count
from multiprocessing import Manager
from pathlib import Path
from statistics import median
from threading import Event
from typing import Any

from benchmarks.serving import Client, serving_process
from benchmarks.tables import Section

OTHERS = "127.0.0.2"
"""Address of those who are not greedy: without keys, callers are told apart by address"""
MIB = 2**20
ASKED = 5
"""Requests of which the median counts"""
RACES = 40

WRONG = json.dumps(
    {
        "sources": [{"vertex": 0}],
        "targets": [*({"vertex": i % 100} for i in range(210_000)), {"vertex": -1}],
    },
    separators=(",", ":"),
).encode()
"""A body of 2.9 MB, whose last vertex does not exist"""
TARGETS = [{"vertex": i % 100} for i in range(5_500)]
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
KEYS = {name: {"Authorization": f"Bearer {name}-0123456789abc"} for name in ("alice", "bob")}

BEFORE: dict[str, str] = {}
"""The figures of the service before it had shares, on the same two cores"""

VERTEX = b"v 0 0 0\n"


def _packed(content: bytes, times: int) -> bytes:
    """Return a mesh of one triangle, followed by the same content many times, packed by gzip."""
    packer, block = zlib.compressobj(9, wbits=31), content * 1000
    parts = [packer.compress(TRIANGLE), *(packer.compress(block) for _ in range(times // 1000))]
    return b"".join([*parts, packer.flush()])


Row = tuple[str, str, str]
"""An attack, what is counted, and the figure"""


def run() -> Section:
    """Be greedy in several ways, one after the other."""
    rows: list[Row] = []
    with serving_process(GEODESIC_WORKERS="2") as (port, pid):
        for attack in (_bodies, _bombs, _vertices, _short_deadlines, _head, _ranges, _sites):
            rows += attack(port, pid)
        rows += _races(port, pid)
        rows += _lists(port, pid)
    keys = ",".join(f"{name}:{name}-0123456789abc" for name in KEYS)
    with serving_process(
        GEODESIC_WORKERS="2", GEODESIC_API_KEYS=keys, GEODESIC_RESULTS_BYTES="3000000"
    ) as (port, pid):
        rows += _answers(port, pid)
    with serving_process(GEODESIC_WORKERS="1", GEODESIC_RATE_LIMIT="3") as (port, pid):
        rows += _forged_names(port, pid)
    return Section(
        "Greedy callers",
        "One caller takes as much as it can, from an address or with a key of its own, while "
        "others are served on the same two cores. *Before* are the figures of the same attacks on "
        "the service of 27 November 2026, with one queue for all bodies and no budget of scratch.",
        ["attack", "what is counted", "found", "before"],
        [(name, what, found, BEFORE.get(f"{name}: {what}", "")) for name, what, found in rows],
    )


def _post(client: Client, path: str, body: Any, **headers: str) -> tuple[int, float]:
    """Return the status of an answer, and its seconds."""
    start = time.perf_counter()
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    response, _ = client.ask(path, body, named, "POST")
    return response.status, time.perf_counter() - start


def _metric(port: int, name: str) -> float:
    text = Client(port, OTHERS).get("/metrics").decode()
    found = re.search(rf"^{re.escape(name)} ([\d.e+]+)$", text, re.MULTILINE)
    return float(found[1]) if found else 0.0


@contextmanager
def _attacked(port: int, blow: Callable[[int], None], connections: int) -> Iterator[None]:
    """Deal a blow again and again inside the block, on several connections of a process."""
    with ProcessPoolExecutor(1) as pool, Manager() as manager:
        stop = manager.Event()
        dealing = pool.submit(_deal, port, blow, connections, stop)
        time.sleep(3.0)
        try:
            yield
        finally:
            stop.set()
        dealing.result()


def _deal(port: int, blow: Callable[[int], None], connections: int, stop: Event) -> None:
    def deal() -> None:
        while not stop.is_set():
            with suppress(OSError, http.client.HTTPException):
                blow(port)

    with ThreadPoolExecutor(connections) as threads:
        for each in [threads.submit(deal) for _ in range(connections)]:
            each.result()


# Attacks


def _bodies(port: int, _pid: int) -> list[Row]:
    mesh = Client(port).upload_sample("sphere", 5_000)
    client, starts = Client(port, OTHERS), count()

    def p50() -> tuple[float, float]:
        large, small = [], []
        for _ in range(ASKED):
            start = next(starts) / 1000
            source = [{"vertex": 0, "start_distance": start}]
            large.append(
                _post(client, f"{mesh}/distances", {"sources": source, "targets": TARGETS})
            )
            small.append(_post(client, f"{mesh}/distances", {"sources": source, "targets": [1]}))
        if {status for status, _ in large + small} != {200}:
            raise RuntimeError("others are refused")
        return median(s for _, s in large), median(s for _, s in small)

    p50()
    alone = p50()
    with _attacked(port, _WrongBody(mesh), 6):
        attacked = p50()
    name = "six connections with bodies of 2.9 MB that are refused"
    return [
        (name, f"p50 of another's query of {what}, ms", f"{1e3 * b:.0f}, alone {1e3 * a:.0f}")
        for what, a, b in zip(("74 kB", "100 bytes"), alone, attacked, strict=True)
    ]


class _WrongBody:
    """A blow: a body that is refused once all of it is checked."""

    def __init__(self, mesh: str) -> None:
        self._mesh = mesh

    def __call__(self, port: int) -> None:
        _post(Client(port), f"{self._mesh}/distances", WRONG, Content_Type="application/json")


def _bombs(port: int, pid: int) -> list[Row]:
    bomb, small = _packed(b"#" * 1000, 524_000), _packed(VERTEX, 11_000_000)
    scratch, headers = _store_of(pid) / "tmp", {"Content_Type": "model/obj"}
    peak = 0
    with ThreadPoolExecutor(4) as threads:
        sent: list[Future[tuple[int, float]]] = [
            threads.submit(
                _post, Client(port), "/v1/meshes", bomb, Content_Encoding="gzip", **headers
            )
            for _ in range(4)
        ]
        while not all(each.done() for each in sent):
            peak = max(peak, _bytes_in(scratch))
            time.sleep(0.01)
    statuses = sorted(each.result()[0] for each in sent)
    status, seconds = _post(Client(port), "/v1/meshes", small, **headers)
    return [
        (
            f"four uploads of {len(bomb) / MIB:.1f} MiB at once",
            "peak of scratch, MiB; statuses",
            f"{peak / MIB:.0f}; {', '.join(map(str, statuses))}",
        ),
        (
            f"a packed file of {len(small) / 1e3:.0f} kB",
            "seconds until it is refused; status",
            f"{seconds:.2f}; {status}",
        ),
    ]


def _vertices(port: int, _pid: int) -> list[Row]:
    packed = _packed(VERTEX, 3_000_000)
    client, start = Client(port), time.perf_counter()
    response, body = client.ask("/v1/meshes", packed, {"Content-Type": "model/obj"}, "POST")
    if response.status == 201:
        matrix = {"sources": [0], "targets": "all"}
        link = f"/v1/meshes/{json.loads(body)['id']}/matrix?format=npy"
        client.ask(link, matrix)
    return [
        (
            f"{len(packed) / 1e3:.0f} kB with three million vertices and a face",
            "seconds of upload and a matrix of 1 × all; status",
            f"{time.perf_counter() - start:.1f}; {response.status}",
        )
    ]


def _short_deadlines(port: int, _pid: int) -> list[Row]:
    before = _metric(port, "geodesic_workers_lost_total")
    for i in range(5):
        link = f"/v1/meshes?sample=terrain&faces={4_000_000 + i}"
        _post(Client(port), link, b"", X_Timeout_Ms="50")
    end = time.monotonic() + 120
    while _metric(port, 'geodesic_workers{state="busy"}') and time.monotonic() < end:
        time.sleep(0.2)
    time.sleep(3.0)  # a worker that is killed is counted a little later
    lost = _metric(port, "geodesic_workers_lost_total") - before
    return [("five samples of 4,000,000 faces within 50 ms", "workers killed", f"{lost:.0f}")]


def _head(port: int, _pid: int) -> list[Row]:
    data, sent = b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * MIB, 0
    with socket.create_connection(("127.0.0.1", port), 1.5) as connection, suppress(OSError):
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            sent += connection.send(data)
    what = "MiB that the service and its socket take"
    return [("a head without end", what, f"{sent / MIB:.1f}")]


def _ranges(port: int, _pid: int) -> list[Row]:
    rows: list[Row] = []
    client = Client(port)
    link = f"{client.upload_sample('plane', 200)}/path?from=0&to=9"
    for header, item, times in (("Accept", "a/b", 6_500), ("Accept-Encoding", "a", 8_000)):
        seconds, statuses = [], set()
        for i in range(ASKED):
            start = time.perf_counter()
            value = ",".join([item] * times + [f"x/{i}"])
            statuses.add(client.ask(link, None, {header: value})[0].status)
            seconds.append(time.perf_counter() - start)
        name = f"{times:,} items in {header}"
        rows.append(
            (
                name,
                "p50 of the request, ms; status",
                f"{1e3 * median(seconds):.1f}; {statuses.pop()}",
            )
        )
    return rows


def _sites(port: int, _pid: int) -> list[Row]:
    status, _ = _post(Client(port), "/v1/meshes?sample=plane", b"", Sec_Fetch_Site="cross-site")
    return [("a browser's upload for another site, without `Origin`", "status", str(status))]


def _races(port: int, _pid: int) -> list[Row]:
    """Cancel jobs, twice at once, as they finish."""
    client = Client(port)
    link = f"{client.upload_sample('plane', 2_000)}/distances"
    asking = {"Prefer": "respond-async"}
    lost = 0

    def cancel(job: str) -> None:
        other = Client(port)
        if other.ask(f"{job}/cancel", b"", {}, "POST")[0].status in (404, 405):
            other.ask(job, None, {}, "DELETE")  # which does both, in older versions

    with ThreadPoolExecutor(2) as threads:
        for i in range(RACES):
            response, _ = client.ask(
                link, {"sources": [{"vertex": 0, "start_distance": i}]}, asking
            )
            job = response.headers["Location"]
            list(threads.map(cancel, [job] * 2))
            lost += client.ask(job)[0].status == 404
    return [(f"{RACES} jobs, cancelled twice as they finish", "jobs that are gone", f"{lost}")]


def _lists(port: int, _pid: int) -> list[Row]:
    client = Client(port)
    for i in range(400):
        corners = [[0, 0, 0], [1, 0, 0], [0, 1, i + 1]]
        client.get("/v1/meshes", {"vertices": corners, "faces": [[0, 1, 2]]})
    waits: list[float] = []
    others = Client(port, OTHERS)
    with ThreadPoolExecutor(1) as thread:
        for _ in range(ASKED):
            listing = thread.submit(client.get, "/v1/meshes?limit=1000")
            while not listing.done():
                start = time.perf_counter()
                others.get("/livez")
                waits.append(time.perf_counter() - start)
    return [("lists of 400 meshes", "longest wait for `/livez`, ms", f"{1e3 * max(waits):.0f}")]


def _answers(port: int, _pid: int) -> list[Row]:
    client = Client(port)
    headers = {**KEYS["alice"], "Content-Type": "application/octet-stream"}
    _, body = client.ask("/v1/meshes?sample=plane&faces=20000", b"", headers, "POST")
    link = f"/v1/meshes/{json.loads(body)['id']}/distances?format=npy"

    def job(name: str, start: int) -> str:
        asking = {**KEYS[name], "Prefer": "respond-async"}
        query = {"sources": [{"vertex": 0, "start_distance": start}]}
        response, body = client.ask(link, query, asking)
        if response.status != 202:
            return f"refused with {response.status}"
        while (state := json.loads(body))["status"] in ("accepted", "running"):
            _, body = client.ask(response.headers["Location"], None, KEYS[name])
        return str(state["status"])

    own = [job("alice", i) for i in range(40)]
    return [
        ("40 jobs of one key", "those answered", str(own.count("successful"))),
        ("40 jobs of one key", "then the job of another key", job("bob", 99)),
    ]


def _forged_names(port: int, _pid: int) -> list[Row]:
    client = Client(port)
    statuses = [
        client.ask("/v1", None, {"X-Forwarded-For": f"10.9.9.{i}"})[0].status for i in range(8)
    ]
    return [
        (
            "eight requests under forged addresses, three a minute allowed",
            "those answered",
            str(statuses.count(200)),
        )
    ]


def _store_of(pid: int) -> Path:
    variables = Path(f"/proc/{pid}/environ").read_bytes().decode().split("\0")
    return Path(next(each for each in variables if each.startswith("GEODESIC_STORE="))[15:])


def _bytes_in(folder: Path) -> int:
    total = 0
    for path in folder.rglob("*"):
        with suppress(OSError):
            total += path.stat().st_size if path.is_file() else 0
    return total

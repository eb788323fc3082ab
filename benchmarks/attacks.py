"""The service under attack: how long others wait, and what the attack costs."""

import gzip
import http.client
import json
import re
import socket
import struct
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import partial
from itertools import count
from multiprocessing import Manager
from random import Random
from statistics import median
from threading import Event
from typing import Any

from benchmarks import greed
from benchmarks.inputs import Inputs
from benchmarks.serving import Client, serving
from benchmarks.tables import Section, rated

SECONDS = 6.0
"""Seconds of each attack"""
SMALL_FACES = 5_000
MOST_LIVENESS_MS, MOST_SLOWER = 100.0, 10.0
MIB = 2**20
OTHERS = "127.0.0.2"
"""Address of those who do not attack; connections are limited by address"""

Attack = Callable[[int], None]
"""One blow to the service on a port; it is dealt again and again"""


def run(_inputs: Inputs, _runs: int) -> Sequence[Section]:
    """Attack the service: by floods, and by greed."""
    return _floods(), greed.run()


def _floods() -> Section:
    """Attack the service in several ways, one after the other, by two processes each."""
    rows = []
    with (
        serving(GEODESIC_WORKERS="2") as port,
        ProcessPoolExecutor(2) as pool,
        Manager() as manager,
    ):
        client = Client(port)
        small = client.upload_sample("sphere", SMALL_FACES)
        sources = iter(count())
        _measure(port, small, sources)  # brings the mesh into the workers
        liveness, paths = _measure(port, small, sources)
        usual_s = median(paths)
        rows.append(["nothing", *_cells(liveness, paths, usual_s), _memory(port)])
        for name, attack in ATTACKS.items():
            stop = manager.Event()
            blows = [pool.submit(_attack, attack, port, stop) for _ in range(2)]
            try:
                time.sleep(0.5)
                liveness, paths = _measure(port, small, sources)
            finally:
                stop.set()
            for each in blows:
                each.result()
            rows.append([name, *_cells(liveness, paths, usual_s), _memory(port)])
    return Section(
        "Attacks",
        f"Two processes attack for {SECONDS:g} s, on the same cores. Meanwhile one client asks for "
        f"`/livez`, at most {MOST_LIVENESS_MS:g} ms each, and another one for exact paths between "
        f"random vertices of a sphere of {SMALL_FACES:,} faces, at most {MOST_SLOWER:g} times as "
        f"long as without an attack.",
        ["attack", "livez p50, ms", "livez max, ms", "path p50, ms", "slower", "API process, MiB"],
        rows,
    )


def _cells(liveness: Sequence[float], paths: Sequence[float], usual_s: float) -> list[str]:
    return [
        f"{1e3 * median(liveness):.1f}",
        rated(1e3 * max(liveness), MOST_LIVENESS_MS, at_least=False, digits=0),
        f"{1e3 * median(paths):.1f}",
        rated(median(paths) / usual_s, MOST_SLOWER, at_least=False, digits=1),
    ]


def _measure(port: int, mesh: str, sources: Any) -> tuple[list[float], list[float]]:
    """Return the seconds of each request for `/livez`, and of each for a path."""
    dice = Random(next(sources))  # noqa: S311 - the same questions in each run
    end = time.monotonic() + SECONDS

    def paths() -> list[float]:
        client, times = Client(port, OTHERS), []
        while time.monotonic() < end:
            a, b = dice.sample(range(SMALL_FACES // 2), 2)
            times.append(_seconds(client, f"{mesh}/path?from=v{a}&to=v{b}"))
        return times

    with ThreadPoolExecutor(1) as thread:
        others, client, times = thread.submit(paths), Client(port, OTHERS), []
        while time.monotonic() < end:
            times.append(_seconds(client, "/livez"))
            time.sleep(0.02)
        return times, others.result()


def _seconds(client: Client, path: str) -> float:
    start = time.perf_counter()
    client.get(path)
    return time.perf_counter() - start


def _memory(port: int) -> str:
    metrics = Client(port, OTHERS).get("/metrics").decode()
    found = re.search(r'geodesic_resident_memory_bytes{process="api"} ([\d.e+]+)', metrics)
    return f"{float(found[1]) / MIB:.0f}" if found else ""


def _attack(attack: Attack, port: int, stop: Event) -> None:
    while not stop.is_set():
        with suppress(OSError, http.client.HTTPException):
            attack(port)


# Attacks


def _send(port: int, data: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), 30) as connection:
        with suppress(OSError):
            connection.sendall(data)
        connection.recv(1000)


def _endless(data: bytes) -> bytes:
    return b"GET / HTTP/1.1\r\nHost: localhost\r\n" + data * (8 * MIB // len(data))


LONG_HEADER, SHORT_HEADERS = _endless(b"a"), _endless(b"a:b\r\n")
LONG_ADDRESS = b"GET /" + b"a" * (8 * MIB)
CHUNKS = (
    b"POST /v1/meshes?format=obj HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n"
    + b"8\r\naaaaaaaa\r\n" * MIB
    + b"0\r\n\r\n"
)
PIPELINE = b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n" * 50_000
SOURCES = {n: b'{"sources":[' + b"1," * (n - 1) + b"1]}" for n in (599_000, 2_000_000)}
BOMB = gzip.compress(bytes(600 * MIB), 9)


def _half_open(port: int) -> None:
    """Hold heads that are never completed, as many as the service admits."""
    with ExitStack() as stack:
        for _ in range(300):
            connection = socket.create_connection(("127.0.0.1", port), 30)
            stack.enter_context(connection)
            connection.sendall(b"GET / HTTP/1.1\r\n")
        time.sleep(1.0)


def _slow_readers(port: int) -> None:
    """Ask for large answers, and read nothing of them."""
    with ExitStack() as stack:
        for _ in range(50):
            connection = stack.enter_context(socket.socket())
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            connection.connect(("127.0.0.1", port))
            connection.sendall(b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n")
        time.sleep(1.0)


def _bad_query(sources: int, port: int) -> None:
    headers = {"Content-Type": "application/json"}
    Client(port).ask("/v1/meshes/0/distances", SOURCES[sources], headers, "POST")


def _bomb(port: int) -> None:
    headers = {"Content-Type": "model/obj", "Content-Encoding": "gzip"}
    Client(port).ask("/v1/meshes", BOMB, headers, "POST")


def _deep_scene() -> bytes:
    nodes = [*({"mesh": 0, "children": [i + 1]} for i in range(90_000)), {"mesh": 0}]
    part = {"attributes": {"POSITION": 0}}
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [{"primitives": [part]}],
        "buffers": [{"byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    points = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(points), b"BIN\0") + points
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


SCENE = _deep_scene()


def _deep(port: int) -> None:
    Client(port).ask("/v1/meshes?format=glb", SCENE, {}, "POST")


def _long_header(port: int) -> None:
    _send(port, LONG_HEADER)


def _short_headers(port: int) -> None:
    _send(port, SHORT_HEADERS)


def _long_address(port: int) -> None:
    _send(port, LONG_ADDRESS)


def _chunks(port: int) -> None:
    _send(port, CHUNKS)


def _pipeline(port: int) -> None:
    _send(port, PIPELINE)


ATTACKS: dict[str, Attack] = {
    "two million wrong sources": partial(_bad_query, 2_000_000),
    "as many as are read": partial(_bad_query, 599_000),
    "a header without end": _long_header,
    "short headers without end": _short_headers,
    "an address without end": _long_address,
    "300 half-open heads each": _half_open,
    "chunks of eight bytes": _chunks,
    "50,000 pipelined requests": _pipeline,
    "50 slow readers each": _slow_readers,
    "a gzip bomb": _bomb,
    "a deep GLB scene": _deep,
}

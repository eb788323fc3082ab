"""What HTTP costs over the solve: upload, and distances as JSON and as npy, also a million."""

import http.client
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from statistics import median

import numpy as np
import orjson

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, verdict
from benchmarks.timing import timed

NAME = "horse97k.ply"
SERVE = "from app.cli import main; main()"
"""What the console script `geodesic` runs; it may not be on the path."""

UPLOAD_S = 2.0
OVERHEAD = {"application/json": 25.0, "application/x-npy": 10.0}
"""Percent over the solve, at most, by media type."""
LARGE_FACES = 2_000_000
LARGE = {"application/json": 2.0, "application/x-npy": 200.0}
"""How many times the seconds of orjson encoding may take; how many MB a second it has to be."""


def run(inputs: Inputs, runs: int) -> Section:
    """Upload a mesh, then ask for its distances and solve the same in this process, by turns."""
    path = inputs.folder / NAME
    rows: list[list[str]] = []
    if path.exists():
        gc.warm_up()
        mesh, body = gc.load_mesh(path), path.read_bytes()
        with _service() as connection:
            upload_s, created = timed(
                partial(_post, connection, "/v1/meshes?format=ply", body, "application/json")
            )
            target = verdict(upload_s, UPLOAD_S, at_least=False, unit=" s")
            rows.append([f"upload of {NAME}", f"{upload_s:.4f}", "", "", target])
            query = f"/v1/meshes/{json.loads(created)['id']}/distances"
            rows += [_overhead(connection, query, kind, mesh, runs) for kind in OVERHEAD]
    else:
        print(f"{NAME}: not in the meshes folder, left out")
    return Section(
        "HTTP",
        f"One client on loopback, medians of {runs}; the solve is `exact_distance` of the same "
        f"source in the benchmark's own process, by turns with the request.",
        ["request", "seconds", "solve, s", "overhead, %", "target"],
        rows,
    )


def run_large(_inputs: Inputs, runs: int) -> Section:
    """Ask for a million distances, and have orjson write the same in this process, by turns."""
    with _service() as connection:
        made = _post(connection, f"/v1/meshes?sample=plane&faces={LARGE_FACES}", b"", "*/*")
        query = f"/v1/meshes/{json.loads(made)['id']}/distances"
        rows = [_large(connection, query, media_type, runs) for media_type in LARGE]
    return Section(
        "Large answers over HTTP",
        f"A million distances to one client on loopback, medians of {runs}; beyond the solve "
        "are encoding into a file of the store, sending and reading. orjson writes the same "
        "numbers at once, by turns with the requests.",
        [
            "answer",
            "MB",
            "encode, s",
            "beyond the solve, s",
            "MB/s",
            "orjson, s",
            "target",
        ],
        rows,
    )


def _large(
    connection: http.client.HTTPConnection, query: str, media_type: str, runs: int
) -> list[str]:
    encodes, requests, bare = [], [], []
    size = 0
    for source in range(-1, runs):  # the first brings the mesh into the worker's memory
        asked = {"sources": [{"vertex": source + 1}], "method": "approximate"}
        body = json.dumps({**asked, "relative_error": 0.1}).encode()
        seconds, (answer, phases) = timed(partial(_answer, connection, query, body, media_type))
        size = len(answer)
        encodes.append(phases["encode"])
        requests.append(seconds - sum(phases.values()) + phases["encode"])
        if media_type == "application/json":
            distances = np.array(orjson.loads(answer)["distances"])
        else:
            distances = np.frombuffer(answer, "<f8", offset=len(answer) % 8 + 128)
        bare.append(timed(partial(orjson.dumps, distances, option=orjson.OPT_SERIALIZE_NUMPY))[0])
    encode_s, request_s, bare_s = (median(each[1:]) for each in (encodes, requests, bare))
    rate = size / request_s / 1e6
    if media_type == "application/json":
        target = verdict(encode_s / bare_s, LARGE[media_type], at_least=False, unit=" × orjson")
    else:
        target = verdict(rate, LARGE[media_type], at_least=True, unit=" MB/s")
    seconds = [f"{each:.4f}" for each in (encode_s, request_s)]
    return [media_type, f"{size / 1e6:.1f}", *seconds, f"{rate:.0f}", f"{bare_s:.4f}", target]


def _overhead(
    connection: http.client.HTTPConnection,
    query: str,
    media_type: str,
    mesh: gc.TriangleMesh,
    runs: int,
) -> list[str]:
    requests, solves = [], []
    for source in range(-1, runs):  # the first brings the mesh into the worker's memory
        body = json.dumps({"sources": [{"vertex": source + 1}]}).encode()
        requests.append(timed(partial(_post, connection, query, body, media_type))[0])
        solves.append(timed(partial(gc.exact_distance, mesh, source + 1))[0])
    request_s, solve_s = median(requests[1:]), median(solves[1:])
    percent = 100 * (request_s / solve_s - 1)
    target = verdict(percent, OVERHEAD[media_type], at_least=False, unit=" %")
    name = f"distances, {media_type}"
    return [name, f"{request_s:.4f}", f"{solve_s:.4f}", f"{percent:.1f}", target]


@contextmanager
def _service() -> Iterator[http.client.HTTPConnection]:
    """Serve on a free port of the loopback interface, with a store of its own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as store:
        command = [sys.executable, "-c", SERVE, "serve", "--port", str(port)]
        environment = {**os.environ, "GEODESIC_STORE": store}
        server = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
        try:
            _wait_until_ready(port, server)
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120)
            yield connection
            connection.close()
        finally:
            server.terminate()
            server.wait(30)


def _wait_until_ready(port: int, server: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 120
    while server.poll() is None and time.monotonic() < end:
        probe = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
        try:
            probe.request("GET", "/readyz")
            if probe.getresponse().status == 200:
                return
        except OSError:
            pass
        finally:
            probe.close()
        time.sleep(0.1)
    raise RuntimeError("the service did not become ready")


def _post(connection: http.client.HTTPConnection, path: str, body: bytes, media_type: str) -> bytes:
    return _answer(connection, path, body, media_type)[0]


def _answer(
    connection: http.client.HTTPConnection, path: str, body: bytes, media_type: str
) -> tuple[bytes, dict[str, float]]:
    """Return the body of an answer, and the seconds of its phases."""
    content_type = "application/json" if body.startswith(b"{") else "application/octet-stream"
    headers = {"Content-Type": content_type, "Accept": media_type}
    connection.request("POST", path, body, headers)
    response = connection.getresponse()
    answer = response.read()
    if response.status not in (200, 201):
        raise RuntimeError(f"{path} answered {response.status}: {answer[:500]!r}")
    phases = re.findall(r"(\w+);dur=([\d.]+)", response.headers.get("server-timing", ""))
    return answer, {name: float(milliseconds) / 1e3 for name, milliseconds in phases}

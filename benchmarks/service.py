"""What HTTP costs over the solve: upload, and distances as JSON and as npy."""

import http.client
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from statistics import median

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
    content_type = "application/json" if body.startswith(b"{") else "application/octet-stream"
    headers = {"Content-Type": content_type, "Accept": media_type}
    connection.request("POST", path, body, headers)
    response = connection.getresponse()
    answer = response.read()
    if response.status not in (200, 201):
        raise RuntimeError(f"{path} answered {response.status}: {answer[:500]!r}")
    return answer

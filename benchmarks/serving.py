"""A service to measure, in processes of its own, and a minimal client."""

import http.client
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

SERVE = "from app.cli import main; main()"
"""The code of the console script `geodesic`, which may not be on the path."""


@contextmanager
def serving(**settings: str) -> Iterator[int]:
    """Serve on a free port of the loopback interface, with a store of its own; yield the port."""
    with serving_process(**settings) as (port, _):
        yield port


@contextmanager
def serving_process(**settings: str) -> Iterator[tuple[int, int]]:
    """Serve likewise; yield the port, and the id of the process."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as store:
        command = [sys.executable, "-c", SERVE, "serve", "--port", str(port)]
        environment = {**os.environ, "GEODESIC_STORE": store, **settings}
        server = subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            _wait_until_ready(port, server)
            yield port, server.pid
        finally:
            server.terminate()
            server.wait(30)


class Client:
    """A persistent connection, from a loopback address."""

    def __init__(self, port: int, address: str = "127.0.0.1") -> None:
        self._connection = http.client.HTTPConnection(
            "127.0.0.1", port, timeout=300, source_address=(address, 0)
        )

    def ask(
        self, path: str, body: Any = None, headers: Mapping[str, str] = {}, method: str = ""
    ) -> tuple[http.client.HTTPResponse, bytes]:
        """Send a request, by default a POST where there is a body, and read the answer."""
        sent = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        kind = "application/octet-stream" if isinstance(body, bytes) else "application/json"
        method = method or ("GET" if body is None else "POST")
        self._connection.request(method, path, sent, {"Content-Type": kind, **headers})
        response = self._connection.getresponse()
        return response, response.read()

    def get(self, path: str, body: Any = None, headers: Mapping[str, str] = {}) -> bytes:
        """Send a request; fail unless the answer is a success."""
        response, answer = self.ask(path, body, headers)
        if response.status not in (200, 201):
            raise RuntimeError(f"{path} answered {response.status}: {answer[:500]!r}")
        return answer

    def upload_sample(self, name: str, faces: int) -> str:
        """Have a sample made; return its address."""
        made = json.loads(self.get(f"/v1/meshes?sample={name}&faces={faces}", b""))
        return f"/v1/meshes/{made['id']}"

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def phases_of(response: http.client.HTTPResponse) -> dict[str, float]:
    """Return the seconds of each phase that an answer states."""
    phases = re.findall(r"(\w+);dur=([\d.]+)", response.headers.get("server-timing", ""))
    return {name: float(milliseconds) / 1e3 for name, milliseconds in phases}


def _wait_until_ready(port: int, server: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 300
    while server.poll() is None and time.monotonic() < end:
        client = Client(port)
        try:
            if client.ask("/readyz")[0].status == 200:
                time.sleep(5)  # the worker for small work comes last
                return
        except OSError:
            pass
        finally:
            client.close()
        time.sleep(0.1)
    raise RuntimeError("the service did not become ready")

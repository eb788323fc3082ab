"""A cluster of processes on this machine: a head, nodes, and services that are its clients."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import psutil

from tests.support.paths import ROOT
from tests.support.processes import Server, workers_of
from tests.support.waiting import wait_until

TOKEN = "a-token-of-tests-only"  # noqa: S105 - of no other use
HEAD = "127.0.0.2"
"""Of this machine, as Ray leaves it: 127.0.0.1 it would replace"""
RAY_START = [sys.executable, "-m", "ray.scripts.scripts", "start", "--block", "--num-cpus=0"]
OPTIONS = ["--object-store-memory=80000000", "--min-worker-port=0", "--max-worker-port=0"]
OPTIONS += ["--include-log-monitor=false", "--disable-usage-stats"]


def variables_of_ray() -> dict[str, str]:
    """Return the variables that the documents have users set."""
    lines = (ROOT / "docker" / "ray.env").read_text().splitlines()
    return dict(line.split("=", 1) for line in lines if line and line[0] != "#")


class Node:
    """Ray on a machine: all processes below one command."""

    def __init__(self, options: Sequence[str], log: Path, settings: dict[str, str]) -> None:
        self._options, self._log, self._settings = options, log, settings
        self._start()
        wait_until(self._has_started)

    def _start(self) -> None:
        with self._log.open("wb") as output:
            self.process = subprocess.Popen(  # noqa: S603 - this Python
                [*RAY_START, *OPTIONS, *self._options],
                env=os.environ | self._settings,
                cwd=ROOT,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def _has_started(self) -> bool:
        if self.process.poll() is not None:  # it gives itself 30 s, too few on a busy machine
            self._start()
        return "Ray runtime started" in self._log.read_text()

    def tree(self) -> list[psutil.Process]:
        """Return the process and all below it."""
        top = psutil.Process(self.process.pid)
        return [top, *top.children(recursive=True)]

    def named(self, name: str) -> psutil.Process:
        """Return the process with a name, such as that of an actor."""
        (found,) = (each for each in self.tree() if name in _name_of(each))
        return found

    def workers(self) -> set[int]:
        """Return the ids of the workers of its host."""
        return set[int]().union(*(workers_of(each.pid) for each in self.tree()))

    def kill(self) -> None:
        """Kill all processes at once, as if the machine had lost its power."""
        tree = self.tree()
        for each in tree:
            each.send_signal(signal.SIGSTOP)  # none sees another one end
        for each in tree:
            each.kill()
        self.process.wait()

    def end(self) -> None:
        """End in order."""
        self.process.terminate()
        self.process.wait()


def _name_of(process: psutil.Process) -> str:
    return " ".join(process.cmdline())


class ProcessCluster:
    """The processes of a cluster, whose machines share one store."""

    def __init__(self, store: Path | str, folder: Path, **settings: str) -> None:
        self.folder, self.store = folder, store
        self.settings = {
            **variables_of_ray(),
            "RAY_AUTH_TOKEN": TOKEN,
            "GEODESIC_STORE": str(store),
            "GEODESIC_WORKERS": "1",
            **settings,
        }
        self.nodes: list[Node] = []
        self.servers: list[Server] = []
        self._stores: list[subprocess.Popen[bytes]] = []
        with socket.socket() as probe:
            probe.bind((HEAD, 0))
            port = probe.getsockname()[1]
        self._address = f"{HEAD}:{port}"
        records = {"RAY_gcs_storage": "rocksdb", "RAY_gcs_storage_path": str(folder / "records")}
        head = [
            "--head",
            f"--port={port}",
            f"--node-ip-address={HEAD}",
            "--include-dashboard=false",
            "--no-monitor",
        ]
        self.head = self._start("h", head, records)

    @property
    def of_services(self) -> dict[str, str]:
        """The settings of a client of the cluster."""
        return {"GEODESIC_ENGINE": "ray", "RAY_ADDRESS": self._address}

    def _start(self, name: str, options: Sequence[str], settings: dict[str, str]) -> Node:
        folder = f"--temp-dir={self.folder / name}"
        return Node([*options, folder], self.folder / f"{name}.log", self.settings | settings)

    def add_node(self) -> Node:
        """Have a machine join; its host is there some seconds later."""
        number = len(self.nodes)
        options = [f"--address={self._address}", f"--node-ip-address=127.0.0.{3 + number}"]
        options.append(f"--resources={json.dumps({'geodesic': 1})}")
        own = {"GEODESIC_COPIES": str(self.folder / f"copies{number}")}
        node = self._start(f"n{number}", options, own)
        self.nodes.append(node)
        return node

    def living(self) -> list[Node]:
        """Return the nodes that run."""
        return [node for node in self.nodes if node.process.poll() is None]

    def named(self, name: str) -> psutil.Process:
        """Return the process with a name, on whatever machine it is."""
        nodes = [self.head, *self.living()]
        (found,) = (each for node in nodes for each in node.tree() if name in _name_of(each))
        return found

    def kill_head(self) -> tuple[list[str], dict[str, str]]:
        """Kill the control store; return its command and environment.

        What has started it would end the rest: this machine's part of Ray, which services use.
        """
        self.head.process.send_signal(signal.SIGSTOP)
        store = self.head.named("gcs_server")
        again = store.cmdline(), store.environ()
        store.kill()
        return again

    def start_head_again(self, again: tuple[list[str], dict[str, str]]) -> None:
        """Start the control store anew."""
        command, environment = again
        self._stores.append(subprocess.Popen(command, env=environment))  # noqa: S603 - Ray's own

    def serve(self, log: Path | None = None, **settings: str) -> Server:
        """Start a service that is a client of the cluster."""
        given = self.settings | self.of_services | settings
        server = Server(self.store, log=log, **given)  # type: ignore[arg-type] # all are settings
        self.servers.append(server)
        return server

    def close(self) -> None:
        for server in self.servers:
            server.close()
        for node in (*self.living(), self.head):
            if node.process.poll() is None:
                node.kill()
        for store in self._stores:
            store.kill()
            store.wait()


@contextmanager
def running_cluster(store: Path | str, **settings: str) -> Iterator[ProcessCluster]:
    """Run a head inside the block; nodes and services are added."""
    with tempfile.TemporaryDirectory(prefix="g", ignore_cleanup_errors=True) as folder:
        cluster = ProcessCluster(store, Path(folder), **settings)
        try:
            yield cluster
        finally:
            cluster.close()

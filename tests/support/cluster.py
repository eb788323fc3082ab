"""A cluster of processes on this machine: a head, nodes, and replicas of the service."""

import os
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import psutil

from tests.support.paths import ROOT
from tests.support.processes import COMMAND_LINE, Server, workers_of
from tests.support.waiting import wait_until

HOST = "127.0.0.2"
"""Of this machine, as Ray leaves it: 127.0.0.1 it would replace"""
TOKEN = "a-token-of-tests-only"  # noqa: S105 - of no other use


class Command:
    """A command that says a line when it works, or when it cannot."""

    def __init__(self, arguments: Sequence[str], log: Path, settings: dict[str, str]) -> None:
        self._log = log
        with log.open("wb") as output:
            self.process = subprocess.Popen(  # noqa: S603 - this Python
                [*COMMAND_LINE, *arguments],
                env=os.environ | settings,
                cwd=ROOT,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def wait(self) -> "Command":
        """Wait until the command has said something, or has ended."""
        wait_until(lambda: self.said or self.process.poll() is not None)
        return self

    @property
    def said(self) -> str:
        return self._log.read_text()

    def tree(self) -> list[psutil.Process]:
        """Return the process and all below it."""
        return tree_of(self.process)

    def workers(self) -> set[int]:
        """Return the ids of the workers of a node."""
        found: set[int] = set()
        for process in self.tree():
            found |= workers_of(process.pid)
        return found

    def kill(self) -> None:
        """Kill all processes at once."""
        kill_at_once(self.process)

    def end(self) -> int:
        """Have the command end in order; return its exit code."""
        self.process.terminate()
        return self.process.wait()


class ProcessCluster:
    """The processes of a cluster, whose machines share one store."""

    def __init__(self, store: Path, folder: Path, **settings: str) -> None:
        with socket.socket() as probe:
            probe.bind((HOST, 0))
            self.port = probe.getsockname()[1]
        self.folder = folder
        self.settings = {
            "GEODESIC_STORE": str(store),
            "GEODESIC_ADDRESS": f"{HOST}:{self.port}",
            "GEODESIC_CLUSTER_TOKEN": TOKEN,
            "GEODESIC_WORKERS": "1",
            **settings,
        }
        self.store = store
        self.nodes: list[Command] = []
        self.servers: list[Server] = []
        self.head = self.start_head()

    def start_head(self) -> Command:
        arguments = ["head", "--host", HOST, "--port", str(self.port)]
        return self.run(*arguments, "--dir", str(self.folder / "h")).wait()

    def run(self, *arguments: str, **settings: str) -> Command:
        log = self.folder / f"{len(list(self.folder.glob('*.log')))}.log"
        return Command(arguments, log, self.settings | settings)

    def add_node(self) -> Command:
        """Start a node; it joins some seconds later."""
        node = self.run("node", "--dir", str(self.folder / f"n{len(self.nodes)}"))
        self.nodes.append(node)
        return node

    def living(self) -> list[Command]:
        """Return the nodes that run."""
        return [node for node in self.nodes if node.process.poll() is None]

    def serve(self) -> Server:
        settings = self.settings | {"GEODESIC_ENGINE": "ray"}
        server = Server(self.store, **settings)  # type: ignore[arg-type] # all are settings
        self.servers.append(server)
        return server

    def close(self) -> None:
        for server in self.servers:
            if server.process.poll() is None:
                server.process.terminate()  # so that its part of Ray ends as well
                server.process.wait()
            server.close()
        for command in (*self.nodes, self.head):
            if command.process.poll() is None:
                command.end()


def tree_of(process: "subprocess.Popen[bytes]") -> list[psutil.Process]:
    """Return a process and all below it."""
    top = psutil.Process(process.pid)
    return [top, *top.children(recursive=True)]


def kill_at_once(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process and all below it, as if the machine had lost its power."""
    tree = tree_of(process)
    for each in tree:
        each.send_signal(signal.SIGSTOP)  # none sees another one end
    for each in tree:
        each.kill()
    process.wait()


@contextmanager
def running_cluster(store: Path, **settings: str) -> Iterator[ProcessCluster]:
    """Run a head inside the block; nodes and replicas are added."""
    store.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="g", ignore_cleanup_errors=True) as folder:
        cluster = ProcessCluster(store, Path(folder), **settings)
        try:
            yield cluster
        finally:
            cluster.close()

"""The service as a process of its own, and processes as the system shows them."""

import os
import signal
import socket
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import httpx2
import psutil

from tests.support.paths import ROOT
from tests.support.waiting import LONG_S, wait_until

COMMAND_LINE = [sys.executable, "-c", "from app.cli import main; main()"]
"""``geodesic`` of this checkout; arguments follow."""


class Server:
    """A service that listens, with one worker and the one for small work; settings are text.

    Its log goes to where that of the tests goes, or to the file ``log``.
    """

    def __init__(
        self,
        store: Path,
        *,
        waits_for_workers: bool = True,
        log: Path | None = None,
        **settings: str,
    ) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.store = store
        own = {"GEODESIC_STORE": str(store), "GEODESIC_WORKERS": "1"}
        own |= {"GEODESIC_DEADLINE_S": str(LONG_S)} | settings
        with nullcontext() if log is None else log.open("wb") as stderr:
            self.process = subprocess.Popen(  # noqa: S603 - this Python, and the text above
                [*COMMAND_LINE, "serve", "--port", str(port)],
                env=os.environ | own,
                cwd=ROOT,
                stderr=stderr,
            )
        self.address = ("127.0.0.1", port)
        self.url = f"http://127.0.0.1:{port}"
        self.client = httpx2.Client(base_url=self.url, timeout=LONG_S)
        wait_until(self.is_ready if waits_for_workers else self.listens)

    def listens(self) -> bool:
        return self._answers("/livez")

    def is_ready(self) -> bool:
        assert self.process.poll() is None, "the service ended"
        return self._answers("/readyz")

    def _answers(self, path: str) -> bool:
        try:
            return bool(self.client.get(path).status_code == 200)
        except httpx2.TransportError:
            return False

    def metrics(self) -> list[str]:
        return self.client.get("/metrics").text.splitlines()

    def metric(self, name: str) -> float:
        """Return the value of a metric, with its labels as they are written; 0 without one."""
        values = (line.rpartition(" ") for line in self.metrics())
        return next((float(value) for found, _, value in values if found == name), 0.0)

    def workers(self) -> set[int]:
        return workers_of(self.process.pid)

    def both_workers(self) -> set[int]:
        wait_until(lambda: len(self.workers()) == 2)
        return self.workers()

    def connect(
        self,
        path: str,
        body: bytes,
        *,
        leave_out: int = 0,
        headers: Mapping[str, str] | None = None,
    ) -> socket.socket:
        """Post a JSON body on a connection of its own, but for the last bytes; await no answer."""
        own = {
            "Host": "localhost",
            "Content-Type": "application/json",
            "Content-Length": str(len(body)),
        }
        lines = [f"{name}: {value}\r\n" for name, value in {**own, **(headers or {})}.items()]
        head = f"POST {path} HTTP/1.1\r\n{''.join(lines)}\r\n"
        connection = socket.create_connection(self.address)
        connection.sendall(head.encode() + body[: len(body) - leave_out])
        return connection

    def begin_query(self, mesh_id: str) -> socket.socket:
        """Ask for distances; wait until a worker has been given the query, not for the answer."""
        body = b'{"sources": [{"vertex": 0}], "targets": [{"vertex": 1}]}'
        connection = self.connect(f"/v1/meshes/{mesh_id}/distances", body)
        wait_until(lambda: self.metric('geodesic_workers{state="busy"}') == 1)
        return connection

    def kill(self) -> None:
        """Kill the process, and wait until it is gone."""
        self.process.kill()
        self.process.wait()

    def close(self) -> None:
        """Kill the process, where it has not ended by itself."""
        self.client.close()
        if self.process.poll() is None:
            self.kill()


def refused_start(store: Path, *options: str, **settings: str) -> str:
    """Return what a service says that does not start."""
    ran = subprocess.run(  # noqa: S603 - this Python
        [*COMMAND_LINE, "serve", "--port", "0", *options],
        env=os.environ | {"GEODESIC_STORE": str(store)} | settings,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1, ran.stderr
    assert "Traceback" not in ran.stderr
    return " ".join(ran.stderr.split())


@contextmanager
def stopped(pids: Iterable[int]) -> Iterator[None]:
    """Have processes do nothing at all meanwhile; what they are given waits."""
    pids = set(pids)
    _send(signal.SIGSTOP, pids)
    try:
        yield
    finally:
        _send(signal.SIGCONT, pids)


def _send(number: signal.Signals, pids: Iterable[int]) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):  # it has just ended
            os.kill(pid, number)


@contextmanager
def slowed(pids: Callable[[], Iterable[int]]) -> Iterator[None]:
    """Have processes run for a tenth of the time, however fast the machine is."""
    over = threading.Event()

    def hold_up() -> None:
        while not over.wait(0.01):
            with stopped(pids()):
                over.wait(0.09)

    thread = threading.Thread(target=hold_up)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def workers_of(service: int) -> set[int]:
    """Return the ids of worker processes that the fork server of a process has forked."""
    return {pid for pid, (_, elder) in _running(b"geodesic-worker").items() if elder == service}


def compilers_of(service: int) -> set[int]:
    """Return the ids of processes that compile kernels for a process."""
    return {pid for pid, (parent, _) in _running(b"run_shared").items() if parent == service}


def _running(command: bytes) -> dict[int, tuple[int, int]]:
    """Return parents, and parents' parents, of processes by some text in their command lines."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if command in (entry / "cmdline").read_bytes():
                    parent = parent_of(int(entry.name))
                    found[int(entry.name)] = parent, parent_of(parent)
            except (FileNotFoundError, ProcessLookupError):
                continue
    return found


def parent_of(pid: int) -> int:
    return int(_status(pid)[1])


def is_running(pid: int) -> bool:
    try:
        return _status(pid)[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def are_gone(pids: Iterable[int]) -> bool:
    return not any(is_running(pid) for pid in pids)


def _status(pid: int) -> list[str]:
    """Return what ``/proc`` says after the name: the state, the parent, and so on."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def processor_time(pid: int) -> Counter[int]:
    """Return the nanoseconds that the threads of a process have had, by niceness above ours."""
    taken, own = Counter[int](), os.getpriority(os.PRIO_PROCESS, 0)
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
            niceness = int((thread / "stat").read_text().rpartition(")")[2].split()[16])
            taken[niceness - own] += int((thread / "schedstat").read_text().split()[0])
    return taken


def total_time(pids: Iterable[int]) -> int:
    """Return the nanoseconds that processes have had, in threads that have ended as well."""
    times = (psutil.Process(pid).cpu_times() for pid in pids)
    return round(1e9 * sum(time.user + time.system for time in times))

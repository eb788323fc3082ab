"""Ray on this machine: its processes, and the way into the cluster that they form.

Ray runs whatever it is sent. So each machine must know the cluster's token, which Ray checks at
each call; there is no dashboard; and no machine offers processors, so that nothing but hosts of
ours is placed on it.
"""

import ctypes
import json
import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from app.engine.cluster import ClusterError
from app.engine.head_records import FolderRecords, RedisRecords, in_redis
from app.queries import code_version
from app.settings import Settings, variable_of

NAMESPACE = "geodesic"

_START_S = 120.0
"""Time that Ray's processes get to start: 10 s on idle cores, and 40 s were seen on busy ones"""
_STOP_S = 10.0
_CONNECT_S = 5.0
_OBJECT_STORE_BYTES = 80_000_000
"""About the least that Ray accepts: our messages are small"""
_LONGEST_FOLDER = 40
"""Characters: a path of a Unix socket has 107, of which Ray's own names take up to 66"""
_RECONNECT_S = 86_400
"""Seconds without the head after which Ray ends a machine's processes; 60 unless set"""
_LOG = "ray.log"
_MADE_OF = "geodesic "
"""Begins the name of the resource that says which code a machine runs"""


@dataclass(frozen=True)
class Head:
    """A head that runs on this machine."""

    processes: "Processes"
    records: FolderRecords | RedisRecords

    def check(self) -> None:
        """Raise ``ClusterError`` where it has ended, or may no longer run."""
        self.processes.check()
        self.records.renew()


@contextmanager
def running_head(host: str, port: int, folder: Path, settings: Settings) -> Iterator[Head]:
    """Run Ray's control store at an address inside the block.

    Its records are in the Redis of the settings, or else in ``folder``.
    """
    _check_host(host)
    _check_free(host, port)
    # Of a head that was killed. With it, Ray takes other members on this machine for a head.
    (folder / "ray_current_cluster").unlink(missing_ok=True)
    options = ["--head", f"--node-ip-address={host}", f"--port={port}"]
    options += ["--include-dashboard=false", "--no-monitor"]  # which would scale a cluster
    with ExitStack() as stack:
        records: FolderRecords | RedisRecords = FolderRecords(folder / "records")
        if settings.redis is not None:
            records = stack.enter_context(in_redis(settings.redis, _token(settings)))
        options += records.options
        running = _running(options, folder, settings, records.environment)
        yield Head(stack.enter_context(running), records)


@contextmanager
def joined(folder: Path, settings: Settings) -> Iterator["Processes"]:
    """Make this machine a member of the cluster, and this process a client, inside the block.

    Raises
    ------
    ClusterError
        That is not possible; the message says why.
    """
    address = settings.address
    host, port = host_and_port(address)
    _check_host(host)
    own_address = _own_address(host, port)
    options = [f"--address={address}", f"--node-ip-address={own_address}"]
    with _running(options, folder, settings, {}) as processes:
        import ray

        on_end = signal.getsignal(signal.SIGTERM)
        ray.init(
            address,
            namespace=NAMESPACE,
            log_to_driver=False,
            logging_level=logging.ERROR,
            _node_ip_address=own_address,
            _temp_dir=str(folder.resolve()),
        )
        signal.signal(signal.SIGTERM, on_end)  # Ray has set one of its own
        _end_listener()
        try:
            _check_code(address)
            yield processes
        finally:
            ray.shutdown()


def _end_listener() -> None:
    """Have Ray's thread that prints errors of the cluster end once the head is away.

    It would ask again and again then, without a pause, and burn a core.
    """
    from ray._private.worker import global_worker

    global_worker.threads_stopped.set()


def host_and_port(address: str | None) -> tuple[str, int]:
    """Return the parts of an address ``H:P``; raises ``ClusterError`` where it is none."""
    try:
        parts = urlsplit(f"//{address or ''}")
        if parts.hostname and parts.port:
            return parts.hostname, parts.port
    except ValueError:
        pass
    raise ClusterError(
        f"{address!r} is not the address of a head: give --address H:P or set "
        f"{variable_of('address')}"
    )


class Processes:
    """The processes of Ray that belong to one folder."""

    def __init__(self, process: "subprocess.Popen[bytes]", log: Path) -> None:
        self._process = process
        self._log = log

    @property
    def are_alive(self) -> bool:
        """Whether none of them has ended: Ray ends all where one does."""
        return self._process.poll() is None

    def check(self) -> None:
        """Raise ``ClusterError`` where they have ended, which nobody asked for."""
        if not self.are_alive:
            raise ClusterError(f"Ray has stopped on this machine; see {self._log}")

    def wait_until_started(self, address: str) -> None:
        """Wait for Ray's word that it runs; raises ``ClusterError`` where it will not."""
        end = time.monotonic() + _START_S
        while True:
            said = self._log.read_text(errors="replace")
            for sign, meaning in _SIGNS.items():
                if sign in said:
                    versions = _versions_in(said, sign)
                    raise ClusterError(meaning.format(address=address, versions=versions))
            if "Ray runtime started" in said:
                return
            if not self.are_alive:
                last = said.strip().splitlines()[-1:] or ["it said nothing"]
                raise ClusterError(f"Ray does not start: {last[0]} (see {self._log})")
            if time.monotonic() > end:
                raise ClusterError(
                    f"Ray has not started within {_START_S:g} s: perhaps another program listens "
                    f"at {address}; see {self._log}"
                )
            time.sleep(0.05)

    def stop(self) -> None:
        """Tell them to end, and kill those that do not."""
        self._process.terminate()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


_SIGNS: Mapping[str, str] = {
    "InvalidAuthToken": "the cluster at {address} has another token: give this machine the token "
    "of the head",
    "Version mismatch": "this machine and the head at {address} have different versions: "
    "{versions}",
}
"""What Ray's log says where it cannot start, and what that means"""


def _versions_in(said: str, sign: str) -> str:
    """Return the versions that Ray has compared, in one line."""
    lines = said.partition(sign)[2].splitlines()[:7]
    return " ".join(" ".join(lines).removeprefix(": ").split())


@contextmanager
def _running(
    options: Sequence[str], folder: Path, settings: Settings, environment: Mapping[str, str]
) -> Iterator[Processes]:
    if find_spec("ray") is None:
        raise ClusterError("Ray is not installed: pip install 'geodesic[cluster]'")
    token = _token(settings)
    folder = folder.resolve()
    if len(str(folder)) > _LONGEST_FOLDER:
        raise ClusterError(
            f"{folder} is too long a path for sockets: give a --dir of at most {_LONGEST_FOLDER} "
            "characters"
        )
    folder.mkdir(parents=True, exist_ok=True)
    os.environ.update(
        {
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": token,
            "RAY_USAGE_STATS_ENABLED": "0",
            "RAY_gcs_rpc_server_reconnect_timeout_s": str(_RECONNECT_S),
            "RAY_worker_niceness": "0",  # long work steps back by itself
            "RAY_memory_monitor_refresh_ms": "0",  # it would kill hosts; workers have limits
        }
    )
    command = [
        *(sys.executable, "-m", "ray.scripts.scripts", "start", "--block", *options),
        *("--num-cpus=0", f"--object-store-memory={_OBJECT_STORE_BYTES}"),
        *("--min-worker-port=0", "--max-worker-port=0"),  # any that is free
        *("--include-log-monitor=false", "--disable-usage-stats", "--log-color=false"),
        f"--resources={json.dumps({_MADE_OF + code_version(): 1})}",
        f"--temp-dir={folder}",
    ]
    log = folder / _LOG
    with log.open("wb") as output:
        process = subprocess.Popen(  # noqa: S603 - our own command
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=os.environ | environment,
            start_new_session=True,  # an interrupt is for this command, which ends them in order
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,  # noqa: PLW1509 - no lock
        )
    processes = Processes(process, log)
    try:
        processes.wait_until_started(settings.address or options[1])
        yield processes
    finally:
        processes.stop()


_SYSTEM = ctypes.CDLL(None)
_PR_SET_PDEATHSIG = 1


def _end_with_parent() -> None:
    """Have Linux end this process once the thread that started it is gone, even if it was killed.

    Ray would go on for ever, and the next start on this machine would bring its processes again.
    """
    _SYSTEM.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def _token(settings: Settings) -> str:
    if settings.cluster_token is None:
        raise ClusterError(
            f"set {variable_of('cluster_token')} to a secret, the same on all machines of the "
            "cluster: anyone who knows it can run code there (openssl rand -hex 32 makes one)"
        )
    return settings.cluster_token.get_secret_value()


def _check_host(host: str) -> None:
    if host in ("localhost", "127.0.0.1", "::1"):
        raise ClusterError(
            f"Ray takes {host} to mean any address of this machine: give the address at which "
            "other machines reach the head, or 127.0.0.2 to try a cluster on one machine"
        )


def _check_free(host: str, port: int) -> None:
    try:
        with socket.create_server((host, port)):
            pass
    except OSError as error:
        raise ClusterError(
            f"the head cannot listen at {host}:{port}: {error.strerror}; see --host and --port"
        ) from error


def _own_address(host: str, port: int) -> str:
    """Return the address by which this machine reaches the head, and is reached by others."""
    try:
        with socket.create_connection((host, port), _CONNECT_S) as connection:
            address = str(connection.getsockname()[0])
    except OSError as error:
        raise ClusterError(
            f"no head answers at {host}:{port} ({error.strerror or error}): start one with "
            f"geodesic head, or correct --address"
        ) from error
    return host if address == "127.0.0.1" else address  # both are this machine


def _check_code(address: str | None) -> None:
    """Raise where the head runs another release: answers would not be the same to the bit."""
    import ray

    nodes: list[dict[str, Any]] = ray.nodes()  # type: ignore[no-untyped-call]
    head = next(node for node in nodes if "node:__internal_head__" in node["Resources"])
    codes = {name for name in head["Resources"] if name.startswith(_MADE_OF)}
    if codes != {_MADE_OF + code_version()}:
        theirs = ", ".join(code.removeprefix(_MADE_OF) for code in sorted(codes)) or "none"
        raise ClusterError(
            f"this machine has geodesic {code_version()}, and the head at {address} has {theirs}: "
            "install the same release on all machines, on the head first"
        )

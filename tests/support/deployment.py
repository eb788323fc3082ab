"""A whole deployment, each part on a machine of its own: head, nodes, replicas, S3, PostgreSQL."""

import re
import shlex
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx2
import psutil

from tests.support.cluster import OPTIONS, RAY_START, TOKEN, variables_of_ray
from tests.support.machines import Machine, Network, network
from tests.support.postgres import Server as Postgres
from tests.support.postgres import running_postgres
from tests.support.processes import COMMAND_LINE
from tests.support.s3 import S3
from tests.support.tls import Authority
from tests.support.waiting import LONG_S, wait_until

HEAD_PORT, PORT = 6379, 8000


@dataclass(eq=False)
class Part:
    """A command, and the machine that runs it."""

    machine: Machine
    arguments: Sequence[str]
    settings: Mapping[str, str]
    log: Path
    process: "subprocess.Popen[bytes] | None" = None

    def start(self) -> None:
        """Run the command, as whatever supervises it does at the start and after each end."""
        self.process = self.machine.run(self.arguments, self.log, self.settings)

    @property
    def is_running(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def kill(self) -> None:
        """End all that the machine runs, at once."""
        self.machine.kill()
        if self.process is not None:
            self.process.wait()

    def end(self) -> int:
        """Have the command end in order; return its exit code."""
        assert self.process is not None
        self.process.terminate()
        return self.process.wait()

    def named(self, name: str) -> list[psutil.Process]:
        """Return the processes on the machine with a name, such as that of an actor."""
        return [each for each in self.machine.processes() if name in each.name()]

    def workers(self) -> set[int]:
        """Return the ids of the worker processes on the machine."""
        return {each.pid for each in self.named("geodesic-worker")}


class Replica(Part):
    """A service that answers."""

    @property
    def url(self) -> str:
        return f"http://{self.machine.address}:{PORT}"

    def ask(self, path: str, **headers: str) -> httpx2.Response:
        """Ask without a body, on a connection of its own."""
        return httpx2.get(self.url + path, headers=headers, timeout=LONG_S)

    def listens(self) -> bool:
        return self._answers("/livez")

    def is_ready(self) -> bool:
        return self._answers("/readyz")

    def _answers(self, path: str) -> bool:
        try:
            return self.ask(path).status_code == 200
        except httpx2.TransportError:
            return False

    def metrics(self, key: str) -> Mapping[str, float]:
        """Return the metrics, by their names with labels."""
        text = self.ask("/metrics", Authorization=f"Bearer {key}").text
        found = re.findall(r"^([a-z_]+(?:\{[^}]*\})?) (\S+)$", text, re.MULTILINE)
        return {name: float(value) for name, value in found}


class Deployment:
    """The parts, and what they share."""

    def __init__(
        self, stack: ExitStack, lan: Network, folder: Path, *, tls: bool, **settings: str
    ) -> None:
        self.folder = folder
        self._authority = Authority(folder) if tls else None
        shared, database, head = (lan.add() for _ in range(3))
        nodes, fronts = [lan.add() for _ in range(2)], [lan.add() for _ in range(3)]
        self.postgres: Postgres = stack.enter_context(
            running_postgres(database.address, database.inside, lan.addresses)
        )
        self.s3 = S3(shared.address, shared.inside)
        stack.callback(self.s3.close)
        self.settings = {
            "GEODESIC_STORE": self.s3.new_url(),
            "GEODESIC_STATE": self.postgres.new_database(),
            **variables_of_ray(),
            "RAY_AUTH_TOKEN": TOKEN,
            "GEODESIC_WORKERS": "1",
            **self.s3.environment,
            **settings,
        }
        self._address = f"{head.address}:{HEAD_PORT}"
        records = {"RAY_gcs_storage": "rocksdb", "RAY_gcs_storage_path": str(folder / "records")}
        head_options = ["--head", f"--port={HEAD_PORT}", "--include-dashboard=false"]
        self.head = Part(*self._ray(head, "h", head_options, records))
        self.nodes = [
            Part(*self._ray(each, f"n{n}", [*self._joining, "--resources", '{"geodesic": 1}'], {}))
            for n, each in enumerate(nodes, start=1)
        ]
        self.replicas = [self._replica(f"r{n}", each) for n, each in enumerate(fronts, start=1)]

    @property
    def _joining(self) -> Sequence[str]:
        return [f"--address={self._address}"]

    def _ray(
        self, machine: Machine, name: str, options: Sequence[str], settings: Mapping[str, str]
    ) -> tuple[Machine, Sequence[str], Mapping[str, str], Path]:
        folder = self.folder / name
        tls = {} if self._authority is None else self._authority.certify(machine.address)
        own = {"GEODESIC_COPIES": str(folder / "copies"), **tls, **settings}
        at = [f"--node-ip-address={machine.address}", f"--temp-dir={folder}"]
        command = [*RAY_START, *OPTIONS, *options, *at]
        return machine, command, self.settings | own, self.folder / f"{name}.log"

    def _replica(self, name: str, machine: Machine) -> Replica:
        """Return a service, and Ray beside it on its machine."""
        _, ray, settings, log = self._ray(machine, name, self._joining, {})
        serve = [*COMMAND_LINE, "serve", "--host", machine.address, "--port", str(PORT)]
        joining = shlex.join(word for word in ray if word != "--block")
        both = f"{joining} && exec {shlex.join(serve)}"
        own = {"GEODESIC_ENGINE": "ray", "RAY_ADDRESS": self._address}
        return Replica(machine, ["sh", "-c", both], {**settings, **own}, log)

    @property
    def parts(self) -> Sequence[Part]:
        return [self.head, *self.nodes, *self.replicas]

    def start(self) -> None:
        """Start all parts; a replica makes the store, which nodes need."""
        self.head.start()
        self._wait_for(lambda: b"Ray runtime started" in self.head.log.read_bytes())
        for replica in self.replicas:  # one by one: Ray gives each start 30 s
            replica.start()
            self._wait_for(replica.listens)
        for node in self.nodes:
            node.start()

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait, and start again what ends meanwhile: a busy machine may be too slow for Ray."""

        def is_so() -> bool:
            self.supervise()
            return condition()

        wait_until(is_so)

    def supervise(self) -> Sequence[str]:
        """Start again what has ended, as systemd would; return the names."""
        ended = [part for part in self.parts if part.process and not part.is_running]
        for part in ended:
            part.machine.kill()  # what the command has left of Ray
            part.start()
        return [part.log.stem for part in ended]

    def close(self) -> None:
        for part in reversed(self.parts):
            part.kill()


@contextmanager
def deployed(*, tls: bool = False, **settings: str) -> Iterator[Deployment]:
    """Have a deployment inside the block, which has been started."""
    with ExitStack() as stack:
        lan = stack.enter_context(network())
        prefix = tempfile.TemporaryDirectory(prefix="g", ignore_cleanup_errors=True)
        deployment = Deployment(stack, lan, Path(stack.enter_context(prefix)), tls=tls, **settings)
        stack.callback(deployment.close)
        deployment.start()
        yield deployment

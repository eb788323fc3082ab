"""A server of PostgreSQL of its own, in a folder that is removed, where Debian's is installed."""

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import pytest

from tests.support.waiting import LONG_S

USER = "geodesic"
SECRET = "only-for-tests"  # noqa: S105 - of a server on loopback that ends with the tests

_numbers = count(1)


def programs() -> Path | None:
    """Return the folder of the programs of the newest PostgreSQL; None where there is none."""
    found = sorted(
        Path("/usr/lib/postgresql").glob("*/bin/postgres"), key=lambda path: int(path.parts[4])
    )
    return found[-1].parent if found else None


class Server:
    """A server on an address of this machine, or of another one, which can be stopped and started.

    ``inside`` goes before commands that are to run on that machine; ``clients`` are the addresses
    of those that may connect from elsewhere.
    """

    def __init__(
        self,
        bin_folder: Path,
        folder: Path,
        host: str = "127.0.0.1",
        inside: Sequence[str] = (),
        clients: str = "127.0.0.1/32",
    ) -> None:
        self._bin = bin_folder
        self._data = folder / "data"
        self._host = host
        self._before = list(inside)
        if os.geteuid() == 0:  # servers refuse to run as root
            self._before += ["runuser", "-u", "postgres", "--"]
            user = pwd.getpwnam("postgres")
            os.chown(folder, user.pw_uid, user.pw_gid)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        secret = folder / "secret"
        secret.write_text(SECRET)
        secret.chmod(0o644)
        self._run("initdb", "-A", "scram-sha-256", "-U", USER, f"--pwfile={secret}", "--no-sync")
        with (self._data / "pg_hba.conf").open("a") as allowed:
            allowed.write(f"host all all {clients} scram-sha-256\n")

    def _run(self, program: str, *arguments: str) -> None:
        command = [*self._before, str(self._bin / program), "-D", str(self._data), *arguments]
        patience = {"PGCTLTIMEOUT": str(int(LONG_S))}
        subprocess.run(command, check=True, capture_output=True, cwd="/", env=os.environ | patience)  # noqa: S603 - of the system

    def start(self) -> None:
        log = self._data.with_name("log")
        options = (
            f"-p {self.port} -c listen_addresses={self._host} -k {self._data.parent} -c fsync=off"
        )
        self._run("pg_ctl", "-w", "-l", str(log), "-o", options, "start")

    def stop(self, mode: str = "immediate") -> None:
        """Stop the server; ``immediate`` is a crash."""
        self._run("pg_ctl", "-w", "-m", mode, "stop")

    def url(self, database: str, secret: str = SECRET) -> str:
        return f"postgresql://{USER}:{secret}@{self._host}:{self.port}/{database}"

    def new_database(self) -> str:
        """Return the URL of a new database."""
        import psycopg

        name = f"state_{next(_numbers)}"
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")
        return self.url(name)


@contextmanager
def running_postgres(
    host: str = "127.0.0.1", inside: Sequence[str] = (), clients: str = "127.0.0.1/32"
) -> Iterator[Server]:
    """Run a server inside the block; skip the test where none is installed."""
    pytest.importorskip("psycopg", reason="needs the extra cluster: pip install geodesic[cluster]")
    bin_folder = programs()
    if bin_folder is None:
        pytest.skip("needs PostgreSQL: apt-get install postgresql")
    if os.geteuid() == 0 and shutil.which("runuser") is None:
        pytest.skip("needs runuser: a server of PostgreSQL refuses to run as root")
    folder = Path(tempfile.mkdtemp(prefix="geodesic-postgres-"))
    folder.chmod(0o755)
    server = Server(bin_folder, folder, host, inside, clients)
    server.start()
    try:
        yield server
    finally:
        server.stop()
        shutil.rmtree(folder)


@pytest.fixture(scope="session")
def postgres() -> Iterator[Server]:
    """A server that runs; a test that stops it starts it again."""
    with running_postgres() as server:
        yield server

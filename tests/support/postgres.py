"""A server of PostgreSQL of its own, in a folder that is removed, where Debian's is installed."""

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
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
    """A server on 127.0.0.1, which can be stopped and started."""

    def __init__(self, bin_folder: Path, folder: Path) -> None:
        self._bin = bin_folder
        self._data = folder / "data"
        # Servers refuse to run as root.
        self._as_user = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
        if self._as_user:
            user = pwd.getpwnam("postgres")
            os.chown(folder, user.pw_uid, user.pw_gid)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        secret = folder / "secret"
        secret.write_text(SECRET)
        secret.chmod(0o644)
        self._run("initdb", "-A", "scram-sha-256", "-U", USER, f"--pwfile={secret}", "--no-sync")
        self._process: subprocess.Popen[bytes] | None = None

    def _run(self, program: str, *arguments: str) -> None:
        command = [*self._as_user, str(self._bin / program), "-D", str(self._data), *arguments]
        patience = {"PGCTLTIMEOUT": str(int(LONG_S))}
        subprocess.run(command, check=True, capture_output=True, cwd="/", env=os.environ | patience)  # noqa: S603 - of the system

    def start(self) -> None:
        log = self._data.with_name("log")
        options = (
            f"-p {self.port} -c listen_addresses=127.0.0.1 -k {self._data.parent} -c fsync=off"
        )
        self._run("pg_ctl", "-w", "-l", str(log), "-o", options, "start")

    def stop(self, mode: str = "immediate") -> None:
        """Stop the server; ``immediate`` is a crash."""
        self._run("pg_ctl", "-w", "-m", mode, "stop")

    def url(self, database: str, secret: str = SECRET) -> str:
        return f"postgresql://{USER}:{secret}@127.0.0.1:{self.port}/{database}"

    def new_database(self) -> str:
        """Return the URL of a new database."""
        import psycopg

        name = f"state_{next(_numbers)}"
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")  # type: ignore[call-overload]
        return self.url(name)


@pytest.fixture(scope="session")
def postgres() -> Iterator[Server]:
    """A server that runs; a test that stops it starts it again."""
    pytest.importorskip("psycopg", reason="needs the extra cluster: pip install geodesic[cluster]")
    bin_folder = programs()
    if bin_folder is None:
        pytest.skip("needs PostgreSQL: apt-get install postgresql")
    if os.geteuid() == 0 and shutil.which("runuser") is None:
        pytest.skip("needs runuser: a server of PostgreSQL refuses to run as root")
    folder = Path(tempfile.mkdtemp(prefix="geodesic-postgres-"))
    folder.chmod(0o755)
    server = Server(bin_folder, folder)
    server.start()
    try:
        yield server
    finally:
        server.stop()
        shutil.rmtree(folder)

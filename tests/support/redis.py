"""A server of Redis or Valkey of its own, where Debian's is installed."""

import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.waiting import wait_until

if TYPE_CHECKING:
    import redis

SECRET = "only-for-tests-as-well"  # noqa: S105 - of a server on loopback that ends with the tests


class Redis:
    """A server on an address of this machine, with a password and a log of changes."""

    def __init__(self, program: str, folder: Path, host: str = "127.0.0.1") -> None:
        with socket.socket() as probe:
            probe.bind((host, 0))
            self.host, self.port = probe.getsockname()
        configuration = (
            f"bind {host}\nport {self.port}\nrequirepass {SECRET}\ndir {folder}\n"
            "appendonly yes\nappendfsync always\nsave ''\n"
        )
        self.process = subprocess.Popen(  # noqa: S603 - of the system
            [program, "-"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
        )
        assert self.process.stdin is not None
        with self.process.stdin as stdin:
            stdin.write(configuration.encode())
        wait_until(self._answers)

    def url(self, secret: str = SECRET) -> str:
        return f"redis://:{secret}@{self.host}:{self.port}"

    def keep_no_log(self) -> None:
        """Have the server keep no log of changes any more."""
        self._client().config_set("appendonly", "no")

    def forget(self, pattern: str) -> None:
        """Remove keys, as if their time had run out."""
        client = self._client()
        for key in client.scan_iter(pattern):
            client.delete(key)

    def _answers(self) -> bool:
        from redis.exceptions import RedisError

        try:
            return bool(self._client().ping())
        except RedisError:
            return False

    def _client(self) -> "redis.Redis":
        import redis

        return redis.Redis.from_url(self.url())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def redis_server() -> Iterator[Redis]:
    """A server that runs."""
    pytest.importorskip("redis", reason="needs the extra cluster: pip install geodesic[cluster]")
    program = shutil.which("valkey-server") or shutil.which("redis-server")
    if program is None:
        pytest.skip("needs Redis or Valkey: apt-get install redis-server")
    with tempfile.TemporaryDirectory() as folder:
        server = Redis(program, Path(folder))
        yield server
        server.close()

"""An S3 server of its own on loopback, by moto, in a process that can be stopped and held up."""

import re
import socket
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from urllib.parse import unquote

import httpx2
import pytest

from tests.support.paths import ROOT
from tests.support.processes import stopped
from tests.support.waiting import wait_until

SECRET = "only-for-tests-too"  # noqa: S105 - of a server on loopback that ends with the tests
_numbers = count(1)


class S3:
    """A server on an address of this machine, or of another one; what it has is in its memory.

    ``inside`` goes before a command that is to run on that machine.
    """

    scheme = "s3"
    module = "moto.server"
    """What Python runs as the server"""

    def __init__(self, host: str = "127.0.0.1", inside: Sequence[str] = ()) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.url = f"http://{host}:{self.port}"
        self._log = tempfile.NamedTemporaryFile(prefix="geodesic-s3-")  # noqa: SIM115 - see close
        self.process = subprocess.Popen(  # noqa: S603 - this Python
            [*inside, sys.executable, "-m", self.module, "-H", host, "-p", str(self.port)],
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=self._log,
        )
        wait_until(self._answers)
        self.environment = {
            "AWS_ENDPOINT_URL": self.url,
            "AWS_ACCESS_KEY_ID": "tests",
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_REGION": "us-east-1",
        }
        import boto3  # half a second

        self.client = boto3.client(
            "s3",
            endpoint_url=self.url,
            aws_access_key_id="tests",
            aws_secret_access_key=SECRET,
            region_name="us-east-1",
        )
        self.client.create_bucket(Bucket="bucket")

    def new_url(self) -> str:
        """Return the URL of a store that nobody has."""
        return f"{self.scheme}://bucket/store-{next(_numbers)}"

    def sizes(self, url: str) -> dict[str, int]:
        """Return the bytes of the objects of a store, by name."""
        prefix = self._prefix(url)
        pages = self.client.get_paginator("list_objects_v2").paginate(
            Bucket="bucket", Prefix=prefix
        )
        found = (each for page in pages for each in page.get("Contents", []))
        return {each["Key"].removeprefix(prefix): each["Size"] for each in found}

    def names(self, url: str) -> set[str]:
        """Return the names of the objects of a store."""
        return set(self.sizes(url))

    def reads(self, url: str) -> Counter[str]:
        """Return how often each object of a store was read so far, whole or in part."""
        place = f"/bucket/{self._prefix(url)}"
        log = re.sub(r"\x1b\[\d+m", "", Path(self._log.name).read_text())  # it has colours
        log = unquote(log)  # Google's client escapes slashes
        return Counter(re.findall(rf'"GET {place}(\S+) HTTP', log))

    def damage(self, url: str, name: str) -> None:
        """Change the last byte of an object."""
        key = self._prefix(url) + name
        content = bytearray(self.client.get_object(Bucket="bucket", Key=key)["Body"].read())
        content[-1] ^= 1
        self.client.put_object(Bucket="bucket", Key=key, Body=bytes(content))

    def _prefix(self, url: str) -> str:
        return url.removeprefix(f"{self.scheme}://bucket/") + "/"

    @contextmanager
    def asking_for_credentials(self) -> Iterator[None]:
        """Have the server refuse all credentials inside the block; else it takes any."""
        link = f"{self.url}/moto-api/reset-auth"
        httpx2.post(link, content=b"0").raise_for_status()
        yield
        httpx2.post(link, content=b"inf").raise_for_status()

    @contextmanager
    def away(self) -> Iterator[None]:
        """Have the server answer nothing inside the block."""
        with stopped([self.process.pid]):
            yield

    def _answers(self) -> bool:
        try:
            return bool(httpx2.get(self.url).status_code)
        except httpx2.TransportError:
            return False

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._log.close()


@pytest.fixture(scope="session")
def s3_server() -> Iterator[S3]:
    """An S3 server that tests share."""
    server = S3()
    yield server
    server.close()


@pytest.fixture
def s3(s3_server: S3, monkeypatch: pytest.MonkeyPatch) -> S3:
    """The server, whose address and credentials are in the environment."""
    for name, value in s3_server.environment.items():
        monkeypatch.setenv(name, value)
    return s3_server

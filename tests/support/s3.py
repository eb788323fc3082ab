"""An S3 server of its own on loopback, by moto, in a process that can be stopped and held up."""

import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count

import httpx2
import pytest

from tests.support.processes import stopped
from tests.support.waiting import wait_until

SECRET = "only-for-tests-too"  # noqa: S105 - of a server on loopback that ends with the tests
_numbers = count(1)


class S3:
    """A server on an address of this machine, or of another one; what it has is in its memory.

    ``inside`` goes before a command that is to run on that machine.
    """

    def __init__(self, host: str = "127.0.0.1", inside: Sequence[str] = ()) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.url = f"http://{host}:{self.port}"
        self.process = subprocess.Popen(  # noqa: S603 - this Python
            [*inside, sys.executable, "-m", "moto.server", "-H", host, "-p", str(self.port)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
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
        return f"s3://bucket/store-{next(_numbers)}"

    def names(self, url: str) -> set[str]:
        """Return the names of the objects of a store."""
        prefix = url.removeprefix("s3://bucket/") + "/"
        found = self.client.list_objects_v2(Bucket="bucket", Prefix=prefix).get("Contents", [])
        return {each["Key"].removeprefix(prefix) for each in found}

    def damage(self, url: str, name: str) -> None:
        """Change the last byte of an object."""
        key = f"{url.removeprefix('s3://bucket/')}/{name}"
        content = bytearray(self.client.get_object(Bucket="bucket", Key=key)["Body"].read())
        content[-1] ^= 1
        self.client.put_object(Bucket="bucket", Key=key, Body=bytes(content))

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

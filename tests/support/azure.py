"""An Azure Blob server of its own on loopback: Azurite, Microsoft's emulator, where it is there."""

import base64
import hashlib
import hmac
import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from email.utils import formatdate
from itertools import count

import httpx2
import pytest

from tests.support.waiting import wait_until

ACCOUNT = "tests"
SECRET = base64.b64encode(b"only-for-tests-too").decode()  # of a server that ends with the tests
CONTAINER = "container"
_VERSION = "2021-12-02"
_numbers = count(1)


class Azure:
    """A server on 127.0.0.1; what it has is in its memory."""

    def __init__(self, program: str) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.url = f"http://127.0.0.1:{port}/{ACCOUNT}"
        options = [
            "--inMemoryPersistence",
            "--skipApiVersionCheck",
            "--disableTelemetry",
            "--silent",
        ]
        self._process = subprocess.Popen(  # noqa: S603 - a program that was found
            [program, "--blobHost", "127.0.0.1", "--blobPort", str(port), *options],
            env=os.environ | {"AZURITE_ACCOUNTS": f"{ACCOUNT}:{SECRET}"},
            stdout=subprocess.DEVNULL,
        )
        self.environment = {
            "AZURE_STORAGE_ACCOUNT_NAME": ACCOUNT,
            "AZURE_STORAGE_ACCOUNT_KEY": SECRET,
            "AZURE_STORAGE_ENDPOINT": self.url,
        }
        wait_until(self._has_container)

    def new_url(self) -> str:
        """Return the URL of a store that nobody has."""
        return f"az://{CONTAINER}/store-{next(_numbers)}"

    def _has_container(self) -> bool:
        """Make the container, by a request that is signed with the account's key."""
        headers = {"x-ms-date": formatdate(usegmt=True), "x-ms-version": _VERSION}
        names = "\n".join(f"{name}:{value}" for name, value in sorted(headers.items()))
        resource = f"/{ACCOUNT}/{ACCOUNT}/{CONTAINER}\nrestype:container"
        text = "PUT" + "\n" * 12 + f"{names}\n{resource}"
        digest = hmac.digest(base64.b64decode(SECRET), text.encode(), hashlib.sha256)
        headers["Authorization"] = f"SharedKey {ACCOUNT}:{base64.b64encode(digest).decode()}"
        try:
            made = httpx2.put(f"{self.url}/{CONTAINER}?restype=container", headers=headers)
        except httpx2.TransportError:
            return False
        assert made.status_code == 201, made.text
        return True

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


@pytest.fixture(scope="session")
def azure_server() -> Iterator[Azure]:
    """An Azure Blob server that tests share."""
    program = shutil.which("azurite-blob")
    if program is None:
        pytest.skip("needs Azurite: npm install --global azurite")
    server = Azure(program)
    yield server
    server.close()


@pytest.fixture
def azure(azure_server: Azure, monkeypatch: pytest.MonkeyPatch) -> Azure:
    """The server, whose address and credentials are in the environment."""
    for name, value in azure_server.environment.items():
        monkeypatch.setenv(name, value)
    return azure_server

"""A server on loopback that obstore's client of Google Cloud Storage speaks to: moto's S3 behind.

It has what that client needs of Google's interface, and is not Google's service.
"""

from collections.abc import Iterator

import pytest

from tests.support.s3 import S3, SECRET


class GCS(S3):
    """A server on 127.0.0.1; what it has is in its memory."""

    scheme = "gs"
    module = "tests.support.gcs_server"

    def __init__(self) -> None:
        super().__init__()
        self.environment = {"GOOGLE_BASE_URL": self.url, "GOOGLE_BEARER_TOKEN": SECRET}


@pytest.fixture(scope="session")
def gcs_server() -> Iterator[GCS]:
    """A server that tests share."""
    server = GCS()
    yield server
    server.close()


@pytest.fixture
def gcs(gcs_server: GCS, monkeypatch: pytest.MonkeyPatch) -> GCS:
    """The server, whose address and credentials are in the environment."""
    for name, value in gcs_server.environment.items():
        monkeypatch.setenv(name, value)
    return gcs_server

"""The service without workers: what these tests ask needs none."""

import pytest

from tests.support.service import ServiceClient


@pytest.fixture(scope="session")
def client(tmp_path_factory: pytest.TempPathFactory) -> ServiceClient:
    """A service that is not started; it answers all the same, but for what a worker does."""
    client = ServiceClient(tmp_path_factory.mktemp("store"))
    client.app.state.service.scratch.prepare()
    client.app.state.service.mesh_catalog.prepare()
    return client

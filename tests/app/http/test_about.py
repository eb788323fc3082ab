import re

import pytest
from starlette.testclient import TestClient

from app import __version__
from app.main import create_app
from app.settings import Settings


def test_index(client: TestClient) -> None:
    index = client.get("/").json()

    assert index["version"] == __version__
    assert index["links"].pop("docs") == "/docs"  # a page
    for link in index["links"].values():
        assert client.get(link).status_code == 200


def test_about_tells_the_limits_in_force(client: TestClient) -> None:
    about = client.get("/v1").json()

    assert about["limits"]["max_faces"] == 5_000_000
    assert isinstance(about["limits"]["max_faces"], int)
    assert about["limits"]["worker_memory_bytes"] >= 2**30
    assert "rate_limit" not in about["limits"]
    assert about["answer_formats"]["npy"] == "application/x-npy"
    assert "ply" in about["mesh_formats"]
    assert about["methods"] == ["exact", "approximate", "fast"]


def test_nothing_is_on_disk_before_the_start(tmp_path) -> None:
    create_app(Settings(store=tmp_path / "store"))

    assert not (tmp_path / "store").exists()


def test_every_request_has_an_id(client: TestClient) -> None:
    first, second = (client.get("/livez").headers["x-request-id"] for _ in range(2))

    assert re.fullmatch("[0-9a-f]{32}", first)
    assert first != second


def test_a_sane_id_of_the_client_is_kept(client: TestClient) -> None:
    response = client.get("/livez", headers={"X-Request-ID": "trace-7"})

    assert response.headers["x-request-id"] == "trace-7"
    assert response.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("given", ["", "a b", "x" * 129, "<script>"])
def test_another_is_not(client: TestClient, given: str) -> None:
    response = client.get("/livez", headers={"X-Request-ID": given})

    assert response.headers["x-request-id"] != given

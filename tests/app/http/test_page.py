"""The root path: the page for browsers, the index for other clients."""

import pytest
from starlette.testclient import TestClient

from app.http import page
from tests.support.service import check_problem

BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}


@pytest.fixture
def built(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A page of one word, with a script."""
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<p>page</p>")
    (tmp_path / "docs.html").write_text("<p>reference</p>")
    (tmp_path / "assets" / "index-1a2b.js").write_text("1")
    monkeypatch.setattr(page, "DIST", tmp_path)


@pytest.mark.usefixtures("built")
def test_browsers_get_the_page(client: TestClient) -> None:
    response = client.get("/", headers=BROWSER)

    assert response.text == "<p>page</p>"
    assert response.headers["content-type"].startswith("text/html")
    assert response.headers["cache-control"] == "no-cache"
    assert response.headers["vary"] == "Accept"
    policy = response.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    etag = {"If-None-Match": response.headers["etag"]}
    assert client.get("/", headers=BROWSER | etag).status_code == 304


@pytest.mark.usefixtures("built")
def test_the_reference_is_a_page_of_its_own(client: TestClient) -> None:
    response = client.get("/docs")

    assert response.text == "<p>reference</p>"
    assert "unsafe" not in response.headers["content-security-policy"]


def test_without_a_page_there_is_no_reference(
    client: TestClient, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "DIST", tmp_path)

    problem = check_problem(client.get("/docs"), 404, "not_found")

    assert "openapi.json" in problem["detail"]


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("accept", ["*/*", "application/json", ""])
def test_others_get_the_index(client: TestClient, accept: str) -> None:
    response = client.get("/", headers={"Accept": accept})

    assert response.json()["page"] == "for browsers"
    assert response.headers["vary"] == "Accept"


def test_without_a_page_everyone_gets_the_index(
    client: TestClient, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "DIST", tmp_path)

    index = client.get("/", headers=BROWSER).json()

    assert index["page"] == "not part of this package"


def test_what_is_no_asset_is_a_problem(client: TestClient) -> None:
    for address in ("/assets/nothing.js", "/assets/../index.html", "/assets/%2e%2e/index.html"):
        check_problem(client.get(address), 404, "not_found")

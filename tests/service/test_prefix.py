"""The service below a prefix, behind a proxy that cuts it off."""

import re
from collections.abc import Iterator
from typing import Any

import httpx2
import pytest
from geodesic_client import Client

from app.http import page
from app.settings import Settings
from tests.support.processes import Server

PREFIX = "/geodesic"
BROWSER = {"Accept": "text/html"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx2.Client]:
    """A client of a proxy that has the service below a prefix, and nothing else."""
    server = Server(tmp_path_factory.mktemp("prefix"), GEODESIC_ROOT_PATH=PREFIX)

    def pass_on(request: httpx2.Request) -> httpx2.Response:
        path = request.url.raw_path.decode()
        if not path.startswith(f"{PREFIX}/"):
            return httpx2.Response(404, text="not of the service")
        headers = {name: value for name, value in request.headers.items() if name != "host"}
        answer = server.client.request(
            request.method, path.removeprefix(PREFIX), headers=headers, content=request.read()
        )
        return httpx2.Response(answer.status_code, headers=answer.headers, content=answer.content)

    transport = httpx2.MockTransport(pass_on)
    with httpx2.Client(transport=transport, base_url="http://127.0.0.1") as client:
        yield client
    server.close()


def links_in(document: Any) -> Iterator[str]:
    """Yield the texts in a document that look like paths of the service."""
    if isinstance(document, dict | list):
        for each in document.values() if isinstance(document, dict) else document:
            yield from links_in(each)
    elif isinstance(document, str) and re.match("/[a-z]", document):
        yield document


def test_all_links_lead_to_the_service(site: httpx2.Client) -> None:
    mesh = site.post(f"{PREFIX}/v1/meshes?sample=plane&faces=8")
    link = mesh.headers["location"]
    job = site.post(f"{link}/distances", json={"sources": [0]}, headers={"Prefer": "respond-async"})
    events = site.get(job.json()["links"]["events"]).text
    missing = site.get(f"{PREFIX}/v1/meshes/nonsense")
    unknown = site.get(f"{PREFIX}/nonsense")
    index = site.get(f"{PREFIX}/")
    documents = [each.json() for each in (mesh, job, missing, unknown, index)]
    found = [link, job.headers["location"], *links_in(documents)]
    found += re.findall(r'"(/[^"]+)"', events)
    assert len(found) > 15
    missed = {documents[2]["instance"], documents[3]["instance"]}
    if not page.is_built():
        missed.add(f"{PREFIX}/docs")
    for each in set(found) - missed:
        assert site.get(each).status_code == 200, each
    assert documents[3]["instance"] == f"{PREFIX}/nonsense"


def test_the_interface_document_names_the_prefix(site: httpx2.Client) -> None:
    assert site.get(f"{PREFIX}/openapi.json").json()["servers"][0]["url"] == PREFIX


def test_probes_and_metrics_are_below_it(site: httpx2.Client) -> None:
    for path in ("/livez", "/readyz", "/metrics", "/v1"):
        assert site.get(PREFIX + path).status_code == 200


def test_the_client_works_through_the_proxy(site: httpx2.Client) -> None:
    site.base_url = f"http://127.0.0.1{PREFIX}"
    try:
        client = Client(http=site)
        mesh = client.sample("plane", 8)
        assert client.distances(mesh, [0]).distances[0] == 0.0
        assert [each.id for each in client.meshes(name="plane")] == [mesh.id]
    finally:
        site.base_url = "http://127.0.0.1"


def test_the_page_names_no_address_outside(site: httpx2.Client) -> None:
    if not page.is_built():
        pytest.skip("the page is not built")
    for path in ("/", "/docs"):
        text = site.get(PREFIX + path, headers=BROWSER).text
        links = re.findall(r'(?:src|href)="([^"#]+)"', text)
        assert links
        for each in links:
            answer = site.get(str(httpx2.URL(f"http://127.0.0.1{PREFIX}{path}").join(each)))
            assert answer.status_code == 200, each


@pytest.mark.parametrize("prefix", ["geodesic", "/geodesic/", "/", "/a b", "http://host/geodesic"])
def test_what_is_no_prefix_is_refused(prefix: str) -> None:
    with pytest.raises(ValueError, match="not a prefix such as /geodesic"):
        Settings(root_path=prefix)

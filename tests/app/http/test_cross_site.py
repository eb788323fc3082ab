"""Requests that pages of other sites make a browser send, and foreign names in `Host`."""

from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from app.http.middleware.cross_site import CrossSiteMiddleware
from app.http.middleware.request_id import RequestIdMiddleware
from app.settings import Settings
from tests.support.service import check_problem

KEYS = "alice:alice-0123456789abc"
METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"]
CHANGING = ["POST", "PUT", "PATCH", "DELETE"]

LOOPBACK = "http://127.0.0.1:8000"
ELSEWHERE = "http://192.0.2.1:8000"


def client_at(address: str, **settings: Any) -> TestClient:
    """Return a client that is connected to an address of a service that answers ``ok``."""
    own = Settings(store=Path("nowhere"), **settings)

    async def answer(_request: Request) -> PlainTextResponse:
        return PlainTextResponse("ok")

    app = Starlette(routes=[Route("/{path:path}", answer, methods=METHODS)])
    app.add_middleware(CrossSiteMiddleware, settings=own)
    app.add_middleware(RequestIdMiddleware, settings=own)
    return TestClient(app, base_url=address)


def status(client: TestClient, method: str = "GET", path: str = "/v1", **headers: str) -> int:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return client.request(method, path, headers=named).status_code


# Hosts

OWN_NAMES = ["localhost", "LOCALHOST:8000", "127.0.0.1", "127.8.9.1:80", "[::1]", "[::1]:8000"]
OWN_NAMES += ["geodesic.localhost", "geodesic.localhost:8000"]
FOREIGN_NAMES = ["evil.example", "evil.example:8000", "localhost.evil.example", "192.168.0.1", ""]
FOREIGN_NAMES += ["127.0.0.1.evil.example", "evil.example#localhost", "localhost:80:80", "[::2]"]
FOREIGN_NAMES += ["evillocalhost", "localhost@evil.example", "localhost, evil.example"]


@pytest.mark.parametrize("address", [LOOPBACK, "http://[::1]:8000"])
@pytest.mark.parametrize("name", OWN_NAMES)
def test_a_loopback_address_answers_under_loopback_names(address: str, name: str) -> None:
    assert status(client_at(address), Host=name) == 200


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", FOREIGN_NAMES)
def test_and_under_no_others(name: str, method: str) -> None:
    response = client_at(LOOPBACK).request(method, "/v1", headers={"Host": name})
    if method == "HEAD":
        assert response.status_code == 421
        return
    problem = check_problem(response, 421, "host_not_allowed")
    assert problem["setting"] == "allowed_hosts"


def test_two_names_are_none() -> None:
    hosts = [("Host", "localhost"), ("Host", "evil.example")]
    response = client_at(LOOPBACK).get("/v1", headers=hosts)
    check_problem(response, 421, "host_not_allowed")


@pytest.mark.parametrize("name", [*OWN_NAMES, *FOREIGN_NAMES])
def test_any_name_will_do_elsewhere_or_with_keys(name: str) -> None:
    assert status(client_at(ELSEWHERE), Host=name) == 200
    assert status(client_at(LOOPBACK, api_keys=KEYS), Host=name) == 200


@pytest.mark.parametrize("keys", ["", KEYS])
@pytest.mark.parametrize("address", [LOOPBACK, ELSEWHERE])
def test_an_operator_can_say_which(address: str, keys: str) -> None:
    hosts = ("geodesic.example.org", "*.example.net", "[2001:db8::1]")
    client = client_at(address, allowed_hosts=hosts, api_keys=keys)
    for name in ("geodesic.example.org", "a.example.net:8000", "a.b.example.NET", "[2001:db8::1]"):
        assert status(client, Host=name) == 200
    for name in ("example.org", "example.net", "a.geodesic.example.org", "evilexample.net", ""):
        assert status(client, Host=name) == 421
    assert status(client, Host="localhost") == (200 if address == LOOPBACK else 421)


@pytest.mark.parametrize("path", ["/livez", "/readyz"])
def test_probes_may_use_any_name(path: str) -> None:
    assert status(client_at(LOOPBACK), path=path, Host="10.0.0.7:8000") == 200


# Origins

FOREIGN_ORIGINS = ["https://evil.example", "http://127.0.0.1:9000", "null", "", "http://[", "x"]


@pytest.mark.parametrize("keys", ["", KEYS])
@pytest.mark.parametrize("method", CHANGING)
@pytest.mark.parametrize("origin", FOREIGN_ORIGINS)
def test_a_page_elsewhere_changes_nothing(origin: str, method: str, keys: str) -> None:
    client = client_at(LOOPBACK, api_keys=keys)
    response = client.request(method, "/v1", headers={"Origin": origin})
    problem = check_problem(response, 403, "origin_not_allowed")
    assert problem["setting"] == "cors_origins"
    assert status(client, method, Origin=origin, Sec_Fetch_Site="cross-site") == 403
    assert status(client, method, Origin=origin, Sec_Fetch_Site="same-site") == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
@pytest.mark.parametrize("method", CHANGING)
def test_nor_does_one_whose_origin_the_browser_keeps_back(method: str, site: str) -> None:
    response = client_at(LOOPBACK).request(method, "/v1", headers={"Sec-Fetch-Site": site})
    check_problem(response, 403, "origin_not_allowed")
    assert status(client_at(LOOPBACK, cors_origins=("*",)), method, Sec_Fetch_Site=site) == 200


@pytest.mark.parametrize("origin", FOREIGN_ORIGINS)
def test_but_it_may_ask_which_the_browser_does_not_let_it_read(origin: str) -> None:
    assert status(client_at(LOOPBACK), Origin=origin) == 200


@pytest.mark.parametrize("method", CHANGING)
def test_the_page_itself_and_clients_without_one_may(method: str) -> None:
    client = client_at(LOOPBACK)
    assert status(client, method) == 200
    assert status(client, method, Origin=LOOPBACK) == 200
    assert status(client, method, Origin="https://127.0.0.1:8000") == 200
    rewritten = client_at("http://10.0.0.7:8000")  # by a proxy, which changed `Host`
    page = "https://geodesic.example.org"
    assert status(rewritten, method, Origin=page) == 403
    assert status(rewritten, method, Origin=page, Sec_Fetch_Site="same-origin") == 200
    named = client_at("http://10.0.0.7:8000", allowed_hosts=("geodesic.example.org", "10.0.0.7"))
    assert status(named, method, Origin=page) == 200


def test_so_may_the_origins_that_cors_allows() -> None:
    for origins in (("https://example.org",), ("*",)):
        client = client_at(LOOPBACK, cors_origins=origins)
        assert status(client, "POST", Origin="https://example.org") == 200
    some = client_at(LOOPBACK, cors_origins=("https://example.org",))
    assert status(some, "POST", Origin="https://example.org:444") == 403

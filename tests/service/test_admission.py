"""Keys, limits and origins, as clients meet them."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.http.middleware import admission
from app.http.server import server_of
from app.main import create_app
from app.settings import Settings
from tests.support.processes import stopped
from tests.support.service import TWO_TRIANGLES, ServiceClient, check_problem, serving
from tests.support.waiting import wait_until

ALICE, BOB = "alice-0123456789", "bob/0123456789=="
PAGE = "https://example.org"


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


@pytest.fixture(scope="module")
def keyed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A service that asks for keys; pages of one origin may use it, and wrong keys are many."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(admission, "WRONG_KEYS_A_MINUTE", 1000)
        yield from serve_keyed(tmp_path_factory)


def serve_keyed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    keys = f"alice:{ALICE},bob:{BOB}"
    store = tmp_path_factory.mktemp("keyed")
    with serving(store, api_keys=keys, cors_origins=PAGE) as client:
        yield client


def limited(store: Path, **settings: Any) -> ServiceClient:
    """A service that can answer what needs no worker."""
    return ServiceClient(store, **settings)


# Keys


@pytest.mark.parametrize(
    "path", ["/", "/livez", "/readyz", "/openapi.json", "/problems/unauthorized"]
)
def test_open_paths_need_no_key(keyed: TestClient, path: str) -> None:
    assert keyed.get(path).status_code == 200
    assert keyed.get(path, headers=bearer("wrong")).status_code == 200


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/v1"),
        ("GET", "/v1/meshes"),
        ("POST", "/v1/meshes?sample=plane"),
        ("DELETE", "/v1/meshes/0"),
        ("GET", "/metrics"),
        ("GET", "/nowhere"),
        ("GET", "/problems"),
        ("GET", "http://testserver//livez"),
        ("GET", "/livez/"),
        ("GET", "/livez/../v1"),
        ("GET", "/LIVEZ"),
        ("OPTIONS", "/v1"),
    ],
)
def test_all_else_needs_one(keyed: TestClient, method: str, path: str) -> None:
    response = keyed.request(method, path)

    check_problem(response, 401, "unauthorized")
    assert response.headers["www-authenticate"] == "Bearer"


def test_every_operation_needs_a_key_or_is_open(keyed: TestClient) -> None:
    document = keyed.get("/openapi.json").json()
    assert document["security"] == [{"apiKey": []}, {}]
    for template, path in document["paths"].items():
        for method, operation in path.items():
            url = template.replace("{code}", "unauthorized")
            has_passed = keyed.request(method, url).status_code != 401
            is_open = operation.get("security") == []
            assert has_passed == is_open, (method, template)
            assert ("401" in operation["responses"]) == (not is_open)


@pytest.mark.parametrize("scheme", ["Bearer", "bearer", "BEARER", "Bearer  "])
@pytest.mark.parametrize("secret", [ALICE, BOB, BOB + " \t"])
def test_any_of_the_keys_opens(keyed: TestClient, scheme: str, secret: str) -> None:
    assert keyed.get("/v1", headers={"Authorization": f"{scheme} {secret}"}).status_code == 200


@pytest.mark.parametrize(
    "given",
    [
        b"",
        b"Bearer",
        b"Bearer ",
        b"Bearer wrong",
        b"Basic " + ALICE.encode(),
        b"Bearer" + ALICE.encode(),
        b"Bearer\t" + ALICE.encode(),
        b"Bearer " + ALICE.encode() + b" x",
        b"Bearer " + ALICE.encode() + b"\x00",
        b"Bearer " + ALICE.encode()[:-1],
        b"Bearer " + ALICE.upper().encode(),
        b"Bearer " + ALICE.encode() + b"=",
        b"Bearer " + ALICE.encode() + b", Bearer " + BOB.encode(),
        b"Bearer " + ALICE.encode("utf-16"),
        b"Bearer " + ALICE.replace("a", "\u0430").encode(),
        b"Bearer \xff\xfe",
        b"Bearer alice:" + ALICE.encode(),
        b"Bearer " + b"x" * 60_000,
        ALICE.encode(),
    ],
)
def test_anything_else_does_not(keyed: TestClient, given: bytes) -> None:
    response = keyed.get("/v1", headers=[(b"Authorization", given)])

    problem = check_problem(response, 401, "unauthorized")
    assert response.headers["www-authenticate"] == 'Bearer error="invalid_token"'
    assert response.headers["cache-control"] == "no-store"
    assert "0123456789" not in response.text
    assert "Authorization: Bearer" in problem["hint"]


def test_wrong_keys_are_slowed_down_and_right_ones_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admission, "WRONG_KEY_PAUSE_S", 0.01)
    monkeypatch.setattr("app.http.middleware.rate_limits.monotonic", lambda: 1000.0)
    with limited(tmp_path, api_keys=f"alice:{ALICE}") as client:
        for _ in range(admission.WRONG_KEYS_A_MINUTE):
            check_problem(client.get("/v1", headers=bearer("wrong")), 401, "unauthorized")
        for _ in range(3):
            response = client.get("/v1", headers=bearer("wrong"))
            check_problem(response, 429, "rate_limited")
            assert int(response.headers["retry-after"]) >= 1
        assert client.get("/v1", headers=bearer(ALICE)).status_code == 200
        check_problem(client.get("/v1"), 401, "unauthorized")


def test_a_slowed_down_answer_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float] = []

    async def sleep(seconds: float) -> None:
        waited.append(seconds)

    monkeypatch.setattr(admission, "WRONG_KEYS_A_MINUTE", 1)
    monkeypatch.setattr(admission, "sleep", sleep)
    client = limited(tmp_path, api_keys=f"alice:{ALICE}")
    assert client.get("/v1", headers=bearer("wrong")).status_code == 401
    assert waited == []
    assert client.get("/v1", headers=bearer("wrong")).status_code == 429
    assert waited == [admission.WRONG_KEY_PAUSE_S]


def test_two_keys_are_none(keyed: TestClient) -> None:
    both = [(b"Authorization", f"Bearer {secret}".encode()) for secret in (ALICE, BOB)]

    check_problem(keyed.get("/v1", headers=both), 401, "unauthorized")


def test_a_key_elsewhere_is_none(keyed: TestClient) -> None:
    check_problem(keyed.get("/v1", params={"access_token": ALICE}), 401, "unauthorized")
    check_problem(
        keyed.get("/v1", headers={"Cookie": f"Authorization={ALICE}"}), 401, "unauthorized"
    )


def test_without_keys_any_or_none_will_do(client: TestClient) -> None:
    assert client.get("/v1").status_code == 200
    assert client.get("/v1", headers=bearer("whatever")).status_code == 200


def test_all_keys_share_meshes(keyed: TestClient) -> None:
    alice, bob = bearer(ALICE), bearer(BOB)
    first = keyed.post("/v1/meshes", json=TWO_TRIANGLES, headers=alice)
    again = keyed.post("/v1/meshes", json=TWO_TRIANGLES, headers=bob)
    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json() == first.json()
    link = first.headers["location"]

    assert keyed.get(link, headers=bob).json() == first.json()
    assert "alice" not in first.text
    assert keyed.delete(link, headers=bob).status_code == 204
    check_problem(keyed.delete(link, headers=alice), 404, "mesh_not_found")


def test_openapi_declares_the_scheme(keyed: TestClient) -> None:
    document = keyed.get("/openapi.json").json()

    scheme = document["components"]["securitySchemes"]["apiKey"]
    assert (scheme["type"], scheme["scheme"]) == ("http", "bearer")


# Limits of a caller


def test_rate_limit(tmp_path: Path) -> None:
    client = limited(tmp_path, rate_limit=2)

    assert client.get("/v1").json()["limits"]["rate_limit"] == 2
    assert client.get("/v1").status_code == 200
    response = client.get("/v1")
    problem = check_problem(response, 429, "rate_limited")
    assert (problem["limit"], problem["setting"]) == (2, "rate_limit")
    assert 1 <= int(response.headers["retry-after"]) <= 30
    for _ in range(5):
        assert client.get("/livez").status_code == 200
        assert client.get("/readyz").status_code == 503


@pytest.mark.parametrize(
    ("trusted", "statuses"),
    [("", [200, 429, 429]), ("10.0.0.1", [200, 429, 429]), ("127.0.0.0/8", [200, 200, 200])],
)
def test_only_a_trusted_proxy_names_the_caller(
    tmp_path: Path, trusted: str, statuses: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else every process of this machine would have as many names as it likes."""
    monkeypatch.setenv("GEODESIC_TRUSTED_PROXIES", trusted)
    monkeypatch.setenv("FORWARDED_ALLOW_IPS", "*")  # uvicorn's
    settings = Settings(store=tmp_path, workers=1, rate_limit=1)
    config = server_of(create_app(settings), "127.0.0.1", 0, settings).config
    config.load()
    client = TestClient(config.loaded_app, client=("127.0.0.1", 1))
    headers = [{"X-Forwarded-For": f"10.9.9.{i}"} for i in range(3)]
    assert [client.get("/v1", headers=each).status_code for each in headers] == statuses


def test_keys_have_rates_of_their_own_wherever_they_come_from(tmp_path: Path) -> None:
    keys = f"alice:{ALICE},bob:{BOB},alice:{'n' * 16}"
    app = create_app(Settings(store=tmp_path, workers=1, rate_limit=1, api_keys=keys))
    one, other = (TestClient(app, client=(host, 1)) for host in ("10.0.0.1", "10.0.0.2"))

    assert one.get("/v1", headers=bearer(ALICE)).status_code == 200
    assert one.get("/v1", headers=bearer(BOB)).status_code == 200
    assert other.get("/v1", headers=bearer(ALICE)).status_code == 429
    assert other.get("/v1", headers=bearer("n" * 16)).status_code == 429
    assert other.get("/v1").status_code == 401


def test_requests_at_the_same_time(tmp_path: Path) -> None:
    with serving(tmp_path, max_concurrent=1) as client, ThreadPoolExecutor(1) as pool:
        client.wait_until_idle()
        with stopped(client.workers()):
            upload = pool.submit(client.post, "/v1/meshes", params={"sample": "plane", "faces": 8})
            wait_until(lambda: client.load.busy == 1)

            response = client.get("/v1")
            problem = check_problem(response, 429, "rate_limited")
            assert (problem["limit"], problem["actual"]) == (1, 2)
            assert problem["setting"] == "max_concurrent"
            assert response.headers["retry-after"] == "1"
            assert client.get("/livez").status_code == 200

        assert upload.result().status_code == 201
        assert client.get("/v1").status_code == 200


# Pages of other origins


def test_pages_of_no_other_origin_unless_set(client: TestClient) -> None:
    ask = {"Origin": PAGE, "Access-Control-Request-Method": "POST"}

    assert not any("access-control" in n for n in client.get("/v1", headers=ask).headers)
    preflight = client.options("/v1/meshes", headers=ask)
    assert preflight.status_code == 405
    assert not any("access-control" in name for name in preflight.headers)


@pytest.mark.parametrize("method", ["GET", "POST", "DELETE"])
def test_preflight_needs_no_key(keyed: TestClient, method: str) -> None:
    wanted = "authorization,content-type,idempotency-key,prefer,x-timeout-ms"
    ask = {
        "Origin": PAGE,
        "Access-Control-Request-Method": method,
        "Access-Control-Request-Headers": wanted,
    }
    response = keyed.options("/v1/meshes", headers=ask)

    assert response.status_code == 200
    assert response.headers["access-control-allow-origin"] == PAGE
    assert response.headers["access-control-allow-headers"] == wanted
    assert method in response.headers["access-control-allow-methods"]


def test_pages_read_answers_and_refusals_with_all_headers(keyed: TestClient) -> None:
    for headers, status in ((bearer(ALICE), 200), (bearer("wrong"), 401)):
        response = keyed.get("/v1", headers={"Origin": PAGE, **headers})
        assert response.status_code == status
        assert response.headers["access-control-allow-origin"] == PAGE
        assert response.headers["access-control-expose-headers"] == "*"
        assert "access-control-allow-credentials" not in response.headers
        assert "Origin" in response.headers["vary"]


@pytest.mark.parametrize("origin", ["https://example.org.evil", "http://example.org", "null"])
def test_pages_of_other_origins_do_not(keyed: TestClient, origin: str) -> None:
    response = keyed.get("/v1", headers={"Origin": origin, **bearer(ALICE)})

    assert "access-control-allow-origin" not in response.headers
    ask = {"Origin": origin, "Access-Control-Request-Method": "GET"}
    assert "access-control-allow-origin" not in keyed.options("/v1", headers=ask).headers

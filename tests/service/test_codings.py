"""Answers that are compressed: when, how, and how caches tell them apart."""

import gzip
import json
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.encoding import negotiate_coding
from app.encoding.codings import zstd
from app.encoding.negotiation import MOST_RANGES
from tests.support.service import check_problem, upload_sample
from tests.support.waiting import wait_until


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 2000)


@pytest.fixture
def link(knot: str) -> str:
    return f"/v1/meshes/{knot}/path?from=v3&to=v700"


def get(client: TestClient, link: str, accepted: str = "identity", **headers: str) -> Any:
    """Return a response and the bytes of its body as they were sent."""
    sent = {"Accept-Encoding": accepted} | {k.replace("_", "-"): v for k, v in headers.items()}
    with client.stream("GET", link, headers=sent) as response:
        return response, b"".join(response.iter_raw())


def unpacked(coding: str, body: bytes) -> bytes:
    if coding == "gzip":
        return gzip.decompress(body)
    return zstd.decompress(body)


@pytest.mark.parametrize("name", ["json", "obj", "csv"])
@pytest.mark.parametrize("coding", ["gzip", "zstd"])
def test_texts_are_compressed(client: TestClient, link: str, name: str, coding: str) -> None:
    plain, expected = get(client, f"{link}&format={name}")
    response, body = get(client, f"{link}&format={name}", coding)
    assert "content-encoding" not in plain.headers
    assert response.headers["content-encoding"] == coding
    assert response.headers["content-length"] == str(len(body))
    assert len(body) < 0.7 * len(expected)
    assert unpacked(coding, body) == expected
    for header in ("content-type", "geodesic-length", "vary", "cache-control"):
        assert response.headers.get(header) == plain.headers.get(header)
    assert "Accept-Encoding" in response.headers["vary"]


@pytest.mark.parametrize("name", ["npy", "octets"])
def test_arrays_are_not(client: TestClient, link: str, name: str) -> None:
    response, body = get(client, f"{link}&format={name}", "gzip, zstd")
    assert "content-encoding" not in response.headers
    assert len(body) % 8 == 0


def test_meshes_are_not(client: TestClient, knot: str) -> None:
    response = client.post(
        f"/v1/meshes/{knot}/distances?format=ply", json={"sources": [{"vertex": 0}]}
    )
    assert "gzip" in response.request.headers["accept-encoding"]
    assert "content-encoding" not in response.headers


def test_what_is_small_is_not(client: TestClient, knot: str) -> None:
    for name in ("json", "csv"):
        response, body = get(client, f"/v1/meshes/{knot}/path?from=v3&to=v3&format={name}", "gzip")
        assert "content-encoding" not in response.headers
        assert 0 < len(body) < 1024
        assert body[:1] in b"{s"


def test_caches_tell_codings_apart(client: TestClient, link: str) -> None:
    etags = {
        accepted: get(client, link, accepted)[0].headers["etag"]
        for accepted in ("identity", "gzip", "zstd")
    }
    assert len(set(etags.values())) == 3
    for accepted, etag in etags.items():
        again, body = get(client, link, accepted, If_None_Match=etag)
        assert (again.status_code, body) == (304, b"")
        assert again.headers["etag"] == etag
        assert "Accept-Encoding" in again.headers["vary"]
    other, _ = get(client, link, "gzip", If_None_Match=etags["identity"])
    assert other.status_code == 200


def test_forms_have_names_of_their_own(client: TestClient, link: str) -> None:
    queries = ("", "&format=npy", "&format=octets", "&format=csv", "&format=obj")
    assert len({get(client, link + query)[0].headers["etag"] for query in queries}) == 5


def test_ranges_are_those_of_the_plain_body(client: TestClient, link: str) -> None:
    plain, expected = get(client, link)
    part, body = get(client, link, "gzip", Range="bytes=10-29")
    assert (part.status_code, body) == (206, expected[10:30])
    assert "content-encoding" not in part.headers
    assert part.headers["content-range"] == f"bytes 10-29/{len(expected)}"
    etag = plain.headers["etag"]
    assert part.headers["etag"] == etag
    same, body = get(client, link, "gzip", Range="bytes=10-29", If_Range=etag)
    assert (same.status_code, body) == (206, expected[10:30])
    packed = get(client, link, "gzip")[0].headers["etag"]
    whole, body = get(client, link, "gzip", Range="bytes=10-29", If_Range=packed)
    assert (whole.status_code, body) == (200, expected), "a part of another body is of no use"
    beyond, _ = get(client, link, "gzip", Range=f"bytes={len(expected)}-")
    assert beyond.status_code == 416


def test_no_part_of_a_compressed_answer_of_a_job_is_sent(client: TestClient, knot: str) -> None:
    """It could not be decoded; the coding was chosen when the job was submitted."""
    sent = {"Accept-Encoding": "gzip", "Prefer": "respond-async"}
    body = {"sources": [{"vertex": 3}]}
    job = client.post(f"/v1/meshes/{knot}/distances", json=body, headers=sent).json()
    wait_until(lambda: client.get(job["links"]["self"]).json()["status"] == "successful")
    whole, expected = get(client, job["links"]["results"], "gzip")
    assert whole.headers["content-encoding"] == "gzip"
    response, same = get(client, job["links"]["results"], "gzip", Range="bytes=10-29")
    assert (response.status_code, same) == (200, expected)
    assert response.headers["accept-ranges"] == "none"
    assert len(json.loads(gzip.decompress(same))["distances"]) > 0


def test_a_client_that_cannot_read_the_answer_of_a_job_is_told_so(
    client: TestClient, knot: str
) -> None:
    sent = {"Accept-Encoding": "gzip", "Prefer": "respond-async"}
    body = {"sources": [{"vertex": 4}]}
    job = client.post(f"/v1/meshes/{knot}/distances", json=body, headers=sent).json()
    wait_until(lambda: client.get(job["links"]["self"]).json()["status"] == "successful")
    link = job["links"]["results"]

    for accepted in ("identity", "zstd", "gzip;q=0"):
        refused = client.get(link, headers={"Accept-Encoding": accepted})
        problem = check_problem(refused, 406, "not_acceptable")
        assert "gzip" in problem["hint"]
    check_problem(client.get(link, headers={"Accept": "image/png"}), 406, "not_acceptable")
    for accepted in ("gzip", "*", "br, *;q=0.1"):
        assert client.get(link, headers={"Accept-Encoding": accepted}).status_code == 200
    assert client.get(link, headers={"Accept": "text/html, */*;q=0.1"}).status_code == 200


@pytest.mark.parametrize(
    ("accepted", "coding"),
    [
        (None, None),
        ("", None),
        ("identity", None),
        ("br", None),
        ("gzip", "gzip"),
        ("gzip, deflate, br, zstd", "zstd"),
        ("gzip;q=0.9, zstd;q=0.8", "gzip"),
        ("GZIP", "gzip"),
        ("*", "zstd"),
        ("*;q=0.5, zstd;q=0", "gzip"),
        ("*;q=0", None),
        ("gzip;q=0", None),
        ("identity, gzip;q=0.5", None),
    ],
)
def test_negotiation(accepted: str | None, coding: str | None) -> None:
    assert negotiate_coding(accepted) == coding


@pytest.mark.parametrize("header", ["Accept", "Accept-Encoding"])
def test_a_header_may_accept_fifty_types_or_codings(
    client: TestClient, plane: str, header: str
) -> None:
    """Thousands of them, which fit into a head, would hold the event loop."""
    link, item = f"/v1/meshes/{plane}/path?from=0&to=9", "*/*" if header == "Accept" else "gzip"
    most = {header: ",".join([item] * MOST_RANGES)}
    assert client.get(link, headers=most).status_code == 200
    more = {header: f"{most[header]},{item}"}
    problem = check_problem(client.get(link, headers=more), 431, "header_too_large")
    assert (problem["limit"], problem["actual"]) == (MOST_RANGES, MOST_RANGES + 1)

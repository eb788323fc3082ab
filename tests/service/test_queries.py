from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.encoding import Representation
from app.queries import DistancesQuery, result_key
from app.schemas.requests import DistancesRequest
from tests.support.service import NPY, check_problem, distances, serving, stored_mesh, upload_sample


def test_distances_are_the_library_s(client: TestClient, plane: str) -> None:
    field = gc.exact_distance(stored_mesh(client, plane), gc.Source(5))

    response = distances(client, plane, sources=[{"vertex": 5}])

    assert response.status_code == 200
    answer = response.json()
    np.testing.assert_array_equal(answer["distances"], field.distances)
    assert answer["mesh_id"] == plane
    assert answer["method"] == "exact"
    assert answer["error_bound"] == {"type": "relative", "value": 0.0, "kind": "guaranteed"}
    assert answer["sources"][0]["vertex"] == 5
    assert answer["sources"][0]["start_distance"] == 0
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}
    assert answer["stats"]["windows_created"] > 0
    assert answer["warnings"] == []
    for phase in ("queue", "load", "compute", "encode"):
        assert f"{phase};dur=" in response.headers["server-timing"]


def test_binary_formats_hold_the_same(client: TestClient, plane: str) -> None:
    answer = distances(client, plane).json()
    npy = distances(client, plane, NPY)
    octets = client.post(
        f"/v1/meshes/{plane}/distances?format=octets", json={"sources": [{"vertex": 0}]}
    )

    np.testing.assert_array_equal(np.load(BytesIO(npy.content)), answer["distances"])
    np.testing.assert_array_equal(np.frombuffer(octets.content, "<f8"), answer["distances"])
    for response in (npy, octets):
        assert response.headers["geodesic-dtype"] == "<f8"
        assert response.headers["geodesic-shape"] == str(len(answer["distances"]))
        assert response.headers["geodesic-mesh-id"] == plane
        assert response.headers["geodesic-error-bound"].startswith('{"type":"relative"')
    assert npy.headers["content-type"] == "application/x-npy"


def test_targets_sources_and_starts(client: TestClient, plane: str) -> None:
    mesh = stored_mesh(client, plane)
    field = gc.exact_distance(mesh, [gc.Source(0, 0.5), gc.Source(9, 0.0)])

    answer = distances(
        client,
        plane,
        sources=[{"vertex": 0, "start_distance": 0.5}, {"vertex": 9}],
        targets=[{"vertex": 3}, {"vertex": 7}, {"vertex": 3}],
        include=["nearest_source"],
    ).json()

    np.testing.assert_array_equal(answer["distances"], field.distances[[3, 7, 3]])
    np.testing.assert_array_equal(answer["nearest_source"], field.nearest_source[[3, 7, 3]])


def test_what_is_out_of_reach(client: TestClient, apart: str) -> None:
    answer = distances(client, apart, max_distance=0.5, include=["nearest_source"]).json()
    binary = np.load(BytesIO(distances(client, apart, NPY, max_distance=0.5).content))

    assert answer["distances"] == [0, None, None, None, None, None]
    assert answer["nearest_source"] == [0, None, None, None, None, None]
    assert answer["unreachable"] == {"disconnected": 3, "beyond_max_distance": 2}
    assert "components" in answer["warnings"][0]
    np.testing.assert_array_equal(binary, [0, *[np.inf] * 5])


@pytest.mark.usefixtures("one_replica")
def test_the_same_query_is_not_solved_again(client: TestClient, plane: str) -> None:
    first, again = (distances(client, plane, sources=[{"vertex": 11}]) for _ in range(2))

    assert again.content == first.content
    assert again.headers["etag"] == first.headers["etag"]
    assert again.headers["server-timing"] == "kept"
    other = distances(client, plane, sources=[{"vertex": 12}])
    assert other.headers["etag"] != first.headers["etag"]
    assert distances(client, plane, NPY, sources=[{"vertex": 11}]).headers["etag"] not in (
        first.headers["etag"],
        other.headers["etag"],
    )


def test_the_hash_of_a_query_is_stable(monkeypatch: pytest.MonkeyPatch) -> None:
    def query_of(**body: Any) -> DistancesQuery:
        return DistancesQuery("m", DistancesRequest.model_validate(body))

    query = query_of(sources=[{"vertex": 1}], targets=[{"vertex": 2}])
    twin = query_of(
        sources=[{"vertex": 1, "start_distance": 0}], targets=[{"vertex": 2}], max_distance=None
    )
    other = query_of(sources=[{"vertex": 1}])
    key = result_key(query)

    assert key == result_key(twin)
    other_form = query.answered_as(Representation("a/c"))
    assert len({key, result_key(other), result_key(other_form)}) == 3
    monkeypatch.setattr("app.queries.base.code_version", lambda: "another")
    assert result_key(query) != key


@pytest.mark.parametrize(
    ("body", "code", "places"),
    [
        ({"sources": [{"vertex": -1}]}, "invalid_point", ["/sources/0/vertex"]),
        (
            {"sources": [{"vertex": 0}, {"vertex": 10**6}], "targets": [{"vertex": -3}]},
            "invalid_point",
            ["/sources/1/vertex", "/targets/0/vertex"],
        ),
        ({"sources": [{"vertex": 10**30}]}, "invalid_point", ["/sources/0/vertex"]),
        ({"sources": []}, "invalid_request", ["/sources"]),
        ({"sources": [{"vertex": 0}], "targets": []}, "invalid_request", ["/targets"]),
        ({}, "invalid_request", ["/sources"]),
        ({"sources": [{"vertex": 1.5}]}, "invalid_request", ["/sources/0/vertex"]),
        ({"sources": [{"vertex": True}]}, "invalid_request", ["/sources/0/vertex"]),
        ({"sources": [{"vertex": "0"}]}, "invalid_request", ["/sources/0/vertex"]),
        ({"sources": [{"vertx": 0}]}, "invalid_request", None),
        ({"sources": [{"vertex": 0}], "source": 1}, "invalid_request", ["/source"]),
        (
            {"sources": [{"vertex": 0, "start_distance": -1}]},
            "invalid_request",
            ["/sources/0/start_distance"],
        ),
        ({"sources": [{"vertex": 0}], "max_distance": -1}, "invalid_request", ["/max_distance"]),
        ({"sources": [{"vertex": 0}], "max_distance": True}, "invalid_request", ["/max_distance"]),
        (
            {"sources": [{"position": [True, 0, 0]}]},
            "invalid_request",
            ["/sources/0/position/0"],
        ),
        (
            {"sources": [{"vertex": 0, "start_distance": False}]},
            "invalid_request",
            ["/sources/0/start_distance"],
        ),
        (
            {"sources": [{"vertex": 0}], "method": "approximate", "relative_error": True},
            "invalid_request",
            ["/relative_error"],
        ),
        ({"sources": [{"vertex": 0}], "method": "heat"}, "invalid_request", ["/method"]),
        ({"sources": [{"vertex": 0}], "include": ["paths"]}, "invalid_request", ["/include/0"]),
    ],
)
def test_refused_distances(
    client: TestClient, plane: str, body: dict, code: str, places: list[str] | None
) -> None:
    response = client.post(f"/v1/meshes/{plane}/distances", json=body)

    problem = check_problem(response, 422, code)
    assert places is None or [fault["pointer"] for fault in problem["errors"]] == places


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite(client: TestClient, plane: str, number: str) -> None:
    for body in (
        f'{{"sources": [{{"vertex": 0, "start_distance": {number}}}]}}',
        f'{{"sources": [{{"vertex": 0}}], "max_distance": {number}}}',
        f'{{"sources": [{{"vertex": {number}}}]}}',
        f'{{"sources": [{{"edge": [0, 1], "t": {number}}}]}}',
        f'{{"sources": [{{"face": 0, "barycentric": [1, 0, {number}]}}]}}',
        f'{{"sources": [{{"position": [0, {number}, 0]}}]}}',
        f'{{"sources": [{{"position": [0, 0, 0], "max_distance": {number}}}]}}',
    ):
        response = client.post(
            f"/v1/meshes/{plane}/distances",
            content=body,
            headers={"Content-Type": "application/json"},
        )
        check_problem(response, 422, "invalid_request")


@pytest.mark.parametrize(
    ("content", "media_type", "status", "code"),
    [
        (b"{", "application/json", 400, "malformed_body"),
        (b'"\xff"', "application/json", 400, "malformed_body"),
        (b"[" * 100_000, "application/json", 400, "malformed_body"),
        (b"9" * 10_000, "application/json", 422, "invalid_request"),
        (b"", "application/json", 422, "invalid_request"),
        (b"[]", "application/json", 422, "invalid_request"),
        (b"{}", "application/x-www-form-urlencoded", 415, "unsupported_media_type"),
        (b"{}", None, 415, "unsupported_media_type"),
    ],
)
def test_bodies_that_are_no_query(
    client: TestClient, plane: str, content: bytes, media_type: str | None, status: int, code: str
) -> None:
    headers = {} if media_type is None else {"Content-Type": media_type}
    response = client.post(f"/v1/meshes/{plane}/distances", content=content, headers=headers)

    check_problem(response, status, code)


@pytest.mark.parametrize(
    ("headers", "parameters", "body", "places"),
    [
        ({"X-Timeout-Ms": "0"}, {}, {}, ["/header/x-timeout-ms"]),
        ([("X-Timeout-Ms", "900"), ("X-Timeout-Ms", "800")], {}, {}, ["/header/x-timeout-ms"]),
        ({"Idempotency-Key": ""}, {}, {}, ["/header/idempotency-key"]),
        ({"Idempotency-Key": "k" * 256}, {}, {}, ["/header/idempotency-key"]),
        ({}, {"dtype": "float16"}, {}, ["/query/dtype"]),
        ({}, {"dtype": ["float32", "perhaps"]}, {}, ["/query/dtype"]),
        ({}, {"colour": "red"}, {}, ["/query/colour"]),
        (
            {"X-Timeout-Ms": "soon"},
            {"dtype": "perhaps", "colour": "red"},
            {"max_distance": -1},
            ["/header/x-timeout-ms", "/query/dtype", "/query/colour", "/max_distance"],
        ),
    ],
)
def test_all_faults_are_named_at_once(
    client: TestClient, plane: str, headers: Any, parameters: Any, body: Any, places: list[str]
) -> None:
    query = {"sources": [{"vertex": 0}], **body}
    link = f"/v1/meshes/{plane}/distances"
    response = client.post(link, json=query, params=parameters, headers=headers)

    problem = check_problem(response, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_a_preference_may_come_in_a_header_of_its_own(client: TestClient, plane: str) -> None:
    headers = [("Prefer", "handling=lenient"), ("Prefer", "respond-async")]
    response = client.post(
        f"/v1/meshes/{plane}/distances", json={"sources": [{"vertex": 0}]}, headers=headers
    )
    assert response.status_code == 202


def test_of_a_parameter_that_is_given_again_the_last_counts(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/path?from=v0&to=v9&from=v5&format=csv&format=json&via=v7&via=v8"
    answer = client.get(link).json()
    assert answer["source"]["vertex"] == 5
    assert [point["vertex"] for point in answer["waypoints"]] == [7, 8]


def test_limits_of_queries(tmp_path: Path) -> None:
    limits = {"max_sources": 2, "max_json_values": 50, "query_memory_bytes": 100}
    with serving(tmp_path, **limits) as client:
        mesh_id = upload_sample(client, "plane", 100)

        many = check_problem(
            distances(client, mesh_id, sources=[{"vertex": 0}] * 3), 422, "limit_exceeded"
        )
        assert (many["limit"], many["actual"]) == (2, 3)
        assert many["setting"] == "max_sources"

        large = check_problem(distances(client, mesh_id), 413, "result_too_large")
        assert large["setting"] == "max_json_values"
        assert "application/x-npy" in large["hint"]
        twice = {"targets": [{"vertex": 0}] * 6, "include": ["nearest_source"]}
        large = check_problem(distances(client, mesh_id, **twice), 413, "result_too_large")
        assert large["actual"] == 6 * (2 + 8)

        for method in ("exact", "approximate"):
            response = distances(client, mesh_id, NPY, method=method)
            check_problem(response, 422, "memory_limit")
            path = f"/v1/meshes/{mesh_id}/path?from=v0&to=v9&method={method}"
            check_problem(client.get(path), 422, "memory_limit")

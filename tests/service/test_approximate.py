"""Approximate answers: what they promise, and how they differ from exact ones."""

from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, distances, stored_mesh, upload_sample

ENDS = {"source": {"vertex": 3}, "target": {"vertex": 700}}


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    """The id of a curved mesh, on which windows merge."""
    return upload_sample(client, "knot", 3000)


def approximate(client: TestClient, mesh_id: str, headers: Any = None, **body: Any) -> Any:
    return distances(client, mesh_id, headers, method="approximate", **body)


def path(client: TestClient, mesh_id: str, headers: Any = None, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/path", json=ENDS | body, headers=headers)


# Distances


def test_distances_are_the_library_s(client: TestClient, knot: str) -> None:
    field = gc.approximate_distance(stored_mesh(client, knot), 3, relative_error=0.01)

    answer = approximate(client, knot, sources=[{"vertex": 3}], relative_error=0.01).json()

    np.testing.assert_array_equal(answer["distances"], field.distances)
    assert answer["method"] == "approximate"
    assert answer["error_bound"] == {"type": "relative", "value": 0.002, "kind": "guaranteed"}
    assert answer["stats"]["windows_kept"] == field.stats.windows_kept


# Kept results


@pytest.mark.usefixtures("one_replica")
def test_each_method_and_error_has_a_result_of_its_own(client: TestClient, knot: str) -> None:
    exact = {"sources": [{"vertex": 42, "start_distance": 0.625}]}
    bodies = [
        exact,
        exact | {"method": "approximate"},
        exact | {"method": "approximate", "relative_error": 0.02},
        exact | {"method": "approximate", "absolute_error": 0.02},
        exact | {"method": "approximate", "relative_error": 0.02, "absolute_error": 0.02},
    ]
    first = [distances(client, knot, **body) for body in bodies]
    again = [distances(client, knot, **body) for body in bodies]

    assert len({response.headers["etag"] for response in first}) == len(bodies)
    for fresh, kept in zip(first, again, strict=True):
        assert "compute" in fresh.headers["server-timing"]
        assert kept.headers["server-timing"] == "kept"
        assert kept.content == fresh.content
    bounds = [response.json()["error_bound"]["value"] for response in again]
    assert bounds == [0, 1e-3, 2e-3, 0.02, 2e-3]  # a larger one is not used


@pytest.mark.usefixtures("one_replica")
def test_the_usual_error_is_one_result_with_its_spelling(client: TestClient, knot: str) -> None:
    bare = approximate(client, knot, sources=[{"vertex": 43}])
    spelt = approximate(client, knot, sources=[{"vertex": 43}], relative_error=0.001)

    assert spelt.headers["server-timing"] == "kept"
    assert spelt.headers["etag"] == bare.headers["etag"]


# Paths


def test_paths_are_the_library_s(client: TestClient, knot: str) -> None:
    mesh = stored_mesh(client, knot)
    field = gc.approximate_distance(mesh, 3, relative_error=0.05, retain="paths")
    expected = field.path_to(700)

    answer = path(client, knot, method="approximate", relative_error=0.05).json()

    assert (answer["status"], answer["method"]) == ("ok", "approximate")
    assert answer["length"] == expected.length
    np.testing.assert_array_equal(answer["points"], expected.points)
    np.testing.assert_array_equal(answer["faces"], expected.faces)
    assert answer["error_bound"] == {
        "type": "relative",
        "value": expected.error_bound.value,
        "kind": "guaranteed",
    }


# Refusals

REFUSED = [
    *(
        ({"method": "approximate", "relative_error": value}, ["relative_error"])
        for value in (0, -1e-3, 1, 1.5, 1e308, "much", [0.1])
    ),
    *(
        ({"method": "approximate", "absolute_error": value}, ["absolute_error"])
        for value in (0, -1, "much", {})
    ),
    (
        {"method": "approximate", "relative_error": 2, "absolute_error": -2},
        ["relative_error", "absolute_error"],
    ),
    ({"relative_error": 0.01}, ["relative_error"]),
    ({"method": "exact", "absolute_error": 0.01}, ["absolute_error"]),
    (
        {"method": "exact", "relative_error": 0.01, "absolute_error": 0.01},
        ["relative_error", "absolute_error"],
    ),
    ({"method": "Approximate"}, ["method"]),
    ({"method": None}, ["method"]),
    ({"method": "approximate", "error": 0.01}, ["error"]),
]


@pytest.mark.parametrize(("body", "names"), REFUSED)
def test_refused_errors(client: TestClient, knot: str, body: dict, names: list[str]) -> None:
    for response in (distances(client, knot, **body), path(client, knot, **body)):
        problem = check_problem(response, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == [f"/{name}" for name in names]
        assert problem["detail"].startswith(f"/{names[0]}: ")


def test_exact_refuses_an_error_with_a_reason(client: TestClient, knot: str) -> None:
    problem = distances(client, knot, relative_error=0.01).json()

    assert "method 'approximate' only" in problem["detail"]

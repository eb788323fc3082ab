"""Fast answers: lengths of paths, never too short, with an estimate of the error."""

from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, distances, stored_mesh, upload_sample

EFFORTS = 1, 2
ROUNDING = 1e-9
SOURCES = [{"vertex": 3}, {"vertex": 400, "start_distance": 0.25}]
ENDS = {"source": {"vertex": 3}, "target": {"vertex": 700}}


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


def fast(client: TestClient, mesh_id: str, headers: Any = None, **body: Any) -> Any:
    return distances(client, mesh_id, headers, method="fast", **body)


def ask(client: TestClient, mesh_id: str, operation: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{operation}", json={"method": "fast"} | body)


# Distances


@pytest.mark.parametrize("effort", EFFORTS)
def test_distances_are_the_library_s(client: TestClient, knot: str, effort: int) -> None:
    sources = [gc.Source(3), gc.Source(400, 0.25)]
    field = gc.fast_distance(stored_mesh(client, knot), sources, effort)

    include = ["nearest_source", "gradient"]
    answer = fast(client, knot, sources=SOURCES, effort=effort, include=include).json()

    np.testing.assert_array_equal(answer["distances"], field.distances)
    np.testing.assert_array_equal(answer["nearest_source"], field.nearest_source)
    np.testing.assert_array_equal(np.array(answer["gradient"], float), field.gradient)
    assert answer["method"] == "fast"
    value = field.error_bound.value
    assert answer["error_bound"] == {"type": "relative", "value": value, "kind": "estimated"}
    assert answer["stats"]["windows_kept"] == field.stats.windows_kept


@pytest.mark.usefixtures("one_replica")
def test_the_usual_effort_is_2(client: TestClient, knot: str) -> None:
    bare = fast(client, knot, sources=[{"vertex": 43}])
    spelt = fast(client, knot, sources=[{"vertex": 43}], effort=2)

    assert spelt.headers["server-timing"] == "kept"
    assert spelt.headers["etag"] == bare.headers["etag"]


# Paths


@pytest.mark.parametrize("effort", [None, *EFFORTS])
@pytest.mark.parametrize("waypoints", [[], [9]])
def test_a_path_is_straight_and_no_shorter_than_the_shortest(
    client: TestClient, knot: str, effort: int | None, waypoints: list[int]
) -> None:
    """Landmarks of the worker may lead it another way than a new search of the library."""
    stops = ENDS | {"waypoints": [{"vertex": v} for v in waypoints]}
    exact = ask(client, knot, "path", **stops, method="exact").json()["length"]
    options = {} if effort is None else {"effort": effort}
    mesh = stored_mesh(client, knot)

    answer = ask(client, knot, "path", **stops, **options).json()

    assert (answer["status"], answer["method"]) == ("ok", "fast")
    bound = answer["error_bound"]
    assert (bound["type"], bound["kind"]) == ("relative", "estimated")
    assert exact * (1 - ROUNDING) <= answer["length"] <= exact * (1 + bound["value"])
    places = [gc.SurfacePoint.face(at["face"], at["barycentric"]) for at in answer["locations"]]
    curve = mesh.curve(places)
    assert curve.length == pytest.approx(answer["length"], rel=ROUNDING)
    if not waypoints:
        assert gc.straighten(curve).length == pytest.approx(answer["length"], rel=ROUNDING)


def test_that_a_path_is_too_long_is_estimated_as_well(client: TestClient, knot: str) -> None:
    beyond = ask(client, knot, "path", **ENDS, max_distance=0.5, effort=2).json()
    some = ask(client, knot, "paths", source=ENDS["source"], targets=[ENDS["target"]])

    assert (beyond["status"], beyond["reason"]) == ("no_path", "beyond_max_distance")
    assert beyond["error_bound"] == some.json()["paths"][0]["error_bound"]
    assert beyond["error_bound"]["kind"] == "estimated"
    several = ask(client, knot, "paths", **ENDS_OF_PATHS, max_distance=0.5).json()["paths"]
    assert several[0]["error_bound"] == beyond["error_bound"]


ENDS_OF_PATHS = {"source": ENDS["source"], "targets": [ENDS["target"]]}


# Refusals


@pytest.mark.parametrize(
    ("body", "names"),
    [
        *(({"method": "fast", "effort": value}, ["effort"]) for value in (0, 3, -1, 2.5, 16)),
        *(({"method": "fast", "effort": value}, ["effort"]) for value in (True, "much", [2], {})),
        ({"effort": 2}, ["effort"]),
        ({"method": "exact", "effort": 2}, ["effort"]),
        ({"method": "approximate", "effort": 2}, ["effort"]),
        ({"method": "fast", "relative_error": 0.1}, ["relative_error"]),
        (
            {"method": "fast", "effort": 1, "relative_error": 0.1, "absolute_error": 1},
            ["relative_error", "absolute_error"],
        ),
        ({"method": "Fast"}, ["method"]),
    ],
)
def test_refused_efforts(client: TestClient, knot: str, body: dict, names: list[str]) -> None:
    for operation, ends in (
        ("distances", {"sources": SOURCES}),
        ("path", ENDS),
        ("paths", ENDS_OF_PATHS),
    ):
        response = client.post(f"/v1/meshes/{knot}/{operation}", json=ends | body)
        problem = check_problem(response, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == [f"/{name}" for name in names]


def test_an_effort_is_refused_with_a_reason(client: TestClient, knot: str) -> None:
    problem = distances(client, knot, sources=SOURCES, effort=2).json()

    assert "method 'fast' only" in problem["detail"]


def test_approximate_paths_have_no_waypoints(client: TestClient, knot: str) -> None:
    response = ask(client, knot, "path", **ENDS, waypoints=[{"vertex": 9}], method="approximate")
    problem = check_problem(response, 422, "invalid_request")

    assert [fault["pointer"] for fault in problem["errors"]] == ["/waypoints"]
    assert "methods 'exact' and 'fast' only" in problem["detail"]


def test_isolines_name_the_methods_that_they_have(client: TestClient, knot: str) -> None:
    response = ask(client, knot, "isolines", sources=SOURCES, count=3)

    problem = check_problem(response, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/method"]
    assert "'exact' or 'approximate'" in problem["detail"]

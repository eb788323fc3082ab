"""Costs over HTTP: cheapest paths and their costs are the library's, and what is refused."""

from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, distances, stored_mesh, upload_sample

RULE = [[-5.0, 6.0], [0.0, 1.0], [5.0, 11.0]]


@pytest.fixture(scope="module")
def hills(client: TestClient) -> str:
    return upload_sample(client, "terrain", 500)


def by_face(mesh: gc.TriangleMesh) -> list[float | None]:
    """Dearer from west to east, and some faces closed."""
    costs = np.linspace(1.0, 4.0, len(mesh.faces)).tolist()
    return [None if k % 17 == 5 else cost for k, cost in enumerate(costs)]


def as_costs(faces: list[float | None]) -> np.ndarray:
    return np.array([np.inf if cost is None else cost for cost in faces])


def known(mesh: gc.TriangleMesh) -> list[tuple[dict, Any]]:
    """Costs as requests and the library have them."""
    faces = by_face(mesh)
    pace, steps = gc.SlopeCost("tobler"), gc.SlopeCost(RULE, "-z", zigzag=False)
    return [
        ({"faces": faces}, as_costs(faces)),
        ({"slope": "tobler", "detail": "fine"}, pace),
        ({"faces": faces, "slope": RULE, "up": "-z", "zigzag": False}, (as_costs(faces), steps)),
    ]


@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize("direction", ["from", "to"])
def test_fields_are_the_library_s(client: TestClient, hills: str, k: int, direction: str) -> None:
    mesh = stored_mesh(client, hills)
    cost, given = known(mesh)[k]
    detail = cost.get("detail", "default")
    field = gc.cost_distance(mesh, [3, 90], given, direction=direction, detail=detail)
    inside = gc.SurfacePoint.face(8, (0.2, 0.3, 0.5))

    asked = {"sources": [3, 90], "cost": cost | {"direction": direction}}
    answer = distances(client, hills, **asked, include=["nearest_source"]).json()

    found = [np.inf if each is None else each for each in answer["distances"]]
    np.testing.assert_array_equal(found, field.costs)
    nearest = [-1 if each is None else each for each in answer["nearest_source"]]
    np.testing.assert_array_equal(nearest, field.nearest_source)
    assert answer["method"] == "cheapest"
    assert answer["error_bound"]["kind"] == "estimated"
    assert answer["error_bound"]["value"] == field.error_bound.value
    place = {"face": 8, "barycentric": [0.2, 0.3, 0.5]}
    of_points = distances(client, hills, **asked, targets=[40, place]).json()["distances"]
    assert of_points == [field.cost_at(40), field.cost_at(inside)]


@pytest.mark.parametrize("k", range(3))
def test_paths_are_the_library_s(client: TestClient, hills: str, k: int) -> None:
    mesh = stored_mesh(client, hills)
    cost, given = known(mesh)[k]
    detail = cost.get("detail", "default")
    path = gc.cheapest_path(mesh, 3, 200, given, detail=detail)

    body = {"source": 3, "target": 200, "cost": cost}
    answer = client.post(f"/v1/meshes/{hills}/path", json=body).json()

    assert (answer["status"], answer["method"]) == ("ok", "cheapest")
    assert (answer["cost"], answer["length"]) == (path.cost, path.length)
    np.testing.assert_array_equal(answer["points"], path.points)
    assert answer["error_bound"]["value"] == path.error_bound.value
    npy = client.post(f"/v1/meshes/{hills}/path?format=npy", json=body)
    assert npy.headers["geodesic-cost"] == repr(path.cost)


@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize("direction", ["from", "to"])
def test_paths_to_many_are_the_library_s(
    client: TestClient, hills: str, k: int, direction: str
) -> None:
    mesh = stored_mesh(client, hills)
    cost, given = known(mesh)[k]
    detail = cost.get("detail", "default")
    asked = cost | {"direction": direction, "max_cost": 1.5 * float(np.median(costs(mesh, k)))}
    field = gc.cost_distance(mesh, 3, given, asked["max_cost"], direction=direction, detail=detail)
    assert np.isfinite(field.costs).any()
    assert np.isinf(field.costs).any()

    body = {"source": 3, "targets": list(range(0, 250, 10)), "cost": asked}
    answer = client.post(f"/v1/meshes/{hills}/paths", json=body).json()

    assert answer["method"] == "cheapest"
    for target, path in zip(body["targets"], answer["paths"], strict=True):
        if np.isinf(field.costs[target]):
            assert (path["status"], path["reason"]) == ("no_path", "beyond_max_cost")
            assert (path["cost"], path["length"]) == (None, None)
            continue
        own = field.path_to(target)
        assert (path["cost"], path["length"]) == (own.cost, own.length)
        np.testing.assert_array_equal(path["points"], own.points)
        assert path["error_bound"]["value"] == own.error_bound.value


def costs(mesh: gc.TriangleMesh, k: int) -> np.ndarray:
    found = gc.cost_distance(mesh, 3, known(mesh)[k][1]).costs
    return found[np.isfinite(found)]


@pytest.mark.parametrize("k", range(3))
def test_lines_of_equal_cost_are_the_library_s(client: TestClient, hills: str, k: int) -> None:
    mesh = stored_mesh(client, hills)
    cost, given = known(mesh)[k]
    field = gc.cost_distance(mesh, [3, 90], given, detail=cost.get("detail", "default"))

    asked = {"sources": [3, 90], "cost": cost}
    for levels in ({"count": 3}, {"levels": [float(np.median(costs(mesh, k)))]}):
        answer = client.post(f"/v1/meshes/{hills}/isolines", json=asked | levels).json()
        spaced = gc.spaced_levels(field.costs, 3).tolist()
        assert [each["level"] for each in answer["isolines"]] == levels.get("levels", spaced)
        assert (answer["method"], answer["chord_error"]) == ("cheapest", 0.0)
        assert answer["error_bound"]["value"] == field.error_bound.value
        for each in answer["isolines"]:
            (own,) = field.isochrones([each["level"]])
            assert len(each["lines"]) == len(own) > 0
            for line, expected in zip(each["lines"], own, strict=True):
                np.testing.assert_array_equal(line["points"], expected.points)


def test_a_path_beyond_the_largest_cost_is_none(client: TestClient, hills: str) -> None:
    body = {"source": 3, "target": 200, "cost": {"slope": "naismith", "max_cost": 0.1}}
    answer = client.post(f"/v1/meshes/{hills}/path", json=body).json()
    assert (answer["status"], answer["reason"]) == ("no_path", "beyond_max_cost")
    assert (answer["cost"], answer["length"]) == (None, None)


def test_barriers_are_closed(client: TestClient, hills: str) -> None:
    mesh, wall = stored_mesh(client, hills), list(range(40, 60))
    blocked = mesh.with_barriers(wall)
    field = gc.cost_distance(blocked, 3, gc.SlopeCost("tobler"))
    answer = distances(client, hills, sources=[3], barriers=wall, cost={"slope": "tobler"}).json()
    found = [np.inf if each is None else each for each in answer["distances"]]
    np.testing.assert_array_equal(found, field.costs)


SLOPE = {"slope": "tobler"}


@pytest.mark.parametrize(
    ("operation", "body", "place"),
    [
        ("distances", {"cost": {}}, "/cost"),
        ("distances", {"cost": {"slope": "hilly"}}, "/cost/slope"),
        ("distances", {"cost": {"faces": [1.0, 2.0]}}, "/cost/faces"),
        ("distances", {"cost": {"faces": [0.0]}}, "/cost/faces/0"),
        ("distances", {"cost": {"faces": [-1.0]}}, "/cost/faces/0"),
        ("distances", {"cost": {"slope": [[-1, 1], [0, 5], [1, 1]]}}, "/cost/slope"),
        ("distances", {"cost": SLOPE, "method": "fast"}, "/method"),
        ("distances", {"cost": SLOPE, "certify": True}, "/certify"),
        ("distances", {"cost": SLOPE, "max_distance": 1.0}, "/max_distance"),
        ("distances", {"cost": SLOPE, "include": ["gradient"]}, "/include"),
        ("path", {"cost": SLOPE, "waypoints": [7]}, "/waypoints"),
        ("path", {"cost": SLOPE, "method": "approximate"}, "/method"),
        ("path", {"cost": SLOPE | {"direction": "to"}}, "/cost/direction"),
        ("paths", {"cost": SLOPE, "method": "fast"}, "/method"),
        ("paths", {"cost": SLOPE, "max_distance": 1.0}, "/max_distance"),
        ("paths", {"cost": {"faces": [1.0, 2.0]}}, "/cost/faces"),
        ("isolines", {"cost": SLOPE, "chord_error": 0.1}, "/chord_error"),
        ("isolines", {"cost": SLOPE, "method": "approximate"}, "/method"),
        ("isolines", {"cost": SLOPE, "max_distance": 1.0}, "/max_distance"),
        ("isolines", {"cost": SLOPE, "values": [1.0], "sources": []}, "/cost"),
        ("isolines", {"cost": {"slope": "hilly"}}, "/cost/slope"),
        ("isolines", {"cost": {"slope": False}}, "/cost/slope"),
        ("distances", {"cost": {"slope": [["steep", 1.0]]}}, "/cost/slope/0/0"),
    ],
)
def test_refused(client: TestClient, hills: str, operation: str, body: dict, place: str) -> None:
    ends: dict[str, dict[str, Any]] = {
        "distances": {"sources": [3]},
        "isolines": {"sources": [3], "count": 3},
        "path": {"source": 3, "target": 200},
        "paths": {"source": 3, "targets": [200]},
    }
    refused = client.post(f"/v1/meshes/{hills}/{operation}", json=ends[operation] | body)
    problem = check_problem(refused, 422, "invalid_request")
    places = [fault["pointer"] for fault in problem["errors"]]
    assert place in places

"""Paths from one point to many over HTTP: the library's, and what is refused."""

from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, serving, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
TARGETS = [{"vertex": 700}, INSIDE, {"vertex": 3}, {"vertex": 700}, {"vertex": 1200}]
METHODS = ({}, {"method": "approximate", "relative_error": 0.05})


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


def paths(client: TestClient, mesh_id: str, query: str = "", **body: Any) -> Any:
    request = {"source": {"vertex": 3}, "targets": TARGETS} | body
    return client.post(f"/v1/meshes/{mesh_id}/paths{query}", json=request)


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_paths_are_the_library_s(client: TestClient, knot: str, method: dict) -> None:
    mesh = stored_mesh(client, knot)
    places = [700, gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)), 3, 700, 1200]
    if method:
        field = gc.approximate_distance(mesh, 3, 0.05, targets=places, retain="paths")
    else:
        field = gc.exact_distance(mesh, 3, targets=places)

    answer = paths(client, knot, **method).json()

    assert answer["mesh_id"] == knot
    assert answer["method"] == method.get("method", "exact")
    assert answer["source"]["vertex"] == 3
    assert answer["stats"]["windows_created"] == field.stats.windows_created
    assert len(answer["paths"]) == len(places)
    for found, place in zip(answer["paths"], places, strict=True):
        expected = field.path_to(place)
        assert found["status"] == "ok"
        assert found["length"] == expected.length
        assert found["points"] == expected.points.tolist()
        assert found["faces"] == expected.faces.tolist()
        assert [tuple(at["barycentric"]) for at in found["locations"]] == [
            location.barycentric for location in expected.locations
        ]
        assert found["error_bound"]["value"] == expected.error_bound.value
        assert found["target"]["position"] == mesh.position(mesh.point(place)).tolist()
    assert "reason" not in answer["paths"][0]
    assert (answer["paths"][2]["length"], len(answer["paths"][2]["points"])) == (0, 1)


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_no_path_has_a_reason_of_its_own(client: TestClient, apart: str, method: dict) -> None:
    targets = [{"vertex": i} for i in (4, 1, 0)]
    found = paths(
        client, apart, source={"vertex": 0}, targets=targets, max_distance=0.5, **method
    ).json()["paths"]

    assert [path["status"] for path in found] == ["no_path", "no_path", "ok"]
    assert [path.get("reason") for path in found] == ["disconnected", "beyond_max_distance", None]
    for path in found[:2]:
        missing = [path[name] for name in ("length", "points", "locations", "faces")]
        assert missing == [None] * 4
        assert path["error_bound"]["kind"] == "guaranteed"
    assert [path["target"]["vertex"] for path in found] == [4, 1, 0]


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"targets": []}, "/targets"),
        ({"targets": None}, "/targets"),
        ({"targets": [3.0]}, "/targets/0"),
        ({"source": None}, "/source"),
        ({"source": {"vertex": 0, "start_distance": 1}}, "/source/start_distance"),
        ({"sources": []}, "/sources"),
        ({"waypoints": []}, "/waypoints"),
        ({"max_distance": -1}, "/max_distance"),
        ({"method": "heat"}, "/method"),
        ({"relative_error": 0.1}, "/relative_error"),
        ({"absolute_error": 0.1}, "/absolute_error"),
        ({"method": "approximate", "relative_error": 1}, "/relative_error"),
        ({"method": "approximate", "absolute_error": 0}, "/absolute_error"),
    ],
)
def test_refused_paths(client: TestClient, knot: str, change: dict, place: str) -> None:
    problem = check_problem(paths(client, knot, **change), 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == [place]


def test_paths_that_are_too_large(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=300) as client:
        mesh_id = upload_sample(client, "plane", 1000)

        few = paths(client, mesh_id, source={"vertex": 0}, targets=[{"vertex": 99}])
        assert few.status_code == 200
        for count in (9, 50):  # found when they are traced, and before
            many = paths(client, mesh_id, source={"vertex": 0}, targets=[{"vertex": 99}] * count)
            problem = check_problem(many, 413, "result_too_large")
            assert problem["actual"] > problem["limit"] == 300
            assert "fewer targets" in problem["hint"]

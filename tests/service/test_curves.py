"""Curves as sources over HTTP: the library's answers, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, distances, serving, stored_mesh, upload_sample

METHODS = ({}, {"method": "approximate", "relative_error": 0.05})
DIAGONAL = [{"vertex": 12 * i} for i in range(4)]
"""Of the plane of 10 × 10 squares: along edges from the corner at the origin"""


def paths(client: TestClient, mesh_id: str, query: str = "", **body: Any) -> Any:
    request = {"source": {"polyline": DIAGONAL}, "targets": [{"vertex": 10}]} | body
    return client.post(f"/v1/meshes/{mesh_id}/paths{query}", json=request)


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_distances_are_the_library_s(client: TestClient, method: dict) -> None:
    knot = upload_sample(client, "knot", 3000)
    mesh = stored_mesh(client, knot)
    curve = gc.shortest_path(mesh, 3, 700).locations
    polyline = [{"face": at.face_index, "barycentric": list(at.barycentric)} for at in curve]
    sources = [gc.Source(gc.Curve(curve), 0.5), 1200]
    target = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    solve = gc.approximate_distance if method else gc.exact_distance
    errors = {"relative_error": 0.05} if method else {}
    field = solve(mesh, sources, targets=[target], **errors)

    body: dict[str, Any] = {
        "sources": [{"polyline": polyline, "start_distance": 0.5}, {"vertex": 1200}],
        "include": ["nearest_source"],
        **method,
    }
    answer = distances(client, knot, **body).json()
    some = distances(
        client,
        knot,
        **body,
        targets=[{"face": 40, "barycentric": [0.2, 0.3, 0.5]}, {"vertex": 9}],
    ).json()

    assert answer["distances"] == field.distances.tolist()
    assert answer["nearest_source"] == field.nearest_source.tolist()
    assert some["distances"] == [field.distance_at(target), field.distances[9]]
    echoed, other = answer["sources"]
    assert echoed["start_distance"] == 0.5
    assert [point["position"] for point in echoed["polyline"]] == [
        mesh.position(mesh.point(at)).tolist() for at in curve
    ]
    assert echoed["polyline"][0]["vertex"] == 3
    assert other["vertex"] == 1200


def test_a_curve_may_be_a_point(client: TestClient, plane: str) -> None:
    point, curve, still = (
        distances(client, plane, sources=[source]).json()
        for source in (
            {"vertex": 7},
            {"polyline": [{"vertex": 7}]},
            {"polyline": [{"vertex": 7}] * 2},
        )
    )

    assert point["distances"] == curve["distances"] == still["distances"]


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_paths_start_on_the_curve(client: TestClient, plane: str, method: dict) -> None:
    answer = paths(client, plane, **method).json()

    assert [point["vertex"] for point in answer["source"]["polyline"]] == [0, 12, 24, 36]
    assert "start_distance" not in answer["source"]
    (path,) = answer["paths"]
    assert path["length"] == pytest.approx(np.hypot(0.7, 0.3), rel=0.05 if method else 1e-12)
    np.testing.assert_allclose(path["points"][0], [0.3, 0.3, 0], atol=0.05 if method else 1e-12)
    (foot,) = paths(client, plane, targets=[{"vertex": 3}]).json()["paths"]
    assert foot["length"] == pytest.approx(0.3 / np.sqrt(2))
    np.testing.assert_allclose(foot["points"][0], [0.15, 0.15, 0], atol=1e-12)


def test_barriers_part_a_curve_from_what_is_behind(client: TestClient, plane: str) -> None:
    wall = list(range(100, 120))
    answer = distances(client, plane, sources=[{"polyline": DIAGONAL}], barriers=wall).json()
    assert answer["unreachable"] == {"disconnected": 55, "beyond_max_distance": 0}
    (path,) = paths(client, plane, barriers=wall).json()["paths"]
    assert (path["status"], path["reason"]) == ("no_path", "disconnected")


@pytest.mark.parametrize(
    ("polyline", "code", "places"),
    [
        ([], "invalid_request", [""]),
        (None, "invalid_request", [""]),
        ({"vertex": 0}, "invalid_request", [""]),
        ([0.0], "invalid_request", ["/0"]),
        ([{"vertex": 0, "start_distance": 1}], "invalid_request", ["/0/start_distance"]),
        ([{"polyline": [{"vertex": 0}]}], "invalid_request", ["/0"]),
        ([{"vertex": 0}, {"vertex": 121}], "invalid_point", ["/1/vertex"]),
        ([{"vertex": 0}, {"edge": [0, 2], "t": 0.5}], "invalid_point", ["/1/edge"]),
        ([{"vertex": i} for i in (0, 1, 3, 4, 60)], "invalid_point", ["/2", "/4"]),
    ],
)
def test_refused_curves(
    client: TestClient, plane: str, polyline: Any, code: str, places: list[str]
) -> None:
    field = client.post(
        f"/v1/meshes/{plane}/distances",
        json={"sources": [{"vertex": 0}, {"polyline": polyline}]},
    )
    for response, where in (
        (field, "/sources/1"),
        (paths(client, plane, source={"polyline": polyline}), "/source"),
    ):
        problem = check_problem(response, 422, code)
        assert [fault["pointer"] for fault in problem["errors"]] == [
            f"{where}/polyline{place}" for place in places
        ]


def test_curves_are_sources_of_sweeps_only(client: TestClient, plane: str) -> None:
    curve = {"polyline": DIAGONAL}
    for operation, body, place in (
        ("distances", {"sources": [{"vertex": 0}], "targets": [curve]}, "/targets/0"),
        ("paths", {"source": {"vertex": 0}, "targets": [curve]}, "/targets/0"),
        ("paths", {"source": curve | {"start_distance": 1}}, "/source/start_distance"),
        ("path", {"source": curve, "target": {"vertex": 0}}, "/source"),
        ("matrix", {"sources": [curve], "targets": [{"vertex": 0}]}, "/sources/0"),
        ("nearest", {"source": curve, "candidates": [{"vertex": 0}]}, "/source"),
    ):
        request = {"targets": [{"vertex": 1}]} | body if operation == "paths" else body
        refused = client.post(f"/v1/meshes/{plane}/{operation}", json=request)
        problem = check_problem(refused, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == [place]


def test_start_distances_are_for_sources_of_sweeps_only(client: TestClient, plane: str) -> None:
    """Where no other source competes, one would add a constant."""
    late, point = {"vertex": 0, "start_distance": 1}, {"vertex": 1}
    for operation, body, place in (
        ("distances", {"sources": [point], "targets": [late]}, "/targets/0"),
        ("paths", {"source": late, "targets": [point]}, "/source"),
        ("path", {"source": late, "target": point}, "/source"),
        ("path", {"source": point, "target": point, "waypoints": [late]}, "/waypoints/0"),
        ("matrix", {"sources": [late]}, "/sources/0"),
        ("matrix", {"sources": [point], "targets": [late]}, "/targets/0"),
        ("nearest", {"source": late, "candidates": [point]}, "/source"),
        ("nearest", {"source": point, "candidates": [late]}, "/candidates/0"),
    ):
        refused = client.post(f"/v1/meshes/{plane}/{operation}", json=body)
        problem = check_problem(refused, 422, "invalid_request")
        (fault,) = problem["errors"]
        assert fault["pointer"] == f"{place}/start_distance"
        assert fault["message"].startswith("Only sources of distances, isolines and borders")
    unknown = client.post(
        f"/v1/meshes/{plane}/nearest", json={"source": {"vertex": 0, "end": 1}, "candidates": [0]}
    )
    assert "start_distance" not in check_problem(unknown, 422, "invalid_request")["detail"]


def test_all_points_of_curves_count(tmp_path: Path) -> None:
    with serving(tmp_path, max_sources=4) as client:
        mesh_id = upload_sample(client, "plane", 200)

        sources = [{"polyline": DIAGONAL}]
        assert distances(client, mesh_id, sources=sources).status_code == 200
        many = distances(client, mesh_id, sources=[*sources, {"vertex": 0}])
        problem = check_problem(many, 422, "limit_exceeded")
        assert (problem["actual"], problem["limit"]) == (5, 4)
        long = paths(client, mesh_id, source={"polyline": [*DIAGONAL, DIAGONAL[-1]]})
        check_problem(long, 422, "limit_exceeded")

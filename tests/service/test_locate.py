"""Positions located on the surface, over HTTP."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.queries import LocateQuery
from app.store.meshes import OpenMesh
from geodesic_core.mesh.closest_point import NearestFace
from tests.support.service import check_problem, context, serving, stored_mesh, upload_sample


def locate(client: TestClient, mesh_id: str, headers: Any = None, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/locate", json=body, headers=headers)


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


def test_points_are_the_library_s(client: TestClient, knot: str) -> None:
    mesh = stored_mesh(client, knot)
    rng = np.random.default_rng(1)
    positions = [*rng.normal(size=(20, 3)), *(mesh.vertices[:5] * (1 + 1e-15))]
    positions.append(mesh.vertices[mesh.faces[7, :2]].mean(axis=0))

    answer = locate(client, knot, points=[list(position) for position in positions]).json()

    assert answer["mesh_id"] == knot
    assert answer["warnings"] == []
    assert len(answer["points"]) == len(positions)
    for found, position in zip(answer["points"], positions, strict=True):
        place = mesh.locate(position)
        if place.vertex_index is None:
            assert found["face"] == place.face_index
            assert tuple(found["barycentric"]) == place.barycentric
            assert "vertex" not in found
        else:
            assert found["vertex"] == place.vertex_index
            assert "face" not in found
        np.testing.assert_array_equal(found["position"], mesh.position(place))
        assert found["distance"] == np.linalg.norm(mesh.position(place) - position)
    assert [found["vertex"] for found in answer["points"][20:25]] == list(range(5))
    assert 0.0 in answer["points"][25]["barycentric"]


def test_what_misses_is_null(client: TestClient, apart: str) -> None:
    positions = [[0, 0, 1], [0, 0, 1.5], [0, 0, 1e300], [0, 0, 0]]

    points = locate(client, apart, points=positions, max_distance=1).json()["points"]

    assert [point and point["distance"] for point in points] == [1, None, None, 0]
    exactly = locate(client, apart, points=positions[:1] + positions[3:], max_distance=0).json()
    assert [point and point["vertex"] for point in exactly["points"]] == [None, 0]


def test_a_vertex_of_no_face_is_not_on_the_surface(client: TestClient) -> None:
    lonely = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], "faces": [[0, 1, 2]]}
    mesh_id = client.post("/v1/meshes", json=lonely).json()["id"]

    answer = locate(client, mesh_id, points=[[5, 5, 5]]).json()

    assert answer["points"][0]["face"] == 0
    assert answer["points"][0]["distance"] > 5
    assert "no face" in answer["warnings"][0]


@pytest.mark.parametrize(
    ("body", "code", "places"),
    [
        ({}, "invalid_request", ["/points"]),
        ({"points": []}, "invalid_request", ["/points"]),
        ({"points": [0, 0, 0]}, "invalid_request", ["/points/0"]),
        ({"points": [[0, 0, 0], [0, 0]]}, "invalid_request", ["/points/1/2"]),
        ({"points": [[0, 0, 0, 0]]}, "invalid_request", ["/points/0"]),
        ({"points": [[0, 0, "0"]]}, "invalid_request", ["/points/0/2"]),
        ({"points": [[0, 0, True]]}, "invalid_request", ["/points/0/2"]),
        ({"points": [{"vertex": 0}]}, "invalid_request", ["/points/0"]),
        ({"points": [[0, 0, 0]], "max_distance": -1}, "invalid_request", ["/max_distance"]),
        ({"points": [[0, 0, 0]], "limit": 1}, "invalid_request", ["/limit"]),
        ({"points": [[0, 0, 0], [0, 1e60, 0]]}, "invalid_point", ["/points/1"]),
    ],
)
def test_refused_bodies(
    client: TestClient, apart: str, body: dict, code: str, places: list[str]
) -> None:
    problem = check_problem(locate(client, apart, **body), 422, code)

    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_points_are_limited_by_the_size_of_their_answer(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=20) as client:
        mesh_id = upload_sample(client, "plane", 100)

        assert locate(client, mesh_id, points=[[0, 0, 0]] * 2).status_code == 200
        response = locate(client, mesh_id, points=[[0, 0, 0]] * 3)
        problem = check_problem(response, 413, "result_too_large")
        assert (problem["limit"], problem["actual"]) == (20, 24)
        assert "fewer points" in problem["hint"]


def test_the_search_tree_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the first of many positions; queries on the same open mesh share it."""
    opened = OpenMesh(("", b""), gc.Solver(gc.samples.knot(500)), [])
    made: list[NearestFace] = []
    build = NearestFace.__init__

    def note(tree: NearestFace, *arguments: Any) -> None:
        made.append(tree)
        build(tree, *arguments)

    monkeypatch.setattr(NearestFace, "__init__", note)
    positions = np.random.default_rng(2).normal(size=(50, 3)).tolist()
    query = LocateQuery("m", LocateQuery.model.model_validate({"points": positions}))
    first, second = (query.answer(opened, context()).members["points"] for _ in range(2))
    assert first == second
    assert len(made) == 1

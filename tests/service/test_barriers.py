"""Barriers over HTTP: every question of the mesh without the blocked faces, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.queries import DistancesQuery, MeshSize, result_key
from app.schemas.requests import DistancesRequest
from app.settings import Settings
from app.store.meshes import OpenMesh
from tests.support.service import check_problem, distances, serving, stored_mesh, upload_sample

WALL = list(range(100, 116))
"""Of the plane of 10 × 10 squares: the sixth column but for its last two rows."""
WHOLE_WALL = list(range(100, 120))

QUERIES: dict[str, dict[str, Any]] = {
    "distances": {"sources": [{"vertex": 0}]},
    "path": {"source": {"vertex": 0}, "target": {"vertex": 10}},
    "paths": {"source": {"vertex": 0}, "targets": [{"vertex": 10}]},
    "matrix": {"sources": [{"vertex": 0}], "targets": [{"vertex": 10}]},
    "nearest": {"source": {"vertex": 0}, "candidates": [{"vertex": 10}, {"vertex": 110}]},
}


def ask(client: TestClient, mesh_id: str, operation: str, query: str = "", **body: Any) -> Any:
    link = f"/v1/meshes/{mesh_id}/{operation}{query}"
    return client.post(link, json=QUERIES[operation] | body)


@pytest.fixture(scope="module")
def walled(client: TestClient, plane: str) -> gc.TriangleMesh:
    return stored_mesh(client, plane).with_barriers(WALL)


def test_answers_are_those_of_the_blocked_mesh(
    client: TestClient, plane: str, walled: gc.TriangleMesh
) -> None:
    field = gc.exact_distance(walled, 0)
    direct = gc.exact_distance(stored_mesh(client, plane), 0).distances
    assert field.distances[10] > 1.9 > 1.1 > direct[10], "the wall is in the way"

    def found(operation: str, **body: Any) -> Any:
        response = ask(client, plane, operation, barriers=WALL, **body)
        assert response.status_code == 200
        return response.json()

    assert found("distances")["distances"] == field.distances.tolist()
    assert found("path")["points"] == gc.shortest_path(walled, 0, 10).points.tolist()
    (outline,) = found("paths")["paths"]
    assert outline["points"] == field.path_to(10).points.tolist()
    assert found("matrix")["distances"] == gc.distance_matrix(walled, [0], [10]).tolist()
    assert found("nearest")["nearest"][0]["candidate"] == 1, "the other is behind the wall"
    assert ask(client, plane, "nearest").json()["nearest"][0]["candidate"] == 0
    rough = found("distances", method="approximate", relative_error=0.01)["distances"]
    assert rough == gc.approximate_distance(walled, 0, 0.01).distances.tolist()


@pytest.mark.usefixtures("one_replica")
@pytest.mark.parametrize("operation", QUERIES)
def test_the_mesh_itself_stays_free(client: TestClient, plane: str, operation: str) -> None:
    before = ask(client, plane, operation).content

    blocked = ask(client, plane, operation, barriers=WALL).content

    assert blocked != before
    for barriers in ({}, {"barriers": []}):
        again = ask(client, plane, operation, **barriers)
        assert (again.content, again.headers["server-timing"]) == (before, "kept")


@pytest.mark.usefixtures("one_replica")
def test_spellings_of_barriers_are_one_query(
    client: TestClient, plane: str, walled: gc.TriangleMesh
) -> None:
    first = ask(client, plane, "distances", barriers=WALL, max_distance=7.5)
    again = ask(client, plane, "distances", barriers=WALL[::-1] + WALL, max_distance=7.5)

    assert (again.content, again.headers["server-timing"]) == (first.content, "kept")
    assert first.json()["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}
    size = MeshSize(len(walled.vertices), len(walled.faces), 1.0)
    queries = [
        DistancesQuery.ask(
            "m", size, DistancesRequest(sources=[{"vertex": 0}], barriers=barriers), Settings()
        )
        for barriers in ([3, 1], [1, 3, 3], [1])
    ]
    keys = [result_key(query) for query in queries]
    assert keys[0] == keys[1] != keys[2]
    assert queries[0].barriers.tolist() == [1, 3]


def test_reasons_are_those_of_the_blocked_mesh(client: TestClient, plane: str) -> None:
    parted = stored_mesh(client, plane).with_barriers(WHOLE_WALL)
    missed = int(np.isinf(gc.exact_distance(parted, 0).distances).sum())
    assert missed == 5 * 11

    for method in ({}, {"method": "approximate"}):
        answer = ask(client, plane, "distances", barriers=WHOLE_WALL, **method).json()
        assert answer["unreachable"] == {"disconnected": missed, "beyond_max_distance": 0}
        path = ask(client, plane, "path", barriers=WHOLE_WALL, **method).json()
        (outline,) = ask(client, plane, "paths", barriers=WHOLE_WALL, **method).json()["paths"]
        for found in (path, outline):
            assert (found["status"], found["reason"]) == ("no_path", "disconnected")
    matrix = ask(client, plane, "matrix", barriers=WHOLE_WALL).json()
    assert matrix["unreachable"] == {"disconnected": 1, "beyond_max_distance": 0}
    assert matrix["sources"][0]["component"] != matrix["targets"][0]["component"]
    nearest = ask(client, plane, "nearest", barriers=WHOLE_WALL, k=2).json()
    assert nearest["unreachable"] == {"disconnected": 1, "beyond_max_distance": 0}


def test_points_are_found_on_the_blocked_mesh(
    client: TestClient, plane: str, walled: gc.TriangleMesh
) -> None:
    inside = walled.vertices[walled.faces[110]].mean(axis=0).tolist()
    place = walled.locate(inside)

    for source in ({"position": inside}, {"position": inside, "max_distance": 0.1}):
        (echoed,) = distances(client, plane, sources=[source], barriers=WALL).json()["sources"]
        assert echoed["face"] == place.face_index
        assert echoed["position"] == walled.position(place).tolist() != inside


def test_points_inside_barriers_are_refused(client: TestClient, plane: str) -> None:
    inside = {"face": 110, "barycentric": [0.2, 0.3, 0.5]}
    (_, u, v) = stored_mesh(client, plane).faces[110].tolist()
    across = {"edge": [5, 17], "t": 0.5}
    near = {"position": [0.55, 0.05, 0], "max_distance": 1e-3}

    refused = ask(
        client,
        plane,
        "matrix",
        barriers=WALL,
        sources=[inside, {"vertex": u}, {"edge": [u, v], "t": 0}],
        targets=[across, near],
    )
    problem = check_problem(refused, 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == [
        "/sources/0/barycentric",
        "/targets/0/edge",
        "/targets/1/position",
    ]
    assert "blocked" in problem["errors"][0]["message"]


@pytest.mark.parametrize("operation", QUERIES)
@pytest.mark.parametrize(
    ("barriers", "places"),
    [
        ([3, 200], ["/barriers/1"]),
        ([-1, 4, 10**30], ["/barriers/0", "/barriers/2"]),
        ([200] * 40, [f"/barriers/{i}" for i in range(10)]),
        (list(range(200)), ["/barriers"]),
        ([1.5], ["/barriers/0"]),
        ([True], ["/barriers/0"]),
        (["3"], ["/barriers/0"]),
        ([[3]], ["/barriers/0"]),
        (3, ["/barriers"]),
        (None, ["/barriers"]),
    ],
)
def test_refused_barriers(
    client: TestClient, plane: str, operation: str, barriers: Any, places: list[str]
) -> None:
    refused = ask(client, plane, operation, barriers=barriers)
    problem = check_problem(refused, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_positions_are_located_without_barriers(client: TestClient, plane: str) -> None:
    refused = client.post(
        f"/v1/meshes/{plane}/locate", json={"points": [[0, 0, 0]], "barriers": [0]}
    )
    check_problem(refused, 422, "invalid_request")


@pytest.mark.filterwarnings("ignore::geodesic_core.errors.BlockedSource")
def test_blocked_meshes_are_kept_while_they_fit(tmp_path: Path) -> None:
    """The same answers with room for one mesh at a time."""
    walls: list[list[int]] = [[], [0], [0, 1], [7], [0]]
    found = []
    for room in (2**31, 1):
        with serving(tmp_path / str(room), worker_mesh_bytes=room) as client:
            mesh_id = upload_sample(client, "plane", 200)
            found.append(
                [
                    distances(client, mesh_id, barriers=wall, max_distance=9 + i).json()[
                        "distances"
                    ]
                    for i, wall in enumerate(walls)
                ]
            )
    mesh = gc.samples.plane(200)
    assert found[0] == found[1]
    for distances_found, wall in zip(found[0], walls, strict=True):
        field = gc.exact_distance(mesh, 0, barriers=wall)
        assert distances_found == [
            None if np.isinf(value) else value for value in field.distances.tolist()
        ]


def test_an_open_mesh_with_barriers_keeps_its_warnings() -> None:
    opened = OpenMesh(("", b""), gc.Solver(gc.samples.plane(200)), ["look out"])

    blocked = opened.with_barriers(np.array(WALL))

    assert blocked.warnings == ["look out"]
    assert blocked.mesh.barriers.tolist() == sorted(WALL)
    assert len(opened.mesh.barriers) == 0

"""The nearest of some candidates over HTTP: the library's, and what is refused."""

from typing import Any

import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
CANDIDATES = [{"vertex": i} for i in range(0, 1500, 100)] + [INSIDE, {"vertex": 100}]


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


def nearest(client: TestClient, mesh_id: str, query: str = "", **body: Any) -> Any:
    request = {"source": {"vertex": 3}, "candidates": CANDIDATES} | body
    return client.post(f"/v1/meshes/{mesh_id}/nearest{query}", json=request)


@pytest.mark.parametrize("k", [1, 5, len(CANDIDATES)])
def test_candidates_are_the_library_s(client: TestClient, knot: str, k: int) -> None:
    mesh = stored_mesh(client, knot)
    places = [*range(0, 1500, 100), gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)), 100]
    expected = gc.nearest(mesh, 3, places, k)

    answer = nearest(client, knot, k=k).json()

    found = answer["nearest"]
    assert [each["candidate"] for each in found] == expected.indices.tolist()
    assert [each["distance"] for each in found] == expected.distances.tolist()
    for each in found:
        assert each["position"] == mesh.position(mesh.point(places[each["candidate"]])).tolist()
    assert answer["source"]["vertex"] == 3
    assert answer["method"] == "exact"
    assert "unreachable" not in answer


def test_one_is_found_where_k_is_left_out(client: TestClient, knot: str) -> None:
    assert nearest(client, knot).json() == nearest(client, knot, k=1).json()


def test_fewer_are_found_within_a_distance(client: TestClient, knot: str) -> None:
    everything = nearest(client, knot, k=17).json()["nearest"]
    limit = everything[4]["distance"]

    answer = nearest(client, knot, k=8, max_distance=limit).json()

    near = [each for each in everything if each["distance"] <= limit]
    assert answer["nearest"] == near
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": 17 - len(near)}


def test_why_there_are_fewer(client: TestClient, apart: str) -> None:
    candidates = [{"vertex": i} for i in (5, 1, 0, 4)]
    answer = nearest(
        client, apart, source={"vertex": 0}, candidates=candidates, k=3, max_distance=0.5
    ).json()

    assert answer["nearest"] == [
        {"candidate": 2, "distance": 0.0, "vertex": 0, "position": [0.0, 0.0, 0.0]}
    ]
    assert answer["unreachable"] == {"disconnected": 2, "beyond_max_distance": 1}
    none = nearest(client, apart, source={"vertex": 0}, candidates=candidates[:1]).json()
    assert none["nearest"] == []
    assert none["unreachable"] == {"disconnected": 1, "beyond_max_distance": 0}


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"k": 0}, "/k"),
        ({"k": -1}, "/k"),
        ({"k": 18}, "/k"),
        ({"k": 1.5}, "/k"),
        ({"k": "3"}, "/k"),
        ({"k": True}, "/k"),
        ({"k": None}, "/k"),
        ({"candidates": []}, "/candidates"),
        ({"candidates": {"vertex": 0}}, "/candidates"),
        ({"source": [{"vertex": 0}]}, "/source"),
        ({"source": {"vertex": 0, "start_distance": 1}}, "/source/start_distance"),
        ({"max_distance": -0.5}, "/max_distance"),
        ({"targets": []}, "/targets"),
    ],
)
def test_refused_questions(client: TestClient, knot: str, change: dict, place: str) -> None:
    problem = check_problem(nearest(client, knot, **change), 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == [place]

"""Samples, cells and means over HTTP: the library's to the bit, and what is refused."""

from typing import Any

import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, stored_mesh

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
PLACE = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))


def ask(client: TestClient, mesh_id: str, link: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{link}", json=body)


def check_points(found: list[Any], mesh: gc.TriangleMesh, expected: Any) -> None:
    assert len(found) == len(expected)
    for point, own in zip(found, expected, strict=True):
        if own is None:
            assert point is None
            continue
        assert point.get("vertex") == own.vertex_index
        if own.vertex_index is None:
            assert (point["face"], tuple(point["barycentric"])) == (own.face_index, own.barycentric)
        assert point["position"] == mesh.position(own).tolist()


def test_farthest_points_are_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    body = {"count": 12, "starts": [INSIDE, 7], "barriers": [3, 4], "include": ["distances"]}
    found = ask(client, terrain, "samples", **body).json()
    expected = gc.farthest_points(mesh, 12, start=[PLACE, 7], barriers=[3, 4])
    check_points(found["points"], mesh, expected.points)
    assert found["radii"] == expected.radius.tolist()
    assert found["covering_radius"] == expected.radius[-1]
    assert found["distances"] == expected.distances.tolist()
    assert found["nearest"] == expected.nearest.tolist()
    assert (found["costs"], found["converged"]) == ([], None)


def test_relaxed_points_are_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    found = ask(client, terrain, "samples", radius=0.4, iterations=3).json()
    spread = gc.farthest_points(mesh, radius=0.4)
    expected = gc.relax_points(mesh, spread.points, 3)
    check_points(found["points"], mesh, expected.points)
    assert found["radii"] == spread.radius.tolist()
    assert found["costs"] == expected.costs.tolist()
    assert found["converged"] is expected.converged
    assert found["covering_radius"] == expected.distances.max()
    assert "distances" not in found


def test_points_as_a_table(client: TestClient, terrain: str) -> None:
    names, *rows = ask(client, terrain, "samples?format=csv", count=3).text.splitlines()
    assert names == "point,distance,x,y,z,vertex,face,u,v,w"
    own = gc.farthest_points(stored_mesh(client, terrain), 3).vertices.tolist()
    assert [int(row.split(",")[5]) for row in rows] == own


def test_cells_are_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    body = {"sources": [INSIDE, 7, 300], "max_distance": 0.7, "chord_error": 0.01}
    found = ask(client, terrain, "cells", **body).json()
    field = gc.exact_distance(mesh, [PLACE, 7, 300], max_distance=0.7)
    expected = field.cells(0.01)
    assert found["areas"] == expected.areas.tolist()
    check_points(found["centroids"], mesh, expected.centroids)
    assert [pair["sources"] for pair in found["neighbours"]] == expected.adjacency.tolist()
    assert [pair["length"] for pair in found["neighbours"]] == expected.border_lengths.tolist()
    names, *rows = ask(client, terrain, "cells?format=csv", **body).text.splitlines()
    assert names == "source,area,x,y,z,vertex,face,u,v,w"
    assert [float(row.split(",")[1]) for row in rows] == found["areas"]


def test_cells_of_curves_have_no_centroids(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    curve = [int(vertex) for vertex in mesh.faces[9, :2]]
    sources = [{"polyline": [{"vertex": v} for v in curve]}, {"vertex": 400}]
    found = ask(client, terrain, "cells", sources=sources).json()
    assert found["centroids"] is None
    own = gc.exact_distance(mesh, [gc.Curve(curve), 400]).cells()
    assert found["areas"] == own.areas.tolist()


def test_the_mean_is_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    found = ask(client, terrain, "mean", points=[INSIDE, 7, 300], weights=[1, 2.5, 0]).json()
    expected = gc.mean_point(mesh, [PLACE, 7, 300], [1.0, 2.5, 0.0])
    check_points([found["mean"]], mesh, [expected.point])
    assert found["variance"] == expected.variance
    assert (found["converged"], found["moves"]) == (expected.converged, expected.moves)


@pytest.mark.parametrize(
    ("link", "body", "member"),
    [
        ("samples", {}, "/count"),
        ("samples", {"count": 0}, "/count"),
        ("samples", {"count": 2, "starts": [{"vertex": 10**6}]}, "/starts/0"),
        ("samples", {"count": 2, "iterations": -1}, "/iterations"),
        ("samples", {"radius": -1.0}, "/radius"),
        ("cells", {"sources": []}, "/sources"),
        ("cells", {"sources": [0], "chord_error": 0.0}, "/chord_error"),
        ("mean", {"points": []}, "/points"),
        ("mean", {"points": [0, 1], "weights": [1.0]}, "/weights"),
        ("mean", {"points": [0, 1], "weights": [0.0, 0.0]}, "/weights"),
        ("mean", {"points": [0, 1], "weights": [1.0, -1.0]}, "/weights/1"),
    ],
)
def test_what_is_wrong_is_named(
    client: TestClient, terrain: str, link: str, body: dict[str, Any], member: str
) -> None:
    code = "invalid_point" if "vertex" in str(body) else "invalid_request"
    problem = check_problem(ask(client, terrain, link, **body), 422, code)
    assert problem["errors"][0]["pointer"].startswith(member)


def test_more_points_than_there_are(client: TestClient, book: str) -> None:
    problem = check_problem(ask(client, book, "samples", count=50), 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/count"
    assert "only" in problem["detail"]

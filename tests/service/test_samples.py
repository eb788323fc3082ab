"""Samples, cells and means over HTTP: the library's to the bit, and what is refused."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, serving, stored_mesh, upload_sample
from tests.support.waiting import wait_until

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
    assert names == "point,x,y,z,vertex,face,u,v,w"
    own = gc.farthest_points(stored_mesh(client, terrain), 3).vertices.tolist()
    assert [int(row.split(",")[4]) for row in rows] == own
    body = {"count": 3, "starts": [INSIDE]}
    rows = np.load(BytesIO(ask(client, terrain, "samples?format=npy", **body).content))
    mesh = stored_mesh(client, terrain)
    points = gc.farthest_points(mesh, 3, start=PLACE).points
    assert rows[:, :3].tolist() == [mesh.position(point).tolist() for point in points]
    assert rows[:, 3].tolist() == [point.face_index for point in points]
    assert rows[:, 4:].tolist() == [list(point.barycentric) for point in points]
    for name in ("csv", "npy"):
        refused = ask(client, terrain, f"samples?format={name}", **body, include=["distances"])
        problem = check_problem(refused, 422, "invalid_request")
        assert problem["errors"][0]["pointer"] == "/include"


def test_parts_without_a_point_are_told(client: TestClient) -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]]
    two = {"vertices": corners, "faces": [[0, 1, 2], [3, 4, 5]]}
    mesh_id = client.post("/v1/meshes", json=two).json()["id"]
    found = ask(client, mesh_id, "samples", count=1, include=["distances"]).json()
    assert (found["radii"], found["covering_radius"]) == ([None], None)
    assert found["distances"] == [0.0, 1.0, 1.0, None, None, None]
    assert found["nearest"] == [0, 0, 0, None, None, None]
    both = ask(client, mesh_id, "samples", count=2).json()
    assert both["radii"] == [None, 1.0]
    apart = ask(client, mesh_id, "mean", points=[0, 3])
    assert check_problem(apart, 422, "invalid_request")["errors"][0]["pointer"] == "/points"


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


def test_cells_between_barriers(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    walls = list(range(60, 90))
    found = ask(client, terrain, "cells", sources=[INSIDE, 7, 300], barriers=walls).json()
    expected = gc.exact_distance(mesh, [PLACE, 7, 300], barriers=walls).cells()
    assert found["areas"] == expected.areas.tolist()
    check_points(found["centroids"], mesh, expected.centroids)
    free = np.delete(mesh.face_areas, walls).sum()
    assert sum(found["areas"]) == pytest.approx(free, rel=1e-12)
    points = [INSIDE, 7, 300]
    mean = ask(client, terrain, "mean", points=points, barriers=walls).json()
    own = gc.mean_point(mesh.with_barriers(walls), [PLACE, 7, 300])
    check_points([mean["mean"]], mesh, [own.point])
    assert mean["variance"] == own.variance


def test_a_cell_without_area_has_no_centroid(client: TestClient, terrain: str) -> None:
    late = {"vertex": 8, "start_distance": 100.0}
    found = ask(client, terrain, "cells", sources=[7, late]).json()
    assert found["areas"][1] == 0.0
    assert found["centroids"][1] is None
    assert found["neighbours"] == []
    table = ask(client, terrain, "cells?format=csv", sources=[7, late]).text
    assert table.splitlines()[2] == "1,0.0" + "," * 8


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


@pytest.mark.usefixtures("one_replica")
def test_none_is_computed_again(client: TestClient, terrain: str) -> None:
    for link, body in BODIES.items():
        first, again = (ask(client, terrain, link, **body) for _ in range(2))
        assert (again.content, again.headers["server-timing"]) == (first.content, "kept")


BODIES: dict[str, dict[str, Any]] = {
    "samples": {"count": 9, "iterations": 2},
    "cells": {"sources": [3, 90]},
    "mean": {"points": [3, 90, 200]},
}


@pytest.mark.parametrize("link", BODIES)
def test_each_may_be_a_job(client: TestClient, terrain: str, link: str) -> None:
    body = BODIES[link]
    address = f"/v1/meshes/{terrain}/{link}"
    job = client.post(address, json=body, headers={"Prefer": "respond-async"})
    assert job.status_code == 202
    links = job.json()["links"]
    wait_until(lambda: client.get(links["self"]).json()["status"] == "successful")
    assert client.get(links["results"]).json() == ask(client, terrain, link, **body).json()
    assert client.delete(links["self"]).status_code == 200


LARGE: dict[str, dict[str, Any]] = {
    "samples": {"count": 9, "iterations": 500},
    "cells": {"sources": list(range(0, 3000, 100))},
    "mean": {"points": list(range(0, 3000, 100))},
}


@pytest.mark.parametrize("link", LARGE)
def test_the_deadline_and_the_memory_hold(client: TestClient, tmp_path: Path, link: str) -> None:
    knot = upload_sample(client, "knot", 20_000)
    late = client.post(
        f"/v1/meshes/{knot}/{link}", json=LARGE[link], headers={"X-Timeout-Ms": "40"}
    )
    check_problem(late, 504, "deadline_exceeded")
    with serving(tmp_path, query_memory_bytes=1_000_000) as small:
        knot = upload_sample(small, "knot", 20_000)
        check_problem(ask(small, knot, link, **LARGE[link]), 422, "memory_limit")


def test_what_is_too_many(tmp_path: Path) -> None:
    with serving(tmp_path / "few", max_sources=5) as client:
        mesh_id = upload_sample(client, "plane", 1000)
        six = list(range(6))
        refused: list[tuple[str, dict[str, Any]]] = [
            ("samples", {"count": 6}),
            ("samples", {"count": 2, "starts": six}),
            ("samples", {"radius": 0.1}),
            ("cells", {"sources": six}),
            ("mean", {"points": six}),
        ]
        for link, body in refused:
            problem = check_problem(ask(client, mesh_id, link, **body), 422, "limit_exceeded")
            assert (problem["actual"], problem["limit"]) == (6, 5)
        five = gc.farthest_points(stored_mesh(client, mesh_id), 5)
        found = ask(client, mesh_id, "samples", radius=five.radius[-1]).json()
        assert len(found["points"]) == 5
    with serving(tmp_path / "short", max_json_values=100) as client:
        mesh_id = upload_sample(client, "plane", 1000)
        after, before = {"radius": 0.1}, {"count": 2, "include": ["distances"]}  # it is found
        check_problem(ask(client, mesh_id, "samples", **after), 413, "result_too_large")
        check_problem(ask(client, mesh_id, "samples", **before), 413, "result_too_large")
        many = ask(client, mesh_id, "samples?format=npy", radius=0.1)
        own = gc.farthest_points(stored_mesh(client, mesh_id), radius=0.1)
        assert len(np.load(BytesIO(many.content))) == len(own) > 12


@pytest.mark.parametrize(
    ("link", "body", "member"),
    [
        ("samples", {}, "/count"),
        ("samples", {"count": 0}, "/count"),
        ("samples", {"count": 2, "starts": [{"vertex": 10**6}]}, "/starts/0"),
        ("samples", {"count": 2, "iterations": -1}, "/iterations"),
        ("samples", {"radius": -1.0}, "/radius"),
        ("samples", {"count": 2, "include": ["cells"]}, "/include/0"),
        ("samples", {"count": 2, "barriers": [-1]}, "/barriers/0"),
        ("samples", {"count": 2, "method": "fast"}, "/method"),
        ("cells", {"sources": []}, "/sources"),
        ("cells", {}, "/sources"),
        ("cells", {"sources": [0], "chord_error": 0.0}, "/chord_error"),
        ("cells", {"sources": [0], "max_distance": -1.0}, "/max_distance"),
        ("cells", {"sources": [0, {"vertex": 10**6}]}, "/sources/1"),
        ("mean", {"points": []}, "/points"),
        ("mean", {"points": [0, {"vertex": 10**6}]}, "/points/1"),
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


def test_a_vertex_in_barriers_only(client: TestClient, plane: str) -> None:
    mesh = stored_mesh(client, plane)
    walls = np.flatnonzero((mesh.faces == 0).any(axis=1)).tolist()
    for link, body, place in (
        ("samples", {"count": 1, "starts": [0], "iterations": 1}, "/starts"),
        ("mean", {"points": [0]}, "/points"),
        ("log-map", {"source": 0}, "/source"),
    ):
        refused = ask(client, plane, link, **body, barriers=walls)
        problem = check_problem(refused, 422, "invalid_point")
        assert problem["errors"][0]["pointer"].startswith(place), link
    cells = ask(client, plane, "cells", sources=[0, 60], barriers=walls).json()
    assert cells["areas"][1] == pytest.approx(np.delete(mesh.face_areas, walls).sum(), rel=1e-12)
    assert (cells["areas"][0], cells["centroids"][0]) == (0.0, None)
    assert "Source 0" in cells["warnings"][0]


def test_where_directions_have_no_meaning(client: TestClient, book: str) -> None:
    spine = {"edge": [0, 1], "t": 0.5}
    for link, body, place in (
        ("samples", {"count": 1, "starts": [spine], "iterations": 1}, "/starts"),
        ("cells", {"sources": [spine]}, "/sources"),
        ("mean", {"points": [spine]}, "/points"),
    ):
        problem = check_problem(ask(client, book, link, **body), 422, "invalid_point")
        assert problem["errors"][0]["pointer"].startswith(place), link

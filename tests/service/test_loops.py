"""Loops, and curves pulled tight, over HTTP: the library's to the bit, and what is refused."""

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


@pytest.fixture
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 2000)


def ask(client: TestClient, mesh_id: str, link: str = "loop", **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{link}", json=body)


def as_written(curve: gc.SurfaceCurve) -> list[dict[str, Any]]:
    return [{"face": p.face_index, "barycentric": list(p.barycentric)} for p in curve.locations]


def check_lines(found: list[Any], expected: list[gc.SurfaceCurve]) -> None:
    assert len(found) == len(expected)
    for line, own in zip(found, expected, strict=True):
        assert (line["closed"], line["length"]) == (own.closed, own.length)
        assert line["points"] == own.points.tolist()
        assert line["faces"] == own.faces.tolist()
        if "locations" in line:
            assert line["locations"] == as_written(own)


def test_loops_are_the_library_s(client: TestClient, knot: str) -> None:
    mesh = stored_mesh(client, knot)
    for include in ([], ["locations"]):
        handles = ask(client, knot, include=include).json()["lines"]
        check_lines(handles, gc.handle_loops(mesh))
        (loop,) = ask(client, knot, through=INSIDE, include=include).json()["lines"]
        check_lines([loop], [gc.shortest_loop(mesh, PLACE)])
        assert ("locations" in loop) == ("locations" in handles[0]) == bool(include)


def test_loops_among_barriers_are_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    middle = mesh.locate(mesh.vertices.mean(axis=0)).face_index
    walls = np.flatnonzero(np.isin(mesh.faces, mesh.faces[middle]).any(axis=1)).tolist()
    found = ask(client, terrain, through=7, barriers=walls).json()
    check_lines(found["lines"], [gc.shortest_loop(mesh, 7, barriers=walls)])
    without = ask(client, terrain, through=7)
    assert check_problem(without, 422, "invalid_request")["errors"][0]["pointer"] == "/through"
    assert ask(client, terrain, barriers=walls).json()["lines"] == []  # holes are no handles


def test_straightened_curves_are_the_library_s(client: TestClient, knot: str) -> None:
    mesh = stored_mesh(client, knot)
    lines = [
        gc.shortest_path(mesh, 0, 900, [500]),
        gc.shortest_loop(mesh, PLACE),
        *gc.exact_distance(mesh, 0).isolines([3.0])[0],
    ]
    curves = [{"polyline": as_written(line), "closed": line.closed} for line in lines]
    curves.append({"polyline": [{"vertex": int(v)} for v in mesh.faces[9]]})
    own = [mesh.curve(line.locations, line.closed) for line in lines]
    tight = [gc.straighten(curve) for curve in [*own, mesh.curve(mesh.faces[9].tolist())]]
    found = ask(client, knot, curves=curves, include=["locations"]).json()["lines"]
    check_lines(found, tight)
    assert [line["closed"] for line in found] == [False, True, True, True, False]
    again = [{"polyline": line["locations"], "closed": line["closed"]} for line in found]
    lengths = [line["length"] for line in ask(client, knot, curves=again).json()["lines"]]
    np.testing.assert_allclose(lengths, [line.length for line in tight], rtol=1e-12)


def test_free_ends_slide_along_the_boundary(client: TestClient, plane: str) -> None:
    mesh = stored_mesh(client, plane)
    curves = [{"polyline": as_written(gc.shortest_path(mesh, 5, 60))}]
    (line,) = ask(client, plane, curves=curves, free_ends=True).json()["lines"]
    own = gc.straighten(gc.shortest_path(mesh, 5, 60), free_ends=True)
    check_lines([line], [own])
    inside = [{"polyline": as_written(gc.shortest_path(mesh, 12, 96))}]
    for body in ({"curves": inside}, {}):
        refused = check_problem(ask(client, plane, **body, free_ends=True), 422, "invalid_request")
        assert refused["errors"][0]["pointer"] == ("/curves/0" if body else "/free_ends")


def test_curves_stay_off_barriers(client: TestClient, plane: str) -> None:
    mesh, walls = stored_mesh(client, plane), [60, 61, 62, 63]
    walled = mesh.with_barriers(walls)
    path = gc.shortest_path(walled, 0, 120, [10])
    curves = [{"polyline": as_written(path)}]
    around = ask(client, plane, curves=curves, barriers=walls).json()["lines"]
    check_lines(around, [gc.straighten(walled.curve(path.locations))])


def test_lines_as_tables_and_drawings(client: TestClient, knot: str) -> None:
    mesh = stored_mesh(client, knot)
    names, *rows = ask(client, knot, "loop?format=csv", through=7).text.splitlines()
    own = gc.shortest_loop(mesh, 7)
    assert names == "line,closed,length,point,x,y,z"
    assert [[float(x) for x in row.split(",")[4:]] for row in rows] == own.points.tolist()
    drawn = ask(client, knot, "loop?format=obj").text
    assert drawn.count("\ng line_") + drawn.startswith("g line_") == 2
    none = upload_sample(client, "sphere", 320)
    assert ask(client, none, "loop?format=csv").text.splitlines()[1:] == [",,,,,,"]


def test_on_lengths_alone_lines_have_locations(client: TestClient) -> None:
    faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
    made = client.post("/v1/meshes", json={"faces": faces, "lengths": [[1.0] * 3] * 4}).json()
    mesh = gc.TriangleMesh.from_lengths(faces, np.ones((4, 3)))
    curve = [0, 1, 3]
    (line,) = ask(client, made["id"], curves=[{"polyline": curve}]).json()["lines"]
    own = gc.straighten(mesh.curve(curve))
    assert (line["length"], line["points"]) == (own.length, None)
    assert line["locations"] == as_written(own)


BODIES: list[dict[str, Any]] = [{}, {"through": 7}, {"curves": [{"polyline": [0]}]}]


@pytest.mark.parametrize("body", BODIES)
def test_each_may_be_a_job_and_is_computed_once(
    client: TestClient, knot: str, body: dict[str, Any]
) -> None:
    address = f"/v1/meshes/{knot}/loop"
    job = client.post(address, json=body, headers={"Prefer": "respond-async"})
    assert job.status_code == 202
    links = job.json()["links"]
    wait_until(lambda: client.get(links["self"]).json()["status"] == "successful")
    again = ask(client, knot, **body)
    assert client.get(links["results"]).json() == again.json()
    assert again.headers["server-timing"] == "kept"
    assert client.delete(links["self"]).status_code == 200


@pytest.mark.parametrize("body", [{}, {"through": 7}])
def test_the_deadline_and_the_memory_hold(
    client: TestClient, tmp_path: Path, body: dict[str, Any]
) -> None:
    knot = upload_sample(client, "knot", 20_000)
    late = client.post(f"/v1/meshes/{knot}/loop", json=body, headers={"X-Timeout-Ms": "20"})
    check_problem(late, 504, "deadline_exceeded")
    with serving(tmp_path, query_memory_bytes=1_000_000) as small:
        knot = upload_sample(small, "knot", 20_000)
        check_problem(ask(small, knot, **body), 422, "memory_limit")


def test_what_is_too_much_for_json(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=100) as client:
        knot = upload_sample(client, "knot", 2000)
        check_problem(ask(client, knot), 413, "result_too_large")
        assert ask(client, knot, "loop?format=csv").status_code == 200


@pytest.mark.parametrize(
    ("body", "code", "member"),
    [
        ({"through": 0, "curves": [{"polyline": [0]}]}, "invalid_request", "/through"),
        ({"through": {"vertex": 10**6}}, "invalid_point", "/through/vertex"),
        ({"curves": []}, "invalid_request", "/curves"),
        ({"curves": [{"polyline": []}]}, "invalid_request", "/curves/0/polyline"),
        ({"curves": [{"polyline": [0]}, {"polyline": [0, 120]}]}, "invalid_point", "/curves/1"),
        (
            {"curves": [{"polyline": [0, 1, 2], "closed": True}]},
            "invalid_point",
            "/curves/0/closed",
        ),
        ({"curves": [{"polyline": [0, 1], "closed": True}]}, "invalid_request", "/curves/0"),
        ({"through": 0}, "invalid_request", "/through"),
        ({"include": ["gradient"]}, "invalid_request", "/include/0"),
        ({"barriers": [-1]}, "invalid_request", "/barriers/0"),
        ({"method": "fast"}, "invalid_request", "/method"),
    ],
)
def test_what_is_wrong_is_named(
    client: TestClient, plane: str, body: dict[str, Any], code: str, member: str
) -> None:
    problem = check_problem(ask(client, plane, **body), 422, code)
    assert problem["errors"][0]["pointer"].startswith(member)


def test_where_loops_have_no_meaning(client: TestClient, book: str) -> None:
    """At the spine of a book, whose pages are more than two."""
    for body in ({}, {"through": 0}):
        problem = check_problem(ask(client, book, **body), 422, "invalid_mesh")
        assert problem["errors"][0]["pointer"].startswith("/vertices/")


def test_a_curve_in_barriers(client: TestClient, plane: str) -> None:
    mesh = stored_mesh(client, plane)
    walls = np.flatnonzero((mesh.faces == 60).any(axis=1)).tolist()
    refused = ask(client, plane, curves=[{"polyline": [60]}], barriers=walls)
    problem = check_problem(refused, 422, "invalid_point")
    assert problem["errors"][0]["pointer"] == "/curves/0/polyline"

"""Surfaces given by the lengths of their edges, over HTTP: a flat torus, which lies nowhere."""

from io import BytesIO
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem

CELLS = 6
"""On each side of the square whose opposite sides are joined"""
INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}


def torus() -> tuple[np.ndarray, np.ndarray]:
    """Return faces and lengths of the torus of girth 1."""
    faces = []
    for row in range(CELLS):
        for column in range(CELLS):
            a, b, c, d = (
                CELLS * ((row + up) % CELLS) + (column + right) % CELLS
                for up, right in ((0, 0), (0, 1), (1, 0), (1, 1))
            )
            faces += [(a, b, d), (a, d, c)]
    side, diagonal = 1.0 / CELLS, np.sqrt(2.0) / CELLS
    lengths = np.tile([[side, side, diagonal], [diagonal, side, side]], (CELLS**2, 1))
    return np.array(faces), lengths


@pytest.fixture(scope="module")
def flat(client: TestClient) -> str:
    """The torus without positions."""
    faces, lengths = torus()
    document = {"faces": faces.tolist(), "lengths": lengths.tolist()}
    return str(client.post("/v1/meshes", json=document).json()["id"])


def ask(client: TestClient, mesh_id: str, link: str, query: str = "", **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{link}{query}", json=body)


def test_json_and_npz_are_one_mesh(client: TestClient, flat: str) -> None:
    faces, lengths = torus()
    archive = BytesIO()
    np.savez(archive, faces=faces, lengths=lengths)
    again = client.post("/v1/meshes?format=npz", content=archive.getvalue())
    assert (again.status_code, again.json()["id"]) == (200, flat)
    report = again.json()
    assert report["bounds"] is None
    assert (report["vertices"], report["euler_characteristic"]) == (CELLS**2, 0)
    assert {"faces", "lengths"} <= set(report["arrays"])
    assert "vertices" not in report["arrays"]
    stored = client.get(report["arrays"]["lengths"])
    np.testing.assert_array_equal(np.load(BytesIO(stored.content)), lengths)
    refused = client.get(f"/v1/meshes/{flat}/arrays/vertices")
    assert "lengths of its edges" in check_problem(refused, 404, "not_found")["detail"]


def test_distances_are_those_of_the_torus(client: TestClient, flat: str) -> None:
    found = ask(client, flat, "distances", sources=[0]).json()["distances"]
    steps = np.minimum(np.arange(CELLS), CELLS - np.arange(CELLS)) / CELLS
    np.testing.assert_allclose(found, np.hypot(*np.meshgrid(steps, steps)).ravel(), atol=1e-12)


def test_what_lies_on_the_surface_is_the_library_s(client: TestClient, flat: str) -> None:
    mesh = gc.TriangleMesh.from_lengths(*torus())
    place = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    path = ask(client, flat, "path", source=0, target=INSIDE).json()
    expected = gc.shortest_path(mesh, 0, place)
    assert (path["length"], path["points"]) == (expected.length, None)
    assert path["target"] == {**INSIDE, "position": None}
    assert [tuple(at["barycentric"]) for at in path["locations"]] == [
        at.barycentric for at in expected.locations
    ]
    table = ask(client, flat, "matrix", sources="all", targets=[0, INSIDE]).json()
    assert table["distances"] == gc.distance_matrix(mesh, range(CELLS**2), [0, place]).tolist()
    assert all(end["position"] is None for end in table["sources"] + table["targets"])
    near = ask(client, flat, "nearest", source=INSIDE, candidates=[0, 20]).json()["nearest"]
    assert near[0]["distance"] == gc.nearest(mesh, place, [0, 20]).distances[0]
    log_map = ask(client, flat, "log-map", source=INSIDE, x_axis=0).json()
    expected_map = gc.log_map(mesh, place, x_axis=0)
    assert log_map["coordinates"] == expected_map.coordinates.tolist()
    (line,) = ask(client, flat, "trace", starts=[INSIDE], directions=[0.5], lengths=[1.5]).json()[
        "lines"
    ]
    expected_line: Any = gc.trace(mesh, place, 0.5, 1.5)
    assert (line["length"], line["points"]) == (expected_line.length, None)
    assert line["faces"] == expected_line.faces.tolist()


def test_samples_cells_and_means_have_no_positions(client: TestClient, flat: str) -> None:
    mesh = gc.TriangleMesh.from_lengths(*torus())
    body = {"count": 5, "starts": [INSIDE], "iterations": 2}
    samples = ask(client, flat, "samples", **body).json()
    place = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    own = gc.relax_points(mesh, gc.farthest_points(mesh, 5, start=place).points, 2)
    assert samples["costs"] == own.costs.tolist()
    rows = np.load(BytesIO(ask(client, flat, "samples", "?format=npy", **body).content))
    assert np.isnan(rows[:, :3]).all()
    assert rows[:, 3:].tolist() == [[at.face_index, *at.barycentric] for at in own.points]
    cells = ask(client, flat, "cells", sources=[0, INSIDE, 20]).json()
    expected = gc.exact_distance(mesh, [0, place, 20]).cells()
    assert cells["areas"] == expected.areas.tolist()
    mean = ask(client, flat, "mean", points=[0, 1, INSIDE]).json()
    assert mean["variance"] == gc.mean_point(mesh, [0, 1, place]).variance
    found = [*samples["points"], *cells["centroids"], mean["mean"]]
    assert all(point["position"] is None for point in found)


def test_lines_are_locations(client: TestClient, flat: str) -> None:
    mesh = gc.TriangleMesh.from_lengths(*torus())
    field = gc.exact_distance(mesh, [0, 20])
    heights = np.arange(float(CELLS**2))
    drawn = ask(client, flat, "isolines", sources=[0, 20], levels=[0.1]).json()["isolines"]
    own = ask(client, flat, "isolines", values=heights.tolist(), levels=[3.5]).json()["isolines"]
    borders = ask(client, flat, "borders", sources=[0, 20]).json()["borders"]
    rims = ask(client, flat, "boundaries", barriers=[0, 30]).json()["boundaries"]
    expected: list[tuple[Any, list[gc.SurfaceCurve]]] = [
        (drawn[0]["lines"], field.isolines([0.1])[0]),
        (own[0]["lines"], gc.ScalarField(mesh, heights).isolines([3.5])[0]),
        (borders, list(field.borders())),
        (rims, mesh.with_barriers([0, 30]).boundaries()),
    ]
    for found, curves in expected:
        assert len(found) == len(curves) > 0
        for line, curve in zip(found, curves, strict=True):
            assert (line["points"], line["closed"]) == (None, curve.closed)
            assert (line["length"], line["faces"]) == (curve.length, curve.faces.tolist())
            assert [(at["face"], tuple(at["barycentric"])) for at in line["locations"]] == [
                (at.face_index, at.barycentric) for at in curve.locations
            ]
    assert ask(client, flat, "boundaries").json()["boundaries"] == []


def test_tables_leave_positions_empty(client: TestClient, flat: str) -> None:
    _, *rows = ask(client, flat, "path", "?format=csv", source=0, target=14).text.splitlines()
    assert all(row.split(",")[3:6] == ["", "", ""] and row.split(",")[6] for row in rows)
    names, *rows = ask(
        client, flat, "isolines", "?format=csv", sources=[0], levels=[9.0, 0.1]
    ).text.splitlines()
    assert names == "level,line,closed,length,point,x,y,z,face,u,v,w"
    assert rows[0] == "9.0" + "," * 11
    assert all(row.split(",")[5:8] == ["", "", ""] and row.split(",")[8] for row in rows[1:])
    body = {"starts": [0], "directions": [0.3], "lengths": [1.0]}
    rows = np.load(BytesIO(ask(client, flat, "trace", "?format=npy", **body).content))
    assert np.isnan(rows[:, 4:7]).all()
    assert np.isfinite(np.delete(rows, (4, 5, 6), axis=1)).all()


@pytest.mark.parametrize(
    ("link", "body", "place"),
    [
        ("distances", {"sources": [0, {"position": [0, 0, 0]}]}, ["/sources/1/position"]),
        ("distances", {"sources": [0], "include": ["gradient"]}, ["/include"]),
        ("distances?format=ply", {"sources": [0]}, []),
        ("path?format=npy", {"source": 0, "target": 9}, []),
        ("path?format=obj", {"source": 0, "target": 9}, []),
        ("paths?format=obj", {"source": 0, "targets": [9]}, []),
        ("isolines?format=obj", {"sources": [0], "count": 2}, []),
        ("borders?format=obj", {"sources": [0, 9]}, []),
        ("boundaries?format=obj", {"barriers": [0]}, []),
        ("locate", {"points": [[0, 0, 0]]}, ["/points"]),
        ("log-map", {"source": 0, "x_axis": [1, 0, 0]}, ["/x_axis"]),
        ("log-map?format=ply", {"source": 0}, []),
        ("trace", {"starts": [0], "directions": [[1, 0, 0]], "lengths": [1]}, ["/directions"]),
        ("trace?format=obj", {"starts": [0], "directions": [1], "lengths": [1]}, []),
    ],
)
def test_what_needs_space_is_refused(
    client: TestClient, flat: str, link: str, body: Any, place: list[str]
) -> None:
    problem = check_problem(ask(client, flat, link, **body), 422, "not_embedded")
    assert [fault["pointer"] for fault in problem.get("errors", [])] == place
    assert "\n" not in problem["detail"]


@pytest.mark.parametrize(
    ("query", "lengths", "code", "words"),
    [
        ("?merge=exact", [[1, 1, 1]], "invalid_request", "merge must be 'none'"),
        ("", [[1, 1, 3]], "invalid_mesh", "longer"),
        ("", [[1, 0, 1]], "invalid_mesh", "from 1e-50"),
        ("", [[1, 1, 1], [1, 1, 1]], "invalid_mesh", "(1, 3)"),
    ],
)
def test_lengths_of_no_surface(
    client: TestClient, query: str, lengths: list[Any], code: str, words: str
) -> None:
    mesh = {"faces": [[0, 1, 2]], "lengths": lengths}
    problem = check_problem(client.post(f"/v1/meshes{query}", json=mesh), 422, code)
    assert words in problem["detail"]

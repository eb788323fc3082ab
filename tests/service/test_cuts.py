"""Cuts over HTTP: the library's to the bit, as meshes of the store; and what is refused."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.store.meshes import CUT_ARRAYS
from tests.support.service import check_problem, serving, stored_mesh, upload_sample
from tests.support.waiting import wait_until

TETRAHEDRON = {"faces": [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], "lengths": [[1, 1, 1]] * 4}


def ask(client: TestClient, mesh_id: str, link: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{link}", json=body)


def as_curves(*lines: dict[str, Any]) -> list[dict[str, Any]]:
    """Return lines of answers as curves of a request."""
    return [{"polyline": line["locations"], "closed": line.get("closed", False)} for line in lines]


def array_of(client: TestClient, mesh_id: str, name: str) -> Any:
    response = client.get(f"/v1/meshes/{mesh_id}/arrays/{name}")
    assert response.status_code == 200, response.text
    return np.load(BytesIO(response.content))


def check_cut(client: TestClient, mesh_id: str, answer: Any, own: gc.CutMesh) -> None:
    """Check that a cut is the library's, in its answer, its document and its arrays."""
    new = answer["cut_mesh_id"]
    assert (answer["kind"], answer["mesh_id"]) == ("cut", mesh_id)
    assert (answer["vertices"], answer["faces"]) == (len(own.vertices), len(own.faces))
    assert answer["parts"] == own.parts.max() + 1
    document = client.get(f"/v1/meshes/{new}").json()
    assert (document["id"], document["cut_from"]) == (new, mesh_id)
    assert (document["vertices"], document["faces"]) == (len(own.vertices), len(own.faces))
    assert set(CUT_ARRAYS) < set(document["arrays"])
    for name in ("faces", *CUT_ARRAYS):
        np.testing.assert_array_equal(array_of(client, new, name), getattr(own, name))
        assert document["arrays"][name] == f"/v1/meshes/{new}/arrays/{name}"
    if own.old.has_positions:
        np.testing.assert_array_equal(array_of(client, new, "vertices"), own.vertices)
    if own.old.lengths is not None:
        np.testing.assert_array_equal(array_of(client, new, "lengths"), own.mesh.lengths)


@pytest.mark.parametrize("separate", [None, False])
def test_lines_of_all_kinds_of_answers_are_cuts(
    client: TestClient, terrain: str, separate: bool | None
) -> None:
    mesh = stored_mesh(client, terrain)
    last, located = len(mesh.vertices) - 1, {"include": ["locations"]}
    path = ask(client, terrain, "path", source=0, target=last).json()
    rings = ask(client, terrain, "isolines", sources=[40], levels=[0.2], **located).json()
    borders = ask(client, terrain, "borders", sources=[7, last], **located).json()
    rims = ask(client, terrain, "boundaries", **located).json()
    far = ask(client, terrain, "trace", starts=[40], directions=[0.5], lengths=[0.4]).json()
    lines = [
        path,
        *rings["isolines"][0]["lines"],
        *borders["borders"],
        *rims["boundaries"],
        *far["lines"],
    ]
    own_lines = [
        gc.shortest_path(mesh, 0, last),
        *gc.exact_distance(mesh, 40, retain="windows").isolines([0.2])[0],
        *gc.exact_distance(mesh, [7, last], retain="windows").borders(),
        *mesh.boundaries(),
        gc.trace(mesh, 40, 0.5, 0.4),
    ]
    assert {line.get("closed", False) for line in lines} == {True, False}
    options = {} if separate is None else {"separate": separate}
    response = ask(client, terrain, "cut", curves=as_curves(*lines), **options)
    own = gc.cut(mesh, own_lines, **options)
    check_cut(client, terrain, response.json(), own)
    assert response.json()["parts"] > 1


def test_points_in_all_spellings(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    a, b, c = mesh.faces[40].tolist()
    points = [
        a,
        {"vertex": b},
        {"edge": [b, c], "t": 0.25},
        {"face": 40, "barycentric": [0.2, 0.3, 0.5]},
        {"position": mesh.vertices[a].tolist()},
    ]
    own = [
        a,
        b,
        mesh.point_on_edge(b, c, 0.25),
        gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)),
        a,
    ]
    answer = ask(client, terrain, "cut", curves=[{"polyline": points}, {"polyline": [9]}]).json()
    check_cut(client, terrain, answer, gc.cut(mesh, [gc.Curve(own), gc.Curve([9])]))


def test_a_closed_curve_leads_back(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    triangle = mesh.faces[40].tolist()
    closed = ask(client, terrain, "cut", curves=[{"polyline": triangle, "closed": True}]).json()
    check_cut(client, terrain, closed, gc.cut(mesh, gc.Curve([*triangle, triangle[0]])))
    assert closed["parts"] == 2
    open_ = ask(client, terrain, "cut", curves=[{"polyline": triangle}]).json()
    assert open_["parts"] == 1


def test_a_surface_of_lengths_alone(client: TestClient) -> None:
    mesh_id = client.post("/v1/meshes", json=TETRAHEDRON).json()["id"]
    mesh = gc.TriangleMesh.from_lengths(TETRAHEDRON["faces"], TETRAHEDRON["lengths"])
    path = ask(
        client, mesh_id, "path", source={"face": 0, "barycentric": [0.2, 0.3, 0.5]}, target=3
    )
    answer = ask(client, mesh_id, "cut", curves=as_curves(path.json())).json()
    own = gc.cut(mesh, gc.shortest_path(mesh, gc.SurfacePoint.face(0, (0.2, 0.3, 0.5)), 3))
    check_cut(client, mesh_id, answer, own)
    assert "vertices" not in client.get(f"/v1/meshes/{answer['cut_mesh_id']}").json()["arrays"]


def test_a_cut_mesh_is_a_mesh_like_any_other(client: TestClient, terrain: str) -> None:
    curves = [{"polyline": [stored_mesh(client, terrain).faces[7].tolist()[0]]}]
    path = ask(client, terrain, "path", source=3, target=90).json()
    body = {"curves": as_curves(path) + curves, "name": "halves"}
    first = ask(client, terrain, "cut", **body)
    new = first.json()["cut_mesh_id"]
    assert (first.status_code, first.headers["location"]) == (201, f"/v1/meshes/{new}")
    phases = [phase.partition(";")[0] for phase in first.headers["server-timing"].split(", ")]
    assert phases == ["queue", "load", "compute", "store"]
    again = ask(client, terrain, "cut", **{**body, "name": "other"})
    assert (again.status_code, again.headers["location"]) == (200, f"/v1/meshes/{new}")
    assert again.json() == first.json()
    assert client.get(f"/v1/meshes/{new}").json()["name"] == "halves"
    assert [each["id"] for each in client.get("/v1/meshes?name=halves").json()["meshes"]] == [new]
    cut = gc.cut(
        stored_mesh(client, terrain),
        [gc.shortest_path(stored_mesh(client, terrain), 3, 90), gc.Curve(curves[0]["polyline"])],
    )
    found = ask(client, new, "distances", sources=[0]).json()["distances"]
    expected = gc.exact_distance(cut.mesh, 0).distances
    assert found == [d if np.isfinite(d) else None for d in expected.tolist()]
    further = ask(client, new, "cut", curves=[{"polyline": [0]}])
    assert client.get(further.headers["location"]).json()["cut_from"] == new
    assert client.delete(f"/v1/meshes/{new}").status_code == 204
    assert ask(client, terrain, "cut", **body).status_code == 201, "it was removed meanwhile"


def test_what_a_mesh_was_cut_from_is_part_of_its_id(client: TestClient, terrain: str) -> None:
    whole = {"curves": [{"polyline": [0]}], "separate": False}  # which changes nothing
    once = ask(client, terrain, "cut", **whole).json()["cut_mesh_id"]
    twice = ask(client, once, "cut", **whole).json()["cut_mesh_id"]
    assert len({terrain, once, twice}) == 3
    for mesh_id in (once, twice):
        for name in ("vertices", "faces"):
            same = array_of(client, terrain, name)
            np.testing.assert_array_equal(array_of(client, mesh_id, name), same)
    refused = client.get(f"/v1/meshes/{terrain}/arrays/face_of")
    assert "was not cut" in check_problem(refused, 404, "not_found")["detail"]


def test_snapped_points_are_told(client: TestClient, terrain: str) -> None:
    near, off, on = 2.0**-31, 2.0**-29, 0.0
    points = [{"face": 40, "barycentric": [0.5 - w, 0.5, w]} for w in (near, off, on)]
    curves = [{"polyline": [points[1]]}, {"polyline": points}]
    answer = ask(client, terrain, "cut", curves=curves).json()
    assert answer["snapped"] == {"count": 1, "ids": [[1, 0]]}
    mesh = stored_mesh(client, terrain)
    places = [gc.SurfacePoint.face(40, (0.5 - w, 0.5, w)) for w in (near, off, on)]
    cut = gc.cut(mesh, [gc.Curve([places[1]]), gc.Curve(places)])
    check_cut(client, terrain, answer, cut)
    weights = cut.location_weights[len(mesh.vertices) :]
    assert sorted({w for row in weights for w in row if 0 < w < 1e-6}) == [off]


def test_a_cut_as_a_job(client: TestClient, terrain: str) -> None:
    path = ask(client, terrain, "path", source=5, target=110).json()
    body = {"curves": as_curves(path)}
    link = f"/v1/meshes/{terrain}/cut"
    job = client.post(link, json=body, headers={"Prefer": "respond-async"})
    assert job.status_code == 202
    where = job.json()["links"]
    wait_until(lambda: client.get(where["self"]).json()["status"] == "successful")
    answer = client.get(where["results"])
    assert answer.status_code == 200
    mesh = stored_mesh(client, terrain)
    check_cut(client, terrain, answer.json(), gc.cut(mesh, gc.shortest_path(mesh, 5, 110)))
    waited = client.post(link, json=body, headers={"Prefer": "respond-async, wait=60"})
    assert (waited.status_code, waited.json()) == (200, answer.json())
    assert client.delete(where["self"]).status_code == 200


CURVE = {"polyline": [0, 1]}
INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}


@pytest.mark.parametrize(
    ("body", "code", "places"),
    [
        ({}, "invalid_request", ["/curves"]),
        ({"curves": []}, "invalid_request", ["/curves"]),
        ({"curves": CURVE}, "invalid_request", ["/curves"]),
        ({"curves": [{"polyline": []}]}, "invalid_request", ["/curves/0/polyline"]),
        ({"curves": [[0, 1]]}, "invalid_request", ["/curves/0"]),
        ({"curves": [{**CURVE, "closed": 1}]}, "invalid_request", ["/curves/0/closed"]),
        ({"curves": [CURVE], "separate": "no"}, "invalid_request", ["/separate"]),
        ({"curves": [CURVE], "barriers": [3]}, "invalid_request", ["/barriers"]),
        ({"curves": [CURVE], "name": "\n"}, "invalid_request", ["/name"]),
        (
            {"curves": [{"polyline": [9]}, {"polyline": [9, 99999]}]},
            "invalid_point",
            ["/curves/1/polyline/1"],
        ),
        (
            {"curves": [{"polyline": [{"face": 0, "barycentric": [0.5, 0.1, 0.1]}]}]},
            "invalid_point",
            ["/curves/0/polyline/0/barycentric"],
        ),
        (
            {"curves": [{"polyline": [9]}, {"polyline": [INSIDE, 0, INSIDE]}]},
            "invalid_point",
            ["/curves/1/polyline/1", "/curves/1/polyline/2"],
        ),
    ],
)
def test_refusals_name_the_member(
    client: TestClient, terrain: str, body: Any, code: str, places: list[str]
) -> None:
    problem = check_problem(ask(client, terrain, "cut", **body), 422, code)
    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_a_curve_that_does_not_close(client: TestClient, terrain: str) -> None:
    path = ask(client, terrain, "path", source=0, target=110).json()
    curves = [{"polyline": [7]}, {"polyline": path["locations"], "closed": True}]
    problem = check_problem(ask(client, terrain, "cut", curves=curves), 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/curves/1/closed"]


def test_a_vertex_with_a_double_is_refused(client: TestClient) -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 1, 0]]
    double = {"vertices": corners, "faces": [[0, 1, 2], [1, 3, 2], [1, 4, 3]]}
    mesh_id = client.post("/v1/meshes", json=double).json()["id"]
    refused = ask(client, mesh_id, "cut", curves=[{"polyline": [0, 2]}])
    problem = check_problem(refused, 422, "invalid_mesh")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/curves"]
    assert "vertex 2" in problem["detail"]


def test_other_formats_and_links(client: TestClient, terrain: str) -> None:
    check_problem(ask(client, terrain, "cut?format=npy", curves=[CURVE]), 406, "not_acceptable")
    check_problem(ask(client, "0" * 32, "cut", curves=[CURVE]), 404, "mesh_not_found")


@pytest.mark.slice(2)
@pytest.mark.parametrize(
    ("settings", "headers", "status", "code"),
    [
        ({"max_faces": 2000}, {}, 422, "limit_exceeded"),
        ({"max_vertices": 1100}, {}, 422, "limit_exceeded"),
        ({"query_memory_bytes": 2**17}, {}, 422, "memory_limit"),
        ({"store_bytes": 1_000_000}, {}, 507, "storage_full"),
        ({"deadline_s": 60}, {"X-Timeout-Ms": "1"}, 504, "deadline_exceeded"),
    ],
)
def test_a_cut_beyond_a_limit_leaves_nothing(
    tmp_path: Path, settings: Any, headers: Any, status: int, code: str
) -> None:
    with serving(tmp_path, **settings) as client:
        mesh_id = upload_sample(client, "plane", 1900)
        before = client.get("/v1/meshes").json()
        x = stored_mesh(client, mesh_id).vertices[:, 0].tolist()
        body = {"values": x, "count": 40, "include": ["locations"]}
        levels = ask(client, mesh_id, "isolines", **body).json()["isolines"]
        curves = as_curves(*(line for each in levels for line in each["lines"]))
        link = f"/v1/meshes/{mesh_id}/cut"
        refused = client.post(link, json={"curves": curves}, headers=headers)
        problem = check_problem(refused, status, code)
        if status != 504:
            (setting,) = settings
            assert (problem["limit"], problem["setting"]) == (settings[setting], setting)
            assert problem["actual"] > problem["limit"]
        assert client.get("/v1/meshes").json() == before
        folders = tmp_path / "meshes", tmp_path / "tmp"
        wait_until(lambda: [path.name for each in folders for path in each.iterdir()] == [mesh_id])

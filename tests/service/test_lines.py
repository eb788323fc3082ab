"""Lines of values, and boundaries, over HTTP: the library's to the bit, and what is refused."""

import csv
import json
from io import BytesIO, StringIO
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, stored_mesh, upload_sample


def ask(client: TestClient, mesh_id: str, link: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{link}", json=body)


def own_values(mesh: gc.TriangleMesh) -> np.ndarray:
    """Return values of both signs, some of them missing."""
    x, y, _ = mesh.vertices.T
    values = np.sin(9.0 * x) * np.cos(7.0 * y)
    values[40:43] = np.nan
    return values


def written(values: np.ndarray) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]


def check_lines(found: list[dict[str, Any]], expected: list[gc.SurfaceCurve]) -> None:
    assert len(found) == len(expected)
    for line, curve in zip(found, expected, strict=True):
        assert (line["closed"], line["length"]) == (curve.closed, curve.length)
        assert line["points"] == curve.points.tolist()
        assert line["faces"] == curve.faces.tolist()
        if "locations" in line:
            assert [(at["face"], tuple(at["barycentric"])) for at in line["locations"]] == [
                (at.face_index, at.barycentric) for at in curve.locations
            ]


@pytest.mark.parametrize("include", [[], ["locations"]])
def test_lines_of_values_are_the_library_s(
    client: TestClient, terrain: str, include: list[str]
) -> None:
    mesh, wall = stored_mesh(client, terrain), [3, 4, 5]
    values, levels = own_values(mesh), [0.0, -0.5, 0.25, 9.0]
    expected = gc.ScalarField(mesh.with_barriers(wall), values).isolines(levels)
    body = {"values": written(values), "levels": levels, "barriers": wall, "include": include}
    answer = ask(client, terrain, "isolines", **body).json()
    assert [each["level"] for each in answer["isolines"]] == levels
    for each, lines in zip(answer["isolines"], expected, strict=True):
        check_lines(each["lines"], lines)
        assert all(("locations" in line) == bool(include) for line in each["lines"])
    assert {line.closed for line in expected[0] + expected[2]} == {True, False}
    assert answer["isolines"][3]["lines"] == []
    assert (answer["method"], answer["chord_error"], answer["sources"]) == ("exact", 0.0, [])
    assert answer["error_bound"] == {"type": "relative", "value": 0.0, "kind": "guaranteed"}


def test_levels_are_spaced_between_values(client: TestClient, terrain: str) -> None:
    values = np.linspace(-3.0, 5.0, len(stored_mesh(client, terrain).vertices))
    answer = ask(client, terrain, "isolines", values=values.tolist(), count=3).json()
    assert [each["level"] for each in answer["isolines"]] == [-1.0, 1.0, 3.0]


def test_locations_of_lines_of_distance(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    field = gc.exact_distance(mesh, [0, 300])
    include = ["locations"]
    drawn = ask(client, terrain, "isolines", sources=[0, 300], levels=[0.2], include=include)
    check_lines(drawn.json()["isolines"][0]["lines"], field.isolines([0.2])[0])
    found = ask(client, terrain, "borders", sources=[0, 300], include=include).json()["borders"]
    check_lines(found, list(field.borders()))
    assert all(len(line["locations"]) == len(line["points"]) for line in found)


def test_boundaries_are_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain).with_barriers([200, 201, 500])
    expected = mesh.boundaries()
    body = {"barriers": [500, 200, 201]}
    found = ask(client, terrain, "boundaries", **body, include=["locations"]).json()["boundaries"]
    check_lines(found, expected)
    assert len(found) > 1
    for line, curve in zip(found, expected, strict=True):
        assert line["vertices"] == [point.vertex_index for point in curve.locations]
        assert mesh.vertices[line["vertices"]].tolist() == line["points"]
    table = ask(client, terrain, "boundaries?format=csv", **body).text
    rows = list(csv.DictReader(StringIO(table)))
    assert [*rows[0]] == ["line", "closed", "length", "point", "x", "y", "z", "vertex"]
    assert [int(row["vertex"]) for row in rows] == [v for line in found for v in line["vertices"]]
    drawn = ask(client, terrain, "boundaries?format=obj", **body).text.splitlines()
    assert [row for row in drawn if row[0] == "g"] == [f"g boundary_{i}" for i in range(len(found))]


def test_open_boundaries_and_none(client: TestClient, book: str) -> None:
    found = ask(client, book, "boundaries").json()["boundaries"]
    check_lines(found, stored_mesh(client, book).boundaries())
    assert {line["closed"] for line in found} == {False}
    ball = upload_sample(client, "sphere", 80)
    assert ask(client, ball, "boundaries").json()["boundaries"] == []
    names, row = ask(client, ball, "boundaries?format=csv").text.splitlines()
    assert (names.count(","), row) == (7, "," * 7)


@pytest.mark.parametrize(
    ("body", "places"),
    [
        ({"count": 2}, ["/sources"]),
        ({"values": [], "count": 2}, ["/values"]),
        ({"values": [1.0, 2.0], "levels": [0.5]}, ["/values"]),
        ({"values": [1.0, "2"], "levels": [0.5]}, ["/values/1"]),
        ({"values": [True], "levels": [0.5]}, ["/values/0"]),
        ({"values": 1.0, "levels": [0.5]}, ["/values"]),
        ({"values": ...}, ["/levels"]),
        ({"values": ..., "levels": [0.5], "count": 1}, ["/count"]),
        ({"values": ..., "levels": [None]}, ["/levels/0"]),
        ({"values": ..., "sources": [0], "count": 2}, ["/sources"]),
        ({"values": ..., "method": "approximate", "count": 2}, ["/method"]),
        (
            {"values": ..., "absolute_error": 0.1, "relative_error": 0.1, "count": 2},
            ["/relative_error", "/absolute_error"],
        ),
        ({"values": ..., "max_distance": 1.0, "count": 2}, ["/max_distance"]),
        ({"values": ..., "chord_error": 1e-3, "count": 2}, ["/chord_error"]),
        ({"values": ..., "count": 2, "include": ["points"]}, ["/include/0"]),
        ({"values": "same", "count": 2}, ["/count"]),
        ({"values": "none", "count": 2}, ["/count"]),
        ({"sources": [0], "levels": [0.5, 0.0, -1.0]}, ["/levels/1", "/levels/2"]),
    ],
)
def test_refused_values(
    client: TestClient, terrain: str, body: dict[str, Any], places: list[str]
) -> None:
    count = len(stored_mesh(client, terrain).vertices)
    given = {"same": [1.0] * count, "none": [None] * count}
    values = body.get("values")
    if values is ...:
        body = body | {"values": [float(i) for i in range(count)]}
    elif isinstance(values, str):
        body = body | {"values": given[values]}
    problem = check_problem(ask(client, terrain, "isolines", **body), 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == places


@pytest.mark.parametrize(
    ("body", "places"),
    [
        ({"sources": [0]}, ["/sources"]),
        ({"barriers": [99999]}, ["/barriers/0"]),
        ({"include": "locations"}, ["/include"]),
    ],
)
def test_refused_boundaries(
    client: TestClient, terrain: str, body: dict[str, Any], places: list[str]
) -> None:
    problem = check_problem(ask(client, terrain, "boundaries", **body), 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == places


def as_npy(array: np.ndarray) -> bytes:
    file = BytesIO()
    np.save(file, array)
    return file.getvalue()


def send_form(client: TestClient, mesh_id: str, request: Any, **arrays: bytes) -> Any:
    parts: dict[str, Any] = {"request": (None, json.dumps(request), "application/json")}
    parts |= {name: (None, array, "application/x-npy") for name, array in arrays.items()}
    return client.post(f"/v1/meshes/{mesh_id}/isolines", files=parts)


@pytest.mark.parametrize("kind", [">f8", "float32", "int16"])
def test_values_in_numpy_s_format_are_those_of_a_list(
    client: TestClient, terrain: str, kind: str
) -> None:
    values = own_values(stored_mesh(client, terrain)) * 100.0
    values[40:43] = np.inf if kind != "int16" else 7.0
    values = values.astype(kind)
    request = {"levels": [0.5, -20.0], "include": ["locations"]}
    listed = [float(x) if np.isfinite(x) else None for x in values]
    expected = ask(client, terrain, "isolines", **request, values=listed)
    found = send_form(client, terrain, request, values=as_npy(values))
    assert (found.status_code, found.content) == (200, expected.content)


def test_forms_that_are_refused(client: TestClient, terrain: str) -> None:
    request, values = {"levels": [0.5]}, np.zeros(len(stored_mesh(client, terrain).vertices))
    npy = as_npy(values)
    lying = as_npy(np.zeros(10)).replace(b"(10,)", b"(99,)")
    for wrong, message in (
        (b"no array", "numpy's format"),
        (npy[:-1], "numpy's format"),
        (lying, "numpy's format"),
        (npy[:90], "numpy's format"),
        (as_npy(np.array([None, 1], object)), "numpy's format"),
        (as_npy(values[:, None]), "a list of real numbers"),
        (as_npy(values.astype(complex)), "a list of real numbers"),
        (as_npy(values > 0), "a list of real numbers"),
        (as_npy(values[1:]), "values"),
    ):
        refused = send_form(client, terrain, request, values=wrong)
        problem = check_problem(refused, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == ["/values"]
        assert message in problem["detail"]
    for sent in (
        send_form(client, terrain, request, value=npy),
        send_form(client, terrain, {**request, "values": [1]}, values=npy),
        send_form(client, terrain, [request], values=npy),
        client.post(f"/v1/meshes/{terrain}/isolines", files={"values": (None, npy)}),
        client.post(
            f"/v1/meshes/{terrain}/isolines",
            content=b"--x\r\n",
            headers={"Content-Type": "multipart/form-data; boundary=x"},
        ),
    ):
        check_problem(sent, 400, "malformed_body")
    elsewhere = client.post(f"/v1/meshes/{terrain}/distances", files={"request": (None, "{}")})
    check_problem(elsewhere, 415, "unsupported_media_type")
    assert send_form(client, terrain, {"sources": [0], **request}).status_code == 200

"""Answers in every format, read back by programs that share no code with the service."""

import csv
import json
from io import BytesIO, StringIO
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.sparse import load_npz
from starlette.testclient import TestClient

from tests.support.service import check_problem, upload_sample

OFFERED = {
    "distances": "json npy octets csv ply",
    "path": "json npy octets obj csv",
    "sweep": "json",
    "paths": "json obj csv",
    "isolines": "json obj csv",
    "borders": "json obj csv",
    "boundaries": "json obj csv",
    "loop": "json obj csv",
    "samples": "json npy octets csv",
    "cells": "json csv",
    "mean": "json",
    "matrix": "json npy octets csv",
    "nearest": "json csv",
    "log-map": "json npy octets csv ply",
    "trace": "json npy octets obj csv",
    "locate": "json csv",
}
BODIES: dict[str, dict[str, Any]] = {
    "distances": {"sources": [{"vertex": 0}, {"vertex": 7}]},
    "path": {"source": {"vertex": 0}, "target": {"vertex": 60}},
    "sweep": {"sources": [{"vertex": 0}], "steps": 9},
    "paths": {"source": {"vertex": 0}, "targets": [{"vertex": 60}, {"vertex": 0}, {"vertex": 99}]},
    "isolines": {"sources": [{"vertex": 60}], "levels": [0.25, 0.5, 9.0]},
    "borders": {"sources": [{"vertex": 0}, {"vertex": 7}]},
    "boundaries": {"barriers": [3]},
    "loop": {"curves": [{"polyline": [0, 1]}, {"polyline": [7, 8, 9]}]},
    "samples": {"count": 4},
    "cells": {"sources": [{"vertex": 0}, {"vertex": 7}]},
    "mean": {"points": [{"vertex": 0}, {"vertex": 7}]},
    "matrix": {"sources": [{"vertex": 0}, {"vertex": 7}], "targets": [{"vertex": 60}] * 3},
    "nearest": {
        "source": {"vertex": 0},
        "candidates": [{"vertex": 60}, {"face": 40, "barycentric": [0.2, 0.3, 0.5]}],
        "k": 2,
    },
    "log-map": {"source": {"vertex": 0}, "max_distance": 5.0},
    "trace": {"starts": [{"vertex": 0}], "directions": [0.5, 1.5], "lengths": [2.0, 0.0]},
    "locate": {"points": [[0.51, 0.32, 0.01], [0, 0, 7], [0, 0, 0]], "max_distance": 1.0},
}
MEDIA_TYPES = {
    "json": "application/json",
    "npy": "application/x-npy",
    "npz": "application/x-npz",
    "octets": "application/octet-stream",
    "obj": "model/obj",
    "ply": "model/ply",
    "csv": "text/csv; charset=utf-8",
}
POINT = ("x", "y", "z")


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 2000)


def ask(client: TestClient, mesh: str, kind: str, name: str, query: str = "", **body: Any) -> Any:
    link = f"/v1/meshes/{mesh}/{kind}?format={name}{query}"
    response = client.post(link, json=body or BODIES[kind])
    assert response.status_code == 200, response.text
    assert response.headers["content-type"] == MEDIA_TYPES[name]
    return response


def rows_of(response: Any) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(response.text)))


def numbers(rows: list[dict[str, str]], *names: str) -> list[Any]:
    """Return columns of a table as JSON has them: None where a cell is empty."""
    cells = [[float(row[name]) if row[name] else None for name in names] for row in rows]
    return [row[0] for row in cells] if len(names) == 1 else cells


def polylines_of(text: str) -> list[tuple[str, list[list[float]]]]:
    """Return what an OBJ file draws: the group, and the points, of each element."""
    vertices: list[list[float]] = []
    found, group = [], ""
    for row in (line.split() for line in text.splitlines() if not line.startswith("#")):
        match row[0]:
            case "v":
                vertices.append([float(x) for x in row[1:]])
            case "g":
                (group,) = row[1:]
            case "l" | "p":
                found.append((group, [vertices[int(i) - 1] for i in row[1:]]))
            case _:
                raise AssertionError(row)
    return found


@pytest.mark.parametrize("kind", OFFERED)
def test_each_format_is_there_by_its_name_and_by_accept_or_refused(
    client: TestClient, plane: str, kind: str
) -> None:
    link = f"/v1/meshes/{plane}/{kind}"
    for name, media_type in MEDIA_TYPES.items():
        accept = {"Accept": media_type.partition(";")[0]}
        answers = (
            client.post(f"{link}?format={name}", json=BODIES[kind]),
            client.post(link, json=BODIES[kind], headers=accept),
        )
        for response in answers:
            if name in OFFERED[kind].split():
                assert (response.status_code, response.headers["content-type"]) == (200, media_type)
                if name != "json":
                    assert response.headers["geodesic-mesh-id"] == plane
            else:
                problem = check_problem(response, 406, "not_acceptable")
                assert MEDIA_TYPES["json"] in problem["detail"]
        if name in OFFERED[kind].split():
            assert answers[0].content == answers[1].content
    html = client.post(link, json=BODIES[kind], headers={"Accept": "text/html"})
    check_problem(html, 406, "not_acceptable")
    check_problem(client.post(f"{link}?format=dxf", json=BODIES[kind]), 422, "invalid_request")


# Distances


def test_distances_as_a_coloured_mesh(client: TestClient, knot: str) -> None:
    body = BODIES["distances"] | {"include": ["nearest_source", "gradient"]}
    answer = ask(client, knot, "distances", "json", **body).json()
    arrays = {
        name: np.load(BytesIO(client.get(f"/v1/meshes/{knot}/arrays/{name}").content))
        for name in ("vertices", "faces")
    }

    ply = trimesh.load(
        BytesIO(ask(client, knot, "distances", "ply", **body).content), "ply", process=False
    )

    assert ply.vertices.tolist() == arrays["vertices"].tolist()
    assert ply.faces.tolist() == arrays["faces"].tolist()
    raw = ply.metadata["_ply_raw"]["vertex"]["data"]
    assert raw["distance"].tolist() == answer["distances"]
    assert raw["nearest_source"].tolist() == answer["nearest_source"]
    gradient = np.column_stack([raw[f"gradient_{x}"] for x in "xyz"])
    np.testing.assert_array_equal(gradient, np.array(answer["gradient"], float))
    colours = ply.visual.vertex_colors[:, :3]
    assert colours[0].tolist() == [68, 1, 84], "viridis begins with violet"
    assert colours[np.argmax(answer["distances"])].tolist() == [253, 231, 37], (
        "and ends with yellow"
    )
    light = colours @ [0.2126, 0.7152, 0.0722]
    order = np.argsort(answer["distances"])
    assert (np.diff(light[order]) > -1.0).all(), "farther is lighter"


def test_what_is_unreachable_is_infinite_and_grey_or_an_empty_cell(
    client: TestClient, apart: str
) -> None:
    body = {"sources": [{"vertex": 1}], "include": ["nearest_source"]}
    answer = ask(client, apart, "distances", "json", **body).json()
    assert answer["distances"][3:] == [None] * 3

    ply = trimesh.load(
        BytesIO(ask(client, apart, "distances", "ply", **body).content), "ply", process=False
    )
    raw = ply.metadata["_ply_raw"]["vertex"]["data"]
    assert raw["distance"].tolist() == answer["distances"][:3] + [np.inf] * 3
    assert raw["nearest_source"].tolist() == [0, 0, 0, -1, -1, -1]
    assert (ply.visual.vertex_colors[3:, :3] == 128).all()

    rows = rows_of(ask(client, apart, "distances", "csv", **body))
    assert list(rows[0]) == ["vertex", "distance", "nearest_source"]
    assert numbers(rows, "vertex") == [0, 1, 2, 3, 4, 5]
    assert numbers(rows, "distance") == answer["distances"]
    assert numbers(rows, "nearest_source") == answer["nearest_source"]


def test_a_table_of_distances_has_all_that_is_included(client: TestClient, knot: str) -> None:
    body = BODIES["distances"] | {"include": ["gradient"]}
    answer = ask(client, knot, "distances", "json", **body).json()
    rows = rows_of(ask(client, knot, "distances", "csv", **body))
    assert numbers(rows, "distance") == answer["distances"]
    assert numbers(rows, "gradient_x", "gradient_y", "gradient_z") == answer["gradient"]


def test_a_table_of_targets(client: TestClient, plane: str) -> None:
    targets = [{"vertex": 3}, {"face": 5, "barycentric": [0.2, 0.3, 0.5]}]
    body = {"sources": [{"vertex": 60}], "targets": targets}
    rows = rows_of(ask(client, plane, "distances", "csv", **body))
    answer = ask(client, plane, "distances", "json", **body).json()
    assert list(rows[0]) == ["target", "distance"]
    assert numbers(rows, "target", "distance") == [
        [i, d] for i, d in enumerate(answer["distances"])
    ]
    link = f"/v1/meshes/{plane}/distances?format=ply"
    check_problem(client.post(link, json=body), 406, "not_acceptable")


@pytest.mark.parametrize("name", ["npy", "octets"])
def test_a_bare_array_holds_nothing_beside(client: TestClient, plane: str, name: str) -> None:
    body = BODIES["distances"] | {"include": ["nearest_source"]}
    response = client.post(f"/v1/meshes/{plane}/distances?format={name}", json=body)
    problem = check_problem(response, 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/include"


def test_a_mesh_whose_vertices_were_merged_is_written_with_those_it_has(client: TestClient) -> None:
    corners = trimesh.creation.icosphere(subdivisions=1)
    soup = corners.export(file_type="stl")
    response = client.post("/v1/meshes?format=stl", content=soup)
    mesh = response.json()["id"]
    arrays = {
        name: np.load(BytesIO(client.get(f"/v1/meshes/{mesh}/arrays/{name}").content))
        for name in ("vertices", "vertex_map")
    }
    assert len(arrays["vertex_map"]) == 3 * len(corners.faces)
    body = {"sources": [{"vertex": 0}]}
    ply = trimesh.load(
        BytesIO(ask(client, mesh, "distances", "ply", **body).content), "ply", process=False
    )
    assert ply.vertices.tolist() == arrays["vertices"].tolist()
    rows = rows_of(ask(client, mesh, "distances", "csv", **body))
    distances = np.array(numbers(rows, "distance"))[arrays["vertex_map"]].reshape(-1, 3)
    edges = np.linalg.norm(corners.triangles - np.roll(corners.triangles, 1, axis=1), axis=2)
    assert (np.abs(distances - np.roll(distances, 1, axis=1)) <= edges * (1 + 1e-6)).all()


# Lines


def test_a_path_in_each_format_is_the_same(client: TestClient, knot: str) -> None:
    body = {"source": {"vertex": 3}, "target": {"face": 40, "barycentric": [0.2, 0.3, 0.5]}}
    answer = ask(client, knot, "path", "json", **body).json()
    points = answer["points"]
    assert len(points) > 2

    assert polylines_of(ask(client, knot, "path", "obj", **body).text) == [("", points)]

    table = ask(client, knot, "path", "csv", **body)
    rows = rows_of(table)
    assert numbers(rows, *POINT) == points
    assert numbers(rows, "point") == list(range(len(points)))
    assert {row["status"] for row in rows} == {"ok"}
    assert numbers(rows, "length") == [answer["length"]] * len(points)
    assert numbers(rows, "face") == [each["face"] for each in answer["locations"]]
    assert numbers(rows, *"uvw") == [each["barycentric"] for each in answer["locations"]]
    assert table.headers["geodesic-length"] == repr(answer["length"])
    assert json.loads(table.headers["geodesic-error-bound"]) == answer["error_bound"]
    assert "geodesic-locations" not in table.headers
    assert "geodesic-omitted" not in table.headers


def test_a_path_to_where_it_starts_is_a_point(client: TestClient, plane: str) -> None:
    body = {"source": {"vertex": 7}, "target": {"vertex": 7}}
    (point,) = ask(client, plane, "path", "json", **body).json()["points"]
    assert polylines_of(ask(client, plane, "path", "obj", **body).text) == [("", [point])]
    assert "p 1" in ask(client, plane, "path", "obj", **body).text


def test_members_too_long_for_a_header_are_named(client: TestClient, knot: str) -> None:
    stops = [{"vertex": vertex} for vertex in range(0, 900, 10)]
    body = {"source": stops[0], "target": stops[-1], "waypoints": stops[1:-1]}
    headers = ask(client, knot, "path", "npy", **body).headers

    assert headers["geodesic-omitted"] == "waypoints"
    assert "geodesic-waypoints" not in headers
    assert "geodesic-faces" in headers


def test_where_there_is_no_path_each_format_says_why(client: TestClient, apart: str) -> None:
    body = {"source": {"vertex": 0}, "target": {"vertex": 4}}
    for name in ("npy", "octets", "obj", "csv"):
        response = ask(client, apart, "path", name, **body)
        assert response.headers["geodesic-status"] == "no_path"
        assert response.headers["geodesic-reason"] == "disconnected"
    assert polylines_of(ask(client, apart, "path", "obj", **body).text) == []
    assert ask(client, apart, "path", "obj", **body).text == "# no line: status=disconnected\n"
    (row,) = rows_of(ask(client, apart, "path", "csv", **body))
    assert row.pop("status") == "disconnected"
    assert not any(row.values())


def test_paths_have_names_also_those_that_are_not_there(client: TestClient, apart: str) -> None:
    body = {"source": {"vertex": 1}, "targets": [{"vertex": 2}, {"vertex": 4}, {"vertex": 0}]}
    answer = ask(client, apart, "paths", "json", **body).json()["paths"]
    there = [(i, path["points"]) for i, path in enumerate(answer) if path["points"] is not None]
    assert [i for i, _ in there] == [0, 2]

    found = polylines_of(ask(client, apart, "paths", "obj", **body).text)
    assert found == [(f"path_{i}", points) for i, points in there]

    rows = rows_of(ask(client, apart, "paths", "csv", **body))
    for i, points in there:
        assert numbers([row for row in rows if row["path"] == str(i)], *POINT) == points
    (row,) = (row for row in rows if row["path"] == "1")
    assert (row["status"], row["x"], row["face"]) == ("disconnected", "", "")


def test_isolines_closed_open_and_none(client: TestClient, plane: str) -> None:
    answer = ask(client, plane, "isolines", "json").json()["isolines"]
    lines = [
        (level["level"], line | {"line": i})
        for level in answer
        for i, line in enumerate(level["lines"])
    ]
    assert {line["closed"] for _, line in lines} == {True, False}
    assert answer[2] == {"level": 9.0, "lines": []}
    ends = [line["points"] + line["points"][:1] * line["closed"] for _, line in lines]

    found = polylines_of(ask(client, plane, "isolines", "obj").text)
    assert found == [(f"level_{level}", p) for (level, _), p in zip(lines, ends, strict=True)]

    rows = rows_of(ask(client, plane, "isolines", "csv"))
    points = [point for _, line in lines for point in line["points"]]
    assert numbers(rows[:-1], *POINT) == points
    told_of_points = [
        [str(level), str(line["line"]), str(line["closed"]).lower()]
        for level, line in lines
        for _ in line["points"]
    ]
    assert [[row["level"], row["line"], row["closed"]] for row in rows[:-1]] == told_of_points
    assert rows[-1] == dict.fromkeys(rows[0], "") | {"level": "9.0"}


def test_levels_that_nothing_is_at(client: TestClient, plane: str) -> None:
    body = {"sources": [{"vertex": 0}], "levels": [8.0, 9.0]}
    assert polylines_of(ask(client, plane, "isolines", "obj", **body).text) == []
    assert numbers(rows_of(ask(client, plane, "isolines", "csv", **body)), "level") == [8.0, 9.0]


# Tables


@pytest.mark.parametrize("layout", ["dense", "sparse", "pairs"])
def test_a_matrix_as_rows(client: TestClient, apart: str, layout: str) -> None:
    body = {
        "sources": [{"vertex": 0}, {"vertex": 4}],
        "targets": [{"vertex": 1}, {"vertex": 2}],
        "layout": layout,
    }
    answer = ask(client, apart, "matrix", "json", **body).json()
    response = ask(client, apart, "matrix", "csv", **body)
    rows = rows_of(response)
    assert list(rows[0]) == ["source", "target", "distance"]
    found = [tuple(row) for row in numbers(rows, "source", "target", "distance")]
    distances = answer["distances"]
    if layout == "dense":
        assert found == [(i, j, distances[i][j]) for i in (0, 1) for j in (0, 1)]
        assert found[2][2] is None
    elif layout == "pairs":
        assert found == [(i, i, distances[i]) for i in (0, 1)]
        assert found[1][2] is None
    else:
        assert found == list(zip(answer["rows"], answer["columns"], distances, strict=True))
        assert len(found) == 2
    assert json.loads(response.headers["geodesic-unreachable"]) == answer["unreachable"]


def test_nearest_and_located_points(client: TestClient, plane: str) -> None:
    for kind, members, index in (
        ("nearest", "nearest", "candidate"),
        ("locate", "points", "point"),
    ):
        answer = ask(client, plane, kind, "json").json()[members]
        answer = [{index: i} | each if each else {index: i} for i, each in enumerate(answer)]
        rows = rows_of(ask(client, plane, kind, "csv"))
        for expected, row in zip(answer, rows, strict=True):
            (found,) = numbers([row], *row)
            found = dict(zip(row, found, strict=True))
            assert found[index] == expected[index]
            assert found["distance"] == expected.get("distance")
            assert [found[x] for x in POINT] == expected.get("position", [None] * 3)
            assert (found["vertex"], found["face"]) == (
                expected.get("vertex"),
                expected.get("face"),
            )
            assert [found[x] for x in "uvw"] == expected.get("barycentric", [None] * 3)
    assert rows[1]["x"] == "", "it misses"


def test_no_candidate_within_reach(client: TestClient, apart: str) -> None:
    body = {"source": {"vertex": 0}, "candidates": [{"vertex": 4}]}
    assert rows_of(ask(client, apart, "nearest", "csv", **body)) == []
    assert ask(client, apart, "nearest", "json", **body).json()["unreachable"]["disconnected"] == 1


# Narrow numbers


def test_float32_halves_the_bytes(client: TestClient, apart: str) -> None:
    body = {"sources": [{"vertex": 1}]}
    wide = np.load(BytesIO(ask(client, apart, "distances", "npy", **body).content))
    npy = ask(client, apart, "distances", "npy", "&dtype=float32", **body)
    octets = ask(client, apart, "distances", "octets", "&dtype=float32", **body)
    assert npy.headers["geodesic-dtype"] == octets.headers["geodesic-dtype"] == "<f4"
    array = np.load(BytesIO(npy.content))
    assert array.dtype == np.float32
    assert array.tolist() == wide.astype(np.float32).tolist()
    assert np.isinf(array[3:]).all()
    assert octets.content == array.tobytes()
    assert len(octets.content) == 4 * len(wide)
    same = ask(client, apart, "distances", "npy", "&dtype=float64", **body)
    assert same.headers["geodesic-dtype"] == "<f8"


def test_float32_of_paths_and_of_sparse_matrices(client: TestClient, plane: str) -> None:
    points = ask(client, plane, "path", "json").json()["points"]
    found = np.load(BytesIO(ask(client, plane, "path", "npy", "&dtype=float32").content))
    assert found.tolist() == np.float32(points).tolist()
    body = BODIES["matrix"] | {"layout": "sparse"}
    npz = ask(client, plane, "matrix", "npz", "&dtype=float32", **body)
    assert npz.headers["geodesic-dtype"] == "<f4"
    table = load_npz(BytesIO(npz.content))
    distances = ask(client, plane, "matrix", "json").json()["distances"]
    assert table.dtype == np.float32
    assert table.toarray().tolist() == np.float32(distances).tolist()


@pytest.mark.parametrize("name", ["json", "csv", "ply"])
def test_float32_goes_with_arrays_only(client: TestClient, plane: str, name: str) -> None:
    link = f"/v1/meshes/{plane}/distances?format={name}&dtype=float32"
    problem = check_problem(client.post(link, json=BODIES["distances"]), 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/query/dtype"


def test_numbers_that_float32_cannot_hold(client: TestClient) -> None:
    large = {"vertices": [[0, 0, 0], [1e39, 0, 0], [0, 1e39, 0]], "faces": [[0, 1, 2]]}
    mesh = client.post("/v1/meshes", json=large).json()["id"]
    link = f"/v1/meshes/{mesh}/distances?format=npy"
    body = {"sources": [{"vertex": 0}]}
    check_problem(client.post(f"{link}&dtype=float32", json=body), 422, "invalid_request")
    assert np.load(BytesIO(client.post(link, json=body).content))[1] == 1e39

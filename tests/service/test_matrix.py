"""Matrices over HTTP: the library's distances in every layout and format, and what is refused."""

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import load_npz
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import NPY, check_problem, serving, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
SOURCES = [{"vertex": 3}, INSIDE, {"vertex": 900}]
TARGETS = [{"vertex": 7}, {"vertex": 3}, {"vertex": 500}, {"face": 41, "barycentric": [0, 0, 1]}]
SIZE = (3, 4)


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


@pytest.fixture(scope="module")
def table(client: TestClient, knot: str) -> np.ndarray:
    mesh = stored_mesh(client, knot)
    inside = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    corner = int(mesh.faces[41, 2])
    return gc.distance_matrix(mesh, [3, inside, 900], [7, 3, 500, corner])


def matrix(
    client: TestClient, mesh_id: str, query: str = "", headers: Any = None, **body: Any
) -> Any:
    request = {"sources": SOURCES, "targets": TARGETS} | body
    return client.post(f"/v1/meshes/{mesh_id}/matrix{query}", json=request, headers=headers)


def test_distances_are_the_library_s(client: TestClient, knot: str, table: np.ndarray) -> None:
    answer = matrix(client, knot).json()

    assert answer["distances"] == table.tolist()
    assert (answer["method"], answer["layout"]) == ("exact", "dense")
    assert answer["error_bound"] == {"type": "relative", "value": 0.0, "kind": "guaranteed"}
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}
    assert answer["mesh_id"] == knot
    assert "shape" not in answer
    assert [end.get("vertex") for end in answer["sources"]] == [3, None, 900]
    assert answer["sources"][1]["barycentric"] == INSIDE["barycentric"]
    assert answer["targets"][1]["vertex"] == 3
    assert {end["component"] for end in answer["sources"] + answer["targets"]} == {0}


@pytest.mark.parametrize("name", ["npy", "octets"])
def test_a_dense_matrix_in_binary(
    client: TestClient, knot: str, table: np.ndarray, name: str
) -> None:
    response = matrix(client, knot, f"?format={name}", max_distance=2.0)

    found = np.frombuffer(response.content[-table.nbytes :], "<f8").reshape(SIZE)
    np.testing.assert_array_equal(found, np.where(table <= 2.0, table, np.inf))
    if name == "npy":
        np.testing.assert_array_equal(np.load(BytesIO(response.content)), found)
    headers = response.headers
    assert (headers["geodesic-dtype"], headers["geodesic-shape"]) == ("<f8", "3,4")
    missing = int(np.count_nonzero(table > 2.0))
    assert 0 < missing < 12
    counts = {"disconnected": 0, "beyond_max_distance": missing}
    assert json.loads(headers["geodesic-unreachable"]) == counts


def test_a_sparse_matrix_has_what_is_near(client: TestClient, knot: str, table: np.ndarray) -> None:
    near = np.argwhere(table <= 2.0)
    answer = matrix(client, knot, layout="sparse", max_distance=2).json()
    npz = matrix(client, knot, "?format=npz", layout="sparse", max_distance=2)

    assert answer["shape"] == [3, 4]
    places = list(zip(answer["rows"], answer["columns"], strict=True))
    assert places == [tuple(place) for place in near.tolist()]
    assert (0, 1) in places, "the distance of a point from itself is there, zero"
    assert answer["distances"] == [table[place] for place in places]
    assert answer["unreachable"]["beyond_max_distance"] == 12 - len(near)
    found = load_npz(BytesIO(npz.content))
    assert found.shape == SIZE
    np.testing.assert_array_equal(found.tocoo().data, answer["distances"])
    np.testing.assert_array_equal(found.tocoo().row, answer["rows"])
    assert npz.headers["content-type"] == "application/x-npz"
    assert npz.headers["geodesic-shape"] == "3,4"
    assert "geodesic-rows" not in npz.headers


def test_pairs(client: TestClient, knot: str, table: np.ndarray) -> None:
    body = {"targets": TARGETS[:3], "layout": "pairs"}
    answer = matrix(client, knot, **body).json()
    npy = matrix(client, knot, headers=NPY, **body)

    np.testing.assert_allclose(answer["distances"], table.diagonal(), rtol=1e-12)
    np.testing.assert_array_equal(np.load(BytesIO(npy.content)), answer["distances"])
    assert npy.headers["geodesic-shape"] == "3"


APPROXIMATE = {"method": "approximate", "relative_error": 1e-3}
WITHIN = {"method": "approximate", "absolute_error": 1e-3}
FAST = {"method": "fast", "effort": 2}


@pytest.mark.parametrize("layout", ["dense", "sparse", "pairs"])
@pytest.mark.parametrize("method", [APPROXIMATE, WITHIN, FAST], ids=str)
def test_other_methods_are_the_library_s_and_tell_their_error(
    client: TestClient, knot: str, layout: Any, method: dict[str, Any]
) -> None:
    mesh = stored_mesh(client, knot)
    inside = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    ends = [3, inside, 900], [7, 3, 500]
    options = {"relative_error": None} | method if method == WITHIN else method
    body = {"targets": TARGETS[:3], "layout": layout, "max_distance": 9.5, **method}
    exact, expected = (
        gc.distance_matrix(mesh, *ends, 9.5, layout, **each) for each in ({}, options)
    )

    answer = matrix(client, knot, **body).json()
    binary = matrix(client, knot, "?format=npz" if layout == "sparse" else "?format=npy", **body)

    found = np.array(answer["distances"], float)
    found[np.isnan(found)] = np.inf
    if layout == "sparse":
        exact, expected = exact.tocoo().data, expected.tocoo().data
        np.testing.assert_array_equal(load_npz(BytesIO(binary.content)).data, expected)
    else:
        np.testing.assert_array_equal(np.load(BytesIO(binary.content)), expected)
    np.testing.assert_array_equal(found, expected)
    bound = gc.error_bound(mesh, **options)
    assert answer["method"] == method["method"]
    assert answer["error_bound"] == {"type": bound.type, "value": bound.value, "kind": bound.kind}
    assert bound.value > 0.0
    assert json.loads(binary.headers["geodesic-error-bound"]) == answer["error_bound"]
    assert binary.headers["geodesic-method"] == method["method"]
    reached = np.isfinite(exact)
    exact, found = exact[reached], found[reached]
    if method == FAST:
        assert (found >= exact * (1 - 1e-12)).all()
    else:
        assert (found <= exact * (1 + 1e-12)).all()
        allowed = bound.value * (exact if bound.type == "relative" else 1.0)
        assert (found >= exact - allowed - 1e-12).all()


def test_the_default_error_is_that_of_single_queries(client: TestClient, knot: str) -> None:
    for method in ("approximate", "fast"):
        row = client.post(
            f"/v1/meshes/{knot}/distances",
            json={"sources": SOURCES[:1], "targets": TARGETS, "method": method},
        ).json()
        answer = matrix(client, knot, sources=SOURCES[:1], method=method).json()
        assert answer["distances"] == [row["distances"]]
        assert answer["error_bound"] == row["error_bound"]
        for name in ("relative_error", "effort"):
            given = {"relative_error": 1e-3, "effort": 2}[name]
            if (name == "effort") == (method == "fast"):
                named = matrix(client, knot, sources=SOURCES[:1], method=method, **{name: given})
                assert (
                    named.headers["etag"]
                    == matrix(client, knot, sources=SOURCES[:1], method=method).headers["etag"]
                )


@pytest.mark.parametrize("layout", ["dense", "sparse", "pairs"])
def test_a_reason_for_each_that_is_missing(client: TestClient, apart: str, layout: str) -> None:
    ends = [{"vertex": i} for i in range(6)]
    answer = matrix(
        client, apart, sources=ends, targets=ends[::-1], layout=layout, max_distance=0.5
    ).json()

    components = [[end["component"] for end in answer[side]] for side in ("sources", "targets")]
    cells = [(i, j) for i in range(6) for j in range(6) if layout != "pairs" or i == j]
    differ = sum(components[0][i] != components[1][j] for i, j in cells)
    reached = sum(i + j == 5 for i, j in cells)  # each itself
    assert answer["unreachable"] == {
        "disconnected": differ,
        "beyond_max_distance": len(cells) - differ - reached,
    }
    if layout == "dense":
        assert sum(value is None for row in answer["distances"] for value in row) == 30
    elif layout == "pairs":
        assert answer["distances"] == [None] * 6
    else:
        assert answer["distances"] == [0.0] * 6
    assert components == [[0, 0, 0, 1, 1, 1], [1, 1, 1, 0, 0, 0]]


@pytest.mark.parametrize(
    ("layout", "formats"),
    [("dense", ["npz"]), ("pairs", ["npz"]), ("sparse", ["npy", "octets"])],
)
def test_formats_that_do_not_hold_a_layout(
    client: TestClient, knot: str, layout: str, formats: list[str]
) -> None:
    targets = TARGETS[:3]
    for name in formats:
        response = matrix(client, knot, f"?format={name}", layout=layout, targets=targets)
        check_problem(response, 406, "not_acceptable")
    response = matrix(client, knot, headers={"Accept": "text/html"}, layout=layout, targets=targets)
    check_problem(response, 406, "not_acceptable")


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"sources": []}, "/sources"),
        ({"targets": []}, "/targets"),
        ({"sources": None}, "/sources"),
        ({"targets": {"vertex": 0}}, "/targets"),
        ({"sources": [{"vertex": 0, "start_distance": 1}]}, "/sources/0/start_distance"),
        ({"max_distance": -1}, "/max_distance"),
        ({"max_distance": "far"}, "/max_distance"),
        ({"layout": "rows"}, "/layout"),
        ({"layout": None}, "/layout"),
        ({"layout": "pairs"}, "/targets"),
        ({"method": "quick"}, "/method"),
        ({"method": "exact", "effort": 2}, "/effort"),
        ({"relative_error": 0.01}, "/relative_error"),
        ({"method": "fast", "absolute_error": 0.01}, "/absolute_error"),
        ({"method": "approximate", "effort": 2}, "/effort"),
        ({"method": "approximate", "relative_error": 1}, "/relative_error"),
        ({"method": "approximate", "absolute_error": 0}, "/absolute_error"),
        ({"method": "fast", "effort": 3}, "/effort"),
        ({"threads": 2}, "/threads"),
    ],
)
def test_refused_matrices(client: TestClient, knot: str, change: dict, place: str) -> None:
    response = matrix(client, knot, **change)
    problem = check_problem(response, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == [place]


def test_missing_sources_are_named(client: TestClient, knot: str) -> None:
    for body in ({"targets": [{"vertex": 0}]}, {}):
        response = client.post(f"/v1/meshes/{knot}/matrix", json=body)

        problem = check_problem(response, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == ["/sources"]


@pytest.mark.parametrize("layout", ["dense", "sparse"])
@pytest.mark.parametrize(
    "sources", [[0, {"face": 7, "barycentric": [0.2, 0.3, 0.5]}, 9], [3], "all"], ids=str
)
def test_without_targets_the_targets_are_the_sources(
    client: TestClient, layout: str, sources: Any
) -> None:
    mesh_id = upload_sample(client, "sphere", 80)
    answers = [
        client.post(f"/v1/meshes/{mesh_id}/matrix", json=body | {"layout": layout})
        for body in ({"sources": sources}, {"sources": sources, "targets": sources})
    ]
    assert [answer.status_code for answer in answers] == [200, 200]
    assert answers[0].content == answers[1].content
    assert answers[0].headers["etag"] == answers[1].headers["etag"]
    table = answers[0].json()
    assert table["sources"] == table["targets"]


def test_faults_of_sources_that_are_targets_too_are_told_once(
    client: TestClient, knot: str
) -> None:
    response = client.post(f"/v1/meshes/{knot}/matrix", json={"sources": [0, 10**6]})

    problem = check_problem(response, 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/sources/1"]


def test_pairs_need_targets(client: TestClient, knot: str) -> None:
    response = client.post(f"/v1/meshes/{knot}/matrix", json={"sources": [0, 1], "layout": "pairs"})

    problem = check_problem(response, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/layout"]
    assert "one for each source" in problem["detail"]


def test_limits_of_matrices(tmp_path: Path) -> None:
    limits = {"max_sources": 4, "max_matrix_cells": 12, "max_json_values": 70}
    vertex = {"vertex": 0}
    with serving(tmp_path, **limits) as client:
        mesh_id = upload_sample(client, "plane", 100)

        assert client.get("/v1").json()["limits"]["max_matrix_cells"] == 12
        for layout in ("dense", "sparse", "pairs"):
            many = {"sources": [vertex] * 5, "targets": [vertex] * 5, "layout": layout}
            problem = check_problem(matrix(client, mesh_id, **many), 422, "limit_exceeded")
            assert (problem["limit"], problem["actual"]) == (4, 5)
            assert problem["setting"] == "max_sources"
        for layout in ("dense", "sparse"):
            many = {"sources": [vertex] * 2, "targets": [vertex] * 7, "layout": layout}
            problem = check_problem(matrix(client, mesh_id, **many), 422, "limit_exceeded")
            assert (problem["limit"], problem["actual"]) == (12, 14)
            assert problem["setting"] == "max_matrix_cells"

        # What is reached counts where it may be less: the neighbours of a corner, and not all.
        around = {"sources": [vertex, vertex], "targets": [{"vertex": i} for i in range(40)]}
        link = "?format=npz"
        near = matrix(client, mesh_id, link, **around, layout="sparse", max_distance=0.25)
        reached = load_npz(BytesIO(near.content)).nnz
        assert 2 < reached <= 12
        far = matrix(client, mesh_id, link, **around, layout="sparse", max_distance=9)
        problem = check_problem(far, 422, "limit_exceeded")
        assert (problem["limit"], problem["actual"]) == (12, 80)
        assert problem["setting"] == "max_matrix_cells"

        large = {"sources": [vertex] * 3, "targets": [vertex] * 4}
        for layout, name, values in (("dense", "npy", 68), ("sparse", "npz", 92)):
            body = {**large, "layout": layout}
            response = matrix(client, mesh_id, f"?format={name}", **body)
            assert response.status_code == 200
            if values > 70:
                problem = check_problem(matrix(client, mesh_id, **body), 413, "result_too_large")
                assert (problem["limit"], problem["actual"]) == (70, values)
                assert f"application/x-{name}" in problem["hint"]
            else:
                assert matrix(client, mesh_id, **body).status_code == 200
        wide = {"sources": [vertex], "targets": [vertex] * 9}
        problem = check_problem(matrix(client, mesh_id, **wide), 413, "result_too_large")
        assert (problem["limit"], problem["actual"]) == (70, 89)
        assert "application/x-npy" in problem["hint"]


def test_memory_of_matrices(tmp_path: Path) -> None:
    with serving(tmp_path, query_memory_bytes=1000) as client:
        mesh_id = upload_sample(client, "plane", 100)
        for operation, body in (
            ("matrix", {"sources": [{"vertex": 0}], "targets": [{"vertex": 1}]}),
            ("nearest", {"source": {"vertex": 0}, "candidates": [{"vertex": 1}]}),
            ("paths", {"source": {"vertex": 0}, "targets": [{"vertex": 1}]}),
        ):
            link = f"/v1/meshes/{mesh_id}/{operation}"
            problem = check_problem(client.post(link, json=body), 422, "memory_limit")
            assert problem["actual"] > problem["limit"] == 1000
            assert problem["setting"] == "query_memory_bytes"

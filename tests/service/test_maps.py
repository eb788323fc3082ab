"""Log maps and straight lines over HTTP: the library's to the bit, and what is refused."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, serving, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
PLACE = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))


def ask(client: TestClient, mesh_id: str, link: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{link}", json=body)


def nulls(array: np.ndarray) -> list[Any]:
    """Return an array as JSON has it."""
    values = array.astype(object)
    values[~np.isfinite(array)] = None
    return list(values.tolist())


@pytest.mark.parametrize("axis", [None, [1.0, 2.0, 0.5], "corner"])
def test_the_log_map_is_the_library_s(client: TestClient, terrain: str, axis: Any) -> None:
    mesh = stored_mesh(client, terrain)
    if axis == "corner":
        axis = int(mesh.faces[40, 1])
    options: dict[str, Any] = {"rescale": False, "max_distance": 0.6, "barriers": [3, 4]}
    expected = gc.log_map(mesh, PLACE, x_axis=axis, **options)
    found = ask(client, terrain, "log-map", source=INSIDE, x_axis=axis, **options).json()
    assert (found["kind"], found["total_angle"]) == ("log_map", expected.total_angle)
    assert found["distances"] == nulls(expected.distances)
    assert found["angles"] == nulls(expected.angles)
    assert found["coordinates"] == nulls(expected.coordinates)
    assert found["bends"] == [None if n < 0 else n for n in expected.bends.tolist()]
    unreached = int(np.isinf(expected.distances).sum())
    assert 0 < sum(found["unreachable"].values()) == unreached < len(found["distances"])


def test_the_columns_of_a_log_map(client: TestClient, terrain: str) -> None:
    expected = gc.log_map(stored_mesh(client, terrain), 5, max_distance=0.6)
    binary = ask(client, terrain, "log-map?format=npy", source=5, max_distance=0.6)
    rows = np.load(BytesIO(binary.content))
    columns = expected.distances, expected.angles, expected.coordinates, expected.bends
    np.testing.assert_array_equal(rows, np.column_stack(columns))
    assert float(binary.headers["geodesic-total-angle"]) == expected.total_angle
    table = ask(client, terrain, "log-map?format=csv", source=5, max_distance=0.6).text
    names, *lines = table.splitlines()
    assert names == "vertex,distance,angle,coordinate_x,coordinate_y,bends"
    cells = [[float(cell) if cell else np.nan for cell in line.split(",")[1:]] for line in lines]
    rows[np.isinf(rows[:, 0]), 0] = np.nan
    rows[rows[:, 4] < 0, 4] = np.nan
    np.testing.assert_array_equal(cells, rows)


@pytest.mark.parametrize("directions", [[0.5], [0.5, 2.0, 6.0], [[1.0, 0.2, 0.0]] * 3])
@pytest.mark.parametrize("at_vertices", ["straight", "stop"])
def test_lines_are_the_library_s(
    client: TestClient, terrain: str, directions: Any, at_vertices: Any
) -> None:
    mesh = stored_mesh(client, terrain)
    body = {"directions": directions, "lengths": [0.3, 0.0, 5.0], "at_vertices": at_vertices}
    answer = ask(client, terrain, "trace", starts=[5, INSIDE, 9], **body).json()
    expected: Any = gc.trace(
        mesh,
        [5, PLACE, 9],
        np.resize(directions, (3, *np.shape(directions)[1:])),
        body["lengths"],
        at_vertices=at_vertices,
    )
    assert [start.get("vertex") for start in answer["starts"]] == [5, None, 9]
    for line, own in zip(answer["lines"], expected, strict=True):
        assert (line["stopped"], line["length"]) == (own.stopped, own.length)
        assert line["end_direction"] == own.end_direction
        assert line["points"] == own.points.tolist()
        assert line["faces"] == own.faces.tolist()
        assert [(at["face"], tuple(at["barycentric"])) for at in line["locations"]] == [
            (at.face_index, at.barycentric) for at in own.locations
        ]


def test_a_star_from_one_point_in_each_format(client: TestClient, terrain: str) -> None:
    body = {"starts": [INSIDE], "directions": [0.0, 1.0, 2.0], "lengths": [0.4]}
    own: Any = gc.trace(stored_mesh(client, terrain), [PLACE] * 3, [0.0, 1.0, 2.0], 0.4)
    rows = np.load(BytesIO(ask(client, terrain, "trace?format=npy", **body).content))
    points = np.concatenate([line.points for line in own])
    np.testing.assert_array_equal(rows[:, 4:7], points)
    counts = [len(line.points) for line in own]
    np.testing.assert_array_equal(rows[:, 0], np.repeat([0, 1, 2], counts))
    np.testing.assert_array_equal(rows[:, 1], np.repeat([line.length for line in own], counts))
    names, *table = ask(client, terrain, "trace?format=csv", **body).text.splitlines()
    assert names == "line,stopped,length,end_direction,point,x,y,z,face,u,v,w"
    assert [line.split(",")[1] for line in table] == ["length"] * len(rows)
    cells = [[float(cell) for i, cell in enumerate(line.split(",")) if i != 1] for line in table]
    np.testing.assert_array_equal(cells, rows)
    drawn = ask(client, terrain, "trace?format=obj", **body).text.splitlines()
    assert [row for row in drawn if row[0] == "g"] == [f"g line_{i}" for i in range(3)]


@pytest.mark.usefixtures("one_replica")
def test_neither_is_computed_again(client: TestClient, terrain: str) -> None:
    line = {"starts": [1], "directions": [0.25], "lengths": [0.5]}
    for link, body in (("log-map", {"source": 11}), ("trace", line)):
        first, again = (ask(client, terrain, link, **body) for _ in range(2))
        assert (again.content, again.headers["server-timing"]) == (first.content, "kept")


LINE = {"starts": [0, 3], "directions": [0.5], "lengths": [1.0]}


@pytest.mark.parametrize(
    ("link", "body", "code", "places"),
    [
        ("log-map", {}, "invalid_request", ["/source"]),
        ("log-map", {"source": [0]}, "invalid_request", ["/source"]),
        ("log-map", {"source": 99999}, "invalid_point", ["/source"]),
        ("log-map", {"source": 0, "rescale": 1}, "invalid_request", ["/rescale"]),
        ("log-map", {"source": 0, "max_distance": -1}, "invalid_request", ["/max_distance"]),
        ("log-map", {"source": 0, "x_axis": [0, 0, 0]}, "invalid_request", ["/x_axis"]),
        ("log-map", {"source": 0, "x_axis": [1, 0]}, "invalid_request", ["/x_axis/2"]),
        ("log-map", {"source": 0, "x_axis": 0}, "invalid_point", ["/x_axis"]),
        (
            "log-map",
            {"source": 0, "x_axis": {"vertex": 99999}},
            "invalid_point",
            ["/x_axis/vertex"],
        ),
        ("log-map", {"source": 0, "barriers": [-1]}, "invalid_request", ["/barriers/0"]),
        ("log-map", {"source": 0, "method": "fast"}, "invalid_request", ["/method"]),
        ("trace", {}, "invalid_request", ["/starts", "/directions", "/lengths"]),
        ("trace", {**LINE, "starts": []}, "invalid_request", ["/starts"]),
        ("trace", {**LINE, "directions": []}, "invalid_request", ["/directions"]),
        ("trace", {**LINE, "directions": [1, [1, 0, 0]]}, "invalid_request", ["/directions/1"]),
        ("trace", {**LINE, "directions": [[1, 0, 0], 1]}, "invalid_request", ["/directions/1"]),
        (
            "trace",
            {**LINE, "directions": [[1, 0, 0], [0, 0, 0]]},
            "invalid_request",
            ["/directions/1"],
        ),
        ("trace", {**LINE, "directions": [[0, 0, 0]]}, "invalid_request", ["/directions/0"]),
        ("trace", {**LINE, "directions": [1, 2, 3]}, "invalid_request", ["/starts"]),
        ("trace", {**LINE, "lengths": [1, -2]}, "invalid_request", ["/lengths/1"]),
        ("trace", {**LINE, "lengths": 1}, "invalid_request", ["/lengths"]),
        ("trace", {**LINE, "starts": [0, 99999]}, "invalid_point", ["/starts/1"]),
        ("trace", {**LINE, "at_vertices": "bend"}, "invalid_request", ["/at_vertices"]),
        ("trace", {**LINE, "max_distance": 1}, "invalid_request", ["/max_distance"]),
    ],
)
def test_refusals_name_the_member(
    client: TestClient, terrain: str, link: str, body: Any, code: str, places: list[str]
) -> None:
    problem = check_problem(ask(client, terrain, link, **body), 422, code)
    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_where_directions_have_no_meaning(client: TestClient, book: str) -> None:
    spine, page = {"edge": [0, 1], "t": 0.5}, {"face": 0, "barycentric": [0.2, 0.3, 0.5]}
    refused = ask(client, book, "log-map", source=spine)
    assert check_problem(refused, 422, "invalid_point")["errors"][0]["pointer"] == "/source"
    line = {"directions": [0.1], "lengths": [1]}
    for starts, place in (([page, spine], "/starts/1"), ([spine], "/starts/0")):
        problem = check_problem(
            ask(client, book, "trace", starts=starts, **line), 422, "invalid_point"
        )
        assert problem["errors"][0]["pointer"] == place
        assert "no tangent plane" in problem["detail"]


def test_true_angles_beyond_a_full_turn_are_refused(client: TestClient, terrain: str) -> None:
    saddle = int(np.argmax(stored_mesh(client, terrain).topology.total_angle))
    mesh = stored_mesh(client, terrain)
    vertex = int(mesh.topology.outer_vertex[saddle])
    refused = ask(client, terrain, "log-map", source=vertex, rescale=False)
    problem = check_problem(refused, 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/rescale"


def test_lines_that_are_too_many_for_json(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=300) as client:
        mesh_id = upload_sample(client, "plane", 1000)
        body = {"starts": [0], "directions": [0.7], "lengths": [0.05]}
        assert ask(client, mesh_id, "trace", **body).status_code == 200
        for more in ({"lengths": [1.2] * 9}, {"lengths": [0.05] * 50}):  # found after, and before
            many = ask(client, mesh_id, "trace", **(body | more))
            problem = check_problem(many, 413, "result_too_large")
            assert problem["actual"] > problem["limit"] == 300
        assert ask(client, mesh_id, "trace?format=npy", **(body | more)).status_code == 200
        check_problem(ask(client, mesh_id, "log-map", source=0), 413, "result_too_large")

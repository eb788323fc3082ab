"""Points anywhere on the surface over HTTP: the library's answers, and one for all spellings."""

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.queries import (
    DistancesQuery,
    LocateQuery,
    MatrixQuery,
    NearestQuery,
    PathQuery,
    PathsQuery,
    Query,
)
from app.schemas.points import VertexPoint, VertexSource
from app.schemas.requests import (
    DistancesRequest,
    LocateRequest,
    MatrixRequest,
    NearestRequest,
    PathRequest,
    PathsRequest,
)
from app.store.meshes import OpenMesh
from tests.support.service import check_problem, context, distances, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
ENDS = {"source": {"vertex": 3}, "target": INSIDE}
METHODS = ({}, {"method": "approximate", "relative_error": 0.05})


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    """The id of a curved closed mesh."""
    return upload_sample(client, "knot", 3000)


@pytest.fixture(scope="module")
def mesh(client: TestClient, knot: str) -> gc.TriangleMesh:
    return stored_mesh(client, knot)


def path(client: TestClient, mesh_id: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/path", json=ENDS | body)


def get_path(client: TestClient, mesh_id: str, source: str, target: str) -> Any:
    parameters = {"from": source, "to": target}
    return client.get(f"/v1/meshes/{mesh_id}/path", params=parameters)


def echo(mesh: gc.TriangleMesh, point: int | gc.SurfacePoint) -> Mapping[str, Any]:
    """Return what answers have to say of a point."""
    place = mesh.point(point)
    position = mesh.position(place).tolist()
    if place.vertex_index is not None:
        return {"vertex": place.vertex_index, "position": position}
    weights = list(place.barycentric)
    return {"face": place.face_index, "barycentric": weights, "position": position}


def text_of(point: Mapping[str, Any]) -> str:
    """Return a point of a body as parameters have it."""
    match point:
        case {"vertex": vertex}:
            return f"v{vertex}"
        case {"edge": (start, end), "t": t}:
            return f"e{start}-{end}:{t!r}"
        case {"face": face, "barycentric": weights}:
            return f"f{face}:" + ",".join(map(repr, weights))
    return "p" + ",".join(map(repr, point["position"]))


def spellings(mesh: gc.TriangleMesh, face: int, corner: int, t: float) -> list[dict[str, Any]]:
    """Return the ways to write a point of an edge, or of a vertex where ``t`` is 0."""
    start, end = (int(mesh.faces[face, i % 3]) for i in (corner, corner + 1))
    position = (1.0 - t) * mesh.vertices[start] + t * mesh.vertices[end]
    found: list[dict[str, Any]] = [{"vertex": start}] if t == 0.0 else []
    found += [
        {"edge": [start, end], "t": t},
        {"edge": [end, start], "t": 1.0 - t},
        {"position": position.tolist()},
        {"position": (position * (1.0 + 1e-15)).tolist(), "max_distance": 1e-9},
    ]
    for other, corners in enumerate(mesh.faces.tolist()):
        if {start, end} <= set(corners):
            weights = [-5e-17] * 3
            weights[corners.index(start)], weights[corners.index(end)] = 1.0 - t, t
            found.append({"face": other, "barycentric": weights})
    return found


# Answers


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_distances_are_the_library_s(
    client: TestClient, knot: str, mesh: gc.TriangleMesh, method: dict
) -> None:
    start, end = mesh.faces[9, :2].tolist()
    outside = (mesh.vertices[700] * 1.001).tolist()
    sources = [
        gc.Source(gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))),
        gc.Source(mesh.point_on_edge(start, end, 0.3), 0.25),
        gc.Source(3, 0.5),
    ]
    targets = [mesh.locate(outside), 5, gc.SurfacePoint.face(41, (0.6, 0.3, 0.1)), 5]
    solve = gc.approximate_distance if method else gc.exact_distance
    errors = {"relative_error": 0.05} if method else {}
    field = solve(mesh, sources, targets=targets, **errors)

    answered = distances(
        client,
        knot,
        sources=[
            INSIDE,
            {"edge": [start, end], "t": 0.3, "start_distance": 0.25},
            {"vertex": 3, "start_distance": 0.5},
        ],
        targets=[
            {"position": outside, "max_distance": 0.1},
            {"vertex": 5},
            {"face": 41, "barycentric": [0.6, 0.3, 0.1]},
            {"vertex": 5},
        ],
        include=["nearest_source"],
        **method,
    ).json()

    assert answered["distances"] == [field.distance_at(target) for target in targets]
    assert answered["nearest_source"] == [field.nearest_source_at(target) for target in targets]
    assert answered["sources"] == [
        {**echo(mesh, source.point), "start_distance": source.start_distance} for source in sources
    ]
    assert answered["targets"] == [echo(mesh, target) for target in targets]
    assert answered["unreachable"] == {"disconnected": 0, "beyond_max_distance": 0}


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_paths_are_the_library_s(
    client: TestClient, knot: str, mesh: gc.TriangleMesh, method: dict
) -> None:
    start, end = mesh.faces[900, 1:].tolist()
    source = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    target = mesh.point_on_edge(start, end, 0.3)
    if method:
        field = gc.approximate_distance(mesh, source, 0.05, targets=[target], retain="paths")
        expected = field.path_to(target)
    else:
        expected = gc.shortest_path(mesh, source, target)

    ends = {"source": INSIDE, "target": {"edge": [start, end], "t": 0.3}}
    answered = path(client, knot, **ends, **method).json()

    assert answered["length"] == expected.length
    np.testing.assert_array_equal(answered["points"], expected.points)
    np.testing.assert_array_equal(answered["faces"], expected.faces)
    assert answered["source"] == echo(mesh, source)
    assert answered["target"] == echo(mesh, target)
    np.testing.assert_allclose(answered["points"][0], answered["source"]["position"], atol=1e-15)
    np.testing.assert_allclose(answered["points"][-1], answered["target"]["position"], atol=1e-15)


def test_waypoints_are_points(client: TestClient, knot: str, mesh: gc.TriangleMesh) -> None:
    nearest = mesh.locate([4.0, 0.5, 0.25])
    expected = gc.shortest_path(
        mesh, 3, gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)), [mesh.point(nearest), 77]
    )

    stops = [{"position": [4, 0.5, 0.25]}, {"vertex": 77}]
    answered = path(client, knot, waypoints=stops).json()
    got = client.get(
        f"/v1/meshes/{knot}/path?from=v3&to=f40:0.2,0.3,0.5&via=p4,0.5,0.25&via=v77"
    ).json()

    np.testing.assert_array_equal(answered["points"], expected.points)
    assert answered["waypoints"] == [echo(mesh, nearest), echo(mesh, 77)]
    assert got == answered


@pytest.mark.parametrize("t", [0.0, 0.3, 1 / 3], ids=["vertex", "edge", "third"])
def test_all_spellings_of_a_point_give_one_answer(
    client: TestClient, knot: str, mesh: gc.TriangleMesh, t: float
) -> None:
    """To the bit: the whole body, with the point that it echoes."""
    written = spellings(mesh, 500, 1, t)
    assert len(written) >= 6
    bodies: dict[str, set[bytes]] = {
        name: set() for name in ("as source", "as target", "distances")
    }
    tags = set()
    for point in written:
        back = get_path(client, knot, "v3", text_of(point))
        responses = {
            "as source": [
                path(client, knot, source=point, target={"vertex": 3}),
                get_path(client, knot, text_of(point), "v3"),
            ],
            "as target": [path(client, knot, target=point), back],
            "distances": [
                distances(client, knot, sources=[INSIDE, point], targets=[point, {"vertex": 5}])
            ],
        }
        for name, answered in responses.items():
            assert [response.status_code for response in answered] == [200] * len(answered)
            bodies[name] |= {response.content for response in answered}
        tags.add(back.headers["etag"])

    assert {name: len(different) for name, different in bodies.items()} == dict.fromkeys(bodies, 1)
    # The question names the answer; max_distance, which text does not have, is no part of it.
    assert len(tags) == len({text_of(point) for point in written})


@pytest.mark.usefixtures("one_replica")
def test_the_index_of_a_vertex_is_a_point(client: TestClient, knot: str) -> None:
    for name, bare in (
        ("distances", {"sources": [3, {"polyline": [0, 1]}], "targets": [5, INSIDE]}),
        ("path", {"source": 3, "target": 5, "waypoints": [4]}),
        ("paths", {"source": 3, "targets": [5]}),
        ("isolines", {"sources": [3], "count": 2}),
        ("matrix", {"sources": [3], "targets": [5]}),
        ("nearest", {"source": 3, "candidates": [5, 4]}),
    ):
        link = f"/v1/meshes/{knot}/{name}"
        answer = client.post(link, json=bare)
        assert answer.status_code == 200
        named = json.loads(re.sub(r"(?<=[\[ ])(\d)(?=[,\]}])", r'{"vertex": \1}', json.dumps(bare)))
        named |= {"count": 2} if name == "isolines" else {}
        again = client.post(link, json=named)
        assert again.content == answer.content
        assert again.headers["server-timing"] == "kept"
    assert get_path(client, knot, "3", "5").content == get_path(client, knot, "v3", "v5").content


def test_an_index_that_is_out_of_range_is_named_where_it_stands(
    client: TestClient, apart: str
) -> None:
    problem = check_problem(distances(client, apart, sources=[0, 6, -1]), 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/sources/1", "/sources/2"]
    body = {"source": {"polyline": [0, 6]}, "targets": [0]}
    response = client.post(f"/v1/meshes/{apart}/paths", json=body)
    problem = check_problem(response, 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/source/polyline/1"]


def test_a_position_inside_a_face_agrees_with_its_weights(
    client: TestClient, knot: str, mesh: gc.TriangleMesh
) -> None:
    position = echo(mesh, gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)))["position"]

    by_weights = distances(client, knot, sources=[INSIDE]).json()
    by_position = distances(client, knot, sources=[{"position": position}]).json()

    assert by_position["sources"][0]["face"] == 40
    np.testing.assert_allclose(
        by_position["distances"], by_weights["distances"], rtol=0, atol=1e-12 * mesh.diagonal
    )


def test_an_answer_can_be_asked_again_by_its_echo(client: TestClient, knot: str) -> None:
    written = {"position": [4, 0.5, 0.25], "max_distance": 1}
    first = path(client, knot, source=written).json()
    found = {name: first["source"][name] for name in ("face", "barycentric")}

    again = path(client, knot, source=found)

    assert again.json() == first
    assert get_path(client, knot, text_of(found), text_of(INSIDE)).json() == first


def test_what_is_out_of_reach(client: TestClient, apart: str) -> None:
    inside = [{"face": face, "barycentric": [0.5, 0.25, 0.25]} for face in (0, 1)]

    answered = distances(
        client,
        apart,
        sources=inside[:1],
        targets=[*inside, {"vertex": 0}, {"vertex": 1}, {"edge": [3, 4], "t": 0.5}],
        max_distance=0.5,
        include=["nearest_source"],
    ).json()

    assert answered["distances"] == [0, None, pytest.approx(np.sqrt(0.125)), None, None]
    assert answered["nearest_source"] == [0, None, 0, None, None]
    assert answered["unreachable"] == {"disconnected": 2, "beyond_max_distance": 1}
    no_path = get_path(client, apart, text_of(inside[0]), text_of(inside[1])).json()
    assert (no_path["status"], no_path["reason"]) == ("no_path", "disconnected")
    assert no_path["source"]["face"] == 0


def test_looking_for_points_can_be_stopped() -> None:
    mesh = gc.samples.plane(200)
    point = VertexPoint(vertex=1)
    queries: list[Query[Any]] = [
        DistancesQuery("m", DistancesRequest(sources=[VertexSource(vertex=1)])),
        PathQuery("m", PathRequest(source=point, target=point)),
        PathsQuery("m", PathsRequest(source=point, targets=[point])),
        MatrixQuery("m", MatrixRequest(sources=[point], targets=[point])),
        NearestQuery("m", NearestRequest(source=point, candidates=[point])),
        LocateQuery("m", LocateRequest(points=[(0.0, 0.0, 0.0)])),
    ]
    for query in queries:
        with pytest.raises(gc.errors.Cancelled, match="looked for"):
            query.answer(
                OpenMesh(("", b""), gc.Solver(mesh), []),
                context(lambda: True),
            )


# Refusals

NO_POINT = "A point has vertex"
BAD_POINTS = [
    # What is no point in itself
    ({}, "invalid_request", "", NO_POINT),
    (7.0, "invalid_request", "", NO_POINT),
    (True, "invalid_request", "", NO_POINT),
    ("v7", "invalid_request", "", NO_POINT),
    ([1, 2, 3], "invalid_request", "", NO_POINT),
    (None, "invalid_request", "", NO_POINT),
    ({"barycentric": [1, 0, 0]}, "invalid_request", "", NO_POINT),
    ({"vertex": 1, "face": 2}, "invalid_request", "/face", "Extra"),
    ({"vertex": 1, "max_distance": 2}, "invalid_request", "/max_distance", "Extra"),
    ({"edge": [0, 1]}, "invalid_request", "/t", "required"),
    ({"edge": [0], "t": 0.5}, "invalid_request", "/edge/1", "required"),
    ({"edge": [0, "1"], "t": 0.5}, "invalid_request", "/edge/1", "integer"),
    ({"edge": 3, "t": 0.5}, "invalid_request", "/edge", "tuple"),
    ({"edge": [0, 1], "t": "0.5"}, "invalid_request", "/t", "number"),
    ({"edge": [0, 1], "t": 0.5, "corner": 1}, "invalid_request", "/corner", "Extra"),
    ({"face": 0}, "invalid_request", "/barycentric", "required"),
    ({"face": 0.5, "barycentric": [1, 0, 0]}, "invalid_request", "/face", "integer"),
    ({"face": True, "barycentric": [1, 0, 0]}, "invalid_request", "/face", "integer"),
    ({"face": 0, "barycentric": [1, 0]}, "invalid_request", "/barycentric/2", "required"),
    ({"face": 0, "barycentric": [1, 0, None]}, "invalid_request", "/barycentric/2", "number"),
    ({"face": 0, "barycentric": [1, 0, True]}, "invalid_request", "/barycentric/2", "number"),
    ({"position": [1, 2]}, "invalid_request", "/position/2", "required"),
    ({"position": [1, 2, "3"]}, "invalid_request", "/position/2", "number"),
    ({"position": {"x": 1}}, "invalid_request", "/position", "tuple"),
    ({"position": [1, 2, 3], "max_distance": -1}, "invalid_request", "/max_distance", "0"),
    # What cannot be on a mesh of this size
    ({"vertex": -1}, "invalid_point", "/vertex", "vertex -1 does not exist"),
    ({"edge": [0, 6], "t": 0.5}, "invalid_point", "/edge/1", "indices are 0 to 5"),
    ({"edge": [-1, 0], "t": 0.5}, "invalid_point", "/edge/0", "vertex -1"),
    ({"edge": [0, 1], "t": 1.5}, "invalid_point", "/t", "t is 1.5"),
    ({"edge": [0, 1], "t": -1e-8}, "invalid_point", "/t", "t is -1e-08"),
    ({"face": 2, "barycentric": [1, 0, 0]}, "invalid_point", "/face", "face 2 does not exist"),
    ({"face": -1, "barycentric": [1, 0, 0]}, "invalid_point", "/face", "face -1"),
    ({"face": 10**30, "barycentric": [1, 0, 0]}, "invalid_point", "/face", "does not exist"),
    # What this mesh does not have
    ({"edge": [0, 3], "t": 0.5}, "invalid_point", "/edge", "no edge joins the vertices 0 and 3"),
    ({"edge": [1, 1], "t": 0.5}, "invalid_point", "/edge", "no edge joins"),
    ({"face": 0, "barycentric": [0.5, 0.5, 0.1]}, "invalid_point", "/barycentric", "sum is 1"),
    ({"face": 0, "barycentric": [1.5, -0.5, 0]}, "invalid_point", "/barycentric", "0 or more"),
    ({"face": 0, "barycentric": [0, 0, 0]}, "invalid_point", "/barycentric", "sum is 1"),
    ({"position": [0, 0, 1], "max_distance": 0.5}, "invalid_point", "/position", "max_distance"),
    ({"position": [0, 0, 1e60]}, "invalid_point", "/position", "in size"),
]  # fmt: skip


@pytest.mark.parametrize(("point", "code", "member", "message"), BAD_POINTS)
def test_points_that_are_refused(
    client: TestClient, apart: str, point: Any, code: str, member: str, message: str
) -> None:
    good = {"vertex": 0}
    requests = [
        ("distances", {"sources": [good, point]}, "/sources/1"),
        ("distances", {"sources": [good], "targets": [good, good, point]}, "/targets/2"),
        ("path", {"source": point, "target": good}, "/source"),
        ("path", {"source": good, "target": point}, "/target"),
        ("path", {"source": good, "target": good, "waypoints": [good, point]}, "/waypoints/1"),
        ("paths", {"source": point, "targets": [good]}, "/source"),
        ("paths", {"source": good, "targets": [good, point]}, "/targets/1"),
        ("matrix", {"sources": [point], "targets": [good]}, "/sources/0"),
        ("matrix", {"sources": [good], "targets": [good, point]}, "/targets/1"),
        ("nearest", {"source": point, "candidates": [good]}, "/source"),
        ("nearest", {"source": good, "candidates": [good, point]}, "/candidates/1"),
    ]
    for operation, body, place in requests:
        response = client.post(f"/v1/meshes/{apart}/{operation}", json=body)
        problem = check_problem(response, 422, code)
        (fault,) = problem["errors"]
        assert fault["pointer"] == place + member
        assert message in fault["message"]
        assert problem["detail"] == f"{fault['pointer']}: {fault['message']}"


TEXTS = [text_of(point) for point, code, _, _ in BAD_POINTS if code == "invalid_point"][:-2]


@pytest.mark.parametrize("text", ["7.0", "e0-1", "f0:1,0", "p1,2,1e999", "p0,0,1e60", *TEXTS])
def test_texts_that_are_refused(client: TestClient, apart: str, text: str) -> None:
    for parameters, place in (
        ({"from": text, "to": "v0"}, "/query/from"),
        ({"from": "v0", "to": text}, "/query/to"),
        ({"from": "v0", "to": "v0", "via": ["v0", text]}, "/query/via/1"),
    ):
        response = client.get(f"/v1/meshes/{apart}/path", params=parameters)
        problem = check_problem(response, 422, "invalid_point")
        (fault,) = problem["errors"]
        assert fault["pointer"] == place
        assert problem["detail"] == f"{place}: {fault['message']}"


def test_each_point_at_fault_is_named(client: TestClient, apart: str) -> None:
    nowhere = {"edge": [0, 3], "t": 0.5}
    body = {"sources": [{"vertex": 0}, nowhere], "targets": [nowhere] * 20}

    problem = check_problem(distances(client, apart, **body), 422, "invalid_point")

    places = [fault["pointer"] for fault in problem["errors"]]
    assert places == ["/sources/1/edge", *(f"/targets/{i}/edge" for i in range(9))]
    got = get_path(client, apart, "e0-3:0.5", "f0:1,1,1")
    problem = check_problem(got, 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/query/from", "/query/to"]


def test_only_sources_start_somewhere(client: TestClient, apart: str) -> None:
    late = {"face": 0, "barycentric": [1, 0, 0], "start_distance": 1}

    problem = check_problem(path(client, apart, source=late), 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/source/start_distance"
    problem = check_problem(distances(client, apart, targets=[late]), 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/targets/0/start_distance"
    early = late | {"start_distance": -1}
    problem = check_problem(distances(client, apart, sources=[early]), 422, "invalid_request")
    assert problem["errors"][0]["pointer"] == "/sources/0/start_distance"

"""Paths between two points over HTTP: the library's answers, waypoints, and how they were found."""

from io import BytesIO
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.queries import PathQuery, result_key
from app.schemas.answers import StepName
from app.schemas.points import VertexPoint
from app.schemas.requests import PathRequest
from tests.support.service import NPY, check_problem, serving, stored_mesh, upload_sample

ENDS = {"source": {"vertex": 0}, "target": {"vertex": 60}}


def test_paths_are_the_library_s(client: TestClient, plane: str) -> None:
    path = gc.shortest_path(stored_mesh(client, plane), 0, 60)

    body = {"source": {"vertex": 0}, "target": {"vertex": 60}}
    answer = client.post(f"/v1/meshes/{plane}/path", json=body).json()

    assert answer["status"] == "ok"
    assert answer["length"] == path.length
    np.testing.assert_array_equal(answer["points"], path.points)
    np.testing.assert_array_equal(answer["faces"], path.faces)
    assert [tuple(place["barycentric"]) for place in answer["locations"]] == [
        location.barycentric for location in path.locations
    ]
    assert answer["points"][0] == answer["source"]["position"]
    assert answer["points"][-1] == answer["target"]["position"]
    assert answer["error_bound"]["value"] == 0


def test_get_answers_as_post_and_is_cached(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/path?from=v0&to=v60"
    body = {"source": {"vertex": 0}, "target": {"vertex": 60}}

    got = client.get(link)

    posted = client.post(f"/v1/meshes/{plane}/path", json=body)
    assert got.json() == posted.json()
    assert "max-age" in got.headers["cache-control"]
    assert posted.headers["cache-control"] == "no-store"
    again = client.get(link, headers={"If-None-Match": got.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    for response in (got, posted, again):
        assert response.headers["vary"] == "Accept, Accept-Encoding, Prefer"
    npy = client.get(link, headers=NPY | {"If-None-Match": got.headers["etag"]})
    assert npy.status_code == 200
    np.testing.assert_array_equal(np.load(BytesIO(npy.content)), got.json()["points"])


def test_part_of_a_result(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/path?from=v0&to=v60&format=npy"
    whole = client.get(link)

    part = client.get(link, headers={"Range": "bytes=-24", "If-Range": whole.headers["etag"]})

    assert part.status_code == 206
    assert part.content == whole.content[-24:]


def test_no_path_is_an_answer(client: TestClient, apart: str) -> None:
    link = f"/v1/meshes/{apart}/path?from=v0&to=v4"

    answer = client.get(link).json()
    npy = client.get(link, headers=NPY)

    assert (answer["status"], answer["reason"]) == ("no_path", "disconnected")
    missing = [answer[name] for name in ("length", "points", "locations", "faces")]
    assert missing == [None] * 4
    assert np.load(BytesIO(npy.content)).shape == (0, 3)
    assert npy.headers["geodesic-status"] == "no_path"
    assert npy.headers["geodesic-reason"] == "disconnected"


@pytest.mark.parametrize(
    ("query", "code", "place"),
    [
        ("from=v0&to=v-1", "invalid_point", "/query/to"),
        ("from=v99999999&to=v1", "invalid_point", "/query/from"),
        ("from=0.0&to=v1", "invalid_point", "/query/from"),
        ("from=v0&to=v" + "9" * 5000, "invalid_point", "/query/to"),
        ("from=v0", "invalid_request", "/query/to"),
        ("from=v0&to=v1&via=v3&via=3.0", "invalid_point", "/query/via/1"),
        ("from=v0&to=v1&via=v99999999", "invalid_point", "/query/via/0"),
        ("from=v0&to=v1&explain=perhaps", "invalid_request", "/query/explain"),
        ("from=v0&to=v1&explain=true&method=approximate", "invalid_request", "/query/explain"),
        ("from=v0&to=v1&via=v2&method=approximate", "invalid_request", "/query/via"),
        ("from=v0&to=v1&format=xml", "invalid_request", "/query/format"),
    ],
)
def test_refused_gets(client: TestClient, plane: str, query: str, code: str, place: str) -> None:
    problem = check_problem(client.get(f"/v1/meshes/{plane}/path?{query}"), 422, code)

    assert [fault["pointer"] for fault in problem["errors"]] == [place]


@pytest.mark.parametrize(
    ("body", "code", "places"),
    [
        (
            {"source": {"vertex": -1}, "target": {"vertex": 10**6}},
            "invalid_point",
            ["/source/vertex", "/target/vertex"],
        ),
        ({"source": {"vertex": 0}}, "invalid_request", ["/target"]),
        ({"source": 0.0, "target": "1"}, "invalid_request", ["/source", "/target"]),
        (
            ENDS | {"waypoints": [{"vertex": 3}, {"vertex": -3}]},
            "invalid_point",
            ["/waypoints/1/vertex"],
        ),
        (ENDS | {"waypoints": {"vertex": 3}}, "invalid_request", ["/waypoints"]),
        (ENDS | {"waypoints": [3.0]}, "invalid_request", ["/waypoints/0"]),
        (ENDS | {"explain": 1}, "invalid_request", ["/explain"]),
        (
            ENDS | {"method": "approximate", "waypoints": [{"vertex": 3}], "explain": True},
            "invalid_request",
            ["/waypoints", "/explain"],
        ),
    ],
)
def test_refused_posts(
    client: TestClient, plane: str, body: dict, code: str, places: list[str]
) -> None:
    problem = check_problem(client.post(f"/v1/meshes/{plane}/path", json=body), 422, code)

    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_waypoints_are_passed_in_order(client: TestClient, plane: str) -> None:
    path = gc.shortest_path(stored_mesh(client, plane), 0, 60, [90, 5, 5])

    body = ENDS | {"waypoints": [{"vertex": 90}, {"vertex": 5}, {"vertex": 5}]}
    answer = client.post(f"/v1/meshes/{plane}/path", json=body).json()
    got = client.get(f"/v1/meshes/{plane}/path?from=v0&to=v60&via=v90&via=v5&via=v5")

    assert answer["length"] == path.length
    np.testing.assert_array_equal(answer["points"], path.points)
    assert [point["vertex"] for point in answer["waypoints"]] == [90, 5, 5]
    assert all(point["position"] in answer["points"] for point in answer["waypoints"])
    assert got.json() == answer


def test_no_path_to_a_waypoint(client: TestClient, apart: str) -> None:
    answer = client.get(f"/v1/meshes/{apart}/path?from=v0&to=v1&via=v4").json()

    assert (answer["status"], answer["reason"]) == ("no_path", "disconnected")


def test_each_route_has_a_result_of_its_own() -> None:
    routes = [(), (3,), (4,), (3, 4), (4, 3)]
    first, last = VertexPoint(vertex=0), VertexPoint(vertex=9)
    queries = [
        PathQuery(
            "m",
            PathRequest(
                source=first,
                target=last,
                waypoints=[VertexPoint(vertex=i) for i in route],
            ),
        )
        for route in routes
    ]

    assert len({result_key(query, "application/json") for query in queries}) == len(routes)


def test_waypoints_are_limited(tmp_path: Path) -> None:
    with serving(tmp_path, max_waypoints=2) as client:
        mesh_id = upload_sample(client, "plane", 100)
        limits = client.get("/v1").json()["limits"]
        link = f"/v1/meshes/{mesh_id}/path"

        assert limits["GEODESIC_MAX_WAYPOINTS"] == 2
        assert client.get(f"{link}?from=v0&to=v60&via=v3&via=v4").status_code == 200
        body = ENDS | {"waypoints": [{"vertex": 3}] * 3}
        for response in (
            client.get(f"{link}?from=v0&to=v60&via=v3&via=v4&via=v5"),
            client.post(link, json=body),
        ):
            problem = check_problem(response, 422, "limit_exceeded")
            assert (problem["limit"], problem["actual"]) == (2, 3)
            assert problem["setting"] == "GEODESIC_MAX_WAYPOINTS"


@pytest.mark.parametrize("by", ["get", "body", "parameter"])
def test_explained_paths_tell_their_steps(client: TestClient, plane: str, by: str) -> None:
    link = f"/v1/meshes/{plane}/path"
    body = ENDS | {"waypoints": [{"vertex": 90}]}
    response = {
        "get": lambda: client.get(f"{link}?from=v0&to=v60&via=v90&explain=true"),
        "body": lambda: client.post(link, json=body | {"explain": True}),
        "parameter": lambda: client.post(f"{link}?explain=true", json=body),
    }[by]()
    path = gc.shortest_path(stored_mesh(client, plane), 0, 60, [90], explain=True)

    answer = response.json()

    assert path.steps is not None
    assert answer["length"] == path.length
    steps = [(leg, name) for leg in (0, 1) for name in get_args(StepName)]
    assert [(step["leg"], step["name"]) for step in answer["steps"]] == steps
    for step, expected in zip(answer["steps"], path.steps, strict=True):
        assert step["seconds"] > 0
        assert (step["bound"], step["windows"]) == (expected.bound, expected.windows)
        assert step["faces"] == expected.faces.tolist()


def test_an_explained_path_is_found_anew_each_time(tmp_path: Path) -> None:
    with serving(tmp_path) as client:
        mesh_id = upload_sample(client, "plane", 100)
        link = f"/v1/meshes/{mesh_id}/path?from=v0&to=v60&explain=true"

        first = client.get(link)
        again = client.get(link, headers={"If-None-Match": first.headers["etag"]})

        assert again.status_code == 200
        assert again.headers["etag"] != first.headers["etag"]
        assert "compute" in again.headers["server-timing"]
        assert first.headers["cache-control"] == again.headers["cache-control"] == "no-store"
        assert not list(tmp_path.glob("results/*/*")), "what is of no further use is not kept"


def test_steps_leave_the_answer_as_it_is(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/path?from=v0&to=v60"

    plain = client.get(link).json()
    explained = client.get(f"{link}&explain=true").json()

    assert "steps" not in plain
    assert explained.pop("steps")
    assert explained == plain


def test_steps_that_are_too_large_for_json(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=300) as client:
        mesh_id = upload_sample(client, "plane", 1000)
        link = f"/v1/meshes/{mesh_id}/path?from=v0&to=v60"

        assert client.get(link).status_code == 200
        assert client.get(f"{link}&explain=true&format=npy").status_code == 200
        problem = check_problem(client.get(f"{link}&explain=true"), 413, "result_too_large")
        assert problem["actual"] > problem["limit"] == 300
        assert "without explain" in problem["hint"]


@pytest.mark.parametrize("method", ["exact", "approximate"])
def test_no_path_beyond_a_largest_distance(client: TestClient, plane: str, method: str) -> None:
    """At the very limit it is there; beyond it there is none, with the reason."""
    link = f"/v1/meshes/{plane}/path"
    body = {"source": {"vertex": 0}, "target": {"vertex": 60}, "method": method}
    length = gc.exact_distance(stored_mesh(client, plane), 0).distances[60]

    for limit, status in ((length, "ok"), (0.999 * length, "no_path"), (0, "no_path")):
        posted = client.post(link, json=body | {"max_distance": limit}).json()
        parameters = {"from": "v0", "to": "v60", "method": method, "max_distance": limit}
        assert client.get(link, params=parameters).json() == posted
        assert posted["status"] == status
        assert posted.get("reason") == (None if status == "ok" else "beyond_max_distance")


def test_the_largest_distance_is_that_of_the_whole_path(client: TestClient, plane: str) -> None:
    body = {**ENDS, "waypoints": [{"vertex": 7}]}
    link = f"/v1/meshes/{plane}/path"
    length = client.post(link, json=body).json()["length"]

    found = client.post(link, json=body | {"max_distance": length}).json()
    missed = client.post(link, json=body | {"max_distance": 0.99 * length, "explain": True}).json()
    estimate = client.post(link, params={"estimate": True}, json=body | {"max_distance": 0.1})

    assert found["length"] == length
    assert (missed["status"], missed["reason"]) == ("no_path", "beyond_max_distance")
    assert estimate.json()["response_bytes"] < 1000


@pytest.mark.parametrize("limit", [-1, "nan", "much"])
def test_largest_distances_that_are_none(client: TestClient, plane: str, limit: object) -> None:
    link = f"/v1/meshes/{plane}/path"

    posted = client.post(link, json={**ENDS, "max_distance": limit})
    got = client.get(link, params={"from": "v0", "to": "v60", "max_distance": limit})

    for response, place in ((posted, "/max_distance"), (got, "/query/max_distance")):
        problem = check_problem(response, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == [place]

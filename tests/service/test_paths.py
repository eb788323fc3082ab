"""Paths between two points over HTTP: the library's answers, waypoints, and how they were found."""

from io import BytesIO
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.schemas.answers import StepName
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
        *(
            (f"from=v0&to=v1&{name}=1", "invalid_request", f"/query/{name}")
            for name in ("max_distance", "effort", "explain", "estimate", "dtype")
        ),
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
        (ENDS | {"explain": True}, "invalid_request", ["/explain"]),
        (
            ENDS | {"method": "approximate", "waypoints": [{"vertex": 3}]},
            "invalid_request",
            ["/waypoints"],
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


def test_waypoints_are_limited(tmp_path: Path) -> None:
    with serving(tmp_path, max_waypoints=2) as client:
        mesh_id = upload_sample(client, "plane", 100)
        limits = client.get("/v1").json()["limits"]
        link = f"/v1/meshes/{mesh_id}/path"

        assert limits["max_waypoints"] == 2
        assert client.get(f"{link}?from=v0&to=v60&via=v3&via=v4").status_code == 200
        body = ENDS | {"waypoints": [{"vertex": 3}] * 3}
        for response in (
            client.get(f"{link}?from=v0&to=v60&via=v3&via=v4&via=v5"),
            client.post(link, json=body),
        ):
            problem = check_problem(response, 422, "limit_exceeded")
            assert (problem["limit"], problem["actual"]) == (2, 3)
            assert problem["setting"] == "max_waypoints"


def test_the_steps_of_a_search(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/path/steps"
    path = gc.shortest_path(stored_mesh(client, plane), 0, 60, [90], explain=True)
    assert path.steps is not None

    first, again = (
        client.post(link, json=ENDS | {"waypoints": [{"vertex": 90}]}) for _ in range(2)
    )

    steps = [(leg, name) for leg in (0, 1) for name in get_args(StepName)]
    assert [(step["leg"], step["name"]) for step in first.json()["steps"]] == steps
    for step, expected in zip(first.json()["steps"], path.steps, strict=True):
        assert (step["bound"], step["windows"]) == (expected.bound, expected.windows)
        assert step["faces"] == expected.faces.tolist()
    assert again.headers["etag"] == first.headers["etag"]
    assert again.json() == first.json()


def test_steps_do_not_depend_on_what_was_asked_before(tmp_path: Path) -> None:
    found = []
    for store, before in ((tmp_path / "a", 0), (tmp_path / "b", 40)):
        with serving(store) as client:
            link = f"/v1/meshes/{upload_sample(client, 'plane', 2000)}/path"
            for vertex in range(before):
                assert client.get(f"{link}?from=v0&to=v{20 * vertex}").status_code == 200
            found.append(client.post(f"{link}/steps", json=ENDS).json())
    assert found[0] == found[1]


def test_without_a_path_there_are_no_steps(client: TestClient, apart: str) -> None:
    body = {"source": {"vertex": 0}, "target": {"vertex": 4}}
    assert client.post(f"/v1/meshes/{apart}/path/steps", json=body).json()["steps"] == []


def test_steps_that_are_too_large_for_json(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=200) as client:
        mesh_id = upload_sample(client, "plane", 1000)
        link = f"/v1/meshes/{mesh_id}/path"

        assert client.post(link, json=ENDS).status_code == 200
        response = client.post(f"{link}/steps", json=ENDS)
        problem = check_problem(response, 413, "result_too_large")
        assert problem["actual"] > problem["limit"] == 200


@pytest.mark.parametrize("method", ["exact", "approximate"])
def test_no_path_beyond_a_largest_distance(client: TestClient, plane: str, method: str) -> None:
    """At the very limit it is there; beyond it there is none, with the reason."""
    link = f"/v1/meshes/{plane}/path"
    body = {"source": {"vertex": 0}, "target": {"vertex": 60}, "method": method}
    length = gc.exact_distance(stored_mesh(client, plane), 0).distances[60]

    for limit, status in ((length, "ok"), (0.999 * length, "no_path"), (0, "no_path")):
        posted = client.post(link, json=body | {"max_distance": limit}).json()
        assert posted["status"] == status
        assert posted.get("reason") == (None if status == "ok" else "beyond_max_distance")


def test_the_largest_distance_is_that_of_the_whole_path(client: TestClient, plane: str) -> None:
    body = {**ENDS, "waypoints": [{"vertex": 7}]}
    link = f"/v1/meshes/{plane}/path"
    length = client.post(link, json=body).json()["length"]

    found = client.post(link, json=body | {"max_distance": length}).json()
    missed = client.post(link, json=body | {"max_distance": 0.99 * length}).json()

    assert found["length"] == length
    assert (missed["status"], missed["reason"]) == ("no_path", "beyond_max_distance")

"""Fast answers: lengths of paths, never too short, with an estimate of the error."""

import json
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import NPY, check_problem, distances, stored_mesh, upload_sample

EFFORTS = 1, 2, 4, 8
ROUNDING = 1e-9
SOURCES = [{"vertex": 3}, {"vertex": 400, "start_distance": 0.25}]
ENDS = {"source": {"vertex": 3}, "target": {"vertex": 700}}
INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
CURVE = {"polyline": [{"vertex": 3}, {"vertex": 3}]}


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


def fast(client: TestClient, mesh_id: str, headers: Any = None, **body: Any) -> Any:
    return distances(client, mesh_id, headers, method="fast", **body)


def ask(client: TestClient, mesh_id: str, operation: str, **body: Any) -> Any:
    return client.post(f"/v1/meshes/{mesh_id}/{operation}", json={"method": "fast"} | body)


# Distances


@pytest.mark.parametrize("effort", EFFORTS)
def test_distances_are_the_library_s(client: TestClient, knot: str, effort: int) -> None:
    sources = [gc.Source(3), gc.Source(400, 0.25)]
    field = gc.fast_distance(stored_mesh(client, knot), sources, effort)

    include = ["nearest_source", "gradient"]
    answer = fast(client, knot, sources=SOURCES, effort=effort, include=include).json()

    np.testing.assert_array_equal(answer["distances"], field.distances)
    np.testing.assert_array_equal(answer["nearest_source"], field.nearest_source)
    np.testing.assert_array_equal(np.array(answer["gradient"], float), field.gradient)
    assert answer["method"] == "fast"
    value = field.error_bound.value
    assert answer["error_bound"] == {"type": "relative", "value": value, "kind": "estimated"}
    assert answer["stats"]["windows_kept"] == field.stats.windows_kept


@pytest.mark.parametrize("sources", [SOURCES[:1], SOURCES, [INSIDE], [CURVE]])
@pytest.mark.parametrize("effort", EFFORTS)
def test_distances_are_never_too_short_and_seldom_longer_than_estimated(
    client: TestClient, knot: str, sources: list, effort: int
) -> None:
    exact = np.array(distances(client, knot, sources=sources).json()["distances"])
    answer = fast(client, knot, sources=sources, effort=effort).json()

    ours, estimate = np.array(answer["distances"]), answer["error_bound"]["value"]
    assert (ours >= exact * (1 - ROUNDING)).all()
    assert np.mean(ours <= exact * (1 + estimate) + ROUNDING) > 0.98


@pytest.mark.usefixtures("one_replica")
def test_the_usual_effort_is_2(client: TestClient, knot: str) -> None:
    bare = fast(client, knot, sources=[{"vertex": 43}])
    spelt = fast(client, knot, sources=[{"vertex": 43}], effort=2)

    assert spelt.headers["server-timing"] == "kept"
    assert spelt.headers["etag"] == bare.headers["etag"]


def test_each_effort_has_a_result_of_its_own(client: TestClient, knot: str) -> None:
    one = {"sources": [{"vertex": 42, "start_distance": 0.375}]}
    rough = one | {"method": "approximate"}
    bodies = [one, rough, *(one | {"method": "fast", "effort": effort} for effort in EFFORTS)]
    first = [distances(client, knot, **body) for body in bodies]
    again = [distances(client, knot, **body) for body in bodies]

    assert len({response.headers["etag"] for response in first}) == len(bodies)
    for fresh, kept in zip(first, again, strict=True):
        assert "compute" in fresh.headers["server-timing"]
        assert kept.headers["server-timing"] == "kept"
        assert kept.content == fresh.content


def test_targets_only(client: TestClient, knot: str) -> None:
    mesh, point = stored_mesh(client, knot), gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))
    field = gc.fast_distance(mesh, 3, targets=[point])

    answer = fast(client, knot, sources=[{"vertex": 3}], targets=[{"vertex": 700}, INSIDE]).json()

    assert answer["distances"] == [field.distances[700], field.distance_at(point)]


def test_barriers_are_in_the_way(client: TestClient, knot: str) -> None:
    walled = stored_mesh(client, knot).with_barriers(range(100, 160))

    answer = fast(client, knot, sources=[{"vertex": 3}], barriers=list(range(100, 160))).json()

    np.testing.assert_array_equal(answer["distances"], gc.fast_distance(walled, 3).distances)


def test_max_distance_bounds_what_is_reached(client: TestClient, knot: str) -> None:
    whole = np.array(fast(client, knot, sources=SOURCES).json()["distances"])

    answer = fast(client, knot, sources=SOURCES, max_distance=2.0).json()

    ours = np.array(answer["distances"], float)  # null becomes NaN
    np.testing.assert_array_equal(ours, np.where(whole <= 2.0, whole, np.nan))
    missed = np.count_nonzero(whole > 2.0)
    assert 0 < missed < len(whole)
    assert answer["unreachable"] == {"disconnected": 0, "beyond_max_distance": missed}


@pytest.mark.parametrize("name", ["npy", "octets"])
def test_headers_of_binary_distances(client: TestClient, knot: str, name: str) -> None:
    body = {"sources": [{"vertex": 3}], "method": "fast", "effort": 1}
    link = f"/v1/meshes/{knot}/distances"
    answer = client.post(link, json=body).json()

    response = client.post(link, params={"format": name}, json=body)

    headers = response.headers
    assert headers["geodesic-method"] == "fast"
    assert json.loads(headers["geodesic-error-bound"]) == answer["error_bound"]
    values = np.frombuffer(response.content[-8 * len(answer["distances"]) :], "<f8")
    np.testing.assert_array_equal(values, answer["distances"])


# Paths


@pytest.mark.parametrize("effort", EFFORTS)
def test_a_path_is_no_longer_than_its_distance(client: TestClient, knot: str, effort: int) -> None:
    exact = ask(client, knot, "path", **ENDS, method="exact").json()["length"]
    field = fast(client, knot, sources=[ENDS["source"]], effort=effort).json()
    expected = gc.fast_distance(stored_mesh(client, knot), 3, effort).path_to(700)

    answer = ask(client, knot, "path", **ENDS, effort=effort).json()

    assert (answer["status"], answer["method"]) == ("ok", "fast")
    assert answer["length"] == expected.length
    np.testing.assert_array_equal(answer["points"], expected.points)
    assert exact * (1 - ROUNDING) <= answer["length"]
    assert answer["length"] <= field["distances"][700] * (1 + ROUNDING)
    assert answer["error_bound"] == field["error_bound"]


def test_paths_to_many_are_those_to_each(client: TestClient, knot: str) -> None:
    ends = {"source": INSIDE, "targets": [{"vertex": 700}, {"vertex": 20}]}

    (far, near) = ask(client, knot, "paths", **ends, effort=1).json()["paths"]

    for path, target in ((far, {"vertex": 700}), (near, {"vertex": 20})):
        one = ask(client, knot, "path", source=INSIDE, target=target, effort=1).json()
        assert (path["length"], path["points"]) == (one["length"], one["points"])
        assert path["error_bound"] == one["error_bound"]


def test_get_answers_as_post_and_is_cached(client: TestClient, knot: str) -> None:
    link = f"/v1/meshes/{knot}/path?from=v3&to=v700"

    got = client.get(f"{link}&method=fast")

    assert got.json() == ask(client, knot, "path", **ENDS, effort=2).json()
    same = client.get(f"{link}&method=fast", headers={"If-None-Match": got.headers["etag"]})
    assert same.status_code == 304
    for other in ("", "&method=approximate"):
        response = client.get(link + other, headers={"If-None-Match": got.headers["etag"]})
        assert response.status_code == 200
        assert response.headers["etag"] != got.headers["etag"]


def test_that_a_path_is_too_long_is_estimated_as_well(client: TestClient, knot: str) -> None:
    beyond = ask(client, knot, "path", **ENDS, max_distance=0.5).json()
    some = ask(client, knot, "paths", source=ENDS["source"], targets=[ENDS["target"]])

    assert (beyond["status"], beyond["reason"]) == ("no_path", "beyond_max_distance")
    assert beyond["error_bound"] == some.json()["paths"][0]["error_bound"]
    assert beyond["error_bound"]["kind"] == "estimated"
    several = ask(client, knot, "paths", **ENDS_OF_PATHS, max_distance=0.5).json()["paths"]
    assert several[0]["error_bound"] == beyond["error_bound"]


ENDS_OF_PATHS = {"source": ENDS["source"], "targets": [ENDS["target"]]}


def test_no_path_between_components_is_certain(client: TestClient, apart: str) -> None:
    answer = client.get(f"/v1/meshes/{apart}/path?from=v0&to=v4&method=fast").json()

    assert (answer["status"], answer["reason"]) == ("no_path", "disconnected")
    assert answer["error_bound"] == {"type": "relative", "value": 0, "kind": "guaranteed"}


# Jobs


def test_a_job_has_the_same_answer(client: TestClient, knot: str) -> None:
    body = {"sources": [{"vertex": 71}], "method": "fast", "effort": 1}
    job = client.post(
        f"/v1/meshes/{knot}/distances", json=body, headers={"Prefer": "respond-async", **NPY}
    ).json()
    client.get(f"/v1/jobs/{job['id']}/events")  # until it has finished

    found = np.load(BytesIO(client.get(f"/v1/jobs/{job['id']}/results").content))

    np.testing.assert_array_equal(
        found, gc.fast_distance(stored_mesh(client, knot), 71, 1).distances
    )


# Refusals


@pytest.mark.parametrize(
    ("body", "names"),
    [
        *(({"method": "fast", "effort": value}, ["effort"]) for value in (0, 3, -1, 2.5, 16)),
        *(({"method": "fast", "effort": value}, ["effort"]) for value in (True, "much", [2], {})),
        ({"effort": 2}, ["effort"]),
        ({"method": "exact", "effort": 2}, ["effort"]),
        ({"method": "approximate", "effort": 2}, ["effort"]),
        ({"method": "fast", "relative_error": 0.1}, ["relative_error"]),
        (
            {"method": "fast", "effort": 1, "relative_error": 0.1, "absolute_error": 1},
            ["relative_error", "absolute_error"],
        ),
        ({"method": "Fast"}, ["method"]),
    ],
)
def test_refused_efforts(client: TestClient, knot: str, body: dict, names: list[str]) -> None:
    for operation, ends in (
        ("distances", {"sources": SOURCES}),
        ("path", ENDS),
        ("paths", ENDS_OF_PATHS),
    ):
        response = client.post(f"/v1/meshes/{knot}/{operation}", json=ends | body)
        problem = check_problem(response, 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == [f"/{name}" for name in names]


def test_an_effort_is_refused_with_a_reason(client: TestClient, knot: str) -> None:
    problem = distances(client, knot, sources=SOURCES, effort=2).json()

    assert "method 'fast' only" in problem["detail"]


def test_waypoints_are_of_exact_paths(client: TestClient, knot: str) -> None:
    response = ask(client, knot, "path", **ENDS, waypoints=[{"vertex": 9}])
    problem = check_problem(response, 422, "invalid_request")

    assert [fault["pointer"] for fault in problem["errors"]] == ["/waypoints"]
    assert "method 'exact' only" in problem["detail"]


def test_isolines_name_the_methods_that_they_have(client: TestClient, knot: str) -> None:
    response = ask(client, knot, "isolines", sources=SOURCES, count=3)

    problem = check_problem(response, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/method"]
    assert "'exact' or 'approximate'" in problem["detail"]

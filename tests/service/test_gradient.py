"""The gradient beside distances: the library's, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import NPY, check_problem, distances, serving, stored_mesh, upload_sample


def rows(gradient: list) -> np.ndarray:
    return np.array(gradient, float)  # None becomes NaN


@pytest.mark.parametrize("method", [{}, {"method": "approximate", "relative_error": 0.05}])
def test_it_is_the_library_s(client: TestClient, method: dict) -> None:
    knot = upload_sample(client, "knot", 3000)
    mesh = stored_mesh(client, knot)
    if method:
        field = gc.approximate_distance(mesh, [3, 9], 0.05)
    else:
        field = gc.exact_distance(mesh, [3, 9])

    answer = distances(
        client,
        knot,
        sources=[{"vertex": 3}, {"vertex": 9}],
        include=["gradient", "nearest_source", "gradient"],
        **method,
    ).json()

    np.testing.assert_array_equal(rows(answer["gradient"]), field.gradient)
    assert answer["gradient"][3] == answer["gradient"][9] == [None] * 3
    assert answer["nearest_source"] == field.nearest_source.tolist()
    assert "gradient" not in distances(client, knot, **method).json()


def test_there_is_none_where_nothing_is_reached(client: TestClient, apart: str) -> None:
    gradient = distances(client, apart, include=["gradient"]).json()["gradient"]

    np.testing.assert_allclose(rows(gradient[1:3]), [[1, 0, 0], [0, 1, 0]])
    assert [gradient[0], *gradient[3:]] == [[None] * 3] * 4


def test_it_ends_at_barriers(client: TestClient, plane: str) -> None:
    wall = list(range(100, 120))
    field = gc.exact_distance(stored_mesh(client, plane), 0, barriers=wall)

    answer = distances(client, plane, barriers=wall, include=["gradient"]).json()

    np.testing.assert_array_equal(rows(answer["gradient"]), field.gradient)


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"targets": [{"vertex": 1}]}, "/include"),
        ({"include": ["curl"]}, "/include/0"),
        ({"include": "gradient"}, "/include"),
    ],
)
def test_refused(client: TestClient, plane: str, change: dict, place: str) -> None:
    refused = distances(client, plane, **{"include": ["gradient"]} | change)
    problem = check_problem(refused, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == [place]


def test_it_comes_with_json_only(client: TestClient, plane: str) -> None:
    refused = distances(client, plane, NPY, include=["nearest_source", "gradient"])
    problem = check_problem(refused, 422, "invalid_request")
    assert [fault["message"].split()[0] for fault in problem["errors"]] == [
        "nearest_source",
        "gradient",
    ]


def test_its_values_count(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=4 * 121) as client:
        mesh_id = upload_sample(client, "plane", 200)

        assert distances(client, mesh_id, include=["gradient"]).status_code == 200
        both = distances(client, mesh_id, include=["gradient", "nearest_source"])
        assert check_problem(both, 413, "result_too_large")["actual"] == 5 * 121

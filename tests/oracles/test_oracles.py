"""The oracles against closed forms, and against one another where they are at home together."""

import math

import numpy as np
import pytest

from tests import zoo
from tests.oracles import closed_forms, graph, unfolding, visibility

FLAT = ("strip", "flat_grid", "annulus", "obstacles", "comb", "pinched_holes")
SOLVABLE = (
    "needle_fan",
    "crowded_lines",
    "prism_long",
    "prism_slivers",
    "brick_grid",
)


@pytest.mark.parametrize("name", closed_forms.REGULAR)
def test_unfolding_solves_the_regular_solids(name):
    matrix = unfolding.distance_matrix(zoo.SMALL[name].vertices, zoo.SMALL[name].faces)
    for row in matrix:
        np.testing.assert_allclose(np.sort(row), closed_forms.REGULAR[name], rtol=1e-14)


@pytest.mark.parametrize("name", FLAT)
def test_unfolding_and_visibility_agree_on_planar_domains(name):
    case = zoo.SMALL[name]
    np.testing.assert_allclose(
        unfolding.distance_matrix(case.vertices, case.faces),
        visibility.distance_matrix(case.vertices[:, :2], case.faces),
        rtol=1e-13,
    )


@pytest.mark.parametrize("name", SOLVABLE)
def test_unfolding_reproduces_the_closed_forms(name):
    case = zoo.KNOWN[name]
    matrix = unfolding.distance_matrix(case.vertices, case.faces)
    for source in range(0, len(case.vertices), 10):
        np.testing.assert_allclose(matrix[source], case.distances(source), rtol=1e-10)


@pytest.mark.parametrize(
    "arguments",
    [
        {"sides": 7, "tilt": 0.9},
        {"sides": 6, "tilt": 0.0},
        {"sides": 8, "tilt": 0.9, "zigzag": True},
        {"sides": 6, "tilt": 0.4, "zigzag": True},
    ],
)
def test_unfolding_solves_cones_of_every_angle(arguments):
    vertices, faces, polar, total = zoo.cone(**arguments, splits=1)
    matrix = unfolding.distance_matrix(vertices, faces)
    for source, row in enumerate(matrix):
        np.testing.assert_allclose(row, closed_forms.cone(polar, source, total), rtol=1e-13)


def test_box_distances_of_the_text_books():
    assert closed_forms.box((1, 1, 1), (0, 0, 0), (1, 1, 1)) == pytest.approx(math.sqrt(5))
    # Dudeney's spider and fly: 40 feet over five of the room's faces, not 42.
    spider, fly = (0, 6, 1), (30, 6, 11)
    assert closed_forms.box((30, 12, 12), spider, fly) == pytest.approx(40)


def test_box_agrees_with_unfolding():
    vertices, faces = zoo.box_grid((1, 2, 3))
    matrix = unfolding.distance_matrix(vertices, faces)
    for source in range(0, len(vertices), 3):
        row = [closed_forms.box((1, 2, 3), vertices[source], end) for end in vertices]
        np.testing.assert_allclose(matrix[source], row, rtol=1e-13)


def test_unfolding_walks_through_every_sheet_of_a_non_manifold_edge():
    book = zoo.IRREGULAR["three_faces_at_an_edge"]
    matrix = unfolding.distance_matrix(book.vertices, book.faces)
    # Any two pages open flat, and the straight line crosses the spine.
    assert matrix[2, 3] == pytest.approx(math.hypot(2, 0.3))
    assert matrix[3, 4] == pytest.approx(math.hypot(2, 0.3))
    assert matrix[2, 4] == pytest.approx(math.hypot(2, 0.6))


@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_unfolding_is_a_metric_between_its_bounds(case):
    matrix = unfolding.distance_matrix(case.vertices, case.faces)
    euclid = np.linalg.norm(case.vertices[:, None] - case.vertices[None], axis=2)
    assert (matrix == matrix.T).all()
    assert (matrix >= euclid * (1 - 1e-13)).all()
    for source in range(0, len(matrix), 5):
        bound = graph.edge_distances(case.vertices, case.faces, source)
        assert (matrix[source] <= bound * (1 + 1e-13)).all()
        np.testing.assert_array_equal(np.isfinite(bound), np.isfinite(matrix[source]))

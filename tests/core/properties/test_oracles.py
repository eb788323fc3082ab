"""The oracles against closed forms, and against one another where they are at home together."""

import math

import numpy as np
import pytest

from tests.support import zoo
from tests.support.oracles import closed_forms, graph, unfolding, visibility

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


@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.parametrize("name", FLAT)
def test_unfolding_and_visibility_agree_on_planar_domains(name):
    case = zoo.SMALL[name]
    np.testing.assert_allclose(
        unfolding.distance_matrix(case.vertices, case.faces),
        visibility.distance_matrix(case.vertices[:, :2], case.faces),
        rtol=1e-13,
    )


@pytest.mark.slow
@pytest.mark.slice(1)
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


@pytest.mark.slow
def test_box_agrees_with_unfolding():
    vertices, faces = zoo.box_grid((1, 2, 3))
    matrix = unfolding.distance_matrix(vertices, faces)
    for source in range(0, len(vertices), 3):
        row = closed_forms.box((1, 2, 3), vertices[source], vertices)
        np.testing.assert_allclose(matrix[source], row, rtol=1e-13)


def test_unfolding_walks_through_every_sheet_of_a_non_manifold_edge():
    book = zoo.IRREGULAR["three_faces_at_an_edge"]
    matrix = unfolding.distance_matrix(book.vertices, book.faces)
    # Any two pages open flat, and the straight line crosses the spine.
    assert matrix[2, 3] == pytest.approx(math.hypot(2, 0.3))
    assert matrix[3, 4] == pytest.approx(math.hypot(2, 0.3))
    assert matrix[2, 4] == pytest.approx(math.hypot(2, 0.6))


LINE = [(x, 0, 0) for x in (3, 5, 7, 6, 2, 0)] + [(3, 2, 0), (5, 2, 0)]
"""Some points of a line, and two beside it."""


@pytest.mark.parametrize(
    ("faces", "start", "end", "expected"),
    [
        ([(4, 3, 0), (4, 3, 1)], 0, 1, 2.0),
        ([(4, 3, 0), (4, 3, 1)], 0, 2, math.inf),
        ([(5, 1, 0), (1, 2, 3), (5, 0, 4)], 4, 2, 5.0),
        # A triangle whose edge is cut, one beyond, and one between the ends of the cut
        ([(4, 3, 6), (4, 3, 0)], 0, 6, 2.0),
        ([(4, 3, 6), (4, 3, 0), (0, 3, 7)], 7, 6, math.sqrt(20)),
        ([(4, 3, 6), (4, 3, 1), (1, 6, 5)], 5, 4, math.sqrt(13) + math.sqrt(5)),
    ],
)
def test_unfolding_glues_faces_of_no_area_shut(faces, start, end, expected):
    assert unfolding.distance_matrix(LINE, faces)[start, end] == pytest.approx(expected)


@pytest.mark.slow
def test_unfolding_says_where_it_does_not_know():
    tip = [(0, 0, 0), (1, 0, 0), (1, 1e-7, 0), (1, 0, 1e-7)]
    with pytest.raises(unfolding.UnknownError):
        unfolding.distance_matrix(tip, [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
    sheets = [(a, b, c) for a in range(6) for b in range(a) for c in range(b)]
    with pytest.raises(unfolding.UnknownError):
        unfolding.distance_matrix(LINE, sheets)


@pytest.mark.slice(3)
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

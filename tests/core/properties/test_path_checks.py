"""Refusals of wrong paths by their check: one thing of a right path is changed at a time."""

from dataclasses import replace

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.path_checks import check_path

SOURCE, TARGET = 0, 45
EDGE = 3
"""Of the points of the path, one that lies on an edge."""


@pytest.fixture(scope="module")
def path() -> gc.GeodesicPath:
    case = zoo.SMALL["crags"]
    return gc.exact_distance(gc.TriangleMesh(case.vertices, case.faces), SOURCE).path_to(TARGET)


def check(path, length=None):
    check_path(path.mesh, path, SOURCE, TARGET, path.length if length is None else length)


def changed(array, k, value):
    array = array.copy()
    array[k] = value
    return array


def test_the_path_itself_is_right(path):
    assert len(path.points) > 3
    check(path)


def test_another_length_is_refused(path):
    with pytest.raises(AssertionError):
        check(path, path.length * (1 + 1e-9))
    with pytest.raises(AssertionError):
        check(replace(path, length=path.length * (1 + 1e-9)), path.length)


def moved(path, k):
    """The path with a point that its location does not give."""
    points = changed(path.points, k, path.points[k] + 1e-12)
    return replace(path, located=path.located._replace(points=points))


@pytest.mark.parametrize("k", [0, -1])
def test_another_end_is_refused(path, k):
    with pytest.raises(AssertionError):
        check(moved(path, k))


def test_another_point_is_refused(path):
    with pytest.raises(AssertionError, match="weights give the point"):
        check(moved(path, EDGE))


@pytest.mark.parametrize(
    ("weights", "claim"),
    [
        ([0.5, 0.5, 1e-14], "the sum of weights is 1"),
        ([1.1, -0.1, 0.0], "weights are not negative"),
        ([0.5, 0.25, 0.25], "weights give the point"),
        ([np.nan] * 3, "weights are not negative"),
    ],
)
def test_other_weights_are_refused(path, weights, claim):
    other = changed(path.located.weights, EDGE, weights)
    with pytest.raises(AssertionError, match=claim):
        check(replace(path, located=path.located._replace(weights=other)))


def test_the_higher_face_at_an_edge_is_refused(path):
    mesh, located = path.mesh, path.located
    face, weights = located.faces[EDGE], located.weights[EDGE]
    edge = mesh.faces[face][weights > 0]
    (other,) = set(np.flatnonzero(np.isin(mesh.faces, edge).sum(axis=1) == 2)) - {face}
    there = [weights[mesh.faces[face] == v].sum() for v in mesh.faces[other]]
    with pytest.raises(AssertionError, match="the lowest that holds the point"):
        check(
            replace(
                path,
                located=located._replace(
                    faces=changed(located.faces, EDGE, other),
                    weights=changed(located.weights, EDGE, there),
                ),
            )
        )


def test_a_piece_outside_of_its_face_is_refused(path):
    with pytest.raises(AssertionError, match=r"pieces \[1\] leave their faces"):
        check(replace(path, faces=changed(path.faces, 1, path.faces[-1])))


def test_a_blocked_face_is_refused(path):
    with pytest.raises(AssertionError, match="no piece crosses a blocked face"):
        check(replace(path, mesh=path.mesh.with_barriers([int(path.faces[2])])))

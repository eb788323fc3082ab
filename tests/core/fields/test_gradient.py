"""The gradient at vertices: whence shortest paths come, turned round."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points
from tests.support.oracles.graph import edge_lengths

DIRECTION = 1e-5
"""Radians: a path may be led through a vertex that lies 1e-12 of its length beside it."""


GENERIC = ("hills", "crags", "crags_with_holes", "crumpled_sphere", "crumpled_torus")
# On a face that is there twice, a position does not tell which of the two is meant.
ONE_SHEET = {name: case for name, case in zoo.IRREGULAR.items() if name != "face_twice"}


@pytest.mark.slice(6)
@zoo.each(zoo.SMALL | ONE_SHEET)
def test_distance_falls_by_as_much_as_one_walks_against_it(case):
    mesh = mesh_of(case)
    step = 1e-3 * min(edge_lengths(mesh.vertices, mesh.faces).values())
    for source in random_points(mesh, 3, seed=31):
        field = gc.exact_distance(mesh, source, retain="windows")
        gradient = field.gradient
        for v, distance in enumerate(field.distances[: 20 if WITHOUT_JIT else None].tolist()):
            if np.isinf(distance) or distance == 0.0:
                assert np.isnan(gradient[v]).all()
            elif distance > step:
                back = mesh.locate(mesh.vertices[v] - step * gradient[v], 1e-9 * step)
                assert distance - field.distance_at(back) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("approximate", [False, True])
@zoo.each({name: zoo.SMALL[name] for name in GENERIC})
@pytest.mark.jit
def test_it_is_the_direction_of_the_last_piece_of_the_path(case, approximate):
    """On meshes on which no two ways are as long."""
    mesh = mesh_of(case)
    for source in random_points(mesh, 3, seed=32):
        if approximate:
            field = gc.approximate_distance(mesh, source, 0.05)
        else:
            field = gc.exact_distance(mesh, source)
        for v in np.flatnonzero(field.distances > 0.0).tolist():
            last = np.diff(field.path_to(v).points[-2:], axis=0)[0]
            last /= np.linalg.norm(last)
            np.testing.assert_allclose(field.gradient[v], last, atol=DIRECTION)


@pytest.mark.parametrize("seed", range(3))
def test_it_points_away_from_a_source_in_the_plane(seed):
    points, faces = zoo.grid(7, 5, seed=seed, jitter=0.2)
    turn = zoo.rotation(seed)
    mesh = gc.TriangleMesh(points @ turn.T, faces)
    for source in random_points(mesh, 6, seed=seed):
        gradient = gc.exact_distance(mesh, source).gradient
        away = mesh.vertices - mesh.position(source)
        length = np.linalg.norm(away, axis=1, keepdims=True)
        is_source = length[:, 0] < 1e-9
        assert np.isnan(gradient[is_source]).all()
        expected = (away / np.where(length > 0, length, 1))[~is_source]
        np.testing.assert_allclose(gradient[~is_source], expected, atol=1e-9)


def test_it_is_nan_at_sources_and_where_nothing_is_reached():
    points, faces = zoo.grid(4, 1)
    mesh = gc.TriangleMesh(
        np.vstack([points, points + np.array([0, 0, 9])]), np.vstack([faces, faces + len(points)])
    )
    field = gc.exact_distance(mesh, [0, gc.Source(4, 9.0)], max_distance=2.5)
    expected = np.isinf(field.distances)
    expected[0] = True
    np.testing.assert_array_equal(np.isnan(field.gradient).any(axis=1), expected)
    # A source that another one is nearer to is a vertex as others.
    field = gc.exact_distance(mesh, [0, gc.Source(4, 9.0)])
    np.testing.assert_allclose(field.gradient[4], [1, 0, 0], atol=1e-12)


def test_it_is_that_of_the_path_where_the_face_has_no_area():
    """The middle of an edge is the third corner of such a face, through which it is reached."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0]]
    mesh = gc.TriangleMesh(points, [[0, 2, 3], [0, 1, 2], [0, 4, 1], [4, 2, 1]])
    gradient = gc.exact_distance(mesh, 3).gradient
    np.testing.assert_allclose(gradient[1], [0, -1, 0], atol=1e-12)


def test_it_is_nan_where_a_curve_starts_beyond_the_limit():
    mesh = gc.samples.knot(500)
    curve = gc.Curve(mesh.faces[100].tolist())
    field = gc.exact_distance(mesh, [0, gc.Source(curve, 0.5)], max_distance=0.4)
    assert np.isinf(field.distances[mesh.faces[100]]).all()
    assert np.isnan(field.gradient[mesh.faces[100]]).all()


def test_it_does_not_change():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    field = gc.exact_distance(mesh, 0)
    assert field.gradient is field.gradient


def test_a_vertex_at_the_place_of_the_source_has_none():
    """A corner of a face of no area lies on its opposite edge, where the source is."""
    corners = [[0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0]]
    mesh = gc.TriangleMesh(corners, [[0, 1, 2], [0, 1, 3]])
    for start in (0.0, 0.5):
        source = gc.Source(gc.SurfacePoint(0, (0.5, 0.5, 0)), start)
        gradient = gc.exact_distance(mesh, source).gradient
        assert np.isnan(gradient[2]).all()
        expected = [[-1, 0, 0], [1, 0, 0], [0, 1, 0]]
        np.testing.assert_allclose(gradient[[0, 1, 3]], expected, atol=1e-15)

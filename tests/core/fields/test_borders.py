"""Borders of territories: equally near to two sources, whole, and joined where three meet."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument
from geodesic_core.kernels.borders.bisectors import is_one_sided
from geodesic_core.kernels.curves.regions import put_disc, put_side
from geodesic_core.kernels.retained.reached import REGION, put_origin
from geodesic_core.tolerances import PARALLEL
from tests.support import zoo
from tests.support.border_checks import (
    check_chords,
    check_crossings,
    check_ends,
    check_points,
)
from tests.support.isoline_checks import check_pieces, distances_from
from tests.support.meshes import mesh_of, random_points

FINE = 1e-6
"""Chord error of what is compared with a closed form."""


def square(seed=0, size=8):
    """A square of the plane, turned, with vertices off the grid; and its sides' directions."""
    points, faces = zoo.grid(size, size, seed=seed, jitter=0.2)
    turn = zoo.rotation(seed)
    return gc.TriangleMesh(points @ turn.T, faces), turn


def place(mesh, turn, x, y):
    return mesh.locate(turn @ np.array([x, y, 0.0]))


def check_all(mesh, sources, field, borders):
    for line in borders:
        check_pieces(mesh, line)
    check_ends(mesh, borders)
    check_crossings(mesh, field, borders)
    check_points(mesh, sources, borders)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("start", [0.0, 0.7, -1.1])
def test_two_points_of_the_plane(seed, start):
    """Their border is the perpendicular bisector, or a branch of a hyperbola."""
    mesh, turn = square(seed)
    (ax, ay), (bx, by) = (2.3, 3.1), (5.2, 4.4)
    a, b = place(mesh, turn, ax, ay), place(mesh, turn, bx, by)
    sources = [gc.Source(a, max(-start, 0.0)), gc.Source(b, max(start, 0.0))]
    (line,) = gc.exact_distance(mesh, sources).borders(FINE)
    assert line.sources == (0, 1)
    assert not line.closed
    flat = (line.points @ turn)[:, :2]
    away = np.linalg.norm(flat - (ax, ay), axis=1) - np.linalg.norm(flat - (bx, by), axis=1)
    np.testing.assert_allclose(away, start, rtol=0, atol=1e-9)
    for point in flat[[0, -1]]:  # at the boundary
        assert min(*point, *(8.0 - point)) < 1e-9
    middles = 0.5 * (flat[1:] + flat[:-1])
    away = np.linalg.norm(middles - (ax, ay), axis=1) - np.linalg.norm(middles - (bx, by), axis=1)
    assert np.abs(away - start).max() <= 2.0 * FINE
    check_crossings(mesh, gc.exact_distance(mesh, sources), [line])


@pytest.mark.jit
@pytest.mark.parametrize("seed", range(3))
def test_three_points_of_the_plane_meet_in_the_centre_of_their_circle(seed):
    mesh, turn = square(seed)
    corners = np.array([(2.1, 2.3), (6.2, 2.9), (3.7, 6.1)])
    borders = gc.exact_distance(mesh, [place(mesh, turn, *c) for c in corners]).borders()
    assert sorted(line.sources for line in borders) == [(0, 1), (0, 2), (1, 2)]
    system = 2.0 * (corners[1:] - corners[0])
    squares = (corners**2).sum(axis=1)
    centre = np.linalg.solve(system, squares[1:] - squares[0])
    for line in borders:
        flat = (line.points @ turn)[:, :2]
        assert min(np.linalg.norm(flat[[0, -1]] - centre, axis=1)) < 1e-9
    check_ends(mesh, borders)


@pytest.mark.jit
def test_a_point_and_a_curve():
    """A parabola, and arcs of hyperbolas around the ends of the curve."""
    mesh, turn = square(4)
    a, b, point = np.array([2.0, 2.0]), np.array([6.0, 2.5]), np.array([4.4, 5.3])
    curve = gc.Curve([place(mesh, turn, *a), place(mesh, turn, *b)])
    # A curve needs points that share faces: it is laid along a shortest path.
    path = gc.shortest_path(mesh, curve.points[0], curve.points[1])
    sources = [gc.Curve(list(path.locations)), place(mesh, turn, *point)]
    (line,) = gc.exact_distance(mesh, sources).borders(FINE)
    flat = (line.points @ turn)[:, :2]
    share = np.clip((flat - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    from_curve = np.linalg.norm(flat - (a + share[:, None] * (b - a)), axis=1)
    np.testing.assert_allclose(from_curve, np.linalg.norm(flat - point, axis=1), rtol=1e-8)
    check_crossings(mesh, gc.exact_distance(mesh, sources), [line])


def test_two_curves():
    """Between parallel curves the border is a straight line."""
    points, faces = zoo.grid(6, 4)
    mesh = gc.TriangleMesh(points @ zoo.rotation(3).T, faces)
    columns = [[int(v) for v in np.flatnonzero(points[:, 0] == x)] for x in (0.0, 5.0)]
    (line,) = gc.exact_distance(mesh, [gc.Curve(column) for column in columns]).borders()
    flat = line.points @ zoo.rotation(3)
    np.testing.assert_allclose(flat[:, 0], 2.5, atol=1e-9)
    assert line.length == pytest.approx(4.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.slice(3)
@pytest.mark.jit
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_all_borders_are_found(case, seed):
    mesh = mesh_of(case)
    points = random_points(mesh, 5, seed=51 + seed)[1:]
    sources = [gc.Source(point, 0.03 * i * mesh.diagonal * seed) for i, point in enumerate(points)]
    field = gc.exact_distance(mesh, sources)
    check_all(mesh, sources, field, field.borders())


@pytest.mark.slice(2)
@pytest.mark.jit
@zoo.each(zoo.SMALL)
def test_what_is_retained_and_the_method_change_no_border(case):
    mesh = mesh_of(case)
    sources = random_points(mesh, 3, seed=52)
    expected = gc.exact_distance(mesh, sources).borders()
    for field in (
        gc.exact_distance(mesh, sources, retain="windows"),
        gc.approximate_distance(mesh, sources, 0.02),
        gc.fast_distance(mesh, sources),
    ):
        found = field.borders()
        assert sum(line.length for line in found) == pytest.approx(
            sum(line.length for line in expected), rel=1e-9
        )
        assert sorted(line.sources for line in found) == sorted(line.sources for line in expected)


@pytest.mark.jit
def test_chord_error_is_how_far_chords_stray():
    mesh = mesh_of(zoo.SMALL["hills"])
    sources = random_points(mesh, 4, seed=53)
    lengths = []
    for chord_error in (0.05, 1e-6):
        borders = gc.exact_distance(mesh, sources).borders(chord_error * mesh.diagonal)
        check_chords(mesh, sources, borders, chord_error * mesh.diagonal)
        lengths.append(sum(len(line.points) for line in borders))
    assert lengths[0] < lengths[1]


@pytest.mark.parametrize("turn", [0, 5, 6])
def test_ties_along_edges_and_through_vertices(turn):
    """On a grid, borders along edges, diagonals and through vertices are one line each."""
    points, faces = zoo.grid(4, 4)
    mesh = gc.TriangleMesh(points @ zoo.rotation(turn).T, faces)
    at = {tuple(point[:2]): i for i, point in enumerate(points.tolist())}
    for first, second, length in (
        ((0, 2), (4, 2), 4.0),
        ((2, 0), (2, 4), 4.0),
        ((0, 0), (4, 4), 4.0 * math.sqrt(2.0)),
        ((4, 0), (0, 4), 4.0 * math.sqrt(2.0)),
        ((1, 2), (2, 2), 4.0),
    ):
        borders = gc.exact_distance(mesh, [at[first], at[second]]).borders()
        assert sum(line.length for line in borders) == pytest.approx(length, abs=1e-7)
        (line,) = borders
        assert not line.closed
    four = [at[corner] for corner in ((0, 0), (4, 0), (0, 4), (4, 4))]
    borders = gc.exact_distance(mesh, four).borders()
    assert sum(line.length for line in borders) == pytest.approx(8.0, abs=1e-7)


@pytest.mark.parametrize("size", [1.0, 3.0, 10.0])
def test_borders_where_each_vertex_is_a_source(size):
    """No vertex is at a distance, and the four territories meet in a point of the diagonal."""
    square = [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]
    mesh = gc.TriangleMesh(np.array(square) * size, [[3, 1, 0], [3, 0, 2]])
    field = gc.exact_distance(mesh, [0, 1, 2, 3])
    borders = field.borders()
    assert sorted(line.sources for line in borders) == [(0, 1), (0, 2), (1, 3), (2, 3)]
    assert [line.length for line in borders] == pytest.approx([0.5 * size] * 4, rel=1e-12)
    assert field.cells().areas == pytest.approx([0.25 * size**2] * 4, rel=1e-12)


def test_a_tie_behind_a_corner_has_a_border_around_it():
    """What is equally near to two sources, by one saddle vertex, belongs to the lower one."""
    points, faces = zoo.grid(4, 4)
    faces = zoo.without_cells(faces, 4, [(x, y) for x in (2, 3) for y in (2, 3)])
    points, faces = zoo.drop_unused(points, faces)
    mesh = gc.TriangleMesh(points, faces)
    at = {tuple(point[:2]): i for i, point in enumerate(points.tolist())}
    # The second source is as far from the corner (2, 2) as the first, and sees less behind it.
    sources = [at[4, 1], gc.Source(at[3, 0])]
    field = gc.exact_distance(mesh, sources)
    assert math.dist((4, 1), (2, 2)) == pytest.approx(math.dist((3, 0), (2, 2)))
    borders = field.borders()
    check_ends(mesh, borders)
    check_points(mesh, sources, borders)


def test_around_a_source_inside_a_face():
    """A territory without a vertex has a closed border."""
    mesh = gc.samples.plane(2)
    inside = gc.SurfacePoint.face(0, (0.5, 0.25, 0.25))
    sources = [gc.Source(inside, 0.2), 0, 1, 2, 3]
    field = gc.exact_distance(mesh, sources)
    borders = field.borders()
    assert any(0 in line.sources for line in borders)
    check_ends(mesh, borders)
    check_points(mesh, sources, borders)


def test_barriers_and_components():
    points, faces = zoo.grid(6, 6)
    mesh = gc.TriangleMesh(points, faces)
    middle = [i for i, f in enumerate(faces) if (np.abs(points[f].mean(axis=0)[:2] - 3) < 1).all()]
    blocked = gc.TriangleMesh(points, np.delete(faces, middle, axis=0))
    sources = [0, 6]
    borders = gc.exact_distance(mesh, sources, barriers=middle).borders()
    check_ends(blocked, borders)
    check_points(mesh.with_barriers(middle), sources, borders)
    assert len(borders) == 2  # below the hole, and above it
    apart = mesh_of(zoo.SMALL["two_components"])
    last = int(apart.faces[np.flatnonzero(apart.components[apart.faces[:, 0]] != 0)[0], 0])
    assert gc.exact_distance(apart, [0, last]).borders() == []
    assert gc.exact_distance(apart, [0]).borders() == []


def test_borders_end_at_the_limit():
    mesh, turn = square(1)
    a, b = place(mesh, turn, 2.5, 4.0), place(mesh, turn, 5.5, 4.0)
    (line,) = gc.exact_distance(mesh, [a, b], 2.5).borders()
    flat = (line.points @ turn)[:, :2]
    np.testing.assert_allclose(flat[:, 0], 4.0, atol=1e-9)
    np.testing.assert_allclose(np.sort(flat[[0, -1], 1]), [2.0, 6.0], atol=1e-9)
    assert gc.exact_distance(mesh, [a, b], 1.4).borders() == []


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("share", [1e-4, 1e-2])
def test_few_points_are_enough_for_a_chord_error(share):
    mesh = gc.samples.knot(2000)
    field = gc.exact_distance(mesh, [0, 300, 700])
    chord_error = share * mesh.diagonal
    fine, coarse = field.borders(1e-8), field.borders(chord_error)
    for few, many in zip(coarse, fine, strict=True):
        assert (few.sources, few.closed) == (many.sources, many.closed)
        assert distances_from(few, many.points).max() <= chord_error * (1 + 1e-9)
        assert distances_from(many, few.points).max() <= 2e-8
    points = [sum(len(line.points) for line in lines) for lines in (coarse, fine)]
    assert points[0] < 0.5 * points[1]


@pytest.mark.parametrize("chord_error", [0.0, -1.0, 1e-12, math.inf, math.nan, "1", True])
def test_chord_errors_that_are_none(chord_error):
    field = gc.exact_distance(mesh_of(zoo.SMALL["octahedron"]), [0, 1])
    with pytest.raises(InvalidArgument, match="chord_error"):
        field.borders(chord_error)


@pytest.mark.parametrize(("share", "is_told"), [(0.99, False), (1.01, True)])
def test_parallel_is_the_angle_of_rays_that_meet_in_no_corner(share, is_told):
    """Of two windows whose inner rays meet at such an angle; one is nearer by far."""
    mesh = gc.TriangleMesh(zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    windows = np.zeros((2, REGION))
    for region, x, radius, slopes in zip(
        windows, (0.3, 0.7), (9.0, 1.0), ((0.5, 0.0), (-share * PARALLEL, -0.5)),
        strict=True,
    ):  # fmt: skip
        put_disc(region, x, -1.0, radius)
        put_origin(region, 0, 0)
        for end, slope in enumerate(slopes):
            length = math.hypot(slope, 1.0)
            put_side(region, end, -1.0 / length, slope / length, 0.0)
    assert is_one_sided(mesh.topology.geometry, 0, *windows, 1e-12) == is_told

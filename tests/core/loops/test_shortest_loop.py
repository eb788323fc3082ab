"""The shortest loop through a point, against closed forms; through separating necks as well."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidMesh, NoLoop
from tests.support import glued, zoo
from tests.support.meshes import mesh_of, random_points


def check_through(loop, point):
    mesh = loop.on_mesh()
    assert loop.closed
    assert loop.locations[0] == mesh.point(point)


@pytest.mark.jit
@pytest.mark.parametrize(
    ("first", "second"),
    [((3, 0), (0, 2)), ((3, 0), (1.4, 2)), ((2, 0), (-0.9, 1.5)), ((5, 0), (2.4, 0.8))],
)
def test_flat_tori(first, second):
    """Through any point, the shortest vector of the lattice; with few faces as well."""
    for columns, rows in ((4, 4), (9, 7)):
        mesh = glued.flat_torus(columns, rows, first, second)
        expected = glued.shortest_lattice_vector(first, second)
        edge = gc.SurfacePoint.edge(3, 1, 0.3)
        for point in (0, 11, edge, gc.SurfacePoint.face(5, (0.2, 0.3, 0.5))):
            loop = gc.shortest_loop(mesh, point)
            check_through(loop, point)
            assert loop.length == pytest.approx(expected, rel=1e-12)


def test_a_neck_between_two_tori():
    """It separates them, so that no homology tells it from a point."""
    mesh, neck, girth = glued.double_torus()
    loop = gc.shortest_loop(mesh, through=neck)
    check_through(loop, neck)
    assert loop.length == pytest.approx(girth, rel=1e-12)
    assert gc.cut(mesh, loop).parts.max() == 1
    assert gc.straighten(loop).length == pytest.approx(girth, rel=1e-12)


@pytest.mark.jit
@pytest.mark.slow
def test_no_loop_through_a_vertex_of_two_tori_is_shorter():
    """Handles as well: candidates are loops of handles, and their sums with ways there and back."""
    mesh, neck, girth = glued.double_torus()
    short = [*gc.handle_loops(mesh), gc.shortest_loop(mesh, neck)]
    for vertex in np.random.default_rng(1).integers(1, len(mesh.vertices), 8).tolist():
        loop = gc.shortest_loop(mesh, vertex)
        field = gc.exact_distance(mesh, vertex)
        for other in short:
            there = min(field.distance_at(place) for place in other.locations)
            assert loop.length <= (2 * there + other.length) * (1 + 1e-12)
        assert loop.length >= girth * (1 - 1e-12)


@pytest.mark.parametrize("place", [(1, 1), (6, 1), (2, 6), (11, 10), (3, 3)])
def test_around_a_hole_in_the_plane(place):
    """As a rubber band around the hole and the point."""
    hole = (3, 4, 7, 9)
    mesh = glued.holed_square(12, hole)
    corners = np.array([(x, y) for x in hole[::2] for y in hole[1::2]] + [place], dtype=float)
    loop = gc.shortest_loop(mesh, glued.at(mesh, *place))
    assert loop.length == pytest.approx(hull_length(corners), rel=1e-12)


def hull_length(points):
    """The outline of the convex hull of points of the plane."""
    hull = [points[np.lexsort(points.T)[0]]]
    while True:
        following = next(point for point in points if (point != hull[-1]).any())
        for point in points:
            (ax, ay), (bx, by) = following - hull[-1], point - hull[-1]
            turn = ax * by - ay * bx
            if turn < 0 or (turn == 0 and math.hypot(bx, by) > math.hypot(ax, ay)):
                following = point
        if (following == hull[0]).all():
            hull = np.array(hull)
            return np.linalg.norm(hull - np.roll(hull, 1, axis=0), axis=1).sum()
        hull.append(following)


@pytest.mark.jit
@pytest.mark.slow
def test_of_two_holes_the_nearer():
    points, faces = zoo.grid(16, 8)
    x, y = points[faces].mean(axis=1)[:, :2].T
    is_in = ((x > 3) & (x < 5) | (x > 10) & (x < 13)) & (y > 3) & (y < 5)
    mesh = gc.TriangleMesh(points, faces[~is_in])
    holes = [
        np.array([(a, b) for a in xs for b in (3.0, 5.0)]) for xs in ((3.0, 5.0), (10.0, 13.0))
    ]
    for place in ((0, 0), (7, 4), (8, 4), (16, 8)):
        loop = gc.shortest_loop(mesh, glued.at(mesh, *place))
        around = [hull_length(np.vstack([hole, [place]])) for hole in holes]
        assert loop.length == pytest.approx(min(around), rel=1e-12)


@pytest.mark.jit
def test_the_tube_of_the_knot():
    knot = gc.samples.knot(3000)
    tube = gc.handle_loops(knot)[0]
    loop = gc.shortest_loop(knot, through=tube.locations[0])
    assert loop.length <= tube.length * (1 + 1e-12)
    assert gc.straighten(loop).length == pytest.approx(tube.length, rel=1e-3)


@pytest.mark.parametrize("make", [lambda: gc.samples.sphere(320), lambda: gc.samples.plane(50)])
def test_where_every_loop_shrinks(make):
    with pytest.raises(NoLoop, match="every loop"):
        gc.shortest_loop(make(), through=0)


@pytest.mark.jit
def test_barriers_are_holes():
    mesh = gc.samples.sphere(1280)
    height = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    wall = np.flatnonzero(np.abs(height) > 0.8)
    loop = gc.shortest_loop(mesh, through=mesh.locate([1, 0, 0]), barriers=wall)
    assert loop.length < 2 * math.pi
    assert gc.cut(mesh, loop).parts.max() == 1


@pytest.mark.parametrize("name", ["moebius", "bow_tie", "three_faces_at_an_edge"])
def test_no_surface_with_two_sides(name):
    mesh = mesh_of({**zoo.SMALL, **zoo.IRREGULAR}[name])
    for ask in (lambda: gc.shortest_loop(mesh, 0), lambda: gc.handle_loops(mesh)):
        with pytest.raises(InvalidMesh, match="two sides"):
            ask()


@pytest.mark.jit
@pytest.mark.slow
@zoo.each({**zoo.SMALL, **zoo.KNOWN, **zoo.IRREGULAR})
def test_nasty_meshes_have_a_loop_or_a_typed_error(case):
    mesh = mesh_of(case)
    for point in random_points(mesh, 2, seed=5):
        try:
            loop = gc.shortest_loop(mesh, point)
            handles = gc.handle_loops(mesh)
        except (NoLoop, InvalidMesh):
            continue
        check_through(loop, point)
        for other in handles:
            field = gc.exact_distance(mesh, point)
            there = min(field.distance_at(place) for place in other.locations)
            assert loop.length <= (2 * there + other.length) * (1 + 1e-9)

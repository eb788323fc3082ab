"""The shortest path on each side of an obstacle, against the plane's taut strings."""

import itertools
import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidMesh, NoPath
from tests.support import glued, zoo
from tests.support.meshes import mesh_of, random_points
from tests.support.straightness import worst_bend

HOLE = (4, 4, 7, 6)


def taut(*places):
    return sum(math.dist(a, b) for a, b in itertools.pairwise(places))


def sides(mesh, a, b, obstacle, **options):
    ends = glued.at(mesh, *a), glued.at(mesh, *b)
    paths = gc.paths_around(mesh, *ends, obstacle, **options)
    for path in paths:
        assert path.points[0, :2].tolist() == [*a]
        assert path.points[-1, :2].tolist() == [*b]
    return [path.length for path in paths]


@pytest.mark.parametrize("kind", ["hole", "barrier", "hole beside others"])
def test_both_sides_of_a_rectangle(kind):
    """From left to right above it is left, back below it."""
    options = {}
    if kind == "barrier":
        points, faces = zoo.grid(12, 12)
        mesh = gc.TriangleMesh(points, faces)
        x, y = points[faces].mean(axis=1)[:, :2].T
        x0, y0, x1, y1 = HOLE
        obstacle = np.flatnonzero((x > x0) & (x < x1) & (y > y0) & (y < y1))
    else:
        mesh = glued.holed_square(12, HOLE)
        obstacle = mesh.boundaries()[1]
        if kind == "hole beside others":  # near the lower right corner
            x, y = mesh.vertices[mesh.faces].mean(axis=1)[:, :2].T
            options["barriers"] = np.flatnonzero((x > 10) & (x < 11) & (y > 1) & (y < 2))
    a, b = (1, 5), (11, 5)
    above = taut(a, (4, 6), (7, 6), b)
    below = taut(a, (4, 4), (7, 4), b)
    assert sides(mesh, a, b, obstacle, **options) == pytest.approx([above, below], rel=1e-12)
    a, b = (1, 8), (11, 3)
    above, below = taut(a, (7, 6), b), taut(a, (4, 4), b)
    assert sides(mesh, a, b, obstacle, **options) == pytest.approx([above, below], rel=1e-12)
    assert sides(mesh, b, a, obstacle, **options) == pytest.approx([below, above], rel=1e-12)


@pytest.mark.parametrize("turned", [False, True])
def test_both_sides_of_a_vertex(turned):
    """One is straight, the other touches the vertex; seen from below, left is right."""
    points, faces = zoo.grid(12, 12)
    mesh = gc.TriangleMesh(points, faces[:, ::-1] if turned else faces)
    a, b = (1, 6), (11, 6)
    for y in (5, 6, 7, 8):
        touching = taut(a, (6, y), b)
        expected = [touching, 10] if (y > 6) != turned else [10, touching]
        assert sides(mesh, a, b, glued.at(mesh, 6, y)) == pytest.approx(expected, rel=1e-12)


def test_both_sides_of_a_cap_of_a_sphere():
    """Alike, as seen in the mirror; the shorter one is the shortest path."""
    mesh = gc.samples.sphere(1280)
    wall = np.flatnonzero(mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0.8)
    start, end = mesh.locate([0.6, -0.8, 0.1]), mesh.locate([0.6, 0.8, 0.1])
    left, right = gc.paths_around(mesh, start, end, wall)
    assert left.points[:, 2].max() > 0.4
    assert right.points[:, 2].min() < -0.4
    shortest = gc.shortest_path(mesh, start, end, barriers=wall)
    assert min(left.length, right.length) == pytest.approx(shortest.length, rel=1e-12)
    assert worst_bend(left) < 1e-6
    assert worst_bend(right) < 1e-6
    back = gc.paths_around(mesh, end, start, wall)
    assert [path.length for path in back] == pytest.approx([right.length, left.length], rel=1e-12)


def test_a_barrier_at_the_rim_has_one_side():
    points, faces = zoo.grid(6, 6)
    mesh = gc.TriangleMesh(points, faces)
    x, y = points[faces].mean(axis=1)[:, :2].T
    wall = np.flatnonzero((x > 2) & (x < 4) & (y < 3))
    with pytest.raises(NoPath, match="one side"):
        gc.paths_around(mesh, glued.at(mesh, 0, 0), glued.at(mesh, 6, 0), wall)


def test_obstacles_that_are_refused():
    mesh = glued.holed_square(12, HOLE)
    inside = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
    path = gc.shortest_path(mesh, 0, 5)
    for obstacle, message in ((inside, "a vertex"), (path, "boundaries"), ([], "no face")):
        with pytest.raises(InvalidArgument, match=message):
            gc.paths_around(mesh, 0, 100, obstacle)
    apart = gc.TriangleMesh(*zoo.joined(zoo.grid(3, 3), zoo.grid(3, 3)))
    with pytest.raises(NoPath):
        gc.paths_around(apart, 0, 20, 5)


@pytest.mark.jit
@pytest.mark.slow
@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_nasty_meshes_have_paths_or_a_typed_error(case):
    """The shorter of the two is the shortest path."""
    mesh = mesh_of(case)
    obstacle = int(mesh.faces[len(mesh.faces) // 2, 0])
    start, end = random_points(mesh, 2, seed=4)
    try:
        paths = gc.paths_around(mesh, start, end, obstacle)
    except (NoPath, InvalidMesh):
        return
    least = min(path.length for path in paths)
    assert least == pytest.approx(gc.shortest_path(mesh, start, end).length, rel=1e-9)

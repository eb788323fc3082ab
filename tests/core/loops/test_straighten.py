"""Curves pulled tight: straight wherever they can be, never longer, their ends in place."""

import copy
import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, NoLoop
from geodesic_core.tolerances import SHORTER
from tests.support import glued, zoo
from tests.support.meshes import mesh_of, random_points
from tests.support.searches import edge_paths, random_pairs
from tests.support.straightness import worst_bend

pytestmark = pytest.mark.jit

TIGHT = 1e-6
"""Radians: the places of crossings are rounded, and may be near each other"""


def detour(mesh, seed):
    """A path past two waypoints."""
    start, end, *stops = random_points(mesh, 4, seed=seed)
    return gc.shortest_path(mesh, start, end, waypoints=stops)


def detours(mesh, count):
    for seed in range(count):
        try:
            yield detour(mesh, seed)
        except gc.errors.NoPath:
            continue


@zoo.each(zoo.SMALL)
def test_paths_are_straight_where_they_can_be(case):
    mesh = mesh_of(case)
    for curve in detours(mesh, 6):
        tight = gc.straighten(curve)
        ends = curve.locations[0], curve.locations[-1]
        distance = gc.shortest_path(mesh, *ends).length
        assert distance * (1 - 1e-9) <= tight.length <= curve.length * (1 + 1e-12)
        assert tight.locations[0] == ends[0]
        assert tight.locations[-1] == ends[1]
        assert worst_bend(tight) < TIGHT


@pytest.mark.slow
@zoo.each({**zoo.KNOWN, **zoo.IRREGULAR})
def test_nasty_meshes_have_no_longer_curves(case):
    mesh = mesh_of(case)
    for curve in detours(mesh, 10):
        tight = gc.straighten(curve)
        assert tight.length <= curve.length * (1 + 1e-12) + 1e-12
        assert tight.locations[-1] == curve.locations[-1]


@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_closed_curves_are_straight_or_shrink_to_a_point(case):
    mesh = mesh_of(case)
    field = gc.exact_distance(mesh, int(mesh.faces[0, 0]))
    for curve in [*(line for lines in field.isolines(field.levels(3)) for line in lines)]:
        try:
            tight = gc.straighten(curve)
        except NoLoop:
            assert curve.closed
            continue
        assert tight.closed == curve.closed
        assert tight.length <= curve.length * (1 + 1e-12)
        if case.name in zoo.SMALL:
            assert worst_bend(tight) < TIGHT


@pytest.mark.parametrize("rim", ["outer", "hole"])
@pytest.mark.parametrize("hole", [(3, 2, 7, 9), (5, 5, 6, 6)])
def test_a_rim_becomes_the_outline_of_the_hole(rim, hole):
    mesh = glued.holed_square(12, hole)
    curve = mesh.boundaries()[0 if rim == "outer" else 1]
    tight = gc.straighten(curve)
    around = 2 * (hole[2] - hole[0] + hole[3] - hole[1])
    assert tight.length == pytest.approx(around, rel=1e-13)
    corners = {(x, y) for x in hole[::2] for y in hole[1::2]}
    assert corners <= {tuple(place) for place in tight.points[:, :2].tolist()}


def test_a_rim_is_bridged_where_the_hole_is_hollow():
    """An L: the outline of the hull of its corners."""
    points, faces = zoo.grid(12, 12)
    x, y = points[faces].mean(axis=1)[:, :2].T
    is_in = (x > 3) & (x < 9) & (y > 3) & (y < 9) & ~((x > 5) & (y > 5))
    mesh = gc.TriangleMesh(points, faces[~is_in])
    expected = 6 + 2 + 4 * math.sqrt(2) + 2 + 6
    for curve in mesh.boundaries():
        assert gc.straighten(curve).length == pytest.approx(expected, rel=1e-13)


def test_loops_of_a_flat_torus_are_as_long_as_their_lattice_vectors():
    """Without bends: they slide to a vertex."""
    first, second = (3.0, 0.0), (0.7, 2.0)
    mesh = glued.flat_torus(9, 7, first, second)
    for i, j in ((1, 0), (0, 1), (1, 1), (2, -1)):
        bent = wound(mesh, 9, 7, i, j)
        length = np.linalg.norm(i * np.array(first) + j * np.array(second))
        assert gc.straighten(bent).length == pytest.approx(length, rel=1e-12)


def wound(mesh, columns, rows, i, j):
    """The closed curve along edges that leads i times around the one way, and j times the other."""
    across, up = np.sign(i), np.sign(j)
    places = [(across * k, 0) for k in range(abs(i) * columns)]
    places += [(i * columns, up * k) for k in range(abs(j) * rows + 1)]
    vertices = [x % columns * rows + y % rows for x, y in places]
    path = gc.shortest_path(mesh, vertices[0], vertices[-1], waypoints=vertices[1:-1])
    located = type(path.located)(*(rows[:-1] for rows in path.located))
    return gc.SurfaceCurve(mesh, path.faces, True, path.length, located)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["knot", "obstacles", "crumpled"])
def test_shorter_is_less_than_rounding_for_loops_that_are_tight_already(name):
    if name == "crumpled":
        points, faces = zoo.torus(40, 30)
        mesh = gc.TriangleMesh(zoo.crumpled(points, 0.1, seed=3), faces)
    else:
        mesh = getattr(gc.samples, name)(5000)
    field, count = gc.exact_distance(mesh, 7), 0
    for line in [line for lines in field.isolines(field.levels(5)) for line in lines]:
        try:
            tight = gc.straighten(line)
        except NoLoop:
            continue
        again = gc.straighten(tight)
        assert again.length == pytest.approx(tight.length, rel=1000 * SHORTER)
        assert worst_bend(tight) < TIGHT
        count += 1
    assert count > 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["obstacles", "knot", "terrain", "crumpled"])
def test_never_longer_than_edge_flips(name):
    peer = pytest.importorskip("potpourri3d")
    if name == "crumpled":
        points, faces = zoo.icosphere(4)
        mesh = gc.TriangleMesh(zoo.crumpled(points, 0.1, seed=3), faces)
    else:
        mesh = getattr(gc.samples, name)(5000)
    flips = peer.EdgeFlipGeodesicSolver(np.array(mesh.vertices), np.array(mesh.faces))
    for start, end, path, _ in edge_paths(mesh, random_pairs(mesh, 40)):
        if start == end:
            continue
        stops = mesh.topology.outer_vertex[path].tolist()
        theirs = np.linalg.norm(np.diff(flips.find_geodesic_path_poly(stops), axis=0), axis=1)
        along = gc.shortest_path(mesh, stops[0], stops[-1], waypoints=stops[1:-1])
        assert gc.straighten(along).length <= theirs.sum() * (1 + 1e-9)


def test_a_path_over_a_bump_goes_around_it():
    """Straight over the top is shortest among those close by, but not in a tube."""
    points, faces = zoo.grid(8, 8)
    points = points.copy()
    points[(points[:, 0] == 4) & (points[:, 1] == 4), 2] = 2.0
    mesh = gc.TriangleMesh(points, faces)
    ends = [
        int(np.flatnonzero((points[:, :2] == place).all(axis=1))[0]) for place in ((0, 4), (8, 4))
    ]
    over = gc.shortest_path(mesh, ends[0], ends[1], waypoints=[mesh.locate((4.0, 4.0, 2.0))])
    assert over.length > 8.5
    assert gc.straighten(over).length == gc.shortest_path(mesh, *ends).length


def test_a_curve_of_one_point_stays():
    mesh = gc.samples.plane(2)
    assert gc.straighten(gc.shortest_path(mesh, 0, 0)).length == 0.0


def test_curves_that_are_refused():
    mesh = gc.samples.plane(200)
    path = gc.shortest_path(mesh, 0, 120)
    with pytest.raises(InvalidArgument, match="resampled"):
        gc.straighten(path.resample(0.1))
    with pytest.raises(InvalidArgument, match="no mesh"):
        gc.straighten(copy.copy(path))
    (circle,) = gc.exact_distance(mesh, 60).isolines([0.2])[0]
    with pytest.raises(NoLoop, match="shrinks"):
        gc.straighten(circle)

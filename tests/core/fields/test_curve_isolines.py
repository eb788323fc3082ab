"""Isolines of curves: straight beside their pieces, round about their ends."""

import itertools
import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.curves.regions import span_on_line
from geodesic_core.kernels.retained.reached import REGION, put_segment_bands
from geodesic_core.tolerances import BEHIND
from tests.core.fields.test_curves import random_curve
from tests.core.fields.test_isolines import FINE, check_all, total_length
from tests.support import zoo
from tests.support.isoline_checks import (
    check_ends,
    check_found_again,
    check_pieces,
    check_points,
    line_points,
    some_levels,
)
from tests.support.meshes import mesh_of
from tests.support.oracles import closed_forms


def to_segments(corners, places):
    """Distances of places from a polyline, in the plane."""
    start, step = corners[:-1], np.diff(corners, axis=0)
    away = places[:, None] - start
    share = np.clip((away * step).sum(axis=2) / (step**2).sum(axis=1), 0, 1)
    return np.linalg.norm(away - share[..., None] * step, axis=2).min(axis=1)


def with_middles(line):
    """The points of a line, and what is halfway between them."""
    points = np.vstack([line.points, line.points[:1]]) if line.closed else line.points
    return np.vstack([points, 0.5 * (points[1:] + points[:-1])])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.jit
def test_stadiums_around_a_segment(seed):
    rng = np.random.default_rng(seed)
    points, faces = zoo.grid(8, 8, seed=seed, jitter=0.2)
    mesh = gc.TriangleMesh(points, faces)
    ends = [mesh.locate([*place, 0.0]) for place in rng.uniform(3.0, 5.0, (2, 2))]
    path = gc.shortest_path(mesh, *ends)
    field = gc.exact_distance(mesh, gc.Curve(path.locations), retain="windows")
    levels = [0.01, 0.3, 1.0, 2.3]
    for level, lines in zip(levels, field.isolines(levels, FINE), strict=True):
        (line,) = lines
        assert line.closed
        found = to_segments(path.points[[0, -1]], line.points)
        # Crossings on the curve itself are told to 1e-12 of their edges.
        np.testing.assert_allclose(found, level, rtol=1e-12, atol=1e-12)
        stadium = 2 * math.pi * level + 2 * path.length
        assert line.length == pytest.approx(stadium, abs=4 * FINE)
        check_pieces(mesh, line)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.jit
def test_around_a_polyline_is_the_edge_of_its_stadiums(seed):
    """All points at the level; within, as much area as a fine raster says."""
    rng = np.random.default_rng(seed)
    points, faces = zoo.grid(8, 8, seed=seed, jitter=0.2)
    mesh = gc.TriangleMesh(points, faces)
    corners = np.insert(rng.uniform(2.5, 5.5, (4, 2)), 2, 0.0, axis=1)
    curve = [
        point
        for start, end in itertools.pairwise(mesh.locate(place) for place in corners)
        for point in gc.shortest_path(mesh, start, end).locations
    ]
    field = gc.exact_distance(mesh, gc.Curve(curve), retain="windows")
    levels = [0.05, 0.4, 1.1, 2.0]
    raster = (np.indices((400, 400)).reshape(2, -1).T + 0.5) / 50
    away = to_segments(corners[:, :2], raster)
    for level, lines in zip(levels, field.isolines(levels, FINE), strict=True):
        area = 0.0
        for line in lines:
            assert line.closed
            np.testing.assert_allclose(to_segments(corners, line.points), level, atol=2e-12)
            np.testing.assert_allclose(to_segments(corners, with_middles(line)), level, atol=FINE)
            x, y = line.points[:, 0], line.points[:, 1]
            area += 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()
        assert abs(area) == pytest.approx((away <= level).mean() * 64, abs=0.02)


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_open_lines_where_the_domain_ends(jitter):
    points, faces = zoo.grid(6, 4, seed=2, jitter=jitter)
    mesh = gc.TriangleMesh(points, faces)
    path = gc.shortest_path(mesh, mesh.locate([0.0, 1.5, 0.0]), mesh.locate([6.0, 1.5, 0.0]))
    field = gc.exact_distance(mesh, gc.Curve(path.locations), retain="windows")
    for level, count in ((0.3, 2), (1.4, 2), (1.7, 1), (2.6, 0)):
        lines = field.isolines([level])[0]
        assert len(lines) == count
        for line in lines:
            assert not line.closed
            assert line.length == pytest.approx(6.0, rel=1e-11)
            np.testing.assert_allclose(np.abs(line.points[:, 1] - 1.5), level, atol=1e-11)
            check_ends(mesh, line)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("scale", [1.0, 1.37])
@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.jit
def test_lines_along_edges_do_not_depend_on_rounding(seed, scale, limited):
    """Around a square along edges, at the levels of other edges, however turned."""
    points, faces = zoo.grid(8, 8)
    turned = scale * points @ zoo.rotation(seed).T
    mesh = gc.TriangleMesh(turned, faces)
    at = {(x, y): v for v, (x, y, _) in enumerate(points.astype(int).tolist())}
    ring = [(x, 2) for x in range(2, 6)] + [(6, y) for y in range(2, 6)]
    ring += [(8 - x, 8 - y) for x, y in ring]
    curve = gc.Curve([at[place] for place in [*ring, ring[0]]])
    corners = points[[at[place] for place in ((2, 2), (6, 2), (6, 6), (2, 6), (2, 2))]]
    for level in (1.0, 1.5):
        limit = scale * level if limited else math.inf
        field = gc.exact_distance(mesh, curve, max_distance=limit, retain="windows")
        lines = field.isolines([scale * level], FINE)[0]
        lengths = sorted(line.length / scale for line in lines)
        inner, outer = 16.0 - 8.0 * level, 16.0 + 2 * math.pi * level
        np.testing.assert_allclose(lengths, [inner, outer], atol=4 * FINE)
        for line in lines:
            assert line.closed
            places = with_middles(line) @ zoo.rotation(seed) / scale
            np.testing.assert_allclose(to_segments(corners, places), level, atol=FINE)


def test_fronts_that_meet_leave_no_line():
    """Halfway between two curves both reach, whatever else they run along."""
    points, faces = zoo.grid(6, 8)
    at = {(x, y): v for v, (x, y, _) in enumerate(points.astype(int).tolist())}
    mesh = gc.TriangleMesh(points, faces)
    for upper in (5, 6):
        curves = [gc.Curve([at[x, y] for x in range(7)]) for y in (2, upper)]
        field = gc.exact_distance(mesh, curves, retain="windows")
        half = (upper - 2) / 2
        before, between = field.isolines([half - 0.25, half])
        assert len(before) == 4
        for line in between:  # those of the lower half and of the upper one
            assert (np.abs(line.points[:, 1] - (upper + 2) / 2) > 1).all()
        np.testing.assert_allclose([line.length for line in before], 6.0, rtol=1e-12)


@pytest.mark.jit
def test_bands_around_a_box():
    """A curve once around a box: straight lines beside it, then down over the edges."""
    size = 3, 2, 2
    mesh = gc.TriangleMesh(*zoo.voxels(list(itertools.product(*map(range, size)))))
    ring = np.array([(1.3, 0, 0), (1.3, 2, 0), (1.3, 2, 2), (1.3, 0, 2), (1.3, 0, 0)], float)
    points = [
        point
        for start, end in itertools.pairwise(mesh.locate(place) for place in ring)
        for point in gc.shortest_path(mesh, start, end).locations
    ]
    field = gc.exact_distance(mesh, gc.Curve(points), retain="windows")
    for level in (0.2, 0.9, 1.2):
        lines = field.isolines([level])[0]
        assert [line.closed for line in lines] == [True, True]
        np.testing.assert_allclose([line.length for line in lines], 8.0, rtol=1e-11)
        for line in lines:
            np.testing.assert_allclose(np.abs(line.points[:, 0] - 1.3), level, atol=1e-11)
    # Beyond the rim of an end the lines run on as squares.
    (end, _) = sorted(field.isolines([1.5])[0], key=lambda line: line.length)
    assert end.length == pytest.approx(4 * (2 - 2 * 0.2), rel=1e-11)


@pytest.mark.jit
@pytest.mark.slow
def test_points_on_a_box_are_at_the_level_by_unfolding():
    size = 3, 2, 2
    mesh = gc.TriangleMesh(*zoo.voxels(list(itertools.product(*map(range, size)))))
    start, end = np.array([0.3, 0.4, 0.0]), np.array([0.9, 0.8, 0.0])
    path = gc.shortest_path(mesh, mesh.locate(start), mesh.locate(end))
    field = gc.exact_distance(mesh, gc.Curve(path.locations), retain="windows")
    shares = np.linspace(0.0, 1.0, 101)[:, None]
    on_curve = (1 - shares) * start + shares * end
    for level, lines in zip((0.6, 1.9), field.isolines([0.6, 1.9]), strict=True):
        for place in lines[0].points[:: max(len(lines[0].points) // 6, 1)]:
            known = closed_forms.box(size, place, on_curve)
            assert level * (1 - 1e-9) <= known.min() <= level + 2e-5


@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.jit
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_all_of_each_level_is_found(case):
    """Of a curve alone, and of one that starts later, beside a point."""
    mesh, rng = mesh_of(case), np.random.default_rng(51)
    curve = random_curve(mesh, rng)
    if curve is None:
        pytest.skip("the random ends are not connected")
    for sources in (curve, [gc.Source(curve, 0.05 * mesh.diagonal), 0]):
        field = gc.exact_distance(mesh, sources, retain="windows")
        check_all(mesh, sources, field, some_levels(field, 51, 2))


@pytest.mark.slice(3)
@pytest.mark.jit
@zoo.each(zoo.SMALL)
def test_levels_of_vertices(case):
    """Of a curve along edges: levels pass through vertices, and lines along edges."""
    mesh = mesh_of(case)
    u, v, w = mesh.faces[0].tolist()
    curve = gc.Curve([u, v, w, u])
    field = gc.exact_distance(mesh, curve, retain="windows")
    vertices = np.flatnonzero(np.isfinite(field.distances) & (field.distances > 0.0))[:6]
    check_all(mesh, curve, field, field.distances[vertices].tolist(), crossings=False)


@pytest.mark.jit
@zoo.each({name: zoo.SMALL[name] for name in ("hills", "annulus", "crumpled_torus", "box_1x2x3")})
def test_limits_and_what_is_kept_change_no_line_within(case):
    mesh = mesh_of(case)
    curve = random_curve(mesh, np.random.default_rng(52))
    full = gc.exact_distance(mesh, curve)
    levels = some_levels(full, 52, 3)
    limit = sorted(levels)[1]
    near = gc.exact_distance(mesh, curve, max_distance=limit, retain="windows")
    for level, ours, theirs in zip(
        levels, near.isolines(levels), full.isolines(levels), strict=True
    ):
        if level > limit:
            assert ours == []
        else:
            assert total_length(ours) == pytest.approx(total_length(theirs), rel=1e-9)


@pytest.mark.jit
@zoo.each(zoo.SMALL)
def test_windows_kept_or_found_again_draw_the_same_lines(case):
    mesh = mesh_of(case)
    curve = random_curve(mesh, np.random.default_rng(54))
    if curve is not None:
        check_found_again(mesh, curve, seed=54)


@pytest.mark.jit
@zoo.each({name: zoo.SMALL[name] for name in ("hills", "annulus", "crumpled_torus", "box_1x2x3")})
def test_approximate_lines_keep_to_the_error(case):
    mesh, error = mesh_of(case), 0.02
    curve = random_curve(mesh, np.random.default_rng(53))
    for retain in ("windows", "distances"):
        field = gc.approximate_distance(mesh, curve, error, retain=retain)
        levels = some_levels(field, 53, 2)
        for level, lines in zip(levels, field.isolines(levels), strict=True):
            points = [point for line in lines for point in line_points(mesh, line)]
            points = points[:: max(len(points) // 20, 1)]
            exact = gc.exact_distance(mesh, curve, targets=points)
            found = np.array([exact.distance_at(point) for point in points])
            assert (found >= level * (1 - 1e-9)).all()
            assert (found <= level / (1 - error)).all()


def test_a_curve_of_one_point_has_its_circles():
    mesh = mesh_of(zoo.SMALL["hills"])
    point = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
    level = 0.2 * mesh.diagonal
    lines = [
        gc.exact_distance(mesh, source).isolines([level])[0]
        for source in (point, gc.Curve([point]))
    ]
    for ours, theirs in zip(*lines, strict=True):
        np.testing.assert_array_equal(ours.points, theirs.points)
    check_points(mesh, point, level, lines[1])


def test_behind_ends_beyond_the_segment_and_before_the_other_front():
    far, bands = 0.25, np.zeros((2, REGION))
    put_segment_bands(bands, 0.0, 0.0, 1.0, 0.0, far)
    assert 1 < BEHIND < 2
    for band, side in zip(bands, (1, -1), strict=True):
        for y, is_inside in ((-far, 1), (0, 1), ((BEHIND - 1) * far, 0), (far, -1)):
            point = 0.5, side * y, 1.0, 0.0
            lo, hi = span_on_line(band, 0.0, *point, -0.1, 0.1)
            assert lo <= hi if is_inside >= 0 else lo > hi

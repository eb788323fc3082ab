"""Isolines: at their level, complete, joined, and as long as geometry says."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument
from geodesic_core.kernels.curves.regions import RADIUS, put_disc
from geodesic_core.kernels.isolines.arcs import outer_arcs
from geodesic_core.kernels.isolines.cuts import united
from geodesic_core.kernels.retained.reached import REGION
from geodesic_core.tolerances import CROSSING, CUT_OFF, FINEST_CHORD, LEVEL, PIECE
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.isoline_checks import (
    check_crossings,
    check_ends,
    check_found_again,
    check_pieces,
    check_points,
    distances_from,
    some_levels,
)
from tests.support.meshes import mesh_of, named_mesh, random_points

FINE = 1e-6
"""Chord error of what is compared with a closed form."""


def total_length(lines):
    return sum(line.length for line in lines)


def check_all(mesh, sources, field, levels, *, crossings=True):
    lines_of_each = field.isolines(levels)
    for level, lines in zip(levels, lines_of_each, strict=True):
        for line in lines:
            check_pieces(mesh, line)
            check_ends(mesh, line)
        if lines:
            check_points(mesh, sources, level, lines)
    if crossings:
        check_crossings(mesh, sources, levels, lines_of_each)


@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.jit
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_all_of_each_level_is_found(case):
    mesh = mesh_of(case)
    for source in random_points(mesh, 3, seed=41)[1:]:
        field = gc.exact_distance(mesh, source, retain="windows")
        check_all(mesh, source, field, some_levels(field, 41, 2))


@pytest.mark.slice(2)
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_points_lie_at_the_level_on_slivers_too(case):
    mesh = mesh_of(case)
    for source in random_points(mesh, 3, seed=42):
        field = gc.exact_distance(mesh, source, retain="windows")
        check_all(mesh, source, field, some_levels(field, 42, 2), crossings=False)


@pytest.mark.jit
@pytest.mark.slice(3)
@zoo.each(zoo.SMALL)
def test_levels_of_vertices(case):
    """A level passes through its vertex, or has all around it within."""
    mesh = mesh_of(case)
    field = gc.exact_distance(mesh, 0, retain="windows")
    vertices = np.flatnonzero(np.isfinite(field.distances) & (field.distances > 0.0))[:6]
    levels = field.distances[vertices].tolist()
    check_all(mesh, 0, field, levels, crossings=False)


LEVELS = pytest.mark.parametrize("share", [-3.0, -0.5, 0.0, 0.5, 3.0])
"""By how much of LEVEL a level is off the distance of a vertex or an edge: as rounding may be."""


@LEVELS
@zoo.each_scale
def test_lines_along_edges_are_one_and_whole(share, scale):
    """Of a curve along a column of edges, lines run along others, or a hair beside them."""
    points, faces = zoo.grid(6, 3)
    turned = scale * points @ zoo.rotation(8).T
    mesh = gc.TriangleMesh(turned, faces)
    column = [int(v) for v in np.flatnonzero(points[:, 0] == 2.0)]
    field = gc.exact_distance(mesh, gc.Curve(column), retain="windows")
    for away, sides in ((1.0, 2), (2.0, 2), (3.0, 1)):
        level = scale * away * (1.0 + share * LEVEL)
        (lines,) = field.isolines([level])
        if away == 2.0:  # the rim itself is within, or a line lies just before it
            lines = [line for line in lines if (line.points @ zoo.rotation(8))[0, 0] > scale]
        assert len(lines) == (1 if away == 2.0 else sides)
        for line in lines:
            assert not line.closed
            assert line.length == pytest.approx(3.0 * scale, rel=1e-11)
            places = line.points @ zoo.rotation(8) / scale
            np.testing.assert_allclose(np.abs(places[:, 0] - 2.0), away, rtol=2 * CROSSING)
            check_pieces(mesh, line)


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.slice(2)
@LEVELS
def test_lines_through_vertices_are_one_and_whole(share):
    """On a grid, circles through vertices, and along none of their edges."""
    points, faces = zoo.grid(8, 8)
    mesh = gc.TriangleMesh(points @ zoo.rotation(9).T, faces)
    centre = int(np.flatnonzero((points == (4, 4, 0)).all(axis=1))[0])
    field = gc.exact_distance(mesh, centre)
    for distance in (1.0, math.sqrt(2.0), 3.0):
        level = distance * (1.0 + share * LEVEL)
        (line,) = field.isolines([level], FINE)[0]
        assert line.closed
        assert line.length == pytest.approx(2 * math.pi * level, rel=4 * FINE / level)
        check_pieces(mesh, line)


@pytest.mark.parametrize("width", [1e-6, 1e-8, 1e-9, 1e-10, 1e-11])
def test_a_strip_may_be_as_narrow_as_points_of_a_line_are_near(width):
    """A level crosses it from side to side, once."""
    points, faces = zoo.grid(20, 1)
    field = gc.exact_distance(gc.TriangleMesh(points * (0.05, width, 1.0), faces), 0)
    levels = [0.013, 0.1234, 0.5, 0.77, 0.987]
    # Rounding across a face, from side to side, is as much larger along it as it is longer.
    rounding = 4.0 * np.finfo(np.float64).eps * (1.0 + 0.05 / width)
    for level, lines in zip(levels, field.isolines(levels), strict=True):
        (line,) = lines
        assert not line.closed
        ends = sorted(line.points[[0, -1], 1])
        np.testing.assert_allclose(ends, [0.0, width], rtol=0, atol=1e-12 * width)
        np.testing.assert_allclose(np.linalg.norm(line.points, axis=1), level, rtol=rounding)


@pytest.mark.parametrize(("radius", "count"), [(0.1, 0), (3.0, 1)])
def test_a_tiny_line_from_an_edge_back_to_it_is_left_out(radius, count):
    """Around a source on the boundary; nor is a circle so small drawn inside a face."""
    mesh = gc.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    source = gc.Source(gc.SurfacePoint.edge(0, 0, 0.4), 1.0)
    (lines,) = gc.exact_distance(mesh, source).isolines([1.0 + radius * PIECE])
    assert len(lines) == count


@pytest.mark.parametrize(("share", "lines"), [(-1e4, 1), (-0.5, 0), (0.0, 0), (0.5, 0), (1e4, 0)])
def test_the_farthest_vertex_is_within_its_own_level(share, lines):
    points, faces = zoo.grid(5, 4)
    mesh = gc.TriangleMesh(points @ zoo.rotation(10).T, faces)
    level = math.hypot(5.0, 4.0) * (1.0 + share * LEVEL)
    assert len(gc.exact_distance(mesh, 0).isolines([level])[0]) == lines


@pytest.mark.jit
@pytest.mark.parametrize("seed", range(3))
def test_circles_in_the_plane(seed):
    points, faces = zoo.grid(8, 8, seed=seed, jitter=0.2)
    mesh = gc.TriangleMesh(points @ zoo.rotation(seed).T, faces)
    face = int(np.argmin(np.linalg.norm(points[faces].mean(axis=1) - (4, 4, 0), axis=1)))
    for source in (gc.SurfacePoint.face(face, (0.2, 0.3, 0.5)), gc.SurfacePoint.edge(face, 1, 0.3)):
        centre = mesh.position(source)
        field = gc.exact_distance(mesh, source, retain="windows")
        for level, lines in zip(
            (0.01, 1.0, 2.9), field.isolines([0.01, 1.0, 2.9], FINE), strict=True
        ):
            (line,) = lines
            assert line.closed
            away = np.linalg.norm(line.points - centre, axis=1)
            np.testing.assert_allclose(away, level, rtol=1e-12)
            assert line.length == pytest.approx(2 * math.pi * level, rel=4 * FINE / level)


def test_arcs_behind_a_corner():
    """In a square without its upper right quarter: light from one arm bends into the other."""
    points, faces = zoo.grid(4, 4)
    cells = [(x, y) for x in (2, 3) for y in (2, 3)]
    points, faces = zoo.drop_unused(points, zoo.without_cells(faces, 4, cells))
    mesh = gc.TriangleMesh(points, faces)
    source, corner = np.array([4.0, 1.0]), np.array([2.0, 2.0])
    field = gc.exact_distance(mesh, mesh.locate([*source, 0.0]), retain="windows")
    for level, lines in zip((3.0, 3.6), field.isolines([3.0, 3.6], FINE), strict=True):
        (line,) = lines
        assert not line.closed
        p = line.points[:, :2]
        turn = (corner - source)[0] * (p - source)[:, 1] - (corner - source)[1] * (p - source)[:, 0]
        direct = np.linalg.norm(p - source, axis=1)
        bent = math.dist(source, corner) + np.linalg.norm(p - corner, axis=1)
        shadow = (turn < 0) & (p[:, 1] > 2)
        assert shadow.any()
        np.testing.assert_allclose(np.where(shadow, bent, direct), level, rtol=1e-12)


@pytest.mark.parametrize("bulge", [-0.6, 0.0, 0.7, 2.0])
def test_circles_around_the_tip_of_a_cone(bulge):
    vertices, faces, _, _ = zoo.cone(12, 1.0)
    vertices = vertices * (1, 1, 1 + bulge)
    mesh = gc.TriangleMesh(vertices, faces)
    degree = np.bincount(faces.ravel())
    tip = int(np.argmax(degree))
    arms = vertices[faces[(faces == tip).any(axis=1)]]
    angle = 0.0
    for corners, ids in zip(arms, faces[(faces == tip).any(axis=1)].tolist(), strict=True):
        i = ids.index(tip)
        u, v = corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]
        angle += math.acos(u @ v / np.linalg.norm(u) / np.linalg.norm(v))
    field = gc.exact_distance(mesh, tip)
    level = 0.3 * np.linalg.norm(arms - vertices[tip], axis=2).max()
    (line,) = field.isolines([level], FINE)[0]
    assert line.closed
    assert line.length == pytest.approx(angle * level, rel=1e-5)


def test_circles_on_a_cube():
    mesh = mesh_of(zoo.SMALL["cube"])
    lengths = [
        total_length(lines) for lines in gc.exact_distance(mesh, 0).isolines([0.3, 1.0], FINE)
    ]
    # Three right angles meet at a corner. Of level 1 the three quarters meet the far edges' ends.
    np.testing.assert_allclose(lengths, [1.5 * math.pi * 0.3, 1.5 * math.pi], rtol=2e-5)


@pytest.mark.slow
@pytest.mark.slice(2)
@pytest.mark.jit
@zoo.each({name: zoo.SMALL[name] for name in ("hills", "annulus", "crumpled_torus", "box_1x2x3")})
def test_several_sources_with_start_distances(case):
    mesh = mesh_of(case)
    points = random_points(mesh, 3, seed=43)
    sources = [gc.Source(point, 0.05 * i * mesh.diagonal) for i, point in enumerate(points)]
    field = gc.exact_distance(mesh, sources, retain="windows")
    check_all(mesh, sources, field, some_levels(field, 43, 3))


@pytest.mark.jit
@zoo.each(zoo.SMALL)
def test_max_distance_and_what_is_kept_change_no_line_within(case):
    mesh = mesh_of(case)
    (source,) = random_points(mesh, 1, seed=44)
    full = gc.exact_distance(mesh, source)
    levels = some_levels(full, 44, 3)
    limit = sorted(levels)[1]
    near = gc.exact_distance(mesh, source, max_distance=limit, retain="windows")
    for level, ours, theirs in zip(
        levels, near.isolines(levels), full.isolines(levels), strict=True
    ):
        if level > limit:
            assert ours == []
        else:
            assert total_length(ours) == pytest.approx(total_length(theirs), rel=1e-9)
            assert sorted(line.closed for line in ours) == sorted(line.closed for line in theirs)


@pytest.mark.slice(4)
@pytest.mark.jit
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_windows_kept_or_found_again_draw_the_same_lines(case):
    mesh = mesh_of(case)
    point, other = random_points(mesh, 2, seed=46)
    for sources in (point, [gc.Source(point, 0.1 * mesh.diagonal), other]):
        check_found_again(mesh, sources, seed=46)


@pytest.mark.slice(3)
@pytest.mark.jit
@zoo.each(zoo.SMALL)
def test_approximate_lines_keep_to_the_error(case):
    mesh = mesh_of(case)
    (source,) = random_points(mesh, 1, seed=45)
    error = 0.02
    for retain in ("windows", "distances"):
        field = gc.approximate_distance(mesh, source, error, retain=retain)
        for level, lines in zip(
            levels := some_levels(field, 45, 2), field.isolines(levels), strict=True
        ):
            for line in lines:
                check_pieces(mesh, line)
                check_ends(mesh, line)
                positions = line.points[:: max(len(line.points) // 10, 1)]
                exact = gc.exact_distance(mesh, source, retain="windows")
                found = np.array([exact.distance_at(mesh.locate(p)) for p in positions])
                assert (found >= level * (1 - 1e-9)).all()
                assert (found <= level / (1 - error)).all()


@pytest.mark.parametrize("chord_error", [1e-2, 1e-4])
def test_chord_error_is_how_far_chords_stray(chord_error):
    points, faces = zoo.grid(4, 4)
    mesh = gc.TriangleMesh(points, faces)
    (line,) = gc.exact_distance(mesh, 12).isolines([1.7], chord_error)[0]
    middles = 0.5 * (line.points + np.roll(line.points, -1, axis=0))
    sagitta = 1.7 - np.linalg.norm(middles - points[12], axis=1)
    assert 0.3 * chord_error < sagitta.max() <= chord_error * (1 + 1e-9)
    with_default = gc.exact_distance(mesh, 12).isolines([1.7])[0][0]
    middles = 0.5 * (with_default.points + np.roll(with_default.points, -1, axis=0))
    assert (1.7 - np.linalg.norm(middles - points[12], axis=1)).max() < 2e-3


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("share", [1e-3, 1e-2, 0.1])
def test_few_points_are_enough_for_a_chord_error(share):
    mesh = mesh_of(zoo.SMALL["crumpled_torus"])
    chord_error = share * np.ptp(mesh.vertices, axis=0).max()
    field = gc.exact_distance(mesh, 0)
    levels = field.levels(5)
    fine, coarse = (field.isolines(levels, error) for error in (1e-8, chord_error))
    for finer, coarser in zip(fine, coarse, strict=True):
        assert [line.closed for line in coarser] == [line.closed for line in finer]
        for few, many in zip(coarser, finer, strict=True):
            check_pieces(mesh, few)
            assert distances_from(few, many.points).max() <= chord_error * (1 + 1e-9)
            assert distances_from(many, few.points).max() <= 2e-8
    few, many = (
        sum(len(line.points) for lines in each for line in lines) for each in (coarse, fine)
    )
    assert few < 0.5 * many


def test_small_loops_stay_whatever_the_chord_error():
    mesh = gc.samples.plane(2)
    source = gc.SurfacePoint.face(0, (0.25, 0.25, 0.5))
    ((line,),) = gc.exact_distance(mesh, source).isolines([1e-3], 1.0)
    assert line.closed
    assert len(line.points) >= 3
    np.testing.assert_allclose(np.linalg.norm(line.points - mesh.position(source), axis=1), 1e-3)


def test_levels_are_spaced_evenly():
    mesh = mesh_of(zoo.SMALL["two_components"])
    field = gc.exact_distance(mesh, 0)
    largest = field.distances[np.isfinite(field.distances)].max()
    np.testing.assert_allclose(field.levels(3), largest * np.array([0.25, 0.5, 0.75]))
    assert all(field.isolines(field.levels(3)))
    for count in (0, -1, 1.0, True, "3", None):
        with pytest.raises(InvalidArgument, match="count of levels"):
            field.levels(count)


def test_there_are_no_levels_where_nothing_is_away():
    mesh = mesh_of(zoo.SMALL["two_components"])
    for source in (0, gc.SurfacePoint.face(0, (0.2, 0.3, 0.5))):
        field = gc.exact_distance(mesh, source, max_distance=1e-6)
        with pytest.raises(InvalidArgument, match="no vertex but the sources is reached"):
            field.levels(3)
        assert field.isolines([1e-7, 9.0])[1] == []


def test_levels_in_their_order_and_more_than_once():
    mesh = mesh_of(zoo.SMALL["octahedron"])
    first, second, none, again = gc.exact_distance(mesh, 0).isolines([0.9, 0.2, 99.0, 0.9])
    assert none == []
    assert len(first) == len(second) == len(again) == 1
    np.testing.assert_array_equal(first[0].points, again[0].points)
    assert first[0].length > second[0].length
    assert gc.exact_distance(mesh, 0).isolines([]) == []


@pytest.mark.parametrize(
    ("levels", "message"),
    [
        (0.5, "sequence of distances"),
        ("0.5", "sequence of distances"),
        (None, "sequence of distances"),
        ([0.5, 0.0], "level 1 is 0.0"),
        ([-1.0], "level 0 is -1.0"),
        ([math.inf], "level 0 is inf"),
        ([math.nan], "level 0 is nan"),
        ([True], "level 0 is True"),
        (["1"], "level 0 is '1'"),
    ],
)
def test_levels_that_are_none(levels, message):
    field = gc.exact_distance(mesh_of(zoo.SMALL["octahedron"]), 0)
    with pytest.raises(InvalidArgument, match=message):
        field.isolines(levels)


def test_the_default_chord_error_is_taken_where_small_parts_are_far_apart():
    """A thousandth of their edges is less than a billionth of the bounding box."""
    part = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    mesh = gc.TriangleMesh(np.vstack([part, part + 1e7]), [[0, 1, 2], [3, 4, 5]])
    default = gc.resolve_chord_error(mesh)
    assert default >= 1e-3
    assert gc.resolve_chord_error(mesh, default) == default


@pytest.mark.parametrize("chord_error", [0.0, -1.0, 1e-12, math.inf, math.nan, "1", True])
def test_chord_errors_that_are_none(chord_error):
    field = gc.exact_distance(mesh_of(zoo.SMALL["octahedron"]), 0)
    with pytest.raises(InvalidArgument, match="chord_error"):
        field.isolines([0.5], chord_error)


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize(
    "name",
    ["rough_scan", "thin_cad", "cow.obj", "spot.obj", "alligator.obj", "fandisk10k.ply"],
)
def test_real_meshes(name):
    mesh = named_mesh(name)
    field = gc.exact_distance(mesh, 0, retain="windows")
    levels = field.levels(5)
    for level, lines in zip(levels, field.isolines(levels), strict=True):
        assert lines
        check_points(mesh, 0, level, lines)
        for line in lines:
            check_ends(mesh, line)


def test_nothing_is_shared_between_calls():
    mesh = mesh_of(zoo.SMALL["hills"])
    field = gc.exact_distance(mesh, 0, retain="paths" if WITHOUT_JIT else "windows")
    first = field.isolines(field.levels(2))
    for lines, others in zip(first, field.isolines(field.levels(2)), strict=True):
        for line, other in zip(lines, others, strict=True):
            np.testing.assert_array_equal(line.points, other.points)
            line.points[:] = 0.0
            assert other.points.any()


@pytest.mark.plain
@zoo.each_scale
@pytest.mark.parametrize("share", [-3.0, -0.5, 0.5, 3.0])
def test_level_is_how_near_two_circles_count_as_one(scale, share):
    """Of circles that are one the first counts; of others, around one point, the larger."""
    mesh = gc.TriangleMesh(scale * zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    discs, level = np.zeros((2, REGION)), 0.1 * scale
    for disc, radius in zip(discs, (level, level * (1.0 + share * LEVEL)), strict=True):
        put_disc(disc, 0.3 * scale, 0.01 * scale, radius)
    arcs = outer_arcs(mesh.topology, 0, discs, level, 0.0)
    assert set(arcs[:, RADIUS]) == {discs[1 if share > 1.0 else 0, RADIUS]}


@pytest.mark.parametrize(("share", "left"), [(0.9, 1), (1.1, 2)])
def test_crossing_is_the_gap_between_stretches_that_are_one(share, left):
    gap = share * CROSSING
    assert united(np.array([[0.5 + gap, 0.75], [0.25, 0.5]]), CROSSING) == left


@pytest.mark.parametrize(("radius", "lines"), [(0.1, 0), (3.0, 1)])
def test_piece_is_the_length_of_what_is_left_out(radius, lines):
    mesh = gc.TriangleMesh(zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    source = gc.Source(gc.SurfacePoint.face(0, (0.3, 0.3, 0.4)), 1.0)
    field = gc.exact_distance(mesh, source)
    assert len(field.isolines([1.0 + radius * PIECE])[0]) == lines


def test_cut_off_is_how_far_lines_stay_below_the_limit():
    """On a square, from both of its lower corners."""
    limit, mesh = 0.8, gc.samples.plane(200)
    left, right = mesh.vertices[[0, 10]]
    field = gc.exact_distance(mesh, [0, 10], max_distance=limit)
    (line,), (border,) = field.isolines([limit])[0], field.borders()
    for points in (line.points, border.points[np.argmax(border.points[:, 1])][None]):
        ways = np.minimum(*(np.linalg.norm(points - corner, axis=1) for corner in (left, right)))
        np.testing.assert_allclose(1.0 - ways / limit, CUT_OFF, rtol=1e-3)


@zoo.each_scale
@pytest.mark.parametrize(("share", "is_taken"), [(0.99, False), (1.01, True)])
def test_finest_chord_is_the_least_chord_error(scale, share, is_taken):
    mesh = gc.TriangleMesh(scale * zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    chord_error = share * FINEST_CHORD * mesh.diagonal
    if is_taken:
        assert gc.resolve_chord_error(mesh, chord_error) == chord_error
    else:
        with pytest.raises(gc.errors.InvalidArgument, match="chord_error"):
            gc.resolve_chord_error(mesh, chord_error)

"""Each tolerance as the bound that its docstring promises."""

import inspect
import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import geodesic_core as gc
from geodesic_core import tolerances
from geodesic_core.control import Control
from geodesic_core.fields import fast_sweep
from geodesic_core.fields.sources import nodes_of
from geodesic_core.fields.sweep import run_sweep
from geodesic_core.kernels.borders.bisectors import is_one_sided
from geodesic_core.kernels.curves.regions import (
    RADIUS,
    put_disc,
    put_side,
    span_on_line,
)
from geodesic_core.kernels.fast import state as fast_state
from geodesic_core.kernels.fast.buckets import push
from geodesic_core.kernels.fast.places import offer
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.bounds import exact_bounds, merging_bounds, with_parallel_windows
from geodesic_core.kernels.front.counters import CREATED, FAR_BUCKET, FRESH
from geodesic_core.kernels.front.pool import put_window
from geodesic_core.kernels.front.pruning import least_to_start
from geodesic_core.kernels.front.relaxation import precedence
from geodesic_core.kernels.front.state import (
    FIRST,
    LAST,
    NO_MERGES,
    NO_SITES,
    SIZE,
    found,
    new_vertices,
    new_wavefront,
    view_of,
)
from geodesic_core.kernels.front.window import B0, B1, BUCKET, NEXT, ROOT, SIGMA, SX, SY
from geodesic_core.kernels.isolines.arcs import outer_arcs
from geodesic_core.kernels.isolines.cuts import united
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    OPPOSITE,
    PINCHED,
    ROW,
    SADDLE,
    SIN_LEFT,
    TAIL,
)
from geodesic_core.kernels.paths import funnel
from geodesic_core.kernels.paths.backtracing import NO_END, Line, Winners, is_on_path
from geodesic_core.kernels.paths.funnel import LEFT, NEITHER, RIGHT, pull_taut, shortened_part
from geodesic_core.kernels.planar import Source, bisector, bracketed, distance
from geodesic_core.kernels.retained.reached import REGION, put_origin, put_segment_bands
from geodesic_core.kernels.sweep import continuous_dijkstra
from geodesic_core.kernels.sweep.merging import accuracy, directionality, merged
from geodesic_core.kernels.sweep.reach import reach_apex
from geodesic_core.kernels.sweep.trim_list import trim_list
from geodesic_core.kernels.sweep.trimming import leaves_gap
from geodesic_core.mesh.triangulation import triangulated
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.tolerances import (
    ASTAR_WEIGHT,
    AT_LIMIT,
    BEHIND,
    BEND,
    DIVERGING,
    DOUBLE_ROOT,
    EDGE_STEPS,
    FALSE_POSITION_STEPS,
    FAR_NEARER,
    FLAT,
    FORKS,
    GAP,
    GRAZING,
    HALF_ULP,
    LANDMARK_ERROR,
    LARGEST_COORDINATE,
    LAST_BUCKET,
    LOCAL_SHARE,
    LOOSE_OVERLAP,
    LOWER_BOUND,
    MOST_AT_LARGE,
    MOST_CROSSINGS,
    MOST_RUNS,
    NEARLY_JOINED,
    NO_AREA,
    ON_PATH,
    OVERLAP,
    PASSES,
    PATH_LENGTH,
    ROUGH,
    ROUGH_VERTICES,
    ROUNDED_COORDINATE,
    ROUNDED_POSITION,
    RUNS,
    SADDLE_EXCESS,
    SAME_PLACE,
    SEARCH_SLACK,
    SECTOR_MARGIN,
    SHARP,
    SHARP_SADDLE,
    SHORTEST_EDGE,
    SINGLE_PRECISION,
    SLACK,
    SLANT,
    SNAP,
    STRAIGHT,
    TIE,
    TRIES,
    WEIGHT,
    WEIGHT_ERROR,
    WIDEST_ERROR,
)
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import MERGING
from tests.support.certificates import check_path
from tests.support.invariants import windows_of
from tests.support.oracles import closed_forms, graph
from tests.support.searches import edge_paths, goal_at_vertex, random_pairs, spread
from tests.support.stepping import started, steps, topology_of, view_of_arrays, window

pytestmark = pytest.mark.file_slice(40)

SCALES = pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])


def test_each_tolerance_is_tested():
    """By a test that has its name and measures against its value."""
    tests = [value for name, value in globals().items() if name.startswith("test_")]
    for name in filter(str.isupper, vars(tolerances)):
        named = [test for test in tests if test.__name__.startswith(f"test_{name.lower()}")]
        assert any(re.search(rf"\b{name}\b", inspect.getsource(test)) for test in named), name


# Coordinates -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "is_taken"), [(1.0, True), (1.01, False)])
def test_largest_coordinate_is_the_most_that_is_taken(share, is_taken):
    points, faces = zoo.octahedron()
    points = points / np.abs(points).max()
    vertices = share * LARGEST_COORDINATE * points
    if is_taken:
        distance = gc.exact_distance(gc.TriangleMesh(vertices, faces), 0).distances
        expected = gc.exact_distance(gc.TriangleMesh(points, faces), 0).distances
        np.testing.assert_allclose(distance / LARGEST_COORDINATE, expected, rtol=1e-14)
    else:
        with pytest.raises(gc.errors.InvalidMesh, match="at most"):
            gc.TriangleMesh(vertices, faces)


@pytest.mark.parametrize(("share", "is_taken"), [(1.01, True), (0.99, False)])
def test_shortest_edge_is_the_least_that_is_taken(share, is_taken):
    vertices = share * SHORTEST_EDGE * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    if is_taken:
        distance = gc.exact_distance(gc.TriangleMesh(vertices, [(0, 1, 2)]), 1).distances
        np.testing.assert_allclose(distance / vertices[1, 0], [1, 0, math.sqrt(2)], rtol=1e-14)
    else:
        with pytest.raises(gc.errors.InvalidMesh, match="shorter than"):
            gc.TriangleMesh(vertices, [(0, 1, 2)])


# Pinched faces -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "is_pinched"), [(0.99, True), (1.01, False)])
@SCALES
def test_no_area_is_an_angle_of_so_much(share, is_pinched, scale):
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, share * NO_AREA, 0), (0, -1, 0)]) * scale
    topology = topology_of(zoo.Case("needle", corners, np.array([(0, 1, 2), (0, 3, 1)])))
    flagged = topology.flags[topology.inner_vertex] & PINCHED != 0
    assert flagged.tolist() == [is_pinched] * 3 + [False]


@pytest.mark.parametrize("share", [0.99, 1.01])
@SCALES
def test_sharp_tips_end_what_winds_about_them(share, scale):
    """A square, as seen from the tip of a cone; just above the bound windows wind as said."""
    sides = 4
    tilt = math.acos(share * SHARP / sides / math.sqrt(2.0))
    vertices, faces, _, total = zoo.cone(sides, tilt)
    assert total == pytest.approx(share * SHARP, rel=1e-4)
    mesh = gc.TriangleMesh(vertices * scale, faces)
    assert ((mesh.topology.flags & PINCHED) != 0).all() == (share < 1)
    found = gc.exact_distance(mesh, 1)
    created = found.stats.windows_created
    assert created < 50 if share < 1 else created < 8 * sides * math.pi / SHARP
    np.testing.assert_allclose(found.distances[0], scale, rtol=1e-14)


# Polygons ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(("share", "is_told"), [(0.99, True), (1.01, False)])
def test_nearly_joined_is_a_share_of_the_height_of_both_vertices(share, is_told, scale):
    """Of each pair along two squares, one is the corner of a face 1/√2 high."""
    gap = share * NEARLY_JOINED * math.sqrt(0.5)
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    faces = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    both = scale * np.vstack([corners, corners + np.array([1.0 + gap, 0.0, 0.0])])
    told = gc.TriangleMesh(both, faces).report.near_vertices
    assert told.ids == (((1, 4), (2, 7)) if is_told else ())


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(("share", "is_told"), [(0.99, True), (1.01, False)])
def test_nearly_joined_is_a_share_of_the_height_of_an_edge(share, is_told, scale):
    """Half the height of its ends, for a vertex that is far higher."""
    edge = np.array([(0, 0, 0), (0, 1, 0), (1, 0.5, 0)])
    height = np.linalg.norm(np.cross(edge[1], edge[2])) / np.linalg.norm(edge[2])
    beside = share * NEARLY_JOINED * height / 2.0
    large = np.array([(-beside, 0.5, 0), (-9, 9, 0), (-9, -9, 0)])
    mesh = gc.TriangleMesh(scale * np.vstack([edge, large]), [(0, 2, 1), (3, 4, 5)])
    assert mesh.report.t_junctions.ids == ((3,) if is_told else ())


@pytest.mark.parametrize(("share", "is_told"), [(0.99, False), (1.01, True)])
def test_nearly_joined_is_a_share_of_an_edge_at_its_ends(share, is_told):
    """Nearer to an end, no vertex counts as on the edge."""
    edge = [(0, 0, 0), (0, 1, 0), (1, 0.5, 0)]
    other = [(0, share * NEARLY_JOINED, 0), (-1.0, 0.1, 0), (-1.0, 0.0, 0)]
    report = gc.TriangleMesh(edge + other, [(0, 2, 1), (3, 4, 5)]).report
    assert (3 in report.t_junctions.ids) == is_told


@pytest.mark.parametrize(("bulge", "is_kept"), [(0.1, False), (10.0, True)])
@SCALES
def test_fan_has_no_sliver_below_its_share(bulge, is_kept, scale):
    """A square whose bottom bends at its middle corner, by a triangle of so much of the share."""
    height = bulge * tolerances.FAN * 4
    square = [(0, 0), (1, -height), (2, 0), (2, 2), (0, 2)]
    points = np.insert(np.array(square, float) * scale, 2, 0.0, axis=1)
    faces, face_map = triangulated(points, np.arange(5), np.array([5]))
    assert ([0, 1, 2] in faces.tolist()) == is_kept
    assert face_map.tolist() == [0, 0, 0]


# Saddles ----------------------------------------------------------------------------------------


def saddle_of(excess: float, splits=0):
    """A zigzag cone whose total angle exceeds a full turn by as little; also its chart."""
    low, high = 0.0, 1.0
    for _ in range(200):
        tilt = (low + high) / 2
        *_, total = zoo.cone(8, tilt, zigzag=True)
        low, high = (tilt, high) if total < 2 * math.pi + excess else (low, tilt)
    return zoo.cone(8, tilt, zigzag=True, splits=splits)


@pytest.mark.parametrize(("share", "is_saddle"), [(0.5, False), (2.0, True)])
def test_saddle_excess_divides_saddles_from_flat_vertices(share, is_saddle):
    vertices, faces, _, _ = saddle_of(share * SADDLE_EXCESS)
    topology = gc.TriangleMesh(vertices, faces).topology
    assert bool(topology.flags[topology.inner_vertex[0]] & SADDLE) == is_saddle


@pytest.mark.jit
@pytest.mark.parametrize("share", [0.1, 0.9])
def test_saddle_excess_bounds_the_error_behind_a_flatter_saddle(share):
    vertices, faces, polar, total = saddle_of(share * SADDLE_EXCESS, splits=2)
    mesh = gc.TriangleMesh(vertices, faces)
    for source in range(1, 9):
        exact = closed_forms.cone(polar, source, total)
        found = gc.exact_distance(mesh, source).distances
        # The rim of the saddle is no circle: its vertices lie where they were computed, to 1e-16.
        np.testing.assert_allclose(found, exact, rtol=SADDLE_EXCESS, atol=0)


def test_sector_margin_is_all_that_a_shadow_is_widened_by():
    vertices, faces, _, total = zoo.cone(12, 0.8, zigzag=True, splits=1)
    shadow = total - 2 * math.pi
    topology = topology_of(zoo.Case("saddle", vertices, faces))
    assert lit_by(topology, 1, 0) == pytest.approx(
        shadow + 2 * SECTOR_MARGIN, abs=0.01 * SECTOR_MARGIN
    )


def lit_by(topology, source, vertex) -> float:
    """The angle into which a vertex emits windows."""
    lit, v = 0.0, topology.inner_vertex[vertex]
    for _, wave in steps(topology, started(topology, source)):
        windows = windows_of(wave)
        lit = max(lit, angles(windows.rows[windows.root == v]).sum())
    return lit


def angles(rows) -> np.ndarray:
    """The angle that each window takes up as seen from its pseudosource."""
    b0, b1, sx, sy = rows[:, [B0, B1, SX, SY]].T
    return np.arctan2(b1 - sx, -sy) - np.arctan2(b0 - sx, -sy)


# Windows on an edge -----------------------------------------------------------------------------


@pytest.mark.slow
@SCALES
@pytest.mark.parametrize(("share", "trimmed"), [(0.5, False), (2.0, True)])
def test_overlap_is_the_least_that_is_trimmed(scale, share, trimmed):
    assert is_trimmed(share * OVERLAP, 0.0, scale) == trimmed


@SCALES
@pytest.mark.parametrize(("share", "trimmed"), [(0.5, False), (2.0, True)])
def test_loose_overlap_is_the_least_that_is_trimmed_of_different_sigma(scale, share, trimmed):
    assert is_trimmed(share * LOOSE_OVERLAP, 1e-3, scale) == trimmed


def is_trimmed(overlap, difference, scale) -> bool:
    """Of two windows on an edge of length ``scale`` that overlap by a share of it."""
    view, wave, h = flat_view(scale)
    b, source = 0.5 * scale, scale * np.array([(0.1, -1.0, 0.0), (1.0, -1.0, difference)])
    left, right = (0.1 * scale, b + overlap * scale), (b, 0.9 * scale)
    put_list(view, wave, h, [(*left, *source[0]), (*right, *source[1])], 0)
    assert trim_list(view, h) == 2
    ends = wave.pool.scratch[0, B1], wave.pool.scratch[1, B0]
    return ends != (left[1], right[0])


@pytest.mark.parametrize("delta", [0.0, *np.geomspace(1e-18, 1e-3, 31)])
def test_double_root_leaves_the_bisector_its_digits(delta):
    """Whichever way it is found: on both sides of the bound."""
    s0, s1 = (0.1, -0.7), (1.2, -1.1)
    x = bisector(0.0, 2.0, *s0, 0.0, *s1, delta)
    lead = math.hypot(x - s1[0], s1[1]) + delta - math.hypot(x - s0[0], s0[1])
    assert abs(lead) <= 1e-16 / DOUBLE_ROOT
    straight = bisector(0.0, 2.0, *s0, 0.0, *s1, 0.0)
    assert abs(x - straight) <= 2 * delta + 1e-16 / DOUBLE_ROOT


@pytest.mark.parametrize("seed", range(20))
def test_half_ulp_and_false_position_steps_are_enough_for_any_bisector(seed):
    """Of a parallel window, too: the lead that is left is a few roundings of the distances."""
    x0, y0, x1, y1, angle, crossing = np.random.default_rng(seed).uniform(0.05, 1.0, 6)
    for s0 in (Source(x0, -y0, 1.0), Source(math.cos(angle), -math.sin(angle), 0.0)):
        s1 = Source(-x1, -y1, 1.0)
        delta = distance(crossing, *s0) - distance(crossing, *s1)
        ends = [distance(x, *s1) + delta - distance(x, *s0) for x in (0.0, 1.0)]
        if ends[0] * ends[1] < 0.0:
            x = bracketed(0.0, 1.0, s0, s1, delta)
            r0, r1 = distance(x, *s0), distance(x, *s1)
            assert abs(r1 + delta - r0) <= 8 * HALF_ULP * (abs(r0) + abs(r1) + abs(delta))


def test_false_position_steps_are_more_than_bisection_would_need():
    assert math.log2(1.0 / HALF_ULP) < FALSE_POSITION_STEPS


@pytest.mark.parametrize(("share", "is_gap"), [(0.5, False), (2.0, True)])
@SCALES
def test_diverging_is_the_least_angle_between_rays_that_leave_a_gap(share, is_gap, scale):
    left = (0.0, 0.5, 0.5 + share * DIVERGING, -1.0, 0.0, 1.0)
    right = (0.5, 1.0, 0.5, -1.0, 0.0, 1.0)
    both = (window(*(scale * x for x in values)) for values in (left, right))
    assert leaves_gap(*both) == is_gap


def test_single_precision_is_more_than_rounding_to_it():
    numbers = np.random.default_rng(0).uniform(1.0, 2.0, 10_000)
    assert (abs(numbers.astype(np.float32) - numbers) < 0.1 * SINGLE_PRECISION * numbers).all()


def flat_view(scale):
    """A flat mesh: its view, its wavefront, and an inner half-edge of length ``scale``."""
    points, faces = zoo.grid(3, 3)
    topology = topology_of(zoo.Case("flat", points * scale, faces))
    wave = started(topology, 0)
    lengths = topology.geometry[:, LENGTH]
    inner = (topology.links[:, OPPOSITE] >= 0) & (abs(lengths / scale - 1) < 1e-9)
    return view_of_arrays(topology, wave), wave, int(np.flatnonzero(inner)[0])


def put_list(view, wave, h, windows, root):
    slots = [put_window(view, window(*values, root=root)) for values in windows]
    wave.pool.lists[h, [SIZE, FIRST, LAST]] = len(slots), slots[0], slots[-1]
    for slot, after in zip(slots, [*slots[1:], -1], strict=True):
        wave.pool.windows.view(np.int32)[slot, NEXT] = after


@SCALES
@pytest.mark.parametrize(("share", "closed"), [(0.5, True), (2.0, False)])
def test_gap_is_the_most_that_is_closed(scale, share, closed):
    view, wave, h = flat_view(scale)
    b, gap = 0.5 * scale, share * GAP * scale
    source = (0.5 * scale, -scale, 0.0)
    put_list(view, wave, h, [(0.1 * scale, b, *source), (b + gap, 0.9 * scale, *source)], 0)
    assert trim_list(view, h) == 2
    assert (wave.pool.scratch[1, B0] == b) == closed
    assert wave.pool.scratch[1, B0] - b <= gap * (1 + 1e-3)
    # The ray through the closed gap is off by no more than the gap, and so is its length.
    here, there = (math.hypot(x - source[0], source[1]) for x in (b, b + gap))
    assert abs(here - there) <= gap


@SCALES
@pytest.mark.parametrize(("detour", "kept"), [(-1.0, True), (0.0, True), (0.5, True), (3.0, False)])
@pytest.mark.parametrize("from_tail", [True, False])
def test_slack_keeps_windows_that_tie_with_a_vertex(scale, detour, kept, from_tail):
    """At the far end of the window: against the path through the vertex and along the edge."""
    view, wave, h = flat_view(scale)
    length = view.mesh.geometry[ROW * h + LENGTH]
    tail, head = view.mesh.links[ROW * h + TAIL], view.mesh.links[ROW * h + HEAD]
    wave.vertices.distance[[tail, head]] = 1e6 * scale  # as good as unreached
    wave.vertices.distance[tail if from_tail else head] = scale
    b0, b1 = 0.25 * length, 0.75 * length
    far = b1 if from_tail else length - b0
    straight = (scale + far) + detour * SLACK * scale
    sy = -0.3 * scale
    reach = math.sqrt(straight**2 - sy**2)
    sx = b1 - reach if from_tail else b0 + reach
    put_list(view, wave, h, [(b0, b1, sx, sy, 0.0)], tail)
    assert trim_list(view, h) == kept


@pytest.mark.slow
@SCALES
def test_bend_is_all_that_a_bent_path_is_surcharged(scale):
    view, wave, h = flat_view(scale)
    row = view.mesh.geometry[ROW * h : ROW * (h + 1)]
    ax, ay = row[LENGTH_LEFT] * row[COS_LEFT], row[LENGTH_LEFT] * row[SIN_LEFT]
    apex = view.mesh.links[ROW * h + APEX]
    wave.vertices.distance[apex] = math.inf
    length = row[LENGTH]
    lies_right = ax < 0.5 * length
    b0, b1 = (0.6 * length, 0.8 * length) if lies_right else (0.2 * length, 0.4 * length)
    sx, sy = 0.5 * (b0 + b1), -0.2 * scale
    end = b0 if lies_right else b1
    wave.pool.scratch[0, [B0, B1, SX, SY, SIGMA]] = b0, b1, sx, sy, 0.0
    wave.pool.scratch.view(np.int32)[0, ROOT] = view.mesh.links[ROW * h + TAIL]
    nearest, crossing, _ = reach_apex(view, h, 1, ax, ay)
    bent = math.hypot(sx - end, sy) + math.hypot(ax - end, ay)
    assert (nearest, crossing) == (0, end)
    assert bent < wave.vertices.distance[apex] <= bent * (1 + 2 * BEND)
    assert wave.vertices.distance[apex] == pytest.approx(bent * (1 + BEND), rel=2e-16)


# Sources and paths ------------------------------------------------------------------------------


@SCALES
def test_tie_is_the_most_that_a_lower_source_may_be_farther(scale):
    for share, lower_wins in ((0.5, True), (-0.5, True), (2.0, False), (-2.0, True)):
        offered = scale * (1 + share * TIE)
        assert precedence(offered, 0, scale, 1) == lower_wins
        assert precedence(scale, 1, offered, 0) != lower_wins
    assert not precedence(scale, 0, scale, 0)
    assert precedence(scale, 7, math.inf, 0)


@pytest.mark.parametrize("seed", range(5))
def test_tie_covers_the_rounding_of_symmetric_meshes(seed):
    """Turned at random, a grid is symmetric but for rounding: its diagonal goes to source 0."""
    case = zoo.Case("grid", *zoo.grid(8, 8)).moved(zoo.rotation(seed), (3.0, 1.0, -2.0))
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    corners = [8, 72]
    field, mirrored = (gc.exact_distance(mesh, ends) for ends in (corners, corners[::-1]))
    diagonal = np.arange(0, 81, 10)
    assert (field.nearest_source[diagonal] == 0).all()
    assert (mirrored.nearest_source[diagonal] == 0).all()
    late = gc.exact_distance(mesh, [gc.Source(8, 8 * 10 * TIE), gc.Source(72)])
    assert (late.nearest_source[diagonal] == 1).all()


@SCALES
def test_on_path_is_the_longest_detour_through_a_vertex(scale):
    target, beside = 0, 1
    here, reach = 2.0 * scale, 0.5 * scale
    for share, taken in ((-1.0, True), (0.0, True), (0.5, True), (2.0, False)):
        distance = scale * np.array([3.0, 0.0])
        distance[beside] = here - reach + share * ON_PATH * distance[target]
        line = Line(0, distance[target], 1.0, 0.0)
        assert is_on_path(winners(distance), beside, reach, here, line) == taken
        assert not is_on_path(winners(distance, [0, 1]), beside, reach, here, line)


def test_on_path_never_leads_away_from_the_source():
    line = Line(0, 1.0, 1.0, 0.0)
    assert not is_on_path(winners(np.array([1.0, 1.0])), 1, 0.0, 1.0, line)


def winners(distance, nearest=(0, 0)) -> Winners:
    """Two vertices at these distances from these sources."""
    vertices = new_vertices(len(distance))._replace(distance=distance)
    found_there = found(vertices._asdict())
    return Winners(np.array(nearest, np.int32), found_there, NO_MERGES, NO_SITES, NO_END)


@SCALES
@pytest.mark.parametrize("sign", [1, -1])
def test_path_length_is_the_most_that_a_path_may_differ_from_its_field(scale, sign):
    points, faces = zoo.grid(5, 4)
    field = gc.exact_distance(gc.TriangleMesh(points * scale, faces), gc.Source(0, scale))
    last = field.mesh.topology.inner_vertex[-1]
    honest = float(field.distances[-1])
    field._result.distance[last] = honest * (1 + 0.5 * sign * PATH_LENGTH)
    assert field.path_to(len(points) - 1).length == pytest.approx(honest - scale, rel=1e-14)
    field._result.distance[last] = honest * (1 + 2.0 * sign * PATH_LENGTH)
    with pytest.raises(gc.errors.InternalError, match="the field says"):
        field.path_to(len(points) - 1)


@SCALES
def test_rounded_position_is_all_that_a_path_from_a_curve_may_be_off(scale):
    places = scale * np.array([[2.0, 0.0, 0.0], [1.0, 2.0, 2.0], [1.0, 1.0, 1.0], [0.0, 2.0, 2.0]])
    mesh = gc.TriangleMesh(places, [[0, 2, 3], [3, 1, 2]])  # vertex 2 lies on the edge of 0 and 3
    field, node = gc.exact_distance(mesh, gc.Curve([3, 0])), mesh.topology.inner_vertex[2]
    assert field.path_to(2).length <= ROUNDED_POSITION * mesh.diagonal
    field._result.distance[node] = 0.5 * ROUNDED_POSITION * mesh.diagonal
    field.path_to(2)
    field._result.distance[node] = 2.0 * ROUNDED_POSITION * mesh.diagonal
    with pytest.raises(gc.errors.InternalError, match="the field says"):
        field.path_to(2)


# Merging ----------------------------------------------------------------------------------------


def merging_view(relative_error, absolute_error=math.inf):
    points, faces = zoo.grid(3, 3)
    topology = topology_of(zoo.Case("flat", points, faces))
    bounds = merging_bounds(math.inf, relative_error, absolute_error)
    return view_of_arrays(topology, new_wavefront(topology, merges=True), bounds)


@pytest.mark.parametrize(("share", "merges"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("absolute", [True, False])
def test_local_share_is_all_that_one_merge_may_use_up(share, merges, absolute):
    error, nearest = 1e-3, 7.0
    allowed = error * nearest
    view = merging_view(0.5, allowed) if absolute else merging_view(error)
    own = share * LOCAL_SHARE * allowed
    assert accuracy(view, own, own, nearest) == merges
    assert accuracy(view, allowed, 0.0, nearest)
    assert not accuracy(view, 1.001 * allowed, 0.0, nearest)


@pytest.mark.parametrize("reach", [1e-9, 1.0, 1e9])
def test_grazing_is_the_least_angle_of_a_merged_pseudosource(reach):
    for share, taken in ((0.99, False), (1.01, True)):
        angle = math.asin(share * GRAZING)
        for along in (math.cos(angle), -math.cos(angle)):
            assert (directionality(along * reach, reach) > 0.0) == taken


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.filter_too_much])  # most cannot be merged
@given(
    st.floats(-2, 3), st.floats(-3, -0.01), st.floats(-2, 3), st.floats(-3, -0.01), st.floats(0, 1)
)
@pytest.mark.jit
def test_lower_bound_is_all_that_a_merged_window_rises_by(s0x, s0y, s1x, s1y, joint):
    b = 0.2 + 0.6 * joint
    # Both windows give the same distance where they meet
    gap = math.hypot(s0x - b, s0y) - math.hypot(s1x - b, s1y)
    sigma0, sigma1 = max(-gap, 0.0), max(gap, 0.0)
    first, second = (0.0, b, s0x, s0y, sigma0), (b, 1.0, s1x, s1y, sigma1)
    can, whole = merged(merging_view(0.5), window(*first), window(*second))
    assume(can)
    sx, sy, sigma, xi = whole.sx, whole.sy, whole.sigma, whole.xi
    assert sy < 0
    assert sigma >= 0
    for b0, b1, x, y, weight in (first, second):
        places = np.linspace(b0, b1, 101)
        before = np.hypot(places - x, y) + weight
        after = np.hypot(places - sx, sy) + sigma
        assert (after <= before * (1 + 100 * LOWER_BOUND)).all()
        assert (before - after <= xi + 1e-12).all()


@pytest.fixture
def worn_out(monkeypatch):
    """Every list of a merging sweep has used up its runs."""

    def new_worn_out_wavefront(*args, **kwargs):
        wave = new_wavefront(*args, **kwargs)
        wave.pool.runs[:] = RUNS
        return wave

    monkeypatch.setattr(state, "new_wavefront", new_worn_out_wavefront)


def test_runs_are_more_than_winding_about_a_tip_takes():
    """The sharpest tip without a crossing history: half as often again, and it can be counted."""
    topology = topology_of(zoo.Case("flat", *zoo.grid(2, 2)))
    counted = np.iinfo(new_wavefront(topology, merges=True).pool.runs.dtype).max
    assert 1.5 * 2 * math.pi / SHARP < RUNS < counted


@pytest.mark.parametrize("left", [0, 100])
def test_most_runs_are_what_a_list_may_come_up(monkeypatch, left):
    """Far more than about the sharpest tip; else the sweep ends, and names a face."""
    mesh = gc.samples.knot(500)
    assert 10 * 2 * math.pi / SHARP < MOST_RUNS < np.iinfo(np.uint16).max
    expected = gc.exact_distance(mesh, 3).distances

    def new_used_wavefront(*args, **kwargs):
        wave = new_wavefront(*args, **kwargs)
        wave.pool.runs[:] = MOST_RUNS - left
        return wave

    monkeypatch.setattr(state, "new_wavefront", new_used_wavefront)
    if left:
        assert gc.exact_distance(mesh, 3).distances.tobytes() == expected.tobytes()
    else:
        with pytest.raises(gc.errors.InternalError, match=r"circles through face \d+; .*fast_dist"):
            gc.exact_distance(mesh, 3)


@pytest.mark.jit
@pytest.mark.parametrize(("most", "ends"), [(0, False), (12, True), (MOST_CROSSINGS, True)])
def test_most_crossings_are_more_than_a_fast_sweep_needs(monkeypatch, most, ends):
    mesh = gc.samples.sphere(20480)
    monkeypatch.setattr(fast_sweep, "MOST_CROSSINGS", most)
    if ends:
        assert np.isfinite(gc.fast_distance(mesh, 0, effort=8).distances).all()
    else:
        with pytest.raises(gc.errors.InternalError, match="exact_distance"):
            gc.fast_distance(mesh, 0, effort=8)


def is_rough(saddles: int, excess: float, vertices: int = 2 * ROUGH_VERTICES) -> bool:
    """Whether a flat mesh counts as rough when some of its vertices have so much excess."""
    mesh = gc.samples.plane(8)
    angles = np.full(vertices, 2 * math.pi)
    angles[:saddles] += excess
    vars(mesh)["topology"] = mesh.topology._replace(total_angle=angles)
    return mesh.is_rough


@pytest.mark.parametrize(("excess", "expected"), [(0.99, False), (1.01, True)])
def test_sharp_saddle_is_the_least_excess_that_makes_a_mesh_rough(excess, expected):
    assert is_rough(2 * ROUGH_VERTICES, excess * SHARP_SADDLE) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.99, False), (1.01, True)])
def test_rough_is_the_least_share_of_sharp_saddles(share, expected):
    assert is_rough(round(share * ROUGH * 2 * ROUGH_VERTICES), 1.0) == expected


@pytest.mark.parametrize(("vertices", "expected"), [(-1, False), (0, True)])
def test_rough_vertices_are_the_fewest_of_a_rough_mesh(vertices, expected):
    count = ROUGH_VERTICES + vertices
    assert is_rough(count, 1.0, count) == expected


@pytest.mark.usefixtures("worn_out")
def test_a_sweep_whose_runs_are_used_up_begins_anew_exactly():
    """With all that was asked for: paths, windows, targets, curves; progress does not go back."""
    mesh = gc.samples.knot(500)
    sources = [3, gc.SurfacePoint.face(50, (0.2, 0.3, 0.5)), gc.Curve(mesh.faces[100, :2].tolist())]
    target = gc.SurfacePoint.face(200, (0.5, 0.25, 0.25))
    shares = []
    found = gc.approximate_distance(
        mesh, sources, 1e-3, targets=[target], retain="windows", progress=shares.append
    )
    exact = gc.exact_distance(mesh, sources, targets=[target], retain="windows")
    assert shares == sorted(shares)
    assert found.distances.tobytes() == exact.distances.tobytes()
    assert found.nearest_source.tobytes() == exact.nearest_source.tobytes()
    assert found.distance_at(target) == exact.distance_at(target)
    for end in (target, 17, 200):
        path, expected = found.path_to(end), exact.path_to(end)
        np.testing.assert_array_equal(path.points, expected.points)
        assert path.error_bound.value < 1e-12
    levels = exact.levels(3)
    for lines, others in zip(found.isolines(levels), exact.isolines(levels), strict=True):
        for line, other in zip(lines, others, strict=True):
            np.testing.assert_array_equal(line.points, other.points)


@pytest.mark.jit
@pytest.mark.usefixtures("worn_out")
def test_searches_whose_runs_are_used_up_find_the_shortest_path():
    mesh = gc.samples.knot(500)
    exact = gc.exact_distance(mesh, 3)
    solver = gc.Solver(mesh)
    for target in [*range(10, 250, 24), 10]:
        assert solver.shortest_path(3, target).length == pytest.approx(
            exact.distances[target], rel=1e-12
        )
    landmarks = Landmarks(mesh)
    landmarks.add(0, Control())
    stored = landmarks.distances[:, 0]
    place = int(mesh.topology.outer_vertex[stored.argmin()])
    expected = gc.exact_distance(mesh, place).distances[mesh.topology.outer_vertex]
    np.testing.assert_allclose(stored, expected, rtol=1e-7)


@pytest.mark.jit
def test_widest_error_is_the_most_that_is_used():
    mesh = gc.samples.knot(2000)
    widest = gc.approximate_distance(mesh, 0, WIDEST_ERROR)
    for error in (2 * WIDEST_ERROR, 0.5):
        field = gc.approximate_distance(mesh, 0, error)
        assert (field.distances == widest.distances).all()
        assert field.error_bound == widest.error_bound
    narrower = gc.approximate_distance(mesh, 0, WIDEST_ERROR / 2)
    assert (narrower.distances != widest.distances).any()


# Fast sweeps -------------------------------------------------------------------------------------


@kernel
def offer_to(topology, front, bounds, h, length, offered):
    """Offer a window to a half-edge that nothing has left by."""
    offer(view_of(topology, front, bounds), h, -1, length, offered)


def waiting(offers: int, sigma: float) -> int:
    """How many of some equal windows wait; they win no place, and all else known is 10.2 there."""
    square = gc.samples.plane(2)
    topology = topology_of(zoo.Case("square", square.vertices, square.faces))
    front = fast_state.new_wavefront(topology, NO_SITES, 1, 1.0, 0)
    front.vertices.distance[:], front.places.values[:] = 10.0, 10.0
    bounds = fast_state.fast_bounds(exact_bounds(math.inf))
    for _ in range(offers):
        offer_to(topology, front, bounds, 0, 1.0, window(0.1, 0.3, 0.2, 0.0, sigma))
    return int(front.counters[CREATED])


@kernel
def push_to(topology, front, bounds, h, pushed, key):
    """Have a window wait to cross a half-edge."""
    push(view_of(topology, front, bounds), h, pushed, 1, key)


def test_last_bucket_is_that_of_all_windows_beyond():
    topology = topology_of(zoo.SMALL["crags"])
    front = fast_state.new_wavefront(topology, NO_SITES, 1, 1.0, 0)
    bounds = fast_state.fast_bounds(exact_bounds(math.inf))
    keys = np.array([0.5, 1.0, 2.0, 1e30]) * LAST_BUCKET
    for key in keys:
        push_to(topology, front, bounds, 0, window(0.0, 1.0, 0.0, 0.0, key), key)
    due = front.pool.windows[: front.counters[FRESH], BUCKET]
    np.testing.assert_array_equal(due, np.minimum(keys, LAST_BUCKET))
    assert front.counters[FAR_BUCKET] == 0.5 * LAST_BUCKET


@pytest.mark.parametrize(("share", "goes_on"), [(1.001, True), (0.999, False)])
def test_far_nearer_lets_a_window_go_on_without_a_place(share, goes_on):
    assert waiting(1, 10.2 / (FAR_NEARER * share)) == goes_on


def test_most_at_large_bounds_the_windows_without_a_place():
    assert waiting(MOST_AT_LARGE + 3, 9.9) == MOST_AT_LARGE


# Searches between two points --------------------------------------------------------------------


@pytest.mark.slow
@SCALES
@pytest.mark.parametrize(("share", "passes"), [(0.5, False), (2.0, True)])
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_straight_is_the_least_turn_that_is_taken_out(scale, share, passes, side):
    """A string bends around the middle of a flat kite, whose other side is a little shorter."""
    turn = share * STRAIGHT
    rise = math.tan(turn / 2) * (-1 if side == RIGHT else 1)
    points = np.array([(-1, 0, 0), (0, rise, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0)]) * scale
    mesh = gc.TriangleMesh(points, [(0, 1, 3), (1, 2, 3), (1, 0, 4), (2, 1, 4)])
    path = mesh.topology.inner_vertex[[0, 1, 2]].astype(np.int32)
    length = shortened_part(mesh.topology, path, np.array([NEITHER, side, NEITHER], np.int8))
    bent = 2.0 * math.hypot(1.0, rise)
    assert length == pytest.approx((2.0 if passes else bent) * scale, rel=1e-14)
    assert bent > 2.0 * (1 + 1e-13), "else the two could not be told apart"


@pytest.mark.jit
@zoo.each(MERGING)
def test_landmark_error_is_all_that_landmarks_fall_short(case):
    """Their bounds make up for it; taken as exact, their distances would bound too much."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    topology = mesh.topology
    landmarks = Landmarks(mesh)
    landmarks.add(0, Control())
    stored = landmarks.distances[:, 0].astype(float)
    place = int(topology.outer_vertex[stored.argmin()])
    exact = gc.exact_distance(mesh, place).distances[topology.outer_vertex]
    assert (stored <= exact * (1 + 1e-7)).all()
    assert (stored >= exact * (1 - LANDMARK_ERROR) * (1 - 1e-7)).all()
    assert (stored < exact * (1 - 0.01 * LANDMARK_ERROR)).any(), "else nothing was merged"
    naive = 0.0
    for start in spread(case, 6):
        goal = goal_at_vertex(mesh, start, landmarks=landmarks)
        view = view_of_arrays(
            topology, new_wavefront(topology, pruned=True), exact_bounds(math.inf, goal)
        )
        distances = gc.exact_distance(mesh, int(topology.outer_vertex[start])).distances
        distances = distances[topology.outer_vertex]
        bounds = np.array([least_to_start(view, v, 0.0) for v in range(len(distances))])
        assert (bounds <= distances * (1 + 1e-12)).all()
        naive = max(naive, (np.abs(stored - stored[start]) - distances).max())
    assert naive > 0


def sought(mesh, source, target, exact, limit) -> float:
    """The distance that an exact sweep finds within a limit, bounded by exact distances itself."""
    topology = mesh.topology
    start, end = (int(topology.inner_vertex[v]) for v in (source, target))
    goal = goal_at_vertex(mesh, start, limit, known=exact[topology.outer_vertex])
    bounds = exact_bounds(math.inf, goal)
    wave = new_wavefront(topology, pruned=True)
    continuous_dijkstra.start_sweep(
        topology, wave, np.array([start], np.int32), np.zeros(1, np.int32), np.zeros(1), bounds
    )
    wave, _ = run_sweep(mesh, wave, bounds, Control(), lambda _: 0.0)
    return float(wave.vertices.distance[end])


SEARCHED = {
    name: zoo.SMALL[name]
    for name in ("crags_with_holes", "crumpled_torus", "bow_tie_of_fans", "obstacles", "box_1x2x3")
} | {name: zoo.KNOWN[name] for name in ("flat", "cone_ruffle", "prism_slivers", "caps")}


@pytest.mark.jit
@zoo.each(SEARCHED)
def test_search_slack_keeps_the_path_itself(case):
    """Under the tightest bounds there can be: no rounding prunes it, and anything less would."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for target in spread(case, 6):
        exact = gc.exact_distance(mesh, target).distances
        for source in spread(case, 9):
            if source == target:
                continue
            distance = exact[source]
            found = sought(mesh, source, target, exact, distance * (1 + SEARCH_SLACK))
            assert found == pytest.approx(distance, rel=0.1 * SEARCH_SLACK)
            lost = sought(mesh, source, target, exact, distance * (1 - SEARCH_SLACK))
            assert not lost <= distance * (1 - 0.1 * SEARCH_SLACK)


# Points -----------------------------------------------------------------------------------------


@SCALES
@pytest.mark.parametrize(("share", "is_found"), [(0.9, True), (1.1, False)])
def test_at_limit_is_how_much_longer_a_path_to_a_point_may_be(scale, share, is_found):
    mesh = gc.TriangleMesh(np.eye(3)[[0, 0, 1]] * scale * [[0], [1], [1]], [[0, 1, 2]])
    middle = gc.SurfacePoint.edge(0, 0, 0.5)
    limit = 0.5 * scale / (1.0 + share * AT_LIMIT)
    found = gc.distance_matrix(mesh, [0], [middle], limit, "pairs")
    assert np.isfinite(found).tolist() == [is_found]
    if is_found:
        assert gc.shortest_path(mesh, 0, middle, max_distance=limit).length == 0.5 * scale
    else:
        with pytest.raises(gc.errors.NoPath):
            gc.shortest_path(mesh, 0, middle, max_distance=limit)


@SCALES
def test_flat_faces_send_light_from_their_middle(scale):
    """Round the middle vertex of a face of no area, and on over its longest edge."""
    vertices = [(-1, 1, 0), (-1, 0, 0), (0, 0, 0), (0, 1, 0), (0, 2, 0), (1, 3, 0), (1, 2, 0)]
    faces = [(3, 0, 1), (3, 1, 2), (4, 3, 2), (4, 2, 5), (2, 6, 5)]
    field = gc.exact_distance(gc.TriangleMesh(scale * np.array(vertices, float), faces), 0)
    assert field.distances[6] == pytest.approx(scale * (1 + math.sqrt(2)), rel=10 * FLAT)


@SCALES
@pytest.mark.parametrize("name", ["book_of_5", "complex_1", "complex_4", "moebius"])
@pytest.mark.jit
def test_same_place_tells_the_face_that_a_path_came_from(name, scale):
    """Rounding stays below it, and what lies elsewhere above: every path has its distance."""
    case = zoo.IRREGULAR[name].moved(scale * zoo.rotation(5), scale * np.array((1.0, -2.0, 3.0)))
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in spread(case, 7):
        field = gc.exact_distance(mesh, source)
        for target in np.flatnonzero(np.isfinite(field.distances)).tolist():
            path = field.path_to(target)
            check_path(mesh, path, source, target, field.distances[target])
            assert path.length == pytest.approx(field.distances[target], rel=SAME_PLACE, abs=0)


def test_behind_ends_beyond_the_segment_and_before_the_other_front():
    far, bands = 0.25, np.zeros((2, REGION))
    put_segment_bands(bands, 0.0, 0.0, 1.0, 0.0, far)
    assert 1 < BEHIND < 2
    for band, side in zip(bands, (1, -1), strict=True):
        for y, is_inside in ((-far, 1), (0, 1), ((BEHIND - 1) * far, 0), (far, -1)):
            point = 0.5, side * y, 1.0, 0.0
            lo, hi = span_on_line(band, 0.0, *point, -0.1, 0.1)
            assert lo <= hi if is_inside >= 0 else lo > hi


@pytest.mark.parametrize("name", ["crags_with_holes", "crumpled_torus"])
def test_astar_weight_is_all_that_a_path_along_edges_is_longer_by(name):
    case = zoo.SMALL[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for start, end, _, length in edge_paths(mesh, random_pairs(mesh, 10)):
        shortest = graph.edge_distances(case.vertices, case.faces, start)[end]
        assert shortest * (1 - 1e-12) <= length <= ASTAR_WEIGHT * shortest * (1 + 1e-12)


@pytest.mark.skipif(not WITHOUT_JIT, reason="compiled kernels cannot be watched")
def test_passes_are_far_more_than_a_strip_takes(monkeypatch):
    passes = []

    def counted(*arguments):
        passes.append(1)
        return pull_taut(*arguments)

    monkeypatch.setattr(funnel, "pull_taut", counted)
    case = zoo.KNOWN["caps"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for _, _, path, _ in edge_paths(mesh, random_pairs(mesh, 10)):
        passes.clear()
        funnel.shortened(mesh.topology, path)
        assert len(passes) < PASSES / 4


def strip_with_fins(count) -> gc.TriangleMesh:
    """A strip of squares, with a third face on each edge between two of them."""
    points, faces = zoo.grid(count, 1)
    x = np.arange(1.0, count)
    tips = np.stack([x, np.full_like(x, 0.5), np.ones_like(x)], axis=1)
    fins = [(i, len(points) + i - 1, count + 1 + i) for i in range(1, count)]
    return gc.TriangleMesh(np.vstack([points, tips]), [*np.asarray(faces).tolist(), *fins])


@pytest.mark.jit
def test_forks_are_enough_for_a_line_over_that_many_seams():
    mesh = strip_with_fins(FORKS)
    for source in (0, FORKS + 1):
        field = gc.exact_distance(mesh, source)
        target = 2 * FORKS + 1 if source == 0 else FORKS
        assert field.distances[target] == pytest.approx(math.hypot(FORKS, 1), rel=1e-12)
        check_path(mesh, field.path_to(target), source, target, field.distances[target])


def test_tries_end_a_line_that_leads_nowhere():
    """Its distance is claimed to be 0, so that each face is too far: all are tried in vain."""
    count = TRIES // 4
    mesh, target = strip_with_fins(count), 2 * count + 1
    field = gc.exact_distance(mesh, 0)
    winners, v = field._points.winners.get(Control()), int(mesh.topology.inner_vertex[target])
    winners.vertices.distance[v] = 0.0
    with pytest.raises(gc.errors.InternalError, match="left the surface"):
        field.path_to(target)


@pytest.fixture
def cube() -> gc.TriangleMesh:
    case = zoo.SMALL["cube"]
    return gc.TriangleMesh(case.vertices, case.faces)


def carrier(mesh, point) -> int:
    """Of how many corners a point is made."""
    return sum(weight > 0 for weight in mesh.point(point).barycentric)


@pytest.mark.parametrize(("share", "corners"), [(0.9, 2), (1.1, 3)])
def test_weight_divides_what_is_on_an_edge_from_what_is_inside(cube, share, corners):
    small = share * WEIGHT
    point = gc.SurfacePoint.face(1, (0.5 - small, small, 0.5))
    assert carrier(cube, point) == corners


@pytest.mark.parametrize(("share", "is_taken"), [(0.9, True), (1.1, False)])
def test_weight_error_is_how_far_weights_may_be_off(cube, share, is_taken):
    off = share * WEIGHT_ERROR
    for weights in ((0.5, 0.5 + off, -off), (0.5, 0.3, 0.2 + off), (0.5, 0.3, 0.2 - off)):
        if is_taken:
            cube.point(gc.SurfacePoint.face(1, weights))
        else:
            with pytest.raises(gc.errors.InvalidPoint, match="weights"):
                cube.point(gc.SurfacePoint.face(1, weights))


def test_edge_steps_tell_points_on_an_edge_apart(cube):
    step = 1 / EDGE_STEPS
    at = lambda t: cube.point(gc.SurfacePoint.edge(0, 0, t))  # noqa: E731
    assert at(0.25) == at(0.25 + 0.4 * step) == at(0.25 - 0.4 * step)
    assert at(0.25) != at(0.25 + 0.6 * step)
    assert at(0.4 * step) == at(0.0)
    assert at(0.4 * step).vertex_index is not None
    assert at(1.2 * step).vertex_index is None


@SCALES
@pytest.mark.parametrize(("share", "snaps"), [(0.5, True), (3.0, False)])
def test_snap_is_how_near_a_position_must_be(scale, share, snaps):
    case = zoo.SMALL["cube"]
    mesh = gc.TriangleMesh(scale * case.vertices, case.faces)
    a, b, c = mesh.vertices[mesh.faces[0]]
    away = share * SNAP * mesh.diagonal
    inward = away * (c - 0.5 * (a + b)) / np.linalg.norm(c - 0.5 * (a + b))
    assert carrier(mesh, mesh.locate(0.6 * a + 0.4 * b + inward)) == (2 if snaps else 3)
    along = away * (b - a) / np.linalg.norm(b - a)
    assert carrier(mesh, mesh.locate(a + along)) == (1 if snaps else 2)


@SCALES
@pytest.mark.parametrize(("share", "snaps"), [(0.5, True), (3.0, False)])
def test_rounded_coordinate_is_how_near_a_position_far_from_zero_must_be(scale, share, snaps):
    mesh = gc.TriangleMesh(scale * (np.eye(3)[[2, 0, 1]] + 5e6), [[0, 1, 2]])
    a, b, c = mesh.vertices
    away = share * ROUNDED_COORDINATE * np.abs(mesh.vertices).max()
    inward = away * (c - 0.5 * (a + b)) / np.linalg.norm(c - 0.5 * (a + b))
    assert carrier(mesh, mesh.locate(0.5 * a + 0.5 * b + inward)) == (2 if snaps else 3)
    along = away * (b - a) / np.linalg.norm(b - a)
    assert carrier(mesh, mesh.locate(a + along)) == (1 if snaps else 2)


@SCALES
@pytest.mark.parametrize(("slope", "strips"), [(0.5, 2), (2.0, 3)])
def test_slant_is_the_flattest_ray_that_a_piece_sends_over_an_edge(scale, slope, strips):
    """A piece that stands on the edge between two cells; those above are always lit by it."""
    points, faces = zoo.grid(2, 2)
    mesh = gc.TriangleMesh(points * scale, faces)
    foot, head = (
        scale * np.array(place) for place in ((0.5, 1, 0), (0.5 + slope * SLANT * 0.2, 1.2, 0))
    )
    line = tuple(mesh.locate(place) for place in (foot, head))
    nodes = nodes_of(mesh, [line], [], gc.Control())
    wave = new_wavefront(mesh.topology, nodes.sites)
    bounds = with_parallel_windows(exact_bounds(math.inf), int(nodes.sources[-1]))
    continuous_dijkstra.start_sweep(
        mesh.topology, wave, nodes.sources, nodes.source_indices, np.zeros(1), bounds
    )
    roots = wave.pool.windows[: wave.counters[FRESH]].view(np.int32)[:, ROOT]
    assert (roots == nodes.sources[-1]).sum() == strips
    found = gc.exact_distance(mesh, gc.Curve(line)).distances
    share = np.clip((mesh.vertices - foot) @ (head - foot) / ((head - foot) @ (head - foot)), 0, 1)
    expected = np.linalg.norm(foot + share[:, None] * (head - foot) - mesh.vertices, axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=0)


@pytest.mark.slow
@SCALES
@pytest.mark.parametrize("share", [-3.0, -0.5, 0.5, 3.0])
def test_level_is_how_near_two_circles_count_as_one(scale, share):
    """Of circles that are one the first counts; of others, around one point, the larger."""
    mesh = gc.TriangleMesh(scale * zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    discs, level = np.zeros((2, REGION)), 0.1 * scale
    for disc, radius in zip(discs, (level, level * (1.0 + share * tolerances.LEVEL)), strict=True):
        put_disc(disc, 0.3 * scale, 0.01 * scale, radius)
    arcs = outer_arcs(mesh.topology, 0, discs, level, 0.0)
    assert set(arcs[:, RADIUS]) == {discs[1 if share > 1.0 else 0, RADIUS]}


@pytest.mark.parametrize(("share", "left"), [(0.9, 1), (1.1, 2)])
def test_crossing_is_the_gap_between_stretches_that_are_one(share, left):
    gap = share * tolerances.CROSSING
    assert united(np.array([[0.5 + gap, 0.75], [0.25, 0.5]]), tolerances.CROSSING) == left


@pytest.mark.parametrize(("radius", "lines"), [(0.1, 0), (3.0, 1)])
def test_piece_is_the_length_of_what_is_left_out(radius, lines):
    mesh = gc.TriangleMesh(zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    source = gc.Source(gc.SurfacePoint.face(0, (0.3, 0.3, 0.4)), 1.0)
    field = gc.exact_distance(mesh, source)
    assert len(field.isolines([1.0 + radius * tolerances.PIECE])[0]) == lines


def test_cut_off_is_how_far_lines_stay_below_the_limit():
    """On a square, from both of its lower corners."""
    limit, mesh = 0.8, gc.samples.plane(200)
    left, right = mesh.vertices[[0, 10]]
    field = gc.exact_distance(mesh, [0, 10], max_distance=limit)
    (line,), (border,) = field.isolines([limit])[0], field.borders()
    for points in (line.points, border.points[np.argmax(border.points[:, 1])][None]):
        ways = np.minimum(*(np.linalg.norm(points - corner, axis=1) for corner in (left, right)))
        np.testing.assert_allclose(1.0 - ways / limit, tolerances.CUT_OFF, rtol=1e-3)


@pytest.mark.parametrize(("share", "is_told"), [(0.99, False), (1.01, True)])
def test_parallel_is_the_angle_of_rays_that_meet_in_no_corner(share, is_told):
    """Of two windows whose inner rays meet at such an angle; one is nearer by far."""
    mesh = gc.TriangleMesh(zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    windows = np.zeros((2, REGION))
    for region, x, radius, slopes in zip(
        windows, (0.3, 0.7), (9.0, 1.0), ((0.5, 0.0), (-share * tolerances.PARALLEL, -0.5)),
        strict=True,
    ):  # fmt: skip
        put_disc(region, x, -1.0, radius)
        put_origin(region, 0, 0)
        for end, slope in enumerate(slopes):
            length = math.hypot(slope, 1.0)
            put_side(region, end, -1.0 / length, slope / length, 0.0)
    assert is_one_sided(mesh.topology.geometry, 0, *windows, 1e-12) == is_told


@SCALES
@pytest.mark.parametrize(("share", "is_taken"), [(0.99, False), (1.01, True)])
def test_finest_chord_is_the_least_chord_error(scale, share, is_taken):
    mesh = gc.TriangleMesh(scale * zoo.SMALL["cube"].vertices, zoo.SMALL["cube"].faces)
    chord_error = share * tolerances.FINEST_CHORD * mesh.diagonal
    if is_taken:
        assert gc.resolve_chord_error(mesh, chord_error) == chord_error
    else:
        with pytest.raises(gc.errors.InvalidArgument, match="chord_error"):
            gc.resolve_chord_error(mesh, chord_error)


def test_rounded_sum_is_how_far_weights_stay_as_they_are(cube):
    for excess, stays in ((0.9, True), (-0.9, True), (5.0, False), (-5.0, False)):
        weights = (0.25, 0.25, 0.5 + excess * tolerances.ROUNDED_SUM)
        point = cube.point(gc.SurfacePoint.face(0, weights))
        assert (point.barycentric == weights) == stays
        assert cube.point(point) == point

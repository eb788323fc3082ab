"""A path along edges, shortened: never below the distance, never above what it was."""

import itertools
import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL
from geodesic_core.kernels.paths import funnel
from geodesic_core.kernels.paths.funnel import (
    LEFT,
    RIGHT,
    Strip,
    around_vertex,
    pull_taut,
    shortened,
    straightened,
    strip_along,
)
from geodesic_core.tolerances import MOST_PASSES, PASSES, STALLS, STRAIGHT, TAUT
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.oracles import visibility
from tests.support.searches import edge_paths, random_pairs

ROUNDING = 1e-9
"""Relative: strips of slivers are unfolded face after face."""


def check_shortened(mesh, pairs):
    """Return by what share the shortened paths exceed the distances, in the mean."""
    excess = []
    for start, end, path, length in edge_paths(mesh, sorted(pairs)):
        distance = gc.exact_distance(mesh, start).distances[end]
        found = shortened(mesh.topology, path)
        assert distance * (1 - ROUNDING) <= found <= length * (1 + ROUNDING)
        if start != end:
            excess.append(found / distance - 1)
    return np.mean(excess)


@zoo.each(zoo.SMALL)
def test_between_the_distance_and_the_path_along_edges(case):
    mesh = mesh_of(case)
    check_shortened(mesh, random_pairs(mesh, 6 if WITHOUT_JIT else 60))


@pytest.mark.slow
@pytest.mark.slice(3)
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_the_same_on_larger_meshes_and_slivers(case):
    mesh = mesh_of(case)
    check_shortened(mesh, random_pairs(mesh, 300))


@pytest.mark.slow
@pytest.mark.jit
def test_mostly_it_is_the_distance_already():
    """Smooth or not: far below the paths along edges, which are 4 to 12 % too long."""
    points, faces = zoo.icosphere(4)
    for vertices in (points, zoo.crumpled(points, 0.02, seed=3)):
        mesh = gc.TriangleMesh(vertices, faces)
        assert check_shortened(mesh, random_pairs(mesh, 60)) < 2e-3


@pytest.mark.jit
@pytest.mark.parametrize("name", ["strip", "flat_grid", "jittered_grid", "comb"])
def test_straight_where_there_is_one_way_only(name):
    """In a plane without holes, what cannot be shortened is shortest."""
    case = zoo.SMALL[name]
    mesh = mesh_of(case)
    pairs = random_pairs(mesh, 8 if WITHOUT_JIT else 100)
    for start, end, path, _ in edge_paths(mesh, pairs):
        distance = gc.exact_distance(mesh, start).distances[end]
        assert shortened(mesh.topology, path) == pytest.approx(distance, rel=1e-12, abs=0)


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize("name", ["annulus", "pinched_holes"])
def test_never_through_a_hole(name):
    case = zoo.SMALL[name]
    mesh = mesh_of(case)
    matrix = visibility.distance_matrix(case.vertices[:, :2], case.faces)
    pairs = random_pairs(mesh, 100)
    for start, end, path, _ in edge_paths(mesh, pairs):
        assert shortened(mesh.topology, path) >= matrix[start, end] * (1 - 1e-12)


def test_a_path_of_one_vertex_or_one_edge():
    mesh = mesh_of(zoo.SMALL["crags"])
    inner = mesh.topology.inner_vertex
    assert shortened(mesh.topology, inner[[7]].astype(np.int32)) == 0
    a, b = mesh.faces[5, :2].tolist()
    edge = float(np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]))
    assert shortened(mesh.topology, inner[[a, b]].astype(np.int32)) == pytest.approx(
        edge, rel=1e-15
    )


# Sides of a vertex ------------------------------------------------------------------------------


def kite(rise=0.0):
    """Two triangles above and two below, around vertex 1 between 0 and 2; its height."""
    points = np.array([(-1, 0, 0), (0, rise, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0)], dtype=float)
    return gc.TriangleMesh(points, [(0, 1, 3), (1, 2, 3), (1, 0, 4), (2, 1, 4)])


def inner(mesh, vertices):
    return mesh.topology.inner_vertex[list(vertices)].astype(np.int32)


def line_along(mesh, vertices):
    """Faces and weights of segments between neighbours, in an order that kernels take."""
    faces, starts, ends = [], [], []
    for v, u in itertools.pairwise(inner(mesh, vertices).tolist()):
        each = enumerate(mesh.topology.links[:, TAIL].reshape(-1, 3).tolist())
        face, corners = next(pair for pair in each if v in pair[1] and u in pair[1])
        faces.append(face)
        starts.append(np.eye(3)[corners.index(v)])
        ends.append(np.eye(3)[corners.index(u)])
    return np.array(faces), np.array(starts), np.array(ends)


def strip_beside(mesh, side):
    """The strip of a kite from vertex 0 to 2, which has vertex 1 on a side."""
    (v,) = inner(mesh, (1,)).tolist()
    first, last = (next(f for f in (2, 3, 0, 1) if holds(mesh, f, u)) for u in (0, 2))
    portals = np.empty(4, np.int32)
    corners = mesh.topology.links[3 * first : 3 * first + 3, TAIL].tolist()
    count = around_vertex(mesh.topology.links, first, corners.index(v), last, side, portals, 0)
    weights = np.array([weights_of(mesh, first, 0), weights_of(mesh, last, 2)])
    return Strip(portals[:count], np.array([first, last]), weights), v


def holds(mesh, face, vertex):
    return weights_of(mesh, face, vertex).any()


def weights_of(mesh, face, vertex):
    corners = mesh.topology.links[3 * face : 3 * face + 3, TAIL]
    return (corners == mesh.topology.inner_vertex[vertex]).astype(float)


def sides_of(mesh, strip, v):
    """The sides of a strip on which a vertex is."""
    links = mesh.topology.links[strip.portals]
    return {side for side, end in ((LEFT, TAIL), (RIGHT, HEAD)) if (links[:, end] == v).any()}


@pytest.mark.slow
@pytest.mark.parametrize("rise", [0.2, -0.2])
@pytest.mark.parametrize("turned", [False, True])
def test_the_side_of_the_lesser_angle(rise, turned):
    """Along x, up is on the left: a strip below the vertex has it on its left."""
    mesh = kite(rise)
    vertices = (2, 1, 0) if turned else (0, 1, 2)
    strip, end = strip_along(mesh.topology, *line_along(mesh, vertices), 0)
    (v,) = inner(mesh, (1,)).tolist()
    assert end == 2
    assert sides_of(mesh, strip, v) == {LEFT if (rise > 0) != turned else RIGHT}
    assert shortened(mesh.topology, inner(mesh, vertices)) == pytest.approx(2, rel=1e-15)


@pytest.mark.parametrize("above", [True, False])
def test_no_side_that_is_open(above):
    """At the rim, the other way around the vertex is no way."""
    points = np.array([(-1, 0, 0), (0, 0.2, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0)], dtype=float)
    faces = [(0, 1, 3), (1, 2, 3)] if above else [(1, 0, 4), (2, 1, 4)]
    mesh = gc.TriangleMesh(points, faces)
    along = 2 * math.hypot(1, 0.2) if above else 2.0
    assert shortened(mesh.topology, inner(mesh, (0, 1, 2))) == pytest.approx(along, rel=1e-15)


def test_a_vertex_with_holes_on_both_sides_stays():
    case = zoo.SMALL["bow_tie"]
    mesh = mesh_of(case)
    assert strip_along(mesh.topology, *line_along(mesh, (1, 0, 7)), 0)[1] == 1
    lengths = np.linalg.norm(mesh.vertices[[1, 7]] - mesh.vertices[0], axis=1)
    path = inner(mesh, (1, 0, 7))
    assert shortened(mesh.topology, path) == pytest.approx(lengths.sum(), rel=1e-15)


@pytest.mark.parametrize("rise", [0.3, -0.3])
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_a_strip_on_the_wrong_side_is_led_over_to_the_other(rise, side):
    mesh = kite(rise)
    strip, _ = strip_beside(mesh, side)
    _, string, is_done = straightened(mesh.topology, strip, STRAIGHT, STRAIGHT, PASSES)
    assert is_done
    assert string.length == pytest.approx(2.0, rel=1e-14)


def test_a_strip_ends_at_its_end_when_it_is_led_past_its_last_vertex():
    """It ended at another vertex, below the distance: caps 3 to 51, where it passes 51 before."""
    mesh = mesh_of(zoo.KNOWN["caps"])
    for start, end in ((3, 51), (51, 3)):
        distance = zoo.KNOWN["caps"].distances(start)[end]
        path = inner(mesh, (3, 2, 11, 21, 31, 41, 51))[:: 1 if start == 3 else -1].copy()
        assert shortened(mesh.topology, path) >= distance * (1 - 1e-12)


# The funnel -------------------------------------------------------------------------------------


def pulled(portals, end):
    """A string from the origin through portals (left x, y, right x, y); length and its bends."""
    ends = np.array([*portals, (*end, *end)], dtype=float)
    size = len(portals)
    bends, sides = np.empty(size + 1, np.int32), np.empty(size + 1, np.int8)
    length, count = pull_taut(ends, size, bends, sides)
    return length, list(zip(bends[:count].tolist(), sides[:count].tolist(), strict=True))


def test_a_straight_string():
    length, bends = pulled([(-1, 1, 1, 1), (-1, 2, 1, 2)], (0.5, 3))
    assert length == pytest.approx(math.hypot(0.5, 3), rel=1e-15)
    assert bends == []


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_string_around_corners(mirrored):
    """To the left around (-1, 1), then to the right around (-2, 3); mirrored the other way."""
    portals = [(-2, 1, -1, 1), (-3, 2, -1.2, 1.8), (-2, 3, -1, 2)]
    end = (-4, 4)
    if mirrored:
        portals = [(-rx, ry, -lx, ly) for lx, ly, rx, ry in portals]
        end = (-end[0], end[1])
    length, bends = pulled(portals, end)
    expected = [(0, RIGHT), (2, LEFT)] if not mirrored else [(0, LEFT), (2, RIGHT)]
    assert bends == expected
    assert length == pytest.approx(
        math.sqrt(2) + math.dist((-1, 1), (-2, 3)) + math.dist((-2, 3), (-4, 4)), rel=1e-15
    )


def test_a_string_along_a_vertex_that_several_portals_share():
    portals = [(-1, 1, 1, 1), (-2, 1.5, 1, 1), (-2, 3, 1, 1), (0, 3, 1, 1)]
    length, bends = pulled(portals, (3, 2))
    assert [side for _, side in bends] == [RIGHT]
    assert length == pytest.approx(math.sqrt(2) + math.dist((1, 1), (3, 2)), rel=1e-15)


def flat_kite(turn, scale=1.0):
    rise = math.tan(turn / 2)
    points = np.array([(-1, 0, 0), (0, rise, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0)]) * scale
    return gc.TriangleMesh(points, [(0, 1, 3), (1, 2, 3), (1, 0, 4), (2, 1, 4)])


@pytest.mark.slow
@zoo.each_scale
@pytest.mark.parametrize(("share", "passes"), [(0.5, False), (2.0, True)])
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_straight_is_the_least_turn_that_is_taken_out(scale, share, passes, side):
    """A string bends around the middle of a flat kite, whose other side is a little shorter."""
    turn = share * STRAIGHT
    mesh = flat_kite(turn if side == RIGHT else -turn, scale)
    strip, _ = strip_beside(mesh, side)
    strip, string, _ = straightened(mesh.topology, strip, STRAIGHT, STRAIGHT, PASSES)
    bent = 2.0 / math.cos(turn / 2)
    assert string.length == pytest.approx((2.0 if passes else bent) * scale, rel=1e-14)
    assert bent > 2.0 * (1 + 1e-13), "else the two could not be told apart"


@pytest.mark.slow
@zoo.each_scale
@pytest.mark.parametrize(("share", "passes"), [(0.5, False), (4.0, True)])
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_taut_is_the_least_turn_that_is_taken_out_of_a_straightened_curve(
    scale, share, passes, side
):
    """The gain is less than rounding, so it is seen by the side on which the vertex is."""
    turn = share * TAUT
    mesh = flat_kite(turn if side == RIGHT else -turn, scale)
    strip, v = strip_beside(mesh, side)
    strip, _, is_done = straightened(mesh.topology, strip, TAUT, 0.0, MOST_PASSES)
    assert is_done
    assert (sides_of(mesh, strip, v) == {side}) == (not passes)
    assert 1.0 / math.cos(TAUT) == 1.0, "what is left is less than rounding"


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


@pytest.mark.skipif(not WITHOUT_JIT, reason="compiled kernels cannot be watched")
@pytest.mark.parametrize("name", ["cone_crowded", "pleats_slivers", "caps"])
def test_stalls_are_far_more_than_a_curve_takes(monkeypatch, name):
    """Passes in a row that gain nothing are few."""
    lengths = []
    pulled = funnel.pulled_taut

    def watched(*arguments):
        string = pulled(*arguments)
        lengths.append(string.length)
        return string

    monkeypatch.setattr(funnel, "pulled_taut", watched)
    case = zoo.KNOWN[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for a, b, c in np.random.default_rng(2).integers(0, len(case.vertices), (2, 3)).tolist():
        curve = gc.shortest_path(mesh, a, b, waypoints=[c])
        lengths.clear()
        gc.straighten(curve)
        least = np.minimum.accumulate(lengths)
        stalled = np.flatnonzero(np.diff(least, prepend=np.inf))
        assert np.diff(stalled, append=len(lengths)).max() - 1 < STALLS / 2
        assert len(lengths) < MOST_PASSES / 20


@pytest.mark.jit
def test_most_passes_are_far_more_than_a_long_detour_takes():
    """A strip moves on by a vertex at each bend in a pass, here across half of a mesh."""
    mesh = gc.samples.sphere(20_000)
    poles = mesh.locate([[0.3, 0.0, 1.0], [0.3, 0.1, -1.0], [-1.0, 0.1, 0.0], [0.0, -1.0, 0.1]])
    curve = gc.shortest_path(mesh, poles[0], poles[1], waypoints=poles[2:])
    first = curve._inner_faces, *curve._segments()[1:]
    strip, _ = strip_along(mesh.topology, *first, 0)
    passes = MOST_PASSES // 10
    _, string, is_done = straightened(mesh.topology, strip, TAUT, 0.0, passes)
    assert is_done
    assert string.length < 0.8 * curve.length

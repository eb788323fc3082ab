"""A path along edges, shortened: never below the distance, never above what it was."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.paths import funnel
from geodesic_core.kernels.paths.funnel import (
    LEFT,
    NEITHER,
    RIGHT,
    angle_on_right,
    pull_taut,
    shortened,
    shortened_part,
    side_to_pass,
)
from geodesic_core.tolerances import PASSES, STRAIGHT
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


@pytest.mark.slow
def test_the_side_of_the_lesser_angle():
    """Along x, up is on the left."""
    for rise, side in ((0.2, RIGHT), (-0.2, LEFT)):
        mesh = kite(rise)
        before, v, after = inner(mesh, (0, 1, 2)).tolist()
        bend = 2 * math.atan(rise)
        turn = math.pi - bend
        assert angle_on_right(mesh.topology, before, v, after) == pytest.approx(turn, rel=1e-14)
        assert angle_on_right(mesh.topology, after, v, before) == pytest.approx(
            math.pi + bend, rel=1e-14
        )
        assert side_to_pass(mesh.topology, before, v, after) == side
        back = RIGHT + LEFT - side
        assert side_to_pass(mesh.topology, after, v, before) == back
        assert shortened(mesh.topology, np.array([before, v, after])) == pytest.approx(2, rel=1e-15)


@pytest.mark.parametrize("above", [True, False])
def test_no_side_that_is_open(above):
    """At the rim, the other way around the vertex is no way."""
    points = np.array([(-1, 0, 0), (0, 0.2, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0)], dtype=float)
    faces = [(0, 1, 3), (1, 2, 3)] if above else [(1, 0, 4), (2, 1, 4)]
    mesh = gc.TriangleMesh(points, faces)
    path = inner(mesh, (0, 1, 2))
    assert side_to_pass(mesh.topology, *path.tolist()) == (LEFT if above else RIGHT)
    along = 2 * math.hypot(1, 0.2) if above else 2.0
    assert shortened(mesh.topology, path) == pytest.approx(along, rel=1e-15)


def test_a_vertex_with_holes_on_both_sides_stays():
    case = zoo.SMALL["bow_tie"]
    mesh = mesh_of(case)
    path = inner(mesh, (1, 0, 7))
    assert side_to_pass(mesh.topology, *path.tolist()) == NEITHER
    lengths = np.linalg.norm(mesh.vertices[[1, 7]] - mesh.vertices[0], axis=1)
    assert shortened(mesh.topology, path) == pytest.approx(lengths.sum(), rel=1e-15)


@pytest.mark.parametrize("rise", [0.3, -0.3])
def test_a_strip_on_the_wrong_side_is_led_over_to_the_other(rise):
    mesh = kite(rise)
    path = inner(mesh, (0, 1, 2))
    for side in (LEFT, RIGHT):
        sides = np.array([NEITHER, side, NEITHER], np.int8)
        assert shortened_part(mesh.topology, path, sides) == pytest.approx(2.0, rel=1e-14)


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
    turns = np.empty(size + 1)
    length, count = pull_taut(ends, size, bends, sides, turns)
    return length, list(zip(bends[:count].tolist(), sides[:count].tolist(), strict=True)), turns


def test_a_straight_string():
    length, bends, _ = pulled([(-1, 1, 1, 1), (-1, 2, 1, 2)], (0.5, 3))
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
    length, bends, turns = pulled(portals, end)
    expected = [(0, RIGHT), (2, LEFT)] if not mirrored else [(0, LEFT), (2, RIGHT)]
    assert bends == expected
    assert length == pytest.approx(
        math.sqrt(2) + math.dist((-1, 1), (-2, 3)) + math.dist((-2, 3), (-4, 4)), rel=1e-15
    )
    first = math.atan2(2, -1) - math.atan2(1, -1)
    assert turns[0] == pytest.approx(abs(first), rel=1e-12)


def test_a_string_along_a_vertex_that_several_portals_share():
    portals = [(-1, 1, 1, 1), (-2, 1.5, 1, 1), (-2, 3, 1, 1), (0, 3, 1, 1)]
    length, bends, _ = pulled(portals, (3, 2))
    assert [side for _, side in bends] == [RIGHT]
    assert length == pytest.approx(math.sqrt(2) + math.dist((1, 1), (3, 2)), rel=1e-15)


@pytest.mark.slow
@zoo.each_scale
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

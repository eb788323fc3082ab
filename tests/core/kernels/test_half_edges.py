"""Half-edges, fans and counts against their definitions, read off the list of faces."""

import itertools
import math
import time
from collections import Counter

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.kernels.mesh.build import (
    empty_embedding,
    fill_geometry,
    fill_links,
    link_around,
    link_opposites,
    trace_boundary,
    unfold_fans,
)
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    APEX_ANGLE,
    BOUNDARY,
    COS_LEFT,
    COS_RIGHT,
    FANS,
    HEAD,
    IRREGULAR,
    LENGTH,
    LENGTH_LEFT,
    LENGTH_RIGHT,
    NO_FACE,
    OPPOSITE,
    OUT_LEFT,
    OUT_RIGHT,
    PINCHED,
    SADDLE,
    SIN_LEFT,
    SIN_RIGHT,
    TAIL,
    Topology,
    following,
    previous,
)
from geodesic_core.mesh.canonical import half_edges_around
from geodesic_core.tolerances import NO_AREA, SADDLE_EXCESS, SHARP
from tests.support import zoo
from tests.support.oracles import closed_forms
from tests.support.stepping import finished, started, topology_of


def inner_faces(topology) -> np.ndarray:
    return topology.links[:, TAIL].reshape(-1, 3)


def positions(case, topology) -> np.ndarray:
    return case.vertices[topology.outer_vertex]


@zoo.each(zoo.SMALL)
def test_numbering_is_a_permutation_and_leads_back(case):
    topology = topology_of(case)
    vertices, faces = np.arange(len(case.vertices)), np.arange(len(case.faces))
    np.testing.assert_array_equal(np.sort(topology.outer_vertex), vertices)
    np.testing.assert_array_equal(topology.inner_vertex[topology.outer_vertex], vertices)
    np.testing.assert_array_equal(np.sort(topology.outer_face), faces)
    outer = topology.outer_vertex[inner_faces(topology)]
    np.testing.assert_array_equal(outer, case.faces[topology.outer_face])


@zoo.each(zoo.SMALL)
def test_opposites_run_the_same_edge_the_other_way(case):
    topology = topology_of(case)
    links = topology.links
    edges = {(row[TAIL], row[HEAD]): h for h, row in enumerate(links.tolist())}
    for h, row in enumerate(links.tolist()):
        assert row[APEX] == links[following(h), HEAD]
        other = edges.get((row[HEAD], row[TAIL]), -1)
        assert row[OPPOSITE] == (other if other >= 0 else NO_FACE)
        for column, neighbour in ((OUT_LEFT, previous(h)), (OUT_RIGHT, following(h))):
            assert row[column] == links[neighbour, OPPOSITE]


@pytest.mark.parametrize("name", list(zoo.IRREGULAR))
def test_half_edges_around_an_edge_are_a_cycle_with_a_bit_for_the_direction(name):
    """However many faces meet, and however they are wound."""
    case = zoo.IRREGULAR[name]
    faces = np.ascontiguousarray(case.faces, np.int32)
    codes = link_around(faces, len(case.vertices))
    flat, ahead = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    around = {}
    for h, (a, b) in enumerate(zip(flat.tolist(), ahead.tolist(), strict=True)):
        around.setdefault(frozenset((a, b)), set()).add(h)
    for start in range(faces.size):
        here = around[frozenset((flat[start], ahead[start]))]
        if len(here) == 1:
            assert codes[start] == -1
            continue
        cycle, h = [], start
        for _ in here:
            code = codes[h]
            assert code % 2 == (flat[h] == flat[code >> 1])
            h = code >> 1
            cycle.append(h)
        assert set(cycle) == here
        assert h == start


@zoo.each(zoo.IRREGULAR)
def test_faces_are_turned_over_until_neighbours_agree(case):
    """Only of one-sided surfaces an edge of two faces is left that both run the same way."""
    topology = topology_of(case)
    links = topology.links
    for h, row in enumerate(links.tolist()):
        edge = sorted(topology.outer_vertex[[row[TAIL], row[HEAD]]].tolist())
        if tuple(edge) in case.non_manifold:
            assert row[OPPOSITE] == IRREGULAR
        elif row[OPPOSITE] >= 0:
            across = links[row[OPPOSITE]]
            assert (across[TAIL], across[HEAD], across[OPPOSITE]) == (row[HEAD], row[TAIL], h)
    irregular = np.flatnonzero(links[:, OPPOSITE] == IRREGULAR)
    left = len(irregular) - sum(
        len(list(half_edges_around(links, h))) > 2 for h in irregular.tolist()
    )
    assert left == (2 if "moebius" in case.name else 0)


@zoo.each(zoo.SMALL)
def test_rows_are_the_triangle_as_seen_from_the_half_edge(case):
    topology = topology_of(case)
    points = positions(case, topology)
    tail, head, apex = (points[topology.links[:, column]] for column in (TAIL, HEAD, APEX))
    rows = topology.geometry

    def check(columns, at, heuristic, other):
        length, cosine, sine, side = columns
        u, w = heuristic - at, other - at
        angle = np.arctan2(np.linalg.norm(np.cross(u, w), axis=1), (u * w).sum(axis=1))
        close = {"rtol": 1e-14, "atol": 1e-14}
        np.testing.assert_allclose(rows[:, length], np.linalg.norm(u, axis=1), rtol=1e-14)
        np.testing.assert_allclose(rows[:, side], np.linalg.norm(w, axis=1), rtol=1e-14)
        np.testing.assert_allclose(rows[:, cosine], np.cos(angle), **close)
        np.testing.assert_allclose(rows[:, sine], np.sin(angle), **close)

    check((LENGTH, COS_LEFT, SIN_LEFT, LENGTH_LEFT), tail, head, apex)
    check((LENGTH, COS_RIGHT, SIN_RIGHT, LENGTH_RIGHT), head, tail, apex)


@zoo.each(zoo.SMALL)
def test_corners_of_a_vertex_follow_each_other_fan_by_fan(case):
    topology = topology_of(case)
    links, faces = topology.links, inner_faces(topology)
    for v in range(len(case.vertices)):
        here = slice(topology.first_corner[v], topology.first_corner[v + 1])
        corners, starts = topology.corners[here], topology.corner_angles[here]
        assert sorted(corners) == np.flatnonzero(faces.reshape(-1) == v).tolist()
        angles = [_angle(topology, h) for h in corners]
        expected = [0.0, *np.cumsum(angles)][: len(corners)]
        np.testing.assert_allclose(starts, expected, atol=1e-14)
        for h, start in zip(corners.tolist(), starts, strict=True):
            assert topology.geometry[following(h), APEX_ANGLE] == start
        assert topology.total_angle[v] == pytest.approx(sum(angles), abs=1e-14)
        breaks = sum(links[a, OUT_LEFT] != b for a, b in itertools.pairwise(corners))
        assert breaks == max(_fans_at(faces, v) - 1, 0)


def _angle(topology, h) -> float:
    return math.atan2(topology.geometry[h, SIN_LEFT], topology.geometry[h, COS_LEFT])


def _fans_at(faces, v) -> int:
    """Components of the link of v: the edges opposite to it."""
    link = [set(face) - {v} for face in faces.tolist() if v in face]
    groups = []
    for edge in link:
        touching = [group for group in groups if group & edge]
        groups = [group for group in groups if not group & edge]
        groups.append(edge.union(*touching))
    return len(groups)


@zoo.each(zoo.SMALL)
def test_flags(case):
    topology = topology_of(case)
    faces = inner_faces(topology)
    edges = Counter(
        frozenset(pair) for face in faces.tolist() for pair in itertools.combinations(face, 2)
    )
    rim = {v for edge, count in edges.items() if count == 1 for v in edge}
    for v, flags in enumerate(topology.flags):
        assert bool(flags & BOUNDARY) == (v in rim)
        assert bool(flags & FANS) == (_fans_at(faces, v) > 1)
        over = topology.total_angle[v] > 2 * math.pi + SADDLE_EXCESS
        assert bool(flags & SADDLE) == (over and v not in rim)


@zoo.each(zoo.SMALL)
def test_components(case):
    label = np.arange(len(case.vertices))
    for _ in range(len(case.vertices)):
        for face in case.faces:
            label[face] = label[face].min()
    _, numbered = np.unique(label, return_inverse=True)
    np.testing.assert_array_equal(topology_of(case).component, numbered)


@pytest.mark.parametrize(
    ("name", "loops"),
    [
        ("single_triangle", 1),
        ("tetrahedron", 0),
        ("flat_grid", 1),
        ("annulus", 2),
        ("obstacles", 4),  # two of the four holes touch at a corner: one loop
        ("prism", 2),
        ("bow_tie", 2),
        ("two_components", 1),
        ("pinched_cubes", 0),
    ],
)
def test_boundary_loops(name, loops):
    _, first, opened = trace_boundary(topology_of(zoo.SMALL[name]).links)
    assert (len(first) - 1, opened) == (loops, 0)


def topology_as_given(case) -> Topology:
    """Built without renumbering, from the same parts."""
    topology = empty_embedding(len(case.vertices), len(case.faces)).topology
    faces = np.ascontiguousarray(case.faces, np.int32)
    opposite, around = link_opposites(faces, len(case.vertices))
    angles, pinched = np.empty(faces.size), np.zeros(len(faces), np.uint8)
    assert fill_geometry(case.vertices, faces, topology.geometry, angles, pinched) == -1
    unfold_fans(faces, opposite, angles, pinched, topology)
    fill_links(faces, opposite, opposite, around, topology.links)
    for array in (topology.inner_vertex, topology.outer_vertex, topology.outer_face):
        array[:] = np.arange(len(array))
    for array in topology:
        array.flags.writeable = False
    return topology


@zoo.each(zoo.SMALL)
def test_the_order_in_memory_does_not_show(case):
    topology, plain = topology_of(case), topology_as_given(case)
    source = int(case.faces[-1, 0])
    found = finished(topology, started(topology, source)).vertices.distance[topology.inner_vertex]
    expected = finished(plain, started(plain, source)).vertices.distance
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.jit
def test_a_fan_of_many_faces_takes_linear_time():
    gc.warm_up()

    def seconds(sides):
        turn = np.linspace(0, 6.0, sides + 1)
        rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(sides + 1)], axis=1)
        vertices = np.vstack([np.zeros(3), rim])
        faces = [(0, k, k + 1) for k in range(1, sides + 1)]
        began = time.thread_time()
        topology = gc.TriangleMesh(vertices, faces).topology
        assert np.diff(topology.first_corner).max() == sides
        return time.thread_time() - began

    # A search in the bucket of the hub would take 100 times as long for 10 times the faces.
    assert min(seconds(200_000) for _ in range(2)) < 40 * min(seconds(20_000) for _ in range(3))


@pytest.mark.parametrize(("share", "is_pinched"), [(0.99, True), (1.01, False)])
@zoo.each_scale
def test_no_area_is_an_angle_of_so_much(share, is_pinched, scale):
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, share * NO_AREA, 0), (0, -1, 0)]) * scale
    topology = topology_of(zoo.Case("needle", corners, np.array([(0, 1, 2), (0, 3, 1)])))
    flagged = topology.flags[topology.inner_vertex] & PINCHED != 0
    assert flagged.tolist() == [is_pinched] * 3 + [False]


@pytest.mark.parametrize("share", [0.99, 1.01])
@zoo.each_scale
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

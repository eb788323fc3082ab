"""The search along edges against Dijkstra's own."""

import itertools
import math

import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.bounds import exact_bounds
from geodesic_core.kernels.front.counters import TOUCHED
from geodesic_core.kernels.front.state import PREDECESSOR
from geodesic_core.kernels.paths.edge_dijkstra import search_edges, vertices_to
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.tolerances import ASTAR_WEIGHT
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.oracles import graph
from tests.support.searches import edge_paths, goal_at_vertex, random_pairs, spread


def all_pairs(case):
    ends = spread(case, 4 if WITHOUT_JIT else 12)
    components = mesh_of(case).components
    return [(a, b) for a, b in itertools.product(ends, ends) if components[a] == components[b]]


@zoo.each(zoo.SMALL)
def test_a_path_along_edges_of_the_length_told(case):
    lengths = graph.edge_lengths(case.vertices, case.faces)
    mesh = mesh_of(case)
    for start, end, path, length in edge_paths(mesh, all_pairs(case)):
        vertices = mesh.topology.outer_vertex[path].tolist()
        assert (vertices[0], vertices[-1]) == (start, end)
        pieces = [lengths[min(pair), max(pair)] for pair in itertools.pairwise(vertices)]
        assert sum(pieces) == pytest.approx(length, rel=1e-12, abs=0)


@pytest.mark.slice(5)
@zoo.each(zoo.SMALL)
def test_no_longer_than_the_shortest_by_the_weight(case):
    for start, end, _, length in edge_paths(mesh_of(case), all_pairs(case)):
        shortest = graph.edge_distances(case.vertices, case.faces, start)[end]
        assert shortest * (1 - 1e-12) <= length <= ASTAR_WEIGHT * shortest * (1 + 1e-12)


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("name", ["flat", "cone_ruffle", "prism_even", "caps", "slivers_1e-05"])
def test_the_same_on_larger_meshes(name):
    case = zoo.KNOWN[name]
    mesh = mesh_of(case)
    longer = 0
    for start, end, _, length in edge_paths(mesh, random_pairs(mesh, 40)):
        shortest = graph.edge_distances(case.vertices, case.faces, start)[end]
        assert shortest * (1 - 1e-12) <= length <= ASTAR_WEIGHT * shortest * (1 + 1e-12)
        longer += length > shortest * (1 + 1e-9)
    assert longer < 30


@pytest.mark.parametrize("name", ["crags_with_holes", "crumpled_torus", "bow_tie_of_fans"])
def test_landmarks_do_not_lengthen_it_beyond_the_weight(name):
    case = zoo.SMALL[name]
    mesh = mesh_of(case)
    topology = mesh.topology
    landmarks = Landmarks(mesh)
    for _ in range(3):
        landmarks.add(0, Control())
    for begin, end in random_pairs(mesh, 5 if WITHOUT_JIT else 40):
        first, last = int(topology.inner_vertex[begin]), int(topology.inner_vertex[end])
        wave = state.new_wavefront(topology, pruned=True)
        goal = goal_at_vertex(mesh, last, landmarks=landmarks)
        search_edges(topology, wave, exact_bounds(math.inf, goal), first, last)
        shortest = graph.edge_distances(case.vertices, case.faces, begin)[end]
        length = wave.vertices.distance[last]
        assert shortest * (1 - 1e-12) <= length <= ASTAR_WEIGHT * shortest * (1 + 1e-12)


def test_it_stops_at_its_end_and_goes_toward_it():
    """Along a strip, from the middle: the other half is not looked at."""
    mesh = gc.TriangleMesh(*zoo.grid(60, 2))
    topology = mesh.topology
    first, last = (int(topology.inner_vertex[v]) for v in (30, 60))
    wave = state.new_wavefront(topology, pruned=True)
    search_edges(topology, wave, exact_bounds(math.inf, goal_at_vertex(mesh, last)), first, last)
    assert wave.vertices.distance[last] == pytest.approx(30.0)
    seen = mesh.vertices[topology.outer_vertex[wave.vertices.touched[: wave.counters[TOUCHED]]], 0]
    assert seen.min() >= 27


def test_an_unreachable_end_is_left_at_infinity():
    mesh = mesh_of(zoo.SMALL["two_components"])
    first, last = (int(mesh.topology.inner_vertex[v]) for v in (0, 15))
    wave = state.new_wavefront(mesh.topology, pruned=True)
    search_edges(
        mesh.topology, wave, exact_bounds(math.inf, goal_at_vertex(mesh, last)), first, last
    )
    assert math.isinf(wave.vertices.distance[last])
    assert vertices_to(wave.vertices.winner_ints[:, PREDECESSOR], last).tolist() == [last]


def test_both_ends_of_an_open_fan_are_neighbours():
    """The last edge of a fan starts no half-edge at its vertex."""
    mesh = mesh_of(zoo.SMALL["open_fan"])
    sides = {tuple(sorted(face[[k, k - 1]].tolist())) for face in mesh.faces for k in range(3)}
    for start, end, path, _ in edge_paths(mesh, sides):
        assert mesh.topology.outer_vertex[path].tolist() == [start, end]


@pytest.mark.parametrize("name", ["crags_with_holes", "crumpled_torus"])
def test_astar_weight_is_all_that_a_path_along_edges_is_longer_by(name):
    case = zoo.SMALL[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for start, end, _, length in edge_paths(mesh, random_pairs(mesh, 10)):
        shortest = graph.edge_distances(case.vertices, case.faces, start)[end]
        assert shortest * (1 - 1e-12) <= length <= ASTAR_WEIGHT * shortest * (1 + 1e-12)

"""Properties of exact distances on any mesh, and agreement with the oracle."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from tests.support.certificates import check_path
from tests.support.meshes import mesh_of
from tests.support.oracles import graph, unfolding
from tests.support.random_meshes import cases

EXACT = 1e-9
seeds = st.integers(0, 2**31 - 1)


def solve(vertices, faces, source):
    return gc.exact_distance(gc.TriangleMesh(vertices, faces), source).distances


def vertex_of(case, seed) -> int:
    return int(np.random.default_rng(seed).choice(np.unique(case.faces)))


@given(cases(), seeds)
def test_agrees_with_the_oracle(case, seed):
    mesh = mesh_of(case)
    matrix = unfolding.distance_matrix(case.vertices, case.faces)
    for source in {0, vertex_of(case, seed), vertex_of(case, seed + 1)}:
        found = gc.exact_distance(mesh, source).distances
        np.testing.assert_allclose(found, matrix[source], rtol=EXACT, atol=0)


@given(cases(), seeds)
def test_no_steeper_than_the_edges_and_between_euclid_and_dijkstra(case, seed):
    source = vertex_of(case, seed)
    distances = solve(case.vertices, case.faces, source)
    for (a, b), length in graph.edge_lengths(case.vertices, case.faces).items():
        if np.isfinite(distances[a]):
            assert abs(distances[a] - distances[b]) <= length * (1 + 1e-12) + 1e-14 * distances[a]
    euclid = np.linalg.norm(case.vertices - case.vertices[source], axis=1)
    assert (distances >= euclid * (1 - 1e-12)).all()
    on_edges = graph.edge_distances(case.vertices, case.faces, source)
    assert (distances <= on_edges * (1 + 1e-12)).all()


@given(cases(), seeds)
def test_symmetry(case, seed):
    mesh = mesh_of(case)
    ends = np.random.default_rng(seed).integers(0, len(case.vertices), 4)
    table = np.array([gc.exact_distance(mesh, int(end)).distances[ends] for end in ends])
    np.testing.assert_allclose(table, table.T, rtol=EXACT)


@given(cases(), seeds)
def test_paths_certify_distances(case, seed):
    mesh = mesh_of(case)
    source = vertex_of(case, seed)
    field = gc.exact_distance(mesh, source)
    for target in np.random.default_rng(seed).integers(0, len(case.vertices), 8).tolist():
        if target != source and np.isfinite(field.distances[target]):
            check_path(mesh, field.path_to(target), source, target, field.distances[target])


@given(cases(), seeds, st.floats(0, 2))
def test_start_distances_are_a_least_of_sums(case, seed, start):
    mesh = mesh_of(case)
    ends = [vertex_of(case, seed), vertex_of(case, seed + 1)]
    field = gc.exact_distance(mesh, [gc.Source(ends[0], start), gc.Source(ends[1])])
    single = [gc.exact_distance(mesh, end).distances for end in ends]
    np.testing.assert_allclose(
        field.distances, np.minimum(single[0] + start, single[1]), rtol=EXACT
    )

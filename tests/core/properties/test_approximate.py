"""Properties of approximate distances on any mesh, and agreement with the oracle."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from tests.core.properties.test_exact import seeds, vertex_of
from tests.support import zoo
from tests.support.approximation import ERRORS, ROUNDING, check_approximate_path, check_within
from tests.support.meshes import mesh_of
from tests.support.random_meshes import cases

errors = st.sampled_from(ERRORS)


@st.composite
def split_cases(draw) -> zoo.Case:
    """Random meshes, their faces split in their planes: more edges, and more to merge."""
    case = draw(cases())
    for _ in range(draw(st.integers(0, 2))):
        case = zoo.Case(f"{case.name} split", *zoo.subdivide(case.vertices, case.faces))
    return case


def solve(vertices, faces, source, error):
    return gc.approximate_distance(gc.TriangleMesh(vertices, faces), source, error).distances


@given(split_cases(), seeds, errors)
def test_agrees_with_exact_distances(case, seed, error):
    mesh, source = mesh_of(case), vertex_of(case, seed)
    exact = gc.exact_distance(mesh, source).distances
    check_within(gc.approximate_distance(mesh, source, error).distances, exact, error)


@given(split_cases(), seeds, errors)
def test_paths_and_their_certificates_hold(case, seed, error):
    mesh, source = mesh_of(case), vertex_of(case, seed)
    exact = gc.exact_distance(mesh, source).distances
    field = gc.approximate_distance(mesh, source, error, retain="paths")
    for target in np.random.default_rng(seed).integers(0, len(case.vertices), 8).tolist():
        if target != source and np.isfinite(exact[target]):
            check_approximate_path(field, target, exact[target], error)


@given(split_cases(), seeds, errors)
def test_twice_the_size_is_twice_the_distance_to_the_bit(case, seed, error):
    source = vertex_of(case, seed)
    doubled = solve(case.vertices * 2.0, case.faces, source, error)
    np.testing.assert_array_equal(doubled, 2.0 * solve(case.vertices, case.faces, source, error))


@given(split_cases(), seeds, errors)
def test_two_runs_are_equal_to_the_bit(case, seed, error):
    source = vertex_of(case, seed)
    fields = [
        gc.approximate_distance(mesh_of(case), source, error, retain=retain)
        for retain in ("distances", "paths")
    ]
    assert fields[0].distances.tobytes() == fields[1].distances.tobytes()


@given(split_cases(), seeds, errors, st.floats(0, 2), st.floats(1e-4, 1))
def test_several_sources_and_both_errors(case, seed, error, start, share):
    mesh, ends = mesh_of(case), [vertex_of(case, seed), vertex_of(case, seed + 1)]
    sources = [gc.Source(ends[0], start), gc.Source(ends[1])]
    exact = gc.exact_distance(mesh, sources).distances
    absolute = error * share * exact[np.isfinite(exact)].max() + 1e-9
    both = gc.approximate_distance(mesh, sources, error, absolute).distances
    check_within(both, exact, error, absolute)
    alone = gc.approximate_distance(mesh, sources, None, absolute).distances
    check_within(alone, exact, absolute=absolute)


@given(split_cases(), seeds, errors, st.floats(0, 1.2))
def test_a_limit_takes_away_only_what_lies_beyond_it(case, seed, error, share):
    mesh, source = mesh_of(case), vertex_of(case, seed)
    exact = gc.exact_distance(mesh, source).distances
    limit = share * exact[np.isfinite(exact)].max()
    found = gc.approximate_distance(mesh, source, error, max_distance=limit).distances
    reached = np.isfinite(found)
    assert reached[exact <= limit * (1 - ROUNDING)].all()
    assert (found[reached] <= limit).all()
    check_within(found[reached], exact[reached], error)

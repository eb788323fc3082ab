"""Properties of paths between two points on any mesh, and agreement with the oracle."""

import numpy as np
import pytest
from hypothesis import given

import geodesic_core as gc
from tests.core.properties.test_approximate import split_cases
from tests.core.properties.test_exact import seeds
from tests.support.meshes import mesh_of
from tests.support.oracles import unfolding
from tests.support.path_checks import LENGTH
from tests.support.random_meshes import cases
from tests.support.searches import STEPS, check_search, random_pairs

EXACT = 1e-9
"""Relative error allowed against the oracle, and where the mesh itself was rounded anew."""


@given(split_cases(), seeds)
def test_paths_are_those_of_the_full_sweep_both_ways(case, seed):
    solver = gc.Solver(mesh_of(case))
    for source, target in random_pairs(solver.mesh, 6, seed):
        distance = gc.exact_distance(solver.mesh, source).distances[target]
        path = solver.shortest_path(source, target)
        check_search(solver.mesh, path, source, target, distance)
        back = solver.shortest_path(target, source)
        check_search(solver.mesh, back, target, source, distance)


@given(split_cases(), seeds)
def test_bounds_tighten_and_stay_bounds(case, seed):
    solver = gc.Solver(mesh_of(case))
    for source, target in random_pairs(solver.mesh, 5, seed):
        path = solver.shortest_path(source, target, explain=True)
        assert [step.name for step in path.steps] == STEPS
        bounds = np.array([step.bound for step in path.steps])
        assert (bounds[1:] <= bounds[:-1] * (1 + LENGTH)).all()
        assert (bounds >= path.length * (1 - LENGTH)).all()
        assert set(path.faces.tolist()) <= set(path.steps[4].faces.tolist())


@given(cases(), seeds)
def test_waypoints_are_passed_and_a_detour_is_no_shorter(case, seed):
    mesh = mesh_of(case)
    source, target = random_pairs(mesh, 1, seed)[0]
    connected = np.flatnonzero(mesh.components == mesh.components[source])
    waypoints = np.random.default_rng(seed).choice(connected, 3).tolist()
    path = gc.shortest_path(mesh, source, target, waypoints)
    stops = [source, *waypoints, target]
    matrix = unfolding.distance_matrix(case.vertices, case.faces)
    assert path.length == pytest.approx(matrix[stops[:-1], stops[1:]].sum(), rel=EXACT, abs=0)
    assert path.length >= matrix[source, target] * (1 - EXACT)
    assert set(stops) <= {place.vertex_index for place in path.locations}

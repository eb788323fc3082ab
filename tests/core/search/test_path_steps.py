"""The steps of a search: the figures behind the paper's figure 10."""

import itertools

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.searches import STEPS, answer, random_pairs, solver_of

ROUNDING = 1e-10
"""Relative: by which a bound may lie below the distance, as pruning allows."""
NAMES = ["cube_in_fours", "crags_with_holes", "crumpled_torus", "double_frame", "bow_tie_of_fans"]


def check_steps(mesh, path, leg=0):
    """The six steps of one leg, of which ``path`` is the answer."""
    steps = [step for step in path.steps if step.leg == leg]
    assert [step.name for step in steps] == STEPS
    bounds = [step.bound for step in steps]
    for before, after in itertools.pairwise(bounds):
        assert after <= before * (1 + ROUNDING)
    assert bounds[-1] == pytest.approx(path.length, rel=ROUNDING, abs=0)
    assert min(bounds) >= path.length * (1 - ROUNDING)
    for step in steps:
        assert step.seconds >= 0
        assert step.faces.dtype == np.int32
        assert (np.diff(step.faces) > 0).all()
        assert ((step.faces >= 0) & (step.faces < len(mesh.faces))).all()
        sweeps = step.name in ("approximate", "exact")
        assert step.windows >= 0 if sweeps else step.windows == 0
        assert len(step.faces) == 0 or sweeps or step.name == "dijkstra"
    edges, heuristic, outward = (
        set(steps[STEPS.index(name)].faces.tolist())
        for name in ("dijkstra", "approximate", "exact")
    )
    assert set(path.faces.tolist()) <= outward
    for faces in (edges, heuristic, outward):
        ends = {int(v) for v in mesh.faces[list(faces)].ravel()}
        both = {path.locations[0].vertex_index, path.locations[-1].vertex_index}
        assert both <= ends


@pytest.mark.parametrize("name", NAMES)
def test_steps_of_a_leg(name):
    solver = solver_of(zoo.SMALL[name])
    for source, target in random_pairs(solver.mesh, 4 if WITHOUT_JIT else 40):
        if source != target:
            check_steps(solver.mesh, solver.shortest_path(source, target, explain=True))
            fresh = gc.shortest_path(solver.mesh, source, target, explain=True)
            check_steps(solver.mesh, fresh)


@pytest.mark.jit
@pytest.mark.parametrize("name", ["flat", "cone_saddle", "prism_even", "slivers_1e-03"])
def test_steps_of_a_leg_on_larger_meshes(name):
    solver = solver_of(zoo.KNOWN[name])
    for source, target in random_pairs(solver.mesh, 30):
        if source != target:
            check_steps(solver.mesh, solver.shortest_path(source, target, explain=True))


@pytest.mark.jit
def test_without_explain_there_are_no_steps_and_the_same_path():
    for source, target in random_pairs(solver_of(zoo.SMALL["crags"]).mesh, 5):
        plain, told = (solver_of(zoo.SMALL["crags"]) for _ in range(2))
        path = plain.shortest_path(source, target)
        explained = told.shortest_path(source, target, explain=True)
        assert path.steps is None
        assert answer(path)[:-1] == answer(explained)[:-1]


@pytest.mark.jit
def test_steps_come_leg_by_leg():
    solver = solver_of(zoo.SMALL["crags"])
    path = solver.shortest_path(3, 50, [30, 30, 8], explain=True)
    assert [step.name for step in path.steps] == 4 * STEPS
    assert [step.leg for step in path.steps] == [leg for leg in range(4) for _ in STEPS]
    stops = [3, 30, 30, 8, 50]
    for leg, ends in enumerate(itertools.pairwise(stops)):
        alone = gc.shortest_path(solver.mesh, *ends)
        assert path.steps[6 * leg + 5].bound == pytest.approx(alone.length, rel=ROUNDING, abs=0)
    assert solver.shortest_path(3, 50, [30]).steps is None


@pytest.mark.jit
def test_each_bound_thins_the_next_search():
    """Between far points of a smooth surface: fewer faces step by step, in the end a thin strip."""
    mesh = gc.TriangleMesh(*zoo.icosphere(5))
    path = gc.shortest_path(mesh, 0, 4000, explain=True)
    edges, heuristic, outward = (
        len(path.steps[STEPS.index(name)].faces) for name in ("dijkstra", "approximate", "exact")
    )
    assert outward < 0.3 * heuristic
    assert outward < edges
    assert outward < 0.1 * len(mesh.faces)
    sweep = gc.exact_distance(mesh, 0).stats.windows_created
    assert path.steps[STEPS.index("exact")].windows < 0.1 * sweep

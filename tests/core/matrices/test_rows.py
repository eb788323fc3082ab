"""Rows of matrices: many sweeps in one memory, each the same to the bit as a field by itself."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.fields.methods import sweep_of
from geodesic_core.fields.sources import as_points, ends_of
from geodesic_core.kernels.front.counters import WORK
from geodesic_core.search import target_sweep
from geodesic_core.search.target_sweep import TargetSweep
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points

METHODS = {
    "exact": gc.exact_distance,
    "approximate": gc.approximate_distance,
    "fast": gc.fast_distance,
}
MESHES = (
    "hills",
    "crags_with_holes",
    "double_frame",
    "two_components",
    "crumpled_torus",
    "bow_tie_of_fans",
    "pinched_cubes",
    "isolated_vertices",
)
by_method = pytest.mark.parametrize("method", METHODS)


def fields_of(mesh, method, sources, targets, limit):
    """The distances of fields, one for each source."""
    fields = [METHODS[method](mesh, each, targets=targets, max_distance=limit) for each in sources]
    return np.array([[field.distance_at(target) for target in targets] for field in fields])


@pytest.mark.jit
@pytest.mark.parametrize("share", [0.1, 0.4])
@by_method
@zoo.each({name: zoo.SMALL[name] for name in MESHES})
def test_limited_rows_are_those_of_fields_to_the_bit(case, method, share):
    mesh = mesh_of(case)
    points = [*range(0, len(mesh.vertices), 3), *random_points(mesh, 6, seed=41)]
    limit = share * mesh.diagonal
    expected = fields_of(mesh, method, points, points, limit)
    table = gc.distance_matrix(mesh, points, list(points[::-1]), limit, method=method)
    np.testing.assert_array_equal(table[:, ::-1], expected)
    assert np.isfinite(table).sum() < table.size
    once = gc.distance_matrix(mesh, points, max_distance=limit, method=method, layout="sparse")
    rows, columns = once.nonzero()
    upper = rows <= columns
    np.testing.assert_array_equal(
        once.data[_places(once)[rows, columns][upper]], expected[rows, columns][upper]
    )


def _places(table):
    """The place of each stored entry in the data of a matrix."""
    places = np.full(table.shape, -1)
    places[np.repeat(np.arange(len(table.indptr) - 1), np.diff(table.indptr)), table.indices] = (
        np.arange(table.nnz)
    )
    return places


@pytest.mark.jit
@by_method
def test_rows_do_not_depend_on_those_before_nor_on_room_and_slices(method, monkeypatch):
    mesh = mesh_of(zoo.SMALL["crags_with_holes"])
    points = [*range(len(mesh.vertices)), *random_points(mesh, 4, seed=42)]
    canonical = as_points(mesh, points, "point", Control())
    ends = ends_of(mesh, canonical, canonical, Control())
    sweeps, limit = np.arange(len(points)), 0.5 * mesh.diagonal
    columns = np.zeros(len(sweeps), np.int32), np.full(len(sweeps), len(points), np.int32)

    def table_of(memory, sweeps):
        table = np.full((len(points), len(points)), math.inf)
        for found in memory.rows(
            ends, limit, sweeps, tuple(side[sweeps] for side in columns), Control()
        ):
            table[found.row_of_each, found.columns] = found.distances
        return table

    make = sweep_of(mesh, method, relative_error=1e-3)
    whole = table_of(TargetSweep(mesh, make), sweeps)
    memory = TargetSweep(mesh, make)
    table_of(memory, sweeps[::-1][:7])
    np.testing.assert_array_equal(table_of(memory, sweeps), whole)
    monkeypatch.setattr(target_sweep, "_ENTRIES", 1)
    engine_of = target_sweep._engine
    monkeypatch.setattr(
        target_sweep, "_engine", lambda *some: engine_of(*some)._replace(first_budget=1)
    )
    np.testing.assert_array_equal(table_of(TargetSweep(mesh, make), sweeps), whole)


@pytest.mark.jit
@pytest.mark.slow
@by_method
def test_a_small_disc_costs_the_same_on_any_mesh(method, monkeypatch):
    """By the work that kernels count: targets and vertices out of reach cost none."""
    work = []
    engine_of = target_sweep._engine

    def counting(*arguments):
        engine = engine_of(*arguments)

        def advance(topology, wave, bounds, budget):
            outcome = engine.advance(topology, wave, bounds, budget)
            work[-1] += int(wave.counters[WORK])
            return outcome

        return engine._replace(advance=advance)

    monkeypatch.setattr(target_sweep, "_engine", counting)
    for size in (40, 120):
        mesh = gc.TriangleMesh(*zoo.grid(size, size))
        middle, every = size // 2 * (size + 2), range(len(mesh.vertices))
        work.append(0)
        gc.distance_matrix(mesh, [middle], every, 3.0, "sparse", method=method, threads=1)
    assert work[0] == work[1] > 0

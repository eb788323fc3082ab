"""Approximate fields are the same to the bit, whoever asks, however often, in whatever memory."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.fields import sweep
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep import continuous_dijkstra, state
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import MERGING
from tests.support.stepping import with_pool


def answer(mesh, source, *, retain="paths"):
    """A field, and a few of its paths, as bytes."""
    field = gc.approximate_distance(mesh, [source, 0], 1e-2, retain=retain)
    paths = [field.path_to(target).points for target in range(1, len(mesh.vertices), 50)]
    return [array.tobytes() for array in (field.distances, field.nearest_source, *paths)]


@pytest.mark.parametrize("name", ["dented_ball", "islands", "furrows"])
def test_two_runs_agree(name):
    case = MERGING[name]
    meshes = [gc.TriangleMesh(case.vertices, case.faces) for _ in range(2)]
    first = answer(meshes[0], 7)
    assert answer(meshes[0], 7) == answer(meshes[1], 7) == first
    assert answer(meshes[0], 7, retain="distances") == first


@pytest.mark.jit
def test_threads_that_share_a_mesh_do_not_disturb_one_another():
    vertices, faces = zoo.icosphere(4)
    mesh = gc.TriangleMesh(zoo.crumpled(vertices, 0.02, seed=1), faces)
    sources = [3, 500, 1000, 3, 500, 1000, 42, 3]
    alone = [answer(mesh, source) for source in sources]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda source: answer(mesh, source), sources)) == alone


@pytest.mark.jit
def test_paths_asked_from_several_threads():
    """Each finds the windows again, and all find the same."""
    case = MERGING["dented_ball"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    targets = list(range(1, len(case.vertices), 7))
    kept = gc.approximate_distance(mesh, 0, 1e-2, retain="paths")
    field = gc.approximate_distance(mesh, 0, 1e-2)
    with ThreadPoolExecutor(4) as pool:
        paths = list(pool.map(lambda target: field.path_to(target).points.tobytes(), targets))
    assert paths == [kept.path_to(target).points.tobytes() for target in targets]


def test_the_mesh_is_not_written_to():
    case = MERGING["islands"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    before = {name: array.tobytes() for name, array in mesh.arrays().items()}
    answer(mesh, 0, retain="distances")
    assert before == {name: array.tobytes() for name, array in mesh.arrays().items()}


@pytest.mark.parametrize("name", ["dented_ring", "islands"])
def test_growing_changes_nothing(name, monkeypatch):
    """From a pool, a scratch and a record of merges of one row each."""
    case = MERGING[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    whole = answer(mesh, 7)
    grown = []

    def cramped(*args, **kwargs):
        wave = allocate(*args, **kwargs)
        paths = 1 if len(wave.pool.merges) else 0
        return with_pool(
            wave,
            windows=np.empty((1, 8)),
            scratch=np.empty((1, 8)),
            merges=np.empty((paths, state.MERGE)),
            merge_ints=np.empty((paths, state.MERGE_INTS), np.int32),
        )

    def counted(wave):
        grown.append(len(wave.pool.merges))
        return more_merges(wave)

    allocate, more_merges = state.new_wavefront, state.with_more_merges
    monkeypatch.setattr(state, "new_wavefront", cramped)
    monkeypatch.setitem(sweep._GROW, Outcome.MERGES_FULL, counted)
    assert answer(mesh, 7) == whole
    assert len(grown) > 5
    assert grown == [2**step for step in range(len(grown))]


@pytest.mark.parametrize("name", ["dented_ball", "islands"])
def test_slices_change_nothing(name, monkeypatch):
    case = MERGING[name]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    whole = answer(mesh, 3)
    slices = []
    advance = continuous_dijkstra.advance

    def slowly(topology, wave, bounds, _):
        slices.append(1)
        return advance(topology, wave, bounds, 200 if WITHOUT_JIT else 1)

    monkeypatch.setattr(continuous_dijkstra, "advance", slowly)
    assert answer(mesh, 3) == whole
    assert len(slices) > 20

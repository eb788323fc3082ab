"""The same question has the same answer, to the bit, whoever asks, in whatever memory."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.fields import sweep
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.state import Merges
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep import continuous_dijkstra
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import MERGING, exact_or_not, solve
from tests.support.meshes import mesh_of
from tests.support.stepping import with_pool

CASES = zoo.SMALL | MERGING


def answer(mesh, source, error, *, retain="paths"):
    """A field, and a few of its paths, as bytes."""
    field = solve(mesh, [source, 0], error, retain=retain)
    last = len(mesh.vertices) - 1
    paths = [field.path_to(target).points for target in {*range(1, last, 50), last}]
    return [array.tobytes() for array in (field.distances, field.nearest_source, *paths)]


@exact_or_not
@pytest.mark.parametrize(
    "name",
    ["crags", "torus", "double_frame", "pinched_holes", "dented_ball", "islands", "furrows"],
)
@pytest.mark.jit
def test_two_runs_agree(name, error):
    meshes = [mesh_of(CASES[name]) for _ in range(2)]
    first = answer(meshes[0], 7, error)
    assert answer(meshes[0], 7, error) == answer(meshes[1], 7, error) == first
    assert answer(meshes[0], 7, error, retain="distances") == first


@pytest.mark.slow
@pytest.mark.jit
@exact_or_not
def test_threads_that_share_a_mesh_do_not_disturb_one_another(error):
    vertices, faces = zoo.icosphere(4)
    mesh = gc.TriangleMesh(zoo.crumpled(vertices, 0.02, seed=1), faces)
    sources = [3, 500, 1000, 3, 500, 1000, 42, 3]
    alone = [answer(mesh, source, error) for source in sources]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda source: answer(mesh, source, error), sources)) == alone


@pytest.mark.jit
@exact_or_not
def test_paths_asked_from_several_threads(error):
    """Each finds the windows again, and all find the same."""
    mesh = mesh_of(MERGING["dented_ball"])
    targets = list(range(1, len(mesh.vertices), 7))
    kept = solve(mesh, 0, error, retain="paths")
    field = solve(mesh, 0, error, retain="distances")
    with ThreadPoolExecutor(4) as pool:
        paths = list(pool.map(lambda target: field.path_to(target).points.tobytes(), targets))
    assert paths == [kept.path_to(target).points.tobytes() for target in targets]


@exact_or_not
@pytest.mark.parametrize("name", ["crags", "islands"])
@pytest.mark.parametrize("retain", ["distances", "paths"])
def test_the_mesh_is_not_written_to(name, error, retain):
    mesh = mesh_of(CASES[name])
    before = {name: array.tobytes() for name, array in mesh.arrays().items()}
    answer(mesh, 0, error, retain=retain)
    assert before == {name: array.tobytes() for name, array in mesh.arrays().items()}
    assert not any(array.flags.writeable for array in mesh.arrays().values())


@exact_or_not
def test_a_mesh_from_its_arrays_answers_alike(error):
    mesh = mesh_of(zoo.SMALL["crumpled_torus"])
    stored = gc.TriangleMesh.from_arrays(mesh.arrays())
    assert answer(stored, 11, error) == answer(mesh, 11, error)


@exact_or_not
def test_callers_arrays_stay_theirs(error):
    case = zoo.SMALL["hills"]
    vertices, faces = case.vertices.copy(), case.faces.copy()
    mesh = gc.TriangleMesh(vertices, faces)
    first = solve(mesh, 0, error).distances
    vertices *= 2
    faces[:] = faces[::-1]
    np.testing.assert_array_equal(solve(mesh, 0, error).distances, first)
    np.testing.assert_array_equal(mesh.vertices, case.vertices)
    np.testing.assert_array_equal(mesh.faces, case.faces)


@pytest.mark.parametrize(
    ("name", "error"), [("islands", 0), ("dented_ring", 1e-2), ("islands", 1e-2)]
)
def test_growing_changes_nothing(name, error, monkeypatch):
    """From a pool, a scratch and a record of merges of one row each."""
    mesh = mesh_of(MERGING[name])
    whole = answer(mesh, 7, error)
    grown = []

    def cramped(*args, **kwargs):
        wave = allocate(*args, **kwargs)
        paths = 1 if len(wave.merges.floats) else 0
        merges = Merges(*(array[:paths].copy() for array in wave.merges))
        wave = wave._replace(merges=merges)
        return with_pool(wave, windows=np.empty((1, 8)), scratch=np.empty((1, 8)))

    def counted(wave):
        grown.append(len(wave.merges.floats))
        return more_merges(wave)

    allocate, more_merges = state.new_wavefront, state.with_more_merges
    monkeypatch.setattr(state, "new_wavefront", cramped)
    monkeypatch.setitem(sweep._GROW, Outcome.MERGES_FULL, counted)
    assert answer(mesh, 7, error) == whole
    if error == 0:
        assert not grown, "exact windows are not merged"
    else:
        assert len(grown) > 5
    assert grown == [2**step for step in range(len(grown))]


@exact_or_not
@pytest.mark.parametrize("name", ["dented_ball", "islands"])
def test_slices_change_nothing(name, error, monkeypatch):
    mesh = mesh_of(MERGING[name])
    whole = answer(mesh, 3, error)
    slices = []
    advance = continuous_dijkstra.advance

    def slowly(topology, wave, bounds, _):
        slices.append(1)
        return advance(topology, wave, bounds, 200 if WITHOUT_JIT else 1)

    monkeypatch.setattr(continuous_dijkstra, "advance", slowly)
    assert answer(mesh, 3, error) == whole
    assert len(slices) > 20

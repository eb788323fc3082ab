"""Distances between many points: dense, sparse and in pairs, in threads."""

import itertools
import math
import threading
from functools import partial

import numpy as np
import pytest
from scipy.sparse import csr_array

import geodesic_core as gc
from geodesic_core.matrices import threads
from geodesic_core.matrices.plan import sweep_order
from geodesic_core.search import path_search
from geodesic_core.search.target_sweep import TargetSweep
from tests.conftest import WITHOUT_JIT
from tests.core.fields.test_points import EXACT, SAME
from tests.support import zoo
from tests.support.meshes import mesh_of, random_points


def as_dense(table: csr_array) -> np.ndarray:
    """With infinity where nothing is stored."""
    full = np.full(table.shape, math.inf)
    stored = table.tocoo()
    full[stored.row, stored.col] = stored.data
    return full


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("ends", ["rectangle", "square"])
def test_results_do_not_depend_on_the_number_of_threads(ends):
    mesh = gc.TriangleMesh(zoo.crumpled(zoo.icosphere(4)[0], 0.03, 5), zoo.icosphere(4)[1])
    points = random_points(mesh, 24, seed=24)
    sources = points if ends == "square" else points[:9]
    solver = gc.Solver(mesh)
    solver.nearest(0, points)  # its memory is not as new
    for layout, limit in itertools.product(("dense", "sparse", "pairs"), (None, 1.0)):
        starts, stops = sources, points
        if layout == "pairs":
            starts, stops = [*sources, *[points[0]] * 15], [*points[-len(sources) :], *points[:15]]
        one = gc.distance_matrix(mesh, starts, stops, limit, layout, threads=1)
        for count in (2, 3, 7, None):
            more = gc.distance_matrix(mesh, starts, stops, limit, layout, threads=count)
            check_same(more, one)
        check_same(solver.distance_matrix(starts, stops, limit, layout), one)


def check_same(table, other):
    if isinstance(table, csr_array):
        for name in ("indptr", "indices", "data"):
            np.testing.assert_array_equal(getattr(table, name), getattr(other, name))
    else:
        np.testing.assert_array_equal(table, other)


@pytest.mark.jit
def test_a_matrix_of_one_set_of_points_is_symmetric():
    mesh = mesh_of(zoo.SMALL["crags"])
    points = random_points(mesh, 8, seed=25)
    points.append(points[2])
    table = gc.distance_matrix(mesh, points, points)
    np.testing.assert_array_equal(table, table.T)
    np.testing.assert_array_equal(np.diag(table), 0.0)
    assert table[2, -1] == 0.0
    np.testing.assert_allclose(table, gc.distance_matrix(mesh, points, points[::-1])[:, ::-1], SAME)


@pytest.mark.jit
def test_transposing_permuting_and_leaving_out_commute_with_the_matrix():
    mesh = mesh_of(zoo.SMALL["crumpled_torus"])
    rng = np.random.default_rng(26)
    points = random_points(mesh, 12, seed=26)
    sources, targets = points[:5], points[5:]
    table = gc.distance_matrix(mesh, sources, targets)
    np.testing.assert_array_equal(gc.distance_matrix(mesh, targets, sources), table.T)
    rows, columns = rng.permutation(5), rng.permutation(7)
    mixed = gc.distance_matrix(mesh, [sources[i] for i in rows], [targets[j] for j in columns])
    np.testing.assert_allclose(mixed, table[np.ix_(rows, columns)], SAME)
    some = gc.distance_matrix(mesh, sources[:3], targets[::2])
    np.testing.assert_allclose(some, table[:3, ::2], SAME)


@pytest.mark.jit
def test_what_is_beyond_max_distance_is_infinite_or_left_out():
    mesh = mesh_of(zoo.SMALL["hills"])
    points = random_points(mesh, 12, seed=27)
    sources, targets = points[:4], points[3:]  # one is both
    full = gc.distance_matrix(mesh, sources, targets)
    limit = float(np.median(full))
    dense = gc.distance_matrix(mesh, sources, targets, limit)
    np.testing.assert_allclose(dense, np.where(full <= limit, full, math.inf), SAME)
    sparse = gc.distance_matrix(mesh, sources, targets, limit, "sparse")
    np.testing.assert_array_equal(as_dense(sparse), dense)
    assert sparse.nnz < full.size
    assert (sparse.data == 0.0).sum() == 1, "a zero is a distance"
    only = gc.distance_matrix(mesh, sources, targets, 0.0)
    np.testing.assert_array_equal(only, np.where(full == 0.0, 0.0, math.inf))


@pytest.mark.jit
def test_pairs_with_a_point_in_common_are_swept(monkeypatch):
    """Whichever side it is on; and the answer is that of searches."""
    mesh = mesh_of(zoo.SMALL["saddle"])
    points = random_points(mesh, 12, seed=28)
    hub, others = points[0], points[1:]
    calls = []
    find = path_search.PathSearch.find
    monkeypatch.setattr(
        path_search.PathSearch, "find", lambda *a, **k: calls.append(a) or find(*a, **k)
    )
    out = gc.distance_matrix(mesh, [hub] * 11, others, layout="pairs")
    back = gc.distance_matrix(mesh, others, [hub] * 11, layout="pairs")
    np.testing.assert_array_equal(out, back)
    assert not calls
    few = gc.distance_matrix(mesh, [hub] * 5, others[:5], layout="pairs")
    assert len(calls) == 5
    np.testing.assert_allclose(few, out[:5], SAME)
    mixed = gc.distance_matrix(
        mesh, [others[3], *[hub] * 11, others[4]], [others[7], *others, others[4]], layout="pairs"
    )
    assert len(calls) == 7
    np.testing.assert_array_equal(mixed[1:-1], out)
    assert mixed[-1] == 0.0


# Bad input --------------------------------------------------------------------------------------

BAD = [
    ({"sources": []}, "InvalidArgument", "no sources"),
    ({"targets": ()}, "InvalidArgument", "no targets"),
    ({"sources": np.empty(0, int)}, "InvalidArgument", "no sources"),
    ({"sources": 3.5}, "InvalidArgument", "sources is 3.5"),
    ({"targets": "12"}, "InvalidArgument", "targets is '12'"),
    ({"sources": [0, -1]}, "InvalidPoint", "source 1 is vertex -1"),
    ({"targets": [0, 1, 99]}, "InvalidPoint", "target 2 is vertex 99"),
    ({"targets": [0, 1.5]}, "InvalidPoint", "target 1 is 1.5"),
    ({"sources": [gc.SurfacePoint.face(8, (1, 0, 0))]}, "InvalidPoint", "source 0 is face 8"),
    ({"layout": "csr"}, "InvalidArgument", "layout is 'csr'"),
    ({"layout": None}, "InvalidArgument", "layout is None"),
    ({"layout": "pairs", "targets": None}, "InvalidArgument", "pairs need targets"),
    ({"layout": "pairs", "targets": [1, 2, 3]}, "InvalidArgument", "2 sources and 3 targets"),
    ({"max_distance": -1.0}, "InvalidArgument", "max_distance is -1.0"),
    ({"max_distance": math.nan}, "InvalidArgument", "max_distance is nan"),
    ({"threads": 0}, "InvalidArgument", "threads is 0"),
    ({"threads": 1.5}, "InvalidArgument", "threads is 1.5"),
    ({"threads": True}, "InvalidArgument", "threads is True"),
]


@pytest.mark.parametrize(("changed", "error", "message"), BAD)
def test_bad_arguments_are_named(changed, error, message):
    mesh = mesh_of(zoo.SMALL["octahedron"])
    arguments = {"sources": [0, 1], "targets": [2, 3]} | changed
    for ask in (
        lambda **kwargs: gc.distance_matrix(mesh, **kwargs),
        gc.Solver(mesh).distance_matrix,
    ):
        with pytest.raises(getattr(gc.errors, error), match=message):
            ask(**arguments)


# Control ----------------------------------------------------------------------------------------

LAYOUTS = pytest.mark.parametrize("layout", ["dense", "sparse", "pairs"])


@pytest.fixture(scope="module")
def mesh():
    gc.warm_up()
    return gc.TriangleMesh(*zoo.icosphere(2 if WITHOUT_JIT else 5))


def points_of(mesh, layout):
    """Sources and targets; of pairs some are swept, others searched for."""
    points = random_points(mesh, 12, seed=29)
    return ([points[0]] * 8 + points[:4], points) if layout == "pairs" else (points[:5], points)


@LAYOUTS
@pytest.mark.jit
def test_progress_grows_from_zero_to_one_in_the_callers_thread(mesh, layout):
    seen, where = [], set()

    def progress(value):
        seen.append(value)
        where.add(threading.get_ident())

    gc.distance_matrix(mesh, *points_of(mesh, layout), layout=layout, progress=progress)
    assert len(seen) >= 2
    assert all(0 <= value <= 1 for value in seen)
    assert seen == sorted(seen)
    assert seen[-1] == 1
    assert where == {threading.get_ident()}


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("count", [1, 2])
def test_it_stops_under_way(count):
    mesh = gc.TriangleMesh(*zoo.icosphere(6))
    asked = []

    def cancel():
        asked.append(1)
        return len(asked) == 3

    points = list(range(0, len(mesh.vertices), len(mesh.vertices) // 50))
    before = threading.active_count()
    with pytest.raises(gc.errors.Cancelled):
        gc.distance_matrix(mesh, points, points[::-1], threads=count, cancel=cancel)
    assert len(asked) == 3
    assert threading.active_count() == before


def test_an_exception_in_a_thread_comes_out_as_it_is(mesh, monkeypatch):
    def fail(*_):
        raise LookupError("a thread's own")

    monkeypatch.setattr(TargetSweep, "rows", fail)
    with pytest.raises(LookupError, match="a thread's own"):
        gc.distance_matrix(mesh, [0, 1, 2], [3, 4, 5], threads=2)


@pytest.mark.slow
@pytest.mark.jit
def test_threads_are_as_many_as_memory_allows(mesh, monkeypatch):
    points = random_points(mesh, 9, seed=30)
    counts = []
    share_out = threads.share_out

    def counted(parts, workers, control):
        counts.append(len(workers))
        share_out(parts, workers, control)

    monkeypatch.setattr(threads, "share_out", counted)
    solver = gc.Solver(mesh)
    whole = solver.distance_matrix(points, points[:4], threads=3)
    needed = solver.nbytes
    for limit in (1.5 * needed, 4 * needed, 50 * needed):
        table = gc.distance_matrix(mesh, points, points[:4], threads=3, memory_limit=int(limit))
        np.testing.assert_array_equal(table, whole)
    assert counts == [3, 1, 2, 3]
    gc.distance_matrix(mesh, points, points[:4])
    assert counts[-1] == min(4, threads.available_cores())
    with pytest.raises(gc.errors.MemoryLimitExceeded, match=str(int(0.9 * needed))):
        gc.distance_matrix(mesh, points, points[:4], memory_limit=int(0.9 * needed))


def test_a_matrix_counts_as_memory(mesh):
    many = [0] * 1000
    with pytest.raises(gc.errors.MemoryLimitExceeded, match="8000000 bytes or more"):
        gc.distance_matrix(mesh, many, many, memory_limit=7_999_999)


@pytest.mark.jit
@pytest.mark.parametrize("method", ["exact", "approximate", "fast"])
@zoo.each({name: zoo.SMALL[name] for name in ("hills", "two_components", "octahedron")})
def test_without_targets_all_pairs_are_found_each_once(case, method, monkeypatch):
    mesh = mesh_of(case)
    points = [0, 5, gc.SurfacePoint.face(3, (0.2, 0.3, 0.5)), 1]
    expected = gc.distance_matrix(mesh, points, list(points), method=method)
    swept: list[int] = []
    rows = TargetSweep.rows

    def counted(memory, ends, limit, sweeps, columns, control):
        swept.extend(columns[1] - columns[0])
        return rows(memory, ends, limit, sweeps, columns, control)

    monkeypatch.setattr(TargetSweep, "rows", counted)
    for ask in (partial(gc.distance_matrix, mesh), gc.Solver(mesh).distance_matrix):
        swept.clear()
        table = ask(points, method=method)
        assert sorted(swept) == [1, 2, 3, 4]
        np.testing.assert_array_equal(table, expected)
        np.testing.assert_array_equal(table, table.T)
        np.testing.assert_array_equal(np.diag(table), 0.0)
        sparse = [
            ask(points, targets, method=method, layout="sparse") for targets in (None, points)
        ]
        np.testing.assert_array_equal(*map(as_dense, sparse))
        np.testing.assert_allclose(as_dense(sparse[0]), expected, rtol=EXACT)
    parts = gc.MatrixParts(mesh, points, method=method)
    assert parts.shape == (4, 4)
    np.testing.assert_array_equal(parts.compute(0), expected[np.ix_(*2 * [_order(mesh, points)])])
    assert gc.distance_matrix(mesh, 0).tolist() == [[0.0]]


def _order(mesh, points):
    return sweep_order(np.array([mesh.position(point) for point in map(mesh.point, points)]))

"""Fast distances: lengths of paths that exist, so never too short; mostly little too long."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.fields import fast_sweep, methods, sweep
from geodesic_core.kernels.fast import state as fast_state
from geodesic_core.kernels.fast.buckets import first_waiting, pop, push
from geodesic_core.kernels.fast.places import offer
from geodesic_core.kernels.front.bounds import exact_bounds
from geodesic_core.kernels.front.counters import CREATED, CURRENT, FAR_BUCKET
from geodesic_core.kernels.front.state import NO_SITES, view_of
from geodesic_core.kernels.jit import kernel
from geodesic_core.tolerances import FAR_NEARER, LAST_BUCKET, MOST_AT_LARGE, MOST_CROSSINGS
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.approximation import MERGING, some_sources
from tests.support.meshes import mesh_of
from tests.support.path_checks import check_path
from tests.support.stepping import topology_of, window, with_pool

EFFORTS = (1, 2) if WITHOUT_JIT else (1, 2, 4, 8)
each_effort = pytest.mark.parametrize("effort", EFFORTS)
EXACT = 1e-12
"""Relative: all that a fast distance may lie below the exact one."""
ROUNDING = 1e-9
INSIDE = gc.SurfacePoint.face(0, (0.2, 0.3, 0.5))
SOURCES = {
    "vertex": lambda _: 0,
    "inside": lambda _: INSIDE,
    "edge": lambda _: gc.SurfacePoint.edge(1, 0, 0.4),
    "curve": lambda mesh: gc.Curve([INSIDE, int(mesh.faces[0, 0])]),
    "several": lambda _: [gc.Source(0, 0.25), gc.SurfacePoint.face(2, (0.1, 0.1, 0.8))],
}
each_source = pytest.mark.parametrize("source", list(SOURCES))


@pytest.fixture
def always_fast(monkeypatch):
    """Fast sweeps of every effort, even where exact ones are as quick."""
    monkeypatch.setattr(methods, "FAST_FROM", {})


def check_never_below(found: np.ndarray, exact: np.ndarray) -> None:
    """Reached where the exact ones are, and no nearer."""
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(exact))
    reached = np.isfinite(exact)
    assert (found[reached] >= exact[reached] * (1 - EXACT)).all()


def check_paths(field: gc.DistanceField, exact: np.ndarray, targets) -> None:
    """Over the surface, no longer than the field says, no shorter than exact."""
    for target in targets:
        path = field.path_to(target)
        start = field.sources[field.nearest_source[target]].start_distance
        point = field.sources[field.nearest_source[target]].point
        rounding = ROUNDING * field.mesh.diagonal
        assert start + path.length <= field.distances[target] * (1 + ROUNDING) + rounding
        assert start + path.length >= exact[target] * (1 - ROUNDING) - rounding
        assert path.error_bound == field.error_bound
        if isinstance(point, int):
            check_path(field.mesh, path, point, target, path.length)


def reached_by(field: gc.DistanceField, count: int) -> list[int]:
    reached = np.flatnonzero(np.isfinite(field.distances) & (field.distances > 0.0))
    return np.random.default_rng(1).permutation(reached)[:count].tolist()


@pytest.mark.jit
@pytest.mark.usefixtures("always_fast")
@zoo.each(MERGING)
def test_more_effort_brings_accuracy(case):
    mesh = mesh_of(case)
    errors = []
    for effort in EFFORTS:
        errors.append(0.0)
        for source in some_sources(case, 8):
            exact = gc.exact_distance(mesh, source).distances
            field = gc.fast_distance(mesh, source, effort)
            errors[-1] += float((field.distances - exact).sum() / exact.sum())
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert errors[0] / 8 < 0.02
    assert errors[3] / 8 < 5e-4


@pytest.mark.jit
@pytest.mark.usefixtures("always_fast")
@each_source
@each_effort
@pytest.mark.parametrize("name", ["land", "islands", "ring"])
def test_every_source(name, effort, source):
    mesh = mesh_of(MERGING[name])
    sources = SOURCES[source](mesh)
    targets = [gc.SurfacePoint.face(5, (0.3, 0.3, 0.4)), gc.SurfacePoint.edge(9, 2, 0.25)]
    targets += [gc.SurfacePoint.face(0, (0.6, 0.2, 0.2)), 7]
    exact = gc.exact_distance(mesh, sources, targets=targets)
    field = gc.fast_distance(mesh, sources, effort, targets=targets)
    check_never_below(field.distances, exact.distances)
    check_paths(field, exact.distances, reached_by(field, 20))
    for target in targets:
        distance = field.distance_at(target)
        assert distance >= exact.distance_at(target) * (1 - EXACT)
        assert distance <= exact.distance_at(target) * 1.2
        path = field.path_to(target)
        start = field.sources[field.nearest_source_at(target)].start_distance
        assert start + path.length <= distance * (1 + ROUNDING)


@each_source
def test_points_that_were_no_targets_and_isolines_are_exact(source):
    mesh = mesh_of(MERGING["islands"])
    sources = SOURCES[source](mesh)
    exact = gc.exact_distance(mesh, sources, retain="windows")
    field = gc.fast_distance(mesh, sources, 1, retain="distances")
    point = gc.SurfacePoint.face(17, (0.3, 0.3, 0.4))
    assert field.distance_at(point) == exact.distance_at(point)
    assert field.nearest_source_at(point) == exact.nearest_source_at(point)
    assert field.path_to(point).length == exact.path_to(point).length
    levels = exact.levels(3)
    for found, lines in zip(field.isolines(levels), exact.isolines(levels), strict=True):
        assert len(found) == len(lines)
        for one, other in zip(found, lines, strict=True):
            np.testing.assert_array_equal(one.points, other.points)


@pytest.mark.jit
@pytest.mark.usefixtures("always_fast")
@each_effort
def test_barriers_and_limits(effort):
    mesh = mesh_of(MERGING["land"])
    barriers = list(range(40, 60))
    limit = 0.4 * float(gc.exact_distance(mesh, 0).distances.max())
    for options in ({"barriers": barriers}, {"max_distance": limit}):
        exact = gc.exact_distance(mesh, 0, **options)
        field = gc.fast_distance(mesh, 0, effort, **options)
        reached = np.isfinite(field.distances)
        assert (field.distances[reached] >= exact.distances[reached] * (1 - EXACT)).all()
        assert (field.distances[reached] <= limit).all() or "barriers" in options
        np.testing.assert_array_equal(field.nearest_source, np.where(reached, 0, -1))
        if "barriers" in options:
            np.testing.assert_array_equal(reached, np.isfinite(exact.distances))


@pytest.mark.parametrize("gap", [1e3, 1e9, 1e300])
def test_start_distances_far_beyond_the_ring_of_buckets(gap):
    """Two components, the second of which starts when the first has long been done."""
    sample = gc.samples.plane(50)
    vertices, faces = sample.vertices, sample.faces
    both = np.vstack([vertices, vertices + np.array([0.0, 0.0, 5.0])])
    mesh = gc.TriangleMesh(both, np.vstack([faces, faces + len(vertices)]))
    field = gc.fast_distance(mesh, [0, gc.Source(len(vertices) + 3, gap)])
    alone = gc.fast_distance(gc.TriangleMesh(vertices, faces), 0)
    np.testing.assert_allclose(field.distances[: len(vertices)], alone.distances, rtol=1e-15)
    assert (field.distances[len(vertices) :] >= gap).all()
    assert set(field.nearest_source[len(vertices) :].tolist()) == {1}


def test_ties_go_to_the_lower_source():
    mesh = gc.samples.plane(2)
    assert gc.fast_distance(mesh, [0, 3]).nearest_source.tolist() == [0, 0, 0, 1]


@pytest.mark.usefixtures("always_fast")
@each_effort
def test_the_same_to_the_bit_whatever_the_slices_and_the_room(effort, monkeypatch):
    mesh = mesh_of(MERGING["ring"])
    whole = gc.fast_distance(mesh, 3, effort)

    def crowded(*arguments):
        wave = new_wavefront(*arguments)
        return with_pool(wave, windows=wave.pool.windows[:40].copy())

    new_wavefront = fast_sweep.new_wavefront
    monkeypatch.setattr(fast_sweep, "new_wavefront", crowded)
    monkeypatch.setattr(fast_sweep, "_FIRST_BUDGET", 1)
    monkeypatch.setattr(sweep, "_SMALLEST_BUDGET", 1)
    monkeypatch.setattr(sweep, "SLICE_SECONDS", 0.0)
    sliced = gc.fast_distance(mesh, 3, effort)
    assert sliced.stats.windows_created == whole.stats.windows_created
    for name, array in whole.arrays().items():
        if name not in ("seconds", "counts"):
            np.testing.assert_array_equal(sliced.arrays()[name], array)


@pytest.mark.parametrize("retain", ["distances", "paths"])
def test_arrays_make_the_same_field(retain):
    mesh = mesh_of(MERGING["land"])
    field = gc.fast_distance(mesh, [SOURCES["curve"](mesh), 5], 2, targets=[9], retain=retain)
    again = gc.DistanceField.from_arrays(mesh, field.arrays())
    np.testing.assert_array_equal(again.distances, field.distances)
    assert again.error_bound == field.error_bound
    assert again.stats == field.stats
    for target in (3, 9, 50):
        np.testing.assert_array_equal(again.path_to(target).points, field.path_to(target).points)
    np.testing.assert_array_equal(again.gradient, field.gradient)


@pytest.mark.jit
@each_source
def test_the_gradient_is_the_direction_of_the_last_piece_of_the_path(source):
    mesh = mesh_of(MERGING["dented_ball"])
    field = gc.fast_distance(mesh, SOURCES[source](mesh), 1)
    for v in reached_by(field, 60):
        last = np.diff(field.path_to(v).points[-2:], axis=0)[0]
        cosine = float(last @ field.gradient[v] / np.linalg.norm(last))
        assert math.acos(min(cosine, 1.0)) < 1e-4


@pytest.mark.parametrize("effort", [0, 3, 16, -1, 2.5, True, "2", None, math.nan])
def test_efforts_that_are_none(effort):
    mesh = gc.samples.plane(2)
    with pytest.raises(gc.errors.InvalidArgument, match=r"effort is .*; it must be 1, 2, 4 or 8"):
        gc.fast_distance(mesh, 0, effort)


def test_windows_are_not_retained():
    mesh = gc.samples.plane(2)
    with pytest.raises(gc.errors.InvalidArgument, match="retain is 'windows'"):
        gc.fast_distance(mesh, 0, retain="windows")


@pytest.mark.usefixtures("always_fast")
def test_the_error_is_estimated_by_effort():
    mesh = gc.samples.plane(2)
    bounds = [gc.fast_distance(mesh, 0, effort).error_bound for effort in (1, 2, 4, 8)]
    assert {(bound.type, bound.kind) for bound in bounds} == {("relative", "estimated")}
    assert [bound.value for bound in bounds] == sorted({b.value for b in bounds}, reverse=True)


@pytest.mark.parametrize("effort", [4, 8])
def test_larger_efforts_run_exactly_where_that_is_as_quick(effort):
    mesh = mesh_of(MERGING["ring"])
    found, exact = gc.fast_distance(mesh, 3, effort), gc.exact_distance(mesh, 3)
    assert found.error_bound == exact.error_bound == gc.error_bound(mesh, "fast", effort=effort)
    assert found.distances.tobytes() == exact.distances.tobytes()
    assert found.stats.windows_created == exact.stats.windows_created
    np.testing.assert_array_equal(found.path_to(7).points, exact.path_to(7).points)
    together = gc.distance_matrix(mesh, [3], method="fast", effort=effort)
    assert together.tobytes() == gc.distance_matrix(mesh, [3]).tobytes()


@pytest.mark.jit
@pytest.mark.parametrize(
    ("faces", "is_rough", "fast"),
    [
        (19_999, False, [1, 2]),
        (20_000, False, [1, 2, 4]),
        (99_999, False, [1, 2, 4]),
        (100_000, False, [1, 2, 4, 8]),
        (100_000, True, [1, 2]),
    ],
)
def test_the_efforts_of_a_fast_sweep(monkeypatch, faces, is_rough, fast):
    mesh = gc.TriangleMesh(np.eye(3), np.tile([[0, 1, 2]], (faces, 1)))
    monkeypatch.setitem(vars(mesh), "is_rough", is_rough)
    bounds = {effort: gc.error_bound(mesh, "fast", effort=effort) for effort in (1, 2, 4, 8)}
    assert [effort for effort, bound in bounds.items() if bound.kind == "estimated"] == fast
    assert all(bound.value == 0.0 for effort, bound in bounds.items() if effort not in fast)


@pytest.mark.jit
@pytest.mark.usefixtures("always_fast")
@pytest.mark.parametrize(("most", "ends"), [(0, False), (12, True), (MOST_CROSSINGS, True)])
def test_most_crossings_are_more_than_a_fast_sweep_needs(monkeypatch, most, ends):
    mesh = gc.samples.sphere(20480)
    monkeypatch.setattr(fast_sweep, "MOST_CROSSINGS", most)
    if ends:
        assert np.isfinite(gc.fast_distance(mesh, 0, effort=8).distances).all()
    else:
        with pytest.raises(gc.errors.InternalError, match="exact_distance"):
            gc.fast_distance(mesh, 0, effort=8)


@kernel
def offer_to(topology, front, bounds, h, length, offered):
    """Offer a window to a half-edge that nothing has left by."""
    offer(view_of(topology, front, bounds), h, -1, length, offered)


def waiting(offers: int, sigma: float) -> int:
    """How many of some equal windows wait; they win no place, and all else known is 10.2 there."""
    square = gc.samples.plane(2)
    topology = topology_of(zoo.Case("square", square.vertices, square.faces))
    front = fast_state.new_wavefront(topology, NO_SITES, 1, 1.0, 0)
    front.vertices.distance[:], front.places.values[:] = 10.0, 10.0
    bounds = fast_state.fast_bounds(exact_bounds(math.inf))
    for _ in range(offers):
        offer_to(topology, front, bounds, 0, 1.0, window(0.1, 0.3, 0.2, 0.0, sigma))
    return int(front.counters[CREATED])


@kernel
def push_to(topology, front, bounds, h, pushed, key):
    """Have a window wait to cross a half-edge."""
    push(view_of(topology, front, bounds), h, pushed, 1, key)


@kernel
def take_from(topology, front, bounds):
    """Take the next window out of its bucket; return its row."""
    wave = view_of(topology, front, bounds)
    slot = first_waiting(wave)
    pop(wave, slot)
    return slot


def test_last_bucket_is_that_of_all_windows_beyond():
    topology = topology_of(zoo.SMALL["crags"])
    front = fast_state.new_wavefront(topology, NO_SITES, 1, 1.0, 0)
    bounds = fast_state.fast_bounds(exact_bounds(math.inf))
    keys = np.array([0.5, 1.0, 2.0, 1e30]) * LAST_BUCKET
    for key in keys:
        push_to(topology, front, bounds, 0, window(0.0, 1.0, 0.0, 0.0, key), key)
    assert front.counters[FAR_BUCKET] == 0.5 * LAST_BUCKET
    rows = [take_from(topology, front, bounds) for _ in keys]
    assert rows[0] == 0
    assert sorted(rows) == list(range(len(keys)))
    assert front.counters[CURRENT] == LAST_BUCKET


@pytest.mark.parametrize(("share", "goes_on"), [(1.001, True), (0.999, False)])
def test_far_nearer_lets_a_window_go_on_without_a_place(share, goes_on):
    assert waiting(1, 10.2 / (FAR_NEARER * share)) == goes_on


def test_most_at_large_bounds_the_windows_without_a_place():
    assert waiting(MOST_AT_LARGE + 3, 9.9) == MOST_AT_LARGE

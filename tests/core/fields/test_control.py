"""Progress, and stopping: on request, in time, within memory. Nothing is left behind."""

import threading
import time

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo

pytestmark = pytest.mark.jit


@pytest.fixture(scope="module")
def mesh():
    """Large enough for several slices of a sweep."""
    gc.warm_up()
    return gc.TriangleMesh(*zoo.icosphere(6))


@pytest.fixture(scope="module")
def distances(mesh):
    return gc.exact_distance(mesh, 0).distances


def check_usable(mesh, distances):
    np.testing.assert_array_equal(gc.exact_distance(mesh, 0).distances, distances)


def repeat_sweeps(mesh, cancel):
    """Sweep until told to stop, however fast the machine is."""
    while True:
        gc.exact_distance(mesh, 0, cancel=cancel)


@pytest.mark.parametrize("arguments", [{}, {"max_distance": 1.0}])
def test_progress_grows_from_zero_to_one(mesh, arguments):
    seen = []
    gc.exact_distance(mesh, 0, progress=seen.append, **arguments)
    assert len(seen) >= 2
    assert all(0 <= value <= 1 for value in seen)
    assert seen == sorted(seen)
    assert seen[-1] == 1


def test_progress_is_spread_over_the_sweep(mesh):
    """A true fraction of the work, as the processor's time tells it: never far behind or ahead."""
    seen = []
    start = time.thread_time()
    gc.exact_distance(mesh, 0, progress=lambda value: seen.append((time.thread_time(), value)))
    times, shares = np.transpose(seen)
    done = (times - start) / (time.thread_time() - start)
    assert np.abs(shares - done).max() < 0.35


@pytest.mark.parametrize("vertex", ["far", "isolated"])
def test_progress_ends_at_one_however_little_there_is_to_do(vertex):
    case = zoo.SMALL["isolated_vertices"]
    seen = []
    source = 0 if vertex == "isolated" else int(case.faces[0, 0])
    gc.exact_distance(gc.TriangleMesh(case.vertices, case.faces), source, progress=seen.append)
    assert seen[-1] == 1


def test_cancel_at_once(mesh, distances):
    with pytest.raises(gc.errors.Cancelled):
        gc.exact_distance(mesh, 0, cancel=lambda: True)
    check_usable(mesh, distances)


def test_cancel_is_asked_again_and_again(mesh, distances):
    asked = []

    def cancel():
        asked.append(1)
        return len(asked) == 3

    with pytest.raises(gc.errors.Cancelled):
        gc.exact_distance(mesh, 0, cancel=cancel)
    assert len(asked) == 3
    check_usable(mesh, distances)


def test_cancel_from_another_thread_stops_at_the_next_question(mesh, distances):
    is_under_way, stop, answers = threading.Event(), threading.Event(), []

    def cancel():
        is_under_way.set()
        answers.append(stop.is_set())
        return answers[-1]

    def press():
        is_under_way.wait()
        stop.set()

    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(gc.errors.Cancelled):
        repeat_sweeps(mesh, cancel)
    thread.join()
    assert answers.index(True) == len(answers) - 1
    check_usable(mesh, distances)


def test_a_false_cancel_changes_nothing(mesh, distances):
    np.testing.assert_array_equal(
        gc.exact_distance(mesh, 0, cancel=lambda: False, deadline_s=600.0).distances, distances
    )


def test_a_deadline_that_is_over_at_once(mesh, distances):
    with pytest.raises(gc.errors.DeadlineExceeded):
        gc.exact_distance(mesh, 0, deadline_s=1e-9)
    check_usable(mesh, distances)


def test_a_deadline_that_passes_under_way(mesh, distances, monkeypatch):
    seen, clock = [], time.perf_counter
    monkeypatch.setattr(time, "perf_counter", lambda: clock() + (1e6 if len(seen) == 2 else 0.0))

    with pytest.raises(gc.errors.DeadlineExceeded, match="within 100000 s"):
        gc.exact_distance(mesh, 0, deadline_s=1e5, progress=seen.append)
    assert len(seen) == 2
    monkeypatch.undo()
    check_usable(mesh, distances)


@pytest.mark.parametrize("limit", [1, 1000, 1_000_000])
def test_memory_limit(mesh, distances, limit):
    with pytest.raises(gc.errors.MemoryLimitExceeded, match=r"\d"):
        gc.exact_distance(mesh, 0, memory_limit=limit)
    check_usable(mesh, distances)


def test_memory_limit_is_what_the_sweep_needs(mesh, distances):
    stats = gc.exact_distance(mesh, 0).stats
    field = gc.exact_distance(mesh, 0, memory_limit=stats.peak_bytes)
    np.testing.assert_array_equal(field.distances, distances)
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.exact_distance(mesh, 0, memory_limit=stats.peak_bytes // 2)


def test_peak_memory_is_at_most_six_tenths_of_the_mesh(mesh):
    assert gc.exact_distance(mesh, 0).stats.peak_bytes <= 0.6 * mesh.nbytes


@pytest.mark.parametrize("stop", ["progress", "cancel"])
def test_an_exception_in_a_callback_comes_out_as_it_is(mesh, distances, stop):
    def fail(*_):
        raise LookupError("the caller's own")

    with pytest.raises(LookupError, match="the caller's own"):
        gc.exact_distance(mesh, 0, **{stop: fail})
    check_usable(mesh, distances)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"cancel": lambda: True}, gc.errors.Cancelled),
        ({"deadline_s": 1e-9}, gc.errors.DeadlineExceeded),
        ({"memory_limit": 1}, gc.errors.MemoryLimitExceeded),
    ],
)
def test_shortest_path_stops_too(mesh, arguments, error):
    with pytest.raises(error):
        gc.shortest_path(mesh, 0, len(mesh.vertices) - 1, **arguments)


def test_other_threads_run_while_a_sweep_does(mesh):
    """The kernels let go of the interpreter; else a thread had a turn or two between slices."""
    ticks, slices, done = [], [], threading.Event()

    def tick():
        while not done.wait(0.001):
            ticks.append(1)

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        for _ in range(50):  # however rarely a busy machine wakes a thread
            gc.exact_distance(mesh, 0, progress=slices.append)
            if len(ticks) > 4 * len(slices):
                break
    finally:
        done.set()
        thread.join()
    assert len(ticks) > 4 * len(slices)


# Approximate sweeps -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def approximate(mesh):
    return gc.approximate_distance(mesh, 0).distances


def check_still_usable(mesh, approximate):
    np.testing.assert_array_equal(gc.approximate_distance(mesh, 0).distances, approximate)


@pytest.mark.parametrize(
    "arguments", [{}, {"max_distance": 1.0}, {"retain": "paths"}, {"relative_error": 1e-6}]
)
def test_progress_of_approximate_sweeps_grows_to_one(mesh, arguments):
    seen = []
    gc.approximate_distance(mesh, 0, progress=seen.append, **arguments)
    assert len(seen) >= 2
    assert all(0 <= value <= 1 for value in seen)
    assert seen == sorted(seen)
    assert seen[-1] == 1


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"cancel": lambda: True}, gc.errors.Cancelled),
        ({"deadline_s": 1e-9}, gc.errors.DeadlineExceeded),
        ({"memory_limit": 1}, gc.errors.MemoryLimitExceeded),
        ({"memory_limit": 1_000_000}, gc.errors.MemoryLimitExceeded),
    ],
)
@pytest.mark.parametrize("retain", ["distances", "paths"])
def test_approximate_sweeps_stop_too(mesh, approximate, arguments, error, retain):
    with pytest.raises(error):
        gc.approximate_distance(mesh, 0, retain=retain, **arguments)
    check_still_usable(mesh, approximate)


def test_approximate_sweeps_are_stopped_under_way(mesh, approximate):
    asked = []

    def cancel():
        asked.append(1)
        return len(asked) == 2

    with pytest.raises(gc.errors.Cancelled):
        repeat_approximate_sweeps(mesh, cancel)
    assert len(asked) == 2
    check_still_usable(mesh, approximate)


def repeat_approximate_sweeps(mesh, cancel):
    while True:
        gc.approximate_distance(mesh, 0, 1e-6, cancel=cancel)


@pytest.mark.parametrize("retain", ["distances", "paths"])
def test_memory_limit_is_what_an_approximate_sweep_needs(mesh, approximate, retain):
    stats = gc.approximate_distance(mesh, 0, retain=retain).stats
    enough = {"retain": retain, "memory_limit": stats.peak_bytes}
    field = gc.approximate_distance(mesh, 0, **enough)
    np.testing.assert_array_equal(field.distances, approximate)
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.approximate_distance(mesh, 0, **(enough | {"memory_limit": stats.peak_bytes // 2}))


def test_what_is_merged_counts_as_memory(mesh):
    """What is enough without paths is not with them."""
    lean = gc.approximate_distance(mesh, 0).stats.peak_bytes
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.approximate_distance(mesh, 0, retain="paths", memory_limit=lean)


def test_an_exception_in_a_callback_of_an_approximate_sweep_comes_out(mesh, approximate):
    def fail(*_):
        raise LookupError("the caller's own")

    for stop in ("progress", "cancel"):
        with pytest.raises(LookupError, match="the caller's own"):
            gc.approximate_distance(mesh, 0, **{stop: fail})
    check_still_usable(mesh, approximate)

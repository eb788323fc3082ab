"""Sweeps under control: true progress, threads beside them, and the memory that they need."""

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


def test_memory_limit_is_what_the_sweep_needs(mesh, distances):
    stats = gc.exact_distance(mesh, 0).stats
    field = gc.exact_distance(mesh, 0, memory_limit=stats.peak_bytes)
    np.testing.assert_array_equal(field.distances, distances)
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.exact_distance(mesh, 0, memory_limit=stats.peak_bytes // 2)


def test_peak_memory_is_at_most_six_tenths_of_the_mesh(mesh):
    assert gc.exact_distance(mesh, 0).stats.peak_bytes <= 0.6 * mesh.nbytes


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

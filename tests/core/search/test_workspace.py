"""One solver in several threads: its calls run one after the other."""

import copy
import pickle
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.waiting import LONG_S

Call = Callable[..., Any]
CALLS: dict[str, Call] = {
    "path": lambda solver, **control: solver.shortest_path(0, 80, **control),
    "matrix": lambda solver, **control: solver.distance_matrix([0], [80], **control),
    "nearest": lambda solver, **control: solver.nearest(0, [80, 70], **control),
}


@pytest.fixture
def solver() -> gc.Solver:
    return gc.Solver(gc.TriangleMesh(*zoo.icosphere(3)))


@pytest.mark.slow
@pytest.mark.jit
def test_threads_get_the_answers_of_one_alone(solver):
    vertices = len(solver.mesh.vertices)
    pairs = np.random.default_rng(3).integers(0, vertices, (60, 2)).tolist()

    def ask(solver: gc.Solver, number: int) -> Any:
        a, b = pairs[number]
        if number % 3 == 0:
            return solver.distance_matrix([a, b], [b, 7])[0, 0]
        if number % 3 == 1:
            return solver.nearest(a, [b], k=1).distances[0]
        return solver.shortest_path(a, b).length

    alone = [ask(gc.Solver(solver.mesh), number) for number in range(len(pairs))]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda number: ask(solver, number), range(len(pairs))))
    np.testing.assert_allclose(together, alone, rtol=1e-13, atol=1e-15)


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("waiting", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("working", CALLS.values(), ids=CALLS)
def test_a_call_that_waits_can_be_stopped(solver, working, waiting):
    has_begun, may_end = threading.Event(), threading.Event()

    def hold(_: float) -> None:
        has_begun.set()
        may_end.wait(LONG_S)

    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(working, solver, progress=hold)
        try:
            assert has_begun.wait(LONG_S)
            with pytest.raises(gc.errors.Cancelled):
                waiting(solver, cancel=lambda: True)
            with pytest.raises(gc.errors.DeadlineExceeded):
                waiting(solver, deadline_s=0.01)
        finally:
            may_end.set()
        first.result()
    waiting(solver)


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.jit
def test_a_callback_cannot_call_the_solver_that_calls_it(solver, call):
    with pytest.raises(gc.errors.InvalidArgument, match="use another Solver"):
        call(solver, progress=lambda _: solver.shortest_path(1, 2))
    call(solver, progress=lambda _: gc.Solver(solver.mesh).shortest_path(1, 2))


@pytest.mark.jit
def test_functions_of_a_solver_are_its_methods(solver):
    assert gc.shortest_path(solver, 0, 80).length == solver.shortest_path(0, 80).length
    assert solver.nbytes > 0
    blocked = gc.shortest_path(solver, 0, 80, barriers=[3])
    assert blocked.length == gc.shortest_path(solver.mesh.with_barriers([3]), 0, 80).length


def pickled(solver: gc.Solver) -> Any:
    return pickle.loads(pickle.dumps(solver))  # noqa: S301 - our own


@pytest.mark.parametrize("copied", [copy.deepcopy, pickled])
@pytest.mark.jit
def test_a_copy_has_memory_of_its_own(solver, copied):
    length = solver.shortest_path(0, 80).length
    other = copied(solver)
    assert other.nbytes == 0
    assert other.shortest_path(0, 80).length == length

"""The memory of a search between two points, its legs and its progress."""

import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.searches import answer, landmark_count

pytestmark = pytest.mark.jit

FAR = (0, 5000)
"""Steps 2 and 4 are both long enough to need more memory than there is at first."""


@pytest.fixture(scope="module")
def mesh():
    gc.warm_up()
    return gc.TriangleMesh(*zoo.icosphere(6))


@pytest.fixture(scope="module")
def answers(mesh):
    """What new solvers say."""
    pairs = [FAR, (100, 17), (3, 3)]
    return {ends: answer(gc.shortest_path(mesh, *ends, explain=True)) for ends in pairs}


def check_usable(solver, answers):
    """The solver is as good as new: the same paths, steps, windows and faces, to the bit."""
    for ends, expected in answers.items():
        assert answer(solver.shortest_path(*ends, explain=True)) == expected
    assert landmark_count(solver) == 0, "else the steps would differ"


def times_asked(mesh, **options) -> int:
    asked = []
    gc.shortest_path(mesh, *FAR, cancel=lambda: asked.append(1), **options)
    return len(asked)


def on_call(number, act):
    """A callback that does as told when it is called for the given time."""
    calls = []

    def callback(*_):
        calls.append(1)
        return act() if len(calls) == number else False

    return callback


def test_the_memory_limit_is_what_the_search_needs(mesh, answers):
    """Too little in any phase is told; enough is enough."""
    least, most = (gc.Solver(mesh) for _ in range(2))
    least.shortest_path(0, 0)
    most.shortest_path(*FAR)
    assert least.nbytes < most.nbytes
    grown = most.nbytes - least.nbytes
    for limit in (1, least.nbytes - 1, least.nbytes, least.nbytes + grown // 3, most.nbytes - 1):
        solver = gc.Solver(mesh)
        with pytest.raises(gc.errors.MemoryLimitExceeded, match=str(limit)):
            solver.shortest_path(*FAR, memory_limit=limit)
        assert solver.nbytes <= max(limit, least.nbytes)
        check_usable(solver, answers)
    solver = gc.Solver(mesh)
    path = solver.shortest_path(*FAR, memory_limit=most.nbytes, explain=True)
    assert answer(path) == answers[FAR]


def test_a_stop_on_a_later_leg(mesh, answers):
    waypoints = [17, 5000]
    count = times_asked(mesh, waypoints=waypoints)
    assert count >= 9
    solver = gc.Solver(mesh)
    with pytest.raises(gc.errors.Cancelled):
        solver.shortest_path(*FAR, waypoints, cancel=on_call(count, lambda: True))
    assert solver.shortest_path(*FAR).length == answers[FAR][3]


@pytest.mark.parametrize("waypoints", [(), (17, 5000)])
def test_progress_grows_from_zero_to_one(mesh, waypoints):
    seen = []
    gc.Solver(mesh).shortest_path(*FAR, waypoints, progress=seen.append)
    assert (seen[0], seen[-1]) == (0.0, 1.0)
    assert seen == sorted(seen)
    assert len(set(seen)) >= 3 * (len(waypoints) + 1)

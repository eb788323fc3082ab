"""Every call that computes, with every way to watch it and to stop it. Nothing is left behind."""

import itertools
import math
import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core import control
from geodesic_core.cutting import retriangulation
from geodesic_core.errors import Cancelled, DeadlineExceeded, InvalidArgument, MemoryLimitExceeded
from geodesic_core.fields import fast_sweep, straight_lines, straighten, sweep
from tests.support import zoo
from tests.support.searches import answer, landmark_count

pytestmark = [pytest.mark.jit, pytest.mark.slow, pytest.mark.slice(8)]

INSIDE = gc.SurfacePoint.face(700, (0.2, 0.3, 0.5))
CURVE = gc.Curve([gc.SurfacePoint.face(40, w) for w in ((0.2, 0.3, 0.5), (0.6, 0.3, 0.1))])
CHORDS = [i / 64 for i in range(1, 64)]
MANY = list(range(0, 2000, 200))
TIGHT = {"relative_error": 1e-6}


@cache
def mesh() -> gc.TriangleMesh:
    return gc.TriangleMesh(*zoo.icosphere(4))


@cache
def knot() -> gc.TriangleMesh:
    return gc.samples.knot(2000)


@cache
def bent() -> gc.SurfaceCurve:
    """A path that is pulled over a quarter of a sphere."""
    return gc.shortest_path(mesh(), 0, 5, [1000, 2000])


def crossing_chords() -> list[gc.Curve]:
    ends = [(gc.SurfacePoint.edge(40, 0, t), gc.SurfacePoint.edge(40, 1, t)) for t in CHORDS]
    return [gc.Curve(pair) for pair in ends]


def solver() -> gc.Solver:
    return gc.Solver(mesh())


class Call(NamedTuple):
    """A call of what ``made`` returns: it is stopped at each of so many questions, or more."""

    made: Callable[[], Any]
    ask: Callable[..., Any]
    questions: int = 3


SWEEPS = {
    "exact": lambda m, **watch: gc.exact_distance(m, 0, **watch),
    "limit": lambda m, **watch: gc.exact_distance(m, 0, 1.0, **watch),
    "targets": lambda m, **watch: gc.exact_distance(m, CURVE, targets=[INSIDE], **watch),
    "windows": lambda m, **watch: gc.exact_distance(m, 0, retain="windows", **watch),
    "approximate": lambda m, **watch: gc.approximate_distance(m, 0, **watch),
    "approximate paths": lambda m, **watch: gc.approximate_distance(
        m, 0, **TIGHT, retain="paths", **watch
    ),
    "fast": lambda m, **watch: gc.fast_distance(m, 0, 8, **watch),
}
SWEEPS |= {
    "log map": lambda m, **watch: gc.log_map(m, INSIDE, x_axis=7, **watch),
    "cut": lambda m, **watch: gc.cut(m, crossing_chords(), **watch),
    "farthest points": lambda m, **watch: gc.farthest_points(m, 60, **watch).distances,
    "relaxed": lambda m, **watch: gc.relax_points(m, [INSIDE, 5, 900], 3, **watch).costs,
    "mean": lambda m, **watch: gc.mean_point(m, [INSIDE, 5, 900], **watch),
    "costs": lambda m, **watch: gc.cost_distance(m, 0, 1.0, detail="fine", **watch).costs,
    "cheapest path": lambda m, **watch: gc.cheapest_path(m, 0, 5, 1.0, **watch).cost,
    "sides": lambda m, **watch: gc.paths_around(m, 0, 2000, 1000, **watch),
    "lines": lambda m, **watch: gc.trace(m, MANY, np.arange(10.0), 300.0, **watch),
}
SEARCHES = {
    "path": lambda s, **watch: s.shortest_path(0, 2000, explain=True, **watch),
    "waypoints": lambda s, **watch: s.shortest_path(0, 2000, [17, INSIDE], **watch),
    "nearest": lambda s, **watch: s.nearest(0, MANY, 9, **watch),
}
MATRICES = {
    layout: lambda s, layout=layout, **watch: s.distance_matrix(
        [3] * 8 + [INSIDE, 5], MANY, layout=layout, threads=2, **watch
    )
    for layout in ("dense", "sparse", "pairs")
}
FIELDS: dict[str, Callable[[], gc.DistanceField]] = {
    "exact": lambda: gc.exact_distance(mesh(), 0),
    "kept": lambda: gc.exact_distance(mesh(), 0, retain="windows"),
    "approximate": lambda: gc.approximate_distance(mesh(), 0),
    "kept approximate": lambda: gc.approximate_distance(mesh(), 0, retain="windows"),
    "fast": lambda: gc.fast_distance(mesh(), 0),
    "curve": lambda: gc.exact_distance(mesh(), CURVE),
    "approximate curve": lambda: gc.approximate_distance(mesh(), CURVE),
    "two": lambda: gc.exact_distance(mesh(), [0, 2000]),
}
METHODS = {
    "isolines": lambda field, **watch: field.isolines(field.levels(3), **watch),
    "each_isoline": lambda field, **watch: list(field.each_isoline(field.levels(3), **watch)),
    "borders": lambda field, **watch: field.borders(**watch),
    "path_to a vertex": lambda field, **watch: field.path_to(300, **watch),
    "path_to": lambda field, **watch: field.path_to(INSIDE, **watch),
    "distance_at": lambda field, **watch: field.distance_at(INSIDE, **watch),
    "nearest_source_at": lambda field, **watch: field.nearest_source_at(INSIDE, **watch),
}


def computes(field: str, method: str) -> bool:
    """Whether a method of such a field sweeps or draws."""
    if method == "path_to a vertex":
        return field in ("approximate", "approximate curve")
    if method == "borders":
        return field == "two"
    return "isoline" in method or field != "kept"


PAIRS = list(itertools.product(FIELDS, METHODS))
CALLS = {name: Call(mesh, ask) for name, ask in SWEEPS.items()}
CALLS |= {name: Call(solver, ask) for name, ask in SEARCHES.items()}
CALLS |= {name: Call(solver, ask, 1) for name, ask in MATRICES.items()}  # threads are asked, too
CALLS |= {f"{f}: {m}": Call(FIELDS[f], METHODS[m]) for f, m in PAIRS if computes(f, m)}
CALLS["certify"] = Call(FIELDS["exact"], lambda field, **watch: field.certify(**watch).lower)
CALLS["cells"] = Call(FIELDS["two"], lambda field, **watch: field.cells(**watch).cell_of)
CALLS["loop"] = Call(knot, lambda m, **watch: gc.shortest_loop(m, 7, **watch))
CALLS["handles"] = Call(knot, gc.handle_loops)
CALLS["sweep steps"] = Call(knot, lambda m, **watch: gc.sweep_steps(m, 7, **watch).windows.d0)
CALLS["tight"] = Call(bent, gc.straighten)
READY = {f"{f}: {m}": Call(FIELDS[f], METHODS[m]) for f, m in PAIRS if not computes(f, m)}
TO_ONE = [name for name in CALLS if "_at" not in name and "path_to" not in name]
"""Calls whose progress ends at 1; that of a search for one point ends when it is found."""
IN_ROUNDS = ("loop", "handles")
"""Calls of several sweeps that tell their progress, the last of which is no question."""

each_call = pytest.mark.parametrize("name", CALLS)


@pytest.fixture(autouse=True)
def slices_by_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each slice twice as long as the one before, however fast the machine is."""
    for module in (control, sweep):
        monkeypatch.setattr(module, "SLICE_SECONDS", 1e9)
    for module in (sweep, fast_sweep):
        monkeypatch.setattr(module, "_FIRST_BUDGET", 2000)
    monkeypatch.setattr(control, "_FIRST_ITEMS", 8)
    monkeypatch.setattr(straight_lines, "_TRAIL", 100)
    monkeypatch.setattr(retriangulation, "_BUDGET", 500)
    monkeypatch.setattr(straighten, "_SLICE_CROSSINGS", 0)


def bits(found: Any) -> Any:
    """All of an answer that does not depend on the clock."""
    if isinstance(found, gc.DistanceField):
        near = int(np.argsort(found.distances)[50])
        counts = found.stats.as_dict() | {"seconds": 0.0}
        return [*map(bits, (found.distances, found.nearest_source, found.path_to(near))), counts]
    if isinstance(found, gc.CutMesh):
        return [*map(bits, (found.vertices, found.faces, found.edge_curves))]
    if isinstance(found, gc.LogMap):
        return [*map(bits, (found.distances, found.angles, found.bends))]
    if isinstance(found, gc.GeodesicPath):
        return answer(found)
    if isinstance(found, gc.SurfaceCurve | gc.Nearest):
        return [bits(part) for part in vars_of(found)]
    if isinstance(found, list | tuple):
        return [bits(part) for part in found]
    if hasattr(found, "toarray"):
        return found.toarray().tobytes()
    return found.tobytes() if isinstance(found, np.ndarray) else found


def vars_of(record: Any) -> Iterator[Any]:
    return (getattr(record, name) for name in record.__dataclass_fields__)


class Asked:
    """A callback that counts how often it is asked, and acts the n-th time."""

    def __init__(self, at: int | None = None, act: Callable[[], Any] = lambda: True) -> None:
        self.at = at
        self.act = act
        self.times = 0

    def __call__(self, *_: Any) -> Any:
        self.times += 1
        return self.act() if self.times == self.at else False


@cache
def expected(name: str) -> Any:
    call = CALLS[name]
    return bits(call.ask(call.made()))


def check_stopped(name: str, thing: Any, error: type[Exception], **watch: Any) -> None:
    """The call ends with this error, and what was asked is as good as new."""
    call = CALLS[name]
    with pytest.raises(error):
        call.ask(thing, **watch)
    if isinstance(thing, gc.Solver) and name != "waypoints":
        assert landmark_count(thing) == 0, "else the steps would differ"
    assert bits(call.ask(thing)) == expected(name)


def stops_of(name: str, callback: str) -> list[int]:
    """Numbers of questions at which a call is stopped: the first ones, some, and the last."""
    call, asked = CALLS[name], Asked()
    assert bits(call.ask(call.made(), **{callback: asked})) == expected(name)
    if call.questions == 1:
        return [1]
    assert asked.times >= call.questions
    stops = {1, 2, asked.times // 2}
    # The last progress is no question, and the last question may be about a landmark, which is
    # stopped without a word.
    if callback == "cancel" and name != "waypoints":
        stops |= {asked.times - 1, asked.times}
    return sorted(stops)


@each_call
def test_progress_grows(name: str) -> None:
    seen: list[float] = []
    call = CALLS[name]
    assert bits(call.ask(call.made(), progress=seen.append)) == expected(name)
    assert seen == sorted(seen)
    assert len(seen) >= max(2, call.questions)
    assert 0 <= seen[0] < 0.5
    assert seen[-1] <= 1
    assert seen[-1] == 1 or name not in TO_ONE


@each_call
def test_cancel_stops_where_it_says_yes(name: str) -> None:
    for at in stops_of(name, "cancel"):
        asked = Asked(at)
        check_stopped(name, CALLS[name].made(), Cancelled, cancel=asked)
        assert asked.times == at


@each_call
def test_a_deadline_that_is_over_at_once(name: str) -> None:
    check_stopped(name, CALLS[name].made(), DeadlineExceeded, deadline_s=1e-9)


@each_call
def test_a_deadline_that_passes_under_way(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, late = time.perf_counter, [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: clock() + late[-1])
    for at in stops_of(name, "progress"):
        late.append(0.0)
        asked, thing = Asked(at, lambda: late.append(1e6)), CALLS[name].made()
        with pytest.raises(DeadlineExceeded, match="within 100000 s"):
            CALLS[name].ask(thing, deadline_s=1e5, progress=asked)
        assert at <= asked.times <= at + (name in IN_ROUNDS)
        assert bits(CALLS[name].ask(thing)) == expected(name)


@each_call
@pytest.mark.parametrize("limit", [1, 1000])
def test_too_little_memory(name: str, limit: int) -> None:
    check_stopped(name, CALLS[name].made(), MemoryLimitExceeded, memory_limit=limit)


@each_call
def test_limits_that_are_not_met_change_nothing(name: str) -> None:
    call = CALLS[name]
    enough = {"deadline_s": 6e5, "memory_limit": 2**40, "cancel": lambda: False}
    assert bits(call.ask(call.made(), **enough)) == expected(name)


@each_call
@pytest.mark.parametrize("stop", ["progress", "cancel"])
def test_an_exception_in_a_callback_comes_out_as_it_is(name: str, stop: str) -> None:
    def fail() -> None:
        raise LookupError("the caller's own")

    for at in stops_of(name, stop):
        check_stopped(name, CALLS[name].made(), LookupError, **{stop: Asked(at, fail)})


@pytest.mark.parametrize("name", CALLS | READY)
@pytest.mark.parametrize("limit", ["deadline_s", "memory_limit"])
def test_limits_out_of_their_domain(name: str, limit: str) -> None:
    call = (CALLS | READY)[name]
    thing = call.made()
    for value in (0, -1, math.nan, "1", True, [1]):
        with pytest.raises(InvalidArgument, match=limit):
            call.ask(thing, **{limit: value})


@pytest.mark.parametrize("name", CALLS | READY)
@pytest.mark.parametrize("callback", ["progress", "cancel"])
def test_callbacks_are_functions(name: str, callback: str) -> None:
    call = (CALLS | READY)[name]
    with pytest.raises(InvalidArgument, match=f"{callback} is 3; it must be a function"):
        call.ask(call.made(), **{callback: 3})


@pytest.mark.parametrize("name", READY)
def test_what_is_there_is_not_computed(name: str) -> None:
    asked, call = Asked(1), READY[name]
    call.ask(call.made(), cancel=asked, memory_limit=1)
    assert asked.times == 0


@pytest.mark.parametrize(
    "name", ["approximate: path_to a vertex", "curve: distance_at", "curve: path_to"]
)
def test_what_was_swept_again_is_kept(name: str) -> None:
    asked, call = Asked(1), CALLS[name]
    field = call.made()
    first = bits(call.ask(field))
    assert bits(call.ask(field, cancel=asked)) == first
    assert asked.times == 0


@pytest.mark.parametrize("name", ["path", "nearest"])
def test_one_call_after_another_is_stopped(name: str) -> None:
    """What one interrupted search leaves, another must not build upon."""
    call, thing = CALLS[name], solver()
    for at in range(1, stops_of(name, "cancel")[-1] + 1):
        with pytest.raises(Cancelled):
            call.ask(thing, cancel=Asked(at))
    assert bits(call.ask(thing)) == expected(name)

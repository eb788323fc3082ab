"""Methods of fields that compute: watched and stopped like solvers, in time and in memory."""

import itertools

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core import control
from geodesic_core.errors import (
    Cancelled,
    DeadlineExceeded,
    InvalidArgument,
    MemoryLimitExceeded,
)
from geodesic_core.fields import sweep
from tests.support import zoo

pytestmark = pytest.mark.jit

INSIDE = gc.SurfacePoint.face(700, (0.2, 0.3, 0.5))
CURVE = gc.Curve([gc.SurfacePoint.face(40, w) for w in ((0.2, 0.3, 0.5), (0.6, 0.3, 0.1))])

FIELDS = {
    "exact": lambda mesh: gc.exact_distance(mesh, 0),
    "kept": lambda mesh: gc.exact_distance(mesh, 0, retain="windows"),
    "approximate": lambda mesh: gc.approximate_distance(mesh, 0),
    "kept approximate": lambda mesh: gc.approximate_distance(mesh, 0, retain="windows"),
    "curve": lambda mesh: gc.exact_distance(mesh, CURVE),
    "approximate curve": lambda mesh: gc.approximate_distance(mesh, CURVE),
}
CALLS = {
    "isolines": lambda field, **watch: field.isolines(field.levels(3), **watch),
    "each_isoline": lambda field, **watch: list(field.each_isoline(field.levels(3), **watch)),
    "path_to a vertex": lambda field, **watch: field.path_to(300, **watch),
    "path_to": lambda field, **watch: field.path_to(INSIDE, **watch),
    "distance_at": lambda field, **watch: field.distance_at(INSIDE, **watch),
    "nearest_source_at": lambda field, **watch: field.nearest_source_at(INSIDE, **watch),
}


def is_long(name, call):
    """Whether a call sweeps, or draws."""
    if "isoline" in call:
        return True
    if call == "path_to a vertex":
        return name in ("approximate", "approximate curve")
    return name != "kept"


PAIRS = list(itertools.product(FIELDS, CALLS))
LONG = [pair for pair in PAIRS if is_long(*pair)]
SHORT = [pair for pair in PAIRS if not is_long(*pair)]


@pytest.fixture(scope="module")
def mesh():
    return gc.TriangleMesh(*zoo.icosphere(4))


@pytest.fixture(autouse=True)
def slices_by_number(monkeypatch):
    """Each slice twice as long as the one before, however fast the machine is."""
    monkeypatch.setattr(sweep, "SLICE_SECONDS", 1e9)
    monkeypatch.setattr(control, "SLICE_SECONDS", 1e9)
    monkeypatch.setattr(sweep, "_FIRST_BUDGET", 2000)
    monkeypatch.setattr(control, "_FIRST_ITEMS", 8)


def flat(answer):
    """What there is in an answer that can be compared."""
    if isinstance(answer, list):
        return [(line.points.tobytes(), line.faces.tobytes()) for lines in answer for line in lines]
    if isinstance(answer, gc.GeodesicPath):
        return answer.points.tobytes()
    return answer


class Asked:
    """A ``cancel`` that counts how often it is asked, and answers yes the n-th time."""

    def __init__(self, stop_at=None):
        self.stop_at = stop_at
        self.times = 0

    def __call__(self):
        self.times += 1
        return self.times == self.stop_at


@pytest.mark.parametrize(("name", "call"), LONG)
def test_progress_grows(mesh, name, call):
    seen = []
    CALLS[call](FIELDS[name](mesh), progress=seen.append)
    assert seen == sorted(seen)
    assert len(seen) >= 3
    assert 0 <= seen[0] < 0.5
    assert seen[-1] <= 1
    if "isoline" in call:
        assert seen[-1] == 1
        assert np.diff(seen).max() < 0.5


@pytest.mark.slow
@pytest.mark.parametrize(("name", "call"), LONG)
def test_cancel_stops_wherever_it_is_asked(mesh, name, call):
    field = FIELDS[name](mesh)
    count = Asked()
    expected = flat(CALLS[call](FIELDS[name](mesh), cancel=count))
    assert count.times >= 3
    for stop_at in {1, 2, count.times // 2, count.times - 1, count.times}:
        asked = Asked(stop_at)
        with pytest.raises(Cancelled):
            CALLS[call](field, cancel=asked)
        assert asked.times == stop_at
    assert flat(CALLS[call](field)) == expected


@pytest.mark.slice(8)
@pytest.mark.parametrize(
    ("watch", "error"),
    [({"deadline_s": 1e-9}, DeadlineExceeded), ({"memory_limit": 1000}, MemoryLimitExceeded)],
)
@pytest.mark.parametrize(("name", "call"), LONG)
def test_deadline_and_memory_limit(mesh, name, call, watch, error):
    field = FIELDS[name](mesh)
    with pytest.raises(error):
        CALLS[call](field, **watch)
    enough = {"deadline_s": 600.0, "memory_limit": 2**40}
    assert flat(CALLS[call](field, **enough)) == flat(CALLS[call](FIELDS[name](mesh)))


@pytest.mark.parametrize(("name", "call"), SHORT)
def test_what_is_there_is_not_computed(mesh, name, call):
    field = FIELDS[name](mesh)
    asked = Asked(1)
    CALLS[call](field, cancel=asked, memory_limit=1)
    assert asked.times == 0


@pytest.mark.parametrize(("name", "call"), PAIRS)
def test_bad_limits(mesh, name, call):
    field = FIELDS[name](mesh)
    for bad in ({"deadline_s": 0}, {"deadline_s": "1"}, {"memory_limit": -1}):
        with pytest.raises(InvalidArgument, match=next(iter(bad))):
            CALLS[call](field, **bad)


@pytest.mark.parametrize(
    ("name", "call"),
    [("approximate", "path_to a vertex"), ("curve", "distance_at"), ("curve", "path_to")],
)
def test_what_was_swept_again_is_kept(mesh, name, call):
    field = FIELDS[name](mesh)
    first = flat(CALLS[call](field))
    asked = Asked(1)
    assert flat(CALLS[call](field, cancel=asked)) == first
    assert asked.times == 0


def test_a_level_alone_is_drawn_in_slices(mesh):
    field = FIELDS["kept"](mesh)
    (level,) = field.levels(1)
    one, bounds = Asked(), Asked()
    field.isolines([level], cancel=one)
    field.isolines([1e-9 * level], cancel=bounds)  # passes hardly a face
    assert one.times >= bounds.times + 6


def test_levels_are_drawn_when_they_are_asked_for(mesh):
    field = FIELDS["exact"](mesh)
    levels, asked = field.levels(5), Asked()
    drawn = field.each_isoline(levels, cancel=asked)
    assert asked.times == 0
    times = []
    for lines, expected in zip(drawn, field.isolines(levels), strict=True):
        assert flat([lines]) == flat([expected])
        times.append(asked.times)
    assert times == sorted(set(times))


@pytest.mark.parametrize("method", ["isolines", "each_isoline"])
def test_arguments_are_refused_at_once(mesh, method):
    draw = getattr(FIELDS["exact"](mesh), method)
    for arguments in (([-1.0],), ([1.0], 0.0), (0.5,)):
        with pytest.raises(InvalidArgument):
            draw(*arguments)


def test_no_level_within_reach_needs_no_sweep(mesh):
    field = gc.exact_distance(mesh, 0, max_distance=0.5)
    asked = Asked(1)
    assert field.isolines([0.6, 9.0], cancel=asked) == [[], []]
    assert field.isolines([], cancel=asked) == []
    assert asked.times == 0


def least_memory(draw):
    """The least limit, within a hundredth, that suffices."""
    low, high = 1.0, 2.0**40
    while high > 1.01 * low:
        middle = (low * high) ** 0.5
        try:
            draw(memory_limit=middle)
            high = middle
        except MemoryLimitExceeded:
            low = middle
    return high


def test_windows_and_what_is_drawn_count_as_memory(mesh):
    field = FIELDS["kept"](mesh)
    levels = field.levels(1)
    coarse = least_memory(lambda **watch: field.isolines(levels, **watch))
    fine = least_memory(lambda **watch: field.isolines(levels, 1e-8, **watch))
    assert coarse > 64 * field.stats.windows_kept
    points = sum(len(line.points) for line in field.isolines(levels, 1e-8)[0])
    assert fine > coarse + 0.5 * 24 * points


def test_isolines_keep_the_windows_of_the_faces_that_they_pass():
    mesh = gc.samples.plane(20_000)
    kept, field = gc.exact_distance(mesh, 0, retain="windows"), gc.exact_distance(mesh, 0)
    (level,) = field.levels(1)
    assert kept.stats.peak_bytes > 4 * field.stats.peak_bytes
    limit = 2 * field.stats.peak_bytes
    lines = field.isolines([level], memory_limit=limit)
    assert flat(lines) == flat(kept.isolines([level]))
    with pytest.raises(MemoryLimitExceeded):
        field.isolines([level], memory_limit=field.stats.peak_bytes)
    with pytest.raises(MemoryLimitExceeded):
        kept.isolines([level], memory_limit=limit)

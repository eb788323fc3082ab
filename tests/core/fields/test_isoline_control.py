"""Isolines under control: drawn in slices, level by level, within memory."""

import pytest

import geodesic_core as gc
from geodesic_core import control
from geodesic_core.errors import InvalidArgument, MemoryLimitExceeded
from geodesic_core.fields import sweep
from tests.support import zoo

pytestmark = pytest.mark.jit

FIELDS = {
    "exact": lambda mesh: gc.exact_distance(mesh, 0),
    "kept": lambda mesh: gc.exact_distance(mesh, 0, retain="windows"),
}


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
    return [(line.points.tobytes(), line.faces.tobytes()) for lines in answer for line in lines]


class Asked:
    """A ``cancel`` that counts how often it is asked, and answers yes the n-th time."""

    def __init__(self, stop_at=None):
        self.stop_at = stop_at
        self.times = 0

    def __call__(self):
        self.times += 1
        return self.times == self.stop_at


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

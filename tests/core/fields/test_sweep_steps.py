"""The steps of a sweep: windows against an oracle, counts against windows, and what is refused."""

from collections import Counter
from functools import cache

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.sweep_steps import MOST_FACES, MOST_STEPS
from tests.support import zoo
from tests.support.oracles import unfolding

CASES = zoo.SMALL | zoo.IRREGULAR
NAMES = [
    "hills",
    "crags_with_holes",
    "obstacles",
    "cube_in_fours",
    "saddle_cone",
    "pinched_cubes",
    "book_of_3",
]
ROUNDING = 1e-9
"""Of a distance, as a share of the largest"""


@cache
def steps_of(name: str, steps: int = MOST_STEPS) -> gc.SweepSteps:
    """So many that each is one operation."""
    return gc.sweep_steps((CASES[name].vertices, CASES[name].faces), 0, steps)


def waits(windows: gc.SweepWindows, step: int) -> np.ndarray:
    return (windows.crossed < 0) | (windows.crossed > step)


def values_at_middles(windows: gc.SweepWindows, lengths: np.ndarray) -> np.ndarray:
    """The distance by each window at the middle of its edge; infinite where it is elsewhere."""
    size = windows.b1 - windows.b0
    sx = (windows.b0 + windows.b1 + (windows.d0**2 - windows.d1**2) / size) / 2
    sy = np.sqrt(np.maximum(windows.d0**2 - (windows.b0 - sx) ** 2, 0))
    found = np.hypot(lengths / 2 - sx, sy) + windows.sigma
    beside = ROUNDING * lengths
    is_over = (windows.b0 <= lengths / 2 + beside) & (lengths / 2 <= windows.b1 + beside)
    return np.where(is_over, found, np.inf)


@pytest.mark.parametrize("name", NAMES)
def test_windows_give_the_exact_distances_on_edges_and_never_less(name: str) -> None:
    steps, case = steps_of(name), CASES[name]
    points, faces = zoo.subdivide(case.vertices, case.faces)
    oracle = unfolding.distance_matrix(points, faces)[0]
    scale = oracle[np.isfinite(oracle)].max()
    middles: dict[frozenset[int], int] = {}
    count: Counter[frozenset[int]] = Counter()
    for (a, b, c), middle in zip(case.faces.tolist(), faces[3::4].tolist(), strict=True):
        pairs = [frozenset(pair) for pair in ((a, b), (b, c), (c, a))]
        count.update(pairs)
        middles |= dict(zip(pairs, middle, strict=True))
    windows = steps.windows
    ends = list(zip(windows.tails.tolist(), windows.heads.tolist(), strict=True))
    at = np.array([middles[frozenset(pair)] for pair in ends])
    lengths = np.linalg.norm(case.vertices[windows.heads] - case.vertices[windows.tails], axis=1)
    values = values_at_middles(windows, lengths)

    assert (values >= oracle[at] - ROUNDING * scale).all(), "of windows that are trimmed as well"
    least = np.full(len(points), np.inf)
    crossed = windows.crossed >= 0
    np.minimum.at(least, at[crossed], values[crossed])
    inner = [pair for pair in middles if count[pair] > 1]  # beyond the boundary no window goes
    assert len(inner) > 5
    for a, b in inner:
        along = np.linalg.norm(case.vertices[a] - case.vertices[b]) / 2
        from_ends = min(steps.distances[a], steps.distances[b]) + along  # the path is the edge
        middle = middles[frozenset((a, b))]
        assert abs(min(least[middle], from_ends) - oracle[middle]) <= ROUNDING * scale


@pytest.mark.parametrize("name", NAMES)
def test_vertices_leave_the_queue_in_the_order_of_their_exact_distances(name: str) -> None:
    steps, case = steps_of(name), CASES[name]
    expected = unfolding.distance_matrix(case.vertices, case.faces)[0]
    reached = steps.settled >= 0

    np.testing.assert_allclose(steps.distances, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(reached, np.isfinite(expected))
    order = np.lexsort([steps.distances, steps.settled])
    assert (np.diff(steps.distances[order][-reached.sum() :]) >= 0).all()
    assert (np.diff(steps.fronts) >= 0).all()
    for step, front in enumerate(steps.fronts):
        there = reached & (steps.settled <= step)
        assert front == steps.distances[there].max(initial=0.0)


@pytest.mark.parametrize("name", NAMES)
def test_counts_are_those_of_the_windows_and_of_the_sweep(name: str) -> None:
    steps = steps_of(name)
    windows, every = steps.windows, np.arange(len(steps))
    stats = gc.exact_distance(steps.mesh, 0).stats

    def counted(column: np.ndarray, which: np.ndarray) -> np.ndarray:
        return np.bincount(column[which], minlength=len(every))

    shortened = windows.first == windows.crossed  # what is left of another one
    np.testing.assert_array_equal(
        np.diff(steps.created, prepend=0), counted(windows.first, ~shortened)
    )
    np.testing.assert_array_equal(
        np.diff(steps.crossed, prepend=0), counted(windows.crossed, windows.crossed >= 0)
    )
    np.testing.assert_array_equal(
        np.diff(steps.trimmed, prepend=0),
        counted(windows.last, windows.last >= 0) - counted(windows.first, shortened),
    )
    for step in every.tolist():
        there = windows.at(step)
        assert waits(there, step).sum() == steps.waiting[step]
    assert (steps.created[-1], steps.crossed[-1]) == (stats.windows_created, stats.windows_kept)
    assert (steps.waiting[0], steps.waiting[-1]) == (0, 0)


def test_few_steps_have_the_windows_of_many_at_the_end() -> None:
    few, many = steps_of("hills", 7), steps_of("hills")

    def at_the_end(steps: gc.SweepSteps) -> set[tuple[float, ...]]:
        windows = steps.windows.at(len(steps) - 1)
        columns = [windows.tails, windows.heads, windows.faces, windows.b0, windows.b1]
        columns += [windows.d0, windows.d1, windows.sigma, windows.pseudosources]
        return set(zip(*(column.tolist() for column in columns), strict=True))

    assert len(few) <= 8 < len(many)
    assert at_the_end(few) == at_the_end(many)
    assert len(at_the_end(few)) == few.crossed[-1]
    np.testing.assert_array_equal(few.distances, many.distances)


def test_the_field_is_that_of_the_usual_sweep_to_the_bit() -> None:
    mesh = gc.TriangleMesh(CASES["crags_with_holes"].vertices, CASES["crags_with_holes"].faces)
    inside = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
    sources = [gc.Source(inside, 0.25), 7]
    steps = gc.Solver(mesh).sweep_steps(sources, 30, barriers=[0])

    field = gc.exact_distance(mesh, sources, barriers=[0])
    np.testing.assert_array_equal(steps.distances, field.distances)
    assert steps.windows.pseudosources[0] == -1, "the source in the face, at once"
    assert (steps.windows.first[0], steps.windows.sigma[0]) == (0, 0.25)
    assert 0 not in steps.windows.faces


def test_pseudosources_are_saddles_and_vertices_of_the_boundary() -> None:
    steps = steps_of("crags_with_holes")
    windows = steps.windows
    found = np.setdiff1d(windows.pseudosources, [0])

    flags = steps.mesh.topology.flags[steps.mesh.topology.inner_vertex]
    assert len(found) > 3
    assert (flags[found] != 0).all()
    np.testing.assert_array_equal(windows.sigma, steps.distances[windows.pseudosources])
    assert (windows.first >= steps.settled[windows.pseudosources]).all()


@pytest.mark.parametrize(
    ("sources", "steps", "message"),
    [
        (0, 0, "from 1 to 1000"),
        (0, MOST_STEPS + 1, "from 1 to 1000"),
        (0, 2.5, "steps"),
        (gc.Curve([0, 1]), 5, "a source is a curve"),
    ],
)
def test_steps_that_cannot_be_are_refused(
    sources: gc.Curve | int, steps: int, message: str
) -> None:
    with pytest.raises(InvalidArgument, match=message):
        gc.sweep_steps(gc.samples.plane(8), sources, steps)


def test_meshes_with_too_many_faces_are_refused_and_told_what_to_do() -> None:
    mesh = gc.samples.plane(2 * 51**2)
    assert len(mesh.faces) > MOST_FACES
    with pytest.raises(InvalidArgument, match=r"at most 5000 faces.*simplify"):
        gc.sweep_steps(mesh, 0)


def test_the_repr_is_short() -> None:
    steps = gc.sweep_steps(gc.samples.plane(8), 0)
    assert repr(steps) == "SweepSteps(15 steps, 6 windows)"

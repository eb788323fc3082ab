"""Many points: a call that prepares them is as quickly stopped as a sweep."""

import sys
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core import validation
from geodesic_core.control import WATCHED_ITEMS
from tests.support import zoo

LIBRARY = str(Path(gc.__file__).parent)
KERNELS = str(Path(LIBRARY, "kernels"))

COUNT = 2000

MESH = gc.TriangleMesh(*zoo.grid(6, 6))


def points_in_faces():
    rng = np.random.default_rng(5)
    faces = rng.integers(len(MESH.faces), size=COUNT).tolist()
    weights = rng.dirichlet(np.ones(3), size=COUNT).tolist()
    return [gc.SurfacePoint.face(*each) for each in zip(faces, map(tuple, weights), strict=True)]


POINTS = points_in_faces()

LINE = [gc.SurfacePoint.edge(0, 0, t) for t in np.linspace(0.0, 1.0, COUNT)]
SHORT_LINES = [gc.Curve(LINE[i : i + 20]) for i in range(0, COUNT, 20)]


CALLS = {
    "sources": lambda **control: gc.exact_distance(MESH, POINTS, **control),
    "curve": lambda **control: gc.exact_distance(MESH, gc.Curve(LINE), **control),
    "short curves": lambda **control: gc.exact_distance(MESH, SHORT_LINES, **control),
    "targets": lambda **control: gc.exact_distance(MESH, 0, targets=POINTS, **control),
    "approximate": lambda **control: gc.approximate_distance(MESH, POINTS, **control),
    "candidates": lambda **control: gc.nearest(MESH, 0, POINTS, **control),
    "columns": lambda **control: gc.distance_matrix(MESH, [0], POINTS, **control),
    "rows": lambda **control: gc.distance_matrix(MESH, POINTS, [0], **control),
    "pairs": lambda **control: gc.distance_matrix(
        MESH, [0, 1] * (COUNT // 2), POINTS, layout="pairs", **control
    ),
    "waypoints": lambda **control: gc.shortest_path(MESH, 0, 1, POINTS[:800], **control),
}


class Stop:
    """A ``cancel`` that stops the call at one question, and counts the work between them.

    Work is functions of the library that are called or resumed, kernels apart.
    """

    def __init__(self, at=None):
        self.at = at
        self.work = [0]  # before each question, and after the last

    def __call__(self):
        self.work.append(0)
        return len(self.work) - 1 == self.at

    def count(self, frame, event, _):
        name = frame.f_code.co_filename
        if event == "call" and name.startswith(LIBRARY) and not name.startswith(KERNELS):
            self.work[-1] += 1

    def watch(self, call):
        before = sys.getprofile()
        sys.setprofile(self.count)
        try:
            return call(cancel=self)
        finally:
            sys.setprofile(before)


def check_questions(call):
    """Little is done between two questions, and next to nothing after the one that stops."""
    stop = Stop()
    stop.watch(call)
    assert max(stop.work) < 100 * WATCHED_ITEMS
    for at in (1, 2, COUNT // WATCHED_ITEMS):
        stop = Stop(at)
        with pytest.raises(gc.errors.Cancelled):
            stop.watch(call)
        assert len(stop.work) == at + 1
        assert stop.work[-1] < 20


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("name", CALLS)
def test_many_points_are_prepared_between_questions(name):
    check_questions(CALLS[name])


@pytest.mark.jit
def test_a_field_of_many_sources_is_asked_between_questions():
    sources = [gc.SurfacePoint.face(3, point.barycentric) for point in POINTS]
    field = gc.exact_distance(MESH, sources)
    check_questions(
        lambda **control: field.distance_at(gc.SurfacePoint.face(3, (0.1, 0.2, 0.7)), **control)
    )


@pytest.mark.parametrize("counts", [[1000], [999, 1], [1] * 1000, [0, 30] * 33 + [10]])
def test_all_that_a_call_watches_counts(counts):
    asked = []
    control, done = gc.Control(cancel=lambda: asked.append(1)), 0
    for size in counts:
        assert list(control.watched(range(size))) == list(range(size))
        done += size
        assert len(asked) == done // WATCHED_ITEMS
    assert done == 1000


def test_what_is_watched_ends_at_the_deadline():
    control, seen = gc.Control(deadline_s=1e-9), []
    with pytest.raises(gc.errors.DeadlineExceeded):
        seen.extend(control.watched(range(1000)))
    assert len(seen) < WATCHED_ITEMS


def test_what_is_watched_shows_no_progress():
    """It is known to no call what share of it this is: progress never goes back."""
    shown = []
    assert list(gc.Control(progress=shown.append).watched(range(1000))) == list(range(1000))
    assert shown == []


@pytest.mark.parametrize("kind", [int, np.int32, np.uint8])
def test_barriers_are_checked_by_their_types(monkeypatch, kind):
    asked = []
    is_index = validation.is_index
    monkeypatch.setattr(validation, "is_index", lambda face: asked.append(face) or is_index(face))
    barriers = [kind(face) for face in [5, 3, 5, 7]] * COUNT
    np.testing.assert_array_equal(validation.as_barriers(barriers, 72), [3, 5, 7])
    assert len(asked) == 1


@pytest.mark.parametrize("wrong", [True, np.True_, 5.0, "5", None, (1, 2)])
def test_the_first_barrier_at_fault_is_named(wrong):
    with pytest.raises(gc.errors.InvalidArgument, match=r"^barrier 3 is"):
        validation.as_barriers([5, 3, np.int64(7), wrong, 8, None, wrong], 72)


def test_many_barriers_are_stopped_before_the_mesh_is_made(monkeypatch):
    monkeypatch.setattr(gc.TriangleMesh, "with_barriers", lambda *_: pytest.fail("made"))
    with pytest.raises(gc.errors.Cancelled):
        gc.exact_distance(MESH, 0, barriers=[3], cancel=lambda: True)

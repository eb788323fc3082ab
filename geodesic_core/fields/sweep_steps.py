"""The steps of an exact sweep: its windows as they come, wait, cross faces and are trimmed away.

The sweep is the same as any other, run in small slices. Between two of them its arrays tell what
has changed, so that no kernel knows of its spectators.
"""

import math
from collections import defaultdict
from dataclasses import dataclass
from itertools import chain
from typing import ClassVar

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.question import Question
from geodesic_core.fields.sweep import NEVER, Engine
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import CREATED, PROPAGATED, RETAINED_ROWS, WORK
from geodesic_core.kernels.front.state import FIRST, SETTLED, SIZE, Wavefront
from geodesic_core.kernels.front.window import B0, B1, NEXT, ROOT, SIGMA, SX, SY
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL, Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep import continuous_dijkstra
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.validation import is_index

MOST_FACES = 5000
"""Of a mesh whose sweep can be followed: some 100 000 windows, 15 MB as JSON"""
MOST_STEPS = 1000
PACE = 3.0
"""Power of time with which work grows: a front that moves evenly has r² faces within distance r,
and about r windows on each of their edges."""


@dataclass(frozen=True, eq=False, repr=False)
class SweepWindows:
    """Windows of a sweep as columns, (N,) each, in the order in which they came.

    A window lies on an edge, seen from the face that it is about to cross. Where trimming makes it
    shorter, it ends, and what is left begins as another one.

    Examples
    --------
    >>> found = gc.sweep_steps(gc.samples.sphere(80), 0).windows
    >>> len(found) == len(found.b0)
    True
    """

    tails: Ints
    """int32: vertex from where b0 and b1 are measured."""
    heads: Ints
    """int32: vertex at the other end of the edge."""
    faces: Ints
    """int32: face that the window is about to cross, or has crossed. Its rays come from the other
    side of the edge, as τ says."""
    b0: Floats
    """Where it begins on the edge, mesh units."""
    b1: Floats
    """Where it ends."""
    d0: Floats
    """Distance of b0 from the pseudosource, mesh units."""
    d1: Floats
    """Distance of b1."""
    sigma: Floats
    """σ, distance of the pseudosource from the source."""
    pseudosources: Ints
    """int32: vertex that the rays come from; -1 where that is a source inside a face or an edge."""
    first: Ints
    """int32: step after which the window is there."""
    crossed: Ints
    """int32: step in which it crosses its face; until then it waits in the queue. -1 for never."""
    last: Ints
    """int32: step in which it was trimmed, away or to be shorter; -1 for never."""

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.first)

    def at(self, step: int) -> "SweepWindows":
        """Return the windows that are there after a step.

        Parameters
        ----------
        step
            Number of the step, from 0 for the start.

        Returns
        -------
        SweepWindows
            Those that wait, and those that have crossed their faces.

        Examples
        --------
        >>> steps = gc.sweep_steps(gc.samples.sphere(80), 0)
        >>> there = steps.windows.at(5)
        >>> waits = (there.crossed < 0) | (there.crossed > 5)
        >>> bool(waits.sum() == steps.waiting[5])
        True
        """
        there = (self.first <= step) & ((self.last < 0) | (self.last > step))
        return SweepWindows(*(column[there] for column in vars(self).values()))


@dataclass(frozen=True, eq=False, repr=False)
class SweepSteps:
    """All that an exact sweep does, step by step: the windows on edges, the front, the counts.

    Step 0 is the start. ``S`` is the number of steps, with it.

    Examples
    --------
    >>> steps = gc.sweep_steps(gc.samples.sphere(80), 0, 20)
    >>> len(steps) <= 21
    True
    >>> bool((np.diff(steps.fronts) >= 0).all())
    True
    """

    most_faces: ClassVar[int] = MOST_FACES
    """Of a mesh whose sweep can be followed."""

    mesh: TriangleMesh
    """The surface, with the barriers of the call."""
    windows: SweepWindows
    """Each with the steps in which it came, crossed a face, and was trimmed."""
    fronts: Floats
    """(S,) mesh units: distance of the farthest vertex that has left the queue."""
    created: Longs
    """(S,) windows created so far."""
    crossed: Longs
    """(S,) windows that have crossed a face so far."""
    waiting: Longs
    """(S,) windows that wait in the queue."""
    distances: Floats
    """(V,) exact distances, mesh units; infinite where unreachable."""
    settled: Ints
    """(V,) int32: step in which each vertex left the queue, with its distance; -1 for never."""

    def __len__(self) -> int:
        """Return the number of steps, with the start."""
        return len(self.fronts)

    def __repr__(self) -> str:
        return f"SweepSteps({len(self) - 1} steps, {len(self.windows)} windows)"

    @property
    def trimmed(self) -> Longs:
        """(S,) windows trimmed away so far: they never cross a face."""
        return self.created - self.crossed - self.waiting


def follow_sweep(question: Question, steps: int, control: Control) -> SweepSteps:
    """Run the exact sweep of a question twice: to know its work, and to follow it.

    Raises
    ------
    InvalidArgument
        The mesh has more than `MOST_FACES` faces, a source is a curve, or there are no or too many
        steps.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded, InternalError
        As in `WholeSweep.run_for`.
    """
    check_size(len(question.mesh.faces))
    if not is_index(steps) or not 1 <= steps <= MOST_STEPS:
        raise InvalidArgument(f"steps must be a whole number from 1 to {MOST_STEPS}, not {steps}")
    if question.has_curves:
        raise InvalidArgument("the steps of a sweep are those from points: a source is a curve")
    sweep, vertices = ExactSweep(question), len(question.mesh.topology.total_angle)
    unwatched = _Follower(vertices, [NEVER])
    sweep.run_for(control.for_part(0, 2), windows=sweep.all_faces, engine=unwatched.engine)
    work = [math.ceil(unwatched.work * (i / steps) ** PACE) for i in range(1, steps)]
    follower = _Follower(vertices, [*work, NEVER])
    wave = sweep.run_for(control.for_part(1, 2), windows=sweep.all_faces, engine=follower.engine)
    return follower.steps(question.mesh, wave)


def check_size(faces: int) -> None:
    """Refuse a mesh with too many faces."""
    if faces > MOST_FACES:
        raise InvalidArgument(
            f"the steps of a sweep can be followed on meshes of at most {MOST_FACES} faces, and "
            f"this one has {faces}: simplify it, or cut a part out"
        )


_Numbers = defaultdict[bytes, list[int]]
"""Numbers of windows by what they are; two may be the same, until one is trimmed away"""


class _Follower:
    """An engine of sweeps that pauses at given amounts of work, and notes what has changed."""

    def __init__(self, vertices: int, ends: list[int]) -> None:
        self.engine = Engine(self._advance)
        self.work = 0
        self._ends = ends  # work at which each step ends, ascending
        self._retained = 0  # rows that are known
        self._waiting: _Numbers = defaultdict(list)  # of the windows that wait
        self._rows: list[bytes] = []
        self._life: list[tuple[int, int, int]] = []  # first, crossed, last
        self._settled = np.full(vertices, -1, np.int32)  # by inner vertex
        self._counts: list[tuple[float, int, int, int]] = []

    def _advance(self, topology: Topology, wave: Wavefront, bounds: Bounds, budget: int) -> Outcome:
        if not self._counts:
            self._note(wave)
        left = max(min(self._ends[0] - self.work, budget), 1)
        outcome = continuous_dijkstra.advance(topology, wave, bounds, left)
        self.work += int(wave.counters[WORK])
        is_due = outcome == Outcome.RUNNING and self.work >= self._ends[0]
        while len(self._ends) > 1 and self.work >= self._ends[0]:
            self._ends.pop(0)
        if is_due or outcome == Outcome.FINISHED:
            self._note(wave)
        return outcome

    def _note(self, wave: Wavefront) -> None:
        step, vertices = len(self._counts), wave.vertices
        has_left = vertices.status == SETTLED
        self._settled[has_left & (self._settled < 0)] = step
        front = vertices.distance[: len(has_left)][has_left].max(initial=0.0)
        waiting = _waiting_windows(wave)
        counters = wave.counters
        counts = int(counters[CREATED]), int(counters[PROPAGATED]), len(waiting)
        self._counts.append((float(front), *counts))
        crossed = _keys(wave.pool.retained[self._retained : counters[RETAINED_ROWS]])
        self._retained = int(counters[RETAINED_ROWS])
        self._note_windows(step, crossed, waiting)

    def _note_windows(self, step: int, crossed: list[bytes], waiting: list[bytes]) -> None:
        before, self._waiting = self._waiting, defaultdict(list)
        for key in crossed:
            if before[key]:
                self._end(before[key].pop(), crossed=step)
            else:
                self._begin(key, (step, step, -1))
        for key in waiting:
            number = before[key].pop() if before[key] else self._begin(key, (step, -1, -1))
            self._waiting[key].append(number)
        for number in chain.from_iterable(before.values()):
            self._end(number, last=step)

    def _end(self, number: int, crossed: int = -1, last: int = -1) -> None:
        self._life[number] = (self._life[number][0], crossed, last)

    def _begin(self, key: bytes, life: tuple[int, int, int]) -> int:
        self._rows.append(key)
        self._life.append(life)
        return len(self._rows) - 1

    def steps(self, mesh: TriangleMesh, wave: Wavefront) -> SweepSteps:
        """Return what was noted, in the caller's numbers."""
        inner = mesh.topology.inner_vertex
        fronts, created, crossed, waiting = zip(*self._counts, strict=True)
        return SweepSteps(
            mesh,
            _as_columns(mesh.topology, self._rows, self._life),
            np.array(fronts),
            np.array(created),
            np.array(crossed),
            np.array(waiting),
            wave.vertices.distance[inner],
            self._settled[inner],
        )


_KEY = np.dtype([("numbers", np.float64, 5), ("root", np.int32), ("half_edge", np.int32)])
"""What makes a window: b0, b1, sx, sy and σ; its pseudosource; the half-edge that it is on"""


def _keys(rows: Floats) -> list[bytes]:
    """Return windows as bytes, from rows in which NEXT is the half-edge."""
    keys, ints = np.empty(len(rows), _KEY), rows.view(np.int32)
    keys["numbers"] = rows[:, [B0, B1, SX, SY, SIGMA]]
    keys["root"], keys["half_edge"] = ints[:, ROOT], ints[:, NEXT]
    return [key.tobytes() for key in keys]


def _waiting_windows(wave: Wavefront) -> list[bytes]:
    """Return the windows in lists as bytes, list by list."""
    lists, next_of = wave.pool.lists, wave.pool.windows.view(np.int32)[:, NEXT]
    half_edges = np.flatnonzero(lists[:, SIZE])
    left, slots = lists[half_edges, SIZE], lists[half_edges, FIRST]
    rows, owners = [], []
    while len(half_edges):
        rows.append(wave.pool.windows[slots])
        owners.append(half_edges)
        goes_on = left > 1
        half_edges, left, slots = half_edges[goes_on], left[goes_on] - 1, next_of[slots[goes_on]]
    if not rows:
        return []
    found = np.concatenate(rows)
    found.view(np.int32)[:, NEXT] = np.concatenate(owners)
    return _keys(found)


def _as_columns(
    topology: Topology, rows: list[bytes], life: list[tuple[int, int, int]]
) -> SweepWindows:
    keys = np.frombuffer(b"".join(rows), _KEY)
    b0, b1, sx, sy, sigma = (column.copy() for column in keys["numbers"].T)
    half_edges, roots = keys["half_edge"], keys["root"]
    is_vertex = roots < len(topology.outer_vertex)
    pseudosources = np.full(len(keys), -1, np.int32)
    pseudosources[is_vertex] = topology.outer_vertex[roots[is_vertex]]
    first, crossed, last = np.array(life, np.int32).reshape(-1, 3).T.copy()
    return SweepWindows(
        topology.outer_vertex[topology.links[half_edges, TAIL]],
        topology.outer_vertex[topology.links[half_edges, HEAD]],
        topology.outer_face[half_edges // 3],
        b0,
        b1,
        np.hypot(b0 - sx, sy),
        np.hypot(b1 - sx, sy),
        sigma,
        pseudosources,
        first,
        crossed,
        last,
    )

"""Invariants of a wavefront between any two steps of a sweep.

The order of a list along its edge is not among it: windows come in at the ends, but those of one
side may reach past those of the other, and a list is trimmed in one pass, each window against the
one before. What that pass owes is checked instead, by `check_survivors`: at no point of the edge
does the least distance of the list get lost.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from geodesic_core.kernels.front.counters import (
    FREE_FIRST,
    FREE_SIZE,
    FRESH,
    HEAP_SIZE,
    PROPAGATED,
    RING_HEAD,
    RING_SIZE,
    SETTLED_VERTICES,
)
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    FAR,
    FIRST,
    IN_RING,
    LAST,
    MARKS,
    PREDECESSOR,
    SETTLED,
    SIZE,
)
from geodesic_core.kernels.front.window import B0, B1, NEXT, ROOT, SIGMA, SX, SY
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    HEAD,
    LENGTH,
    LENGTH_LEFT,
    OPPOSITE,
    SIN_LEFT,
    TAIL,
)
from tests.support import zoo
from tests.support.oracles import unfolding

ROUNDING = 1e-12
"""Relative: some hundred roundings of 1e-16, and the tolerances of the core, which are as small."""


# The truth --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Exact:
    """Exact distances, in inner numbering."""

    vertices: np.ndarray
    """(V,)"""
    shares: np.ndarray
    """(S,): where half-edges are sampled, as shares of their length from the tail"""
    edges: np.ndarray
    """(3F, S)"""


@cache
def _refined(case: zoo.Case):
    """All distances of a mesh twice subdivided, and its vertices on each half-edge: (3F, 3)."""
    once = zoo.subdivide(case.vertices, case.faces)
    twice = zoo.subdivide(*once)
    face, edge = np.divmod(np.arange(3 * len(case.faces)), 3)
    # A split face gives three corner faces, in order, and the middle one, between its middles.
    middle = once[1][4 * face + 3, edge]
    first = twice[1][4 * (4 * face + edge) + 3, edge]
    second = twice[1][4 * (4 * face + (edge + 1) % 3) + 3, edge]
    return unfolding.distance_matrix(*twice), np.stack([first, middle, second], axis=1)


def exact_by_unfolding(case: zoo.Case, topology, sources, starts) -> Exact:
    """By the oracle, on a finer mesh of the same surface: at the quarters of the edges."""
    matrix, on_edges = _refined(case)
    best = (matrix[sources] + np.asarray(starts)[:, None]).min(axis=0)
    return Exact(
        best[: len(case.vertices)][topology.outer_vertex],
        np.array([0.25, 0.5, 0.75]),
        best[on_edges][_outer_half_edges(topology)],
    )


def exact_by_euclid(case: zoo.Case, topology, sources, starts) -> Exact:
    """On a convex planar mesh: at many points of the edges."""
    shares = np.linspace(0.0, 1.0, 9)
    tails = case.vertices[case.faces].reshape(-1, 3)
    heads = case.vertices[np.roll(case.faces, -1, axis=1)].reshape(-1, 3)
    points = tails[:, None] + shares[:, None] * (heads - tails)[:, None]

    def distances(points):
        from_each = np.linalg.norm(points[..., None, :] - case.vertices[sources], axis=-1)
        return (from_each + starts).min(axis=-1)

    return Exact(
        distances(case.vertices)[topology.outer_vertex],
        shares,
        distances(points)[_outer_half_edges(topology)],
    )


def _outer_half_edges(topology) -> np.ndarray:
    inner = np.arange(len(topology.links))
    return 3 * topology.outer_face[inner // 3] + inner % 3


# The state --------------------------------------------------------------------------------------


def check_wavefront(topology, wave, exact: Exact) -> None:
    """Check the whole state between two steps; O(V + F + windows)."""
    check_heap(wave)
    check_ring(topology, wave)
    check_pool(wave)
    check_vertices(wave, exact)
    check_windows(topology, wave, exact)


def check_heap(wave) -> None:
    """The heap's order, its inverse, and that it holds what can be in it."""
    heap = wave.queues.heap[: wave.counters[HEAP_SIZE]]
    place = np.full(len(wave.queues.heap), -1)
    place[heap] = np.arange(len(heap))
    assert len(np.unique(heap)) == len(heap)
    np.testing.assert_array_equal(wave.queues.heap_place, place)
    np.testing.assert_array_equal(wave.queues.heap_keys[: len(heap)], wave.vertices.distance[heap])
    keys = [(wave.vertices.distance[v], v) for v in heap]
    assert all(keys[(i - 1) // 4] < keys[i] for i in range(1, len(keys)))
    assert np.isfinite(wave.vertices.distance[heap]).all()
    reached = np.isfinite(wave.vertices.distance)
    assert (place[reached & (wave.vertices.status != SETTLED)] >= 0).all(), (
        "what is reached is done or waits"
    )
    assert wave.counters[SETTLED_VERTICES] == np.count_nonzero(wave.vertices.status == SETTLED)


def ring_of(wave) -> np.ndarray:
    places = wave.counters[RING_HEAD] + np.arange(wave.counters[RING_SIZE])
    return wave.queues.ring[places % len(wave.queues.ring)]


def check_ring(topology, wave) -> None:
    """The ring holds what is flagged, each once; and every list with an end that is done."""
    ring, sizes = ring_of(wave), wave.pool.lists[:, SIZE]
    np.testing.assert_array_equal(
        np.sort(ring), np.flatnonzero(wave.pool.lists[:, MARKS] & IN_RING)
    )
    assert (sizes[ring] > 0).all()
    ends_done = (wave.vertices.status[topology.links[:, [TAIL, HEAD]]] == SETTLED).any(axis=1)
    assert (wave.pool.lists[(sizes > 0) & ends_done, MARKS] & IN_RING).all(), (
        "a due list waits for nobody"
    )
    apex_status = wave.vertices.status[topology.links[:, APEX]]
    assert (
        (wave.vertices.status[topology.links[ring, TAIL]] != FAR) | (apex_status[ring] != FAR)
    ).all()


def slots_of(wave, h) -> list[int]:
    """The list of h."""
    slots, slot = [], int(wave.pool.lists[h, FIRST])
    for _ in range(wave.pool.lists[h, SIZE]):
        slots.append(slot)
        slot = int(_ints(wave)[slot, NEXT])
    return slots


def _ints(wave) -> np.ndarray:
    return wave.pool.windows.view(np.int32)


def check_pool(wave) -> None:
    """Every slot ever used is in one list, or free, or passed an edge, and nowhere twice."""
    free, slot = [], int(wave.counters[FREE_FIRST])
    for _ in range(wave.counters[FREE_SIZE]):
        free.append(slot)
        slot = int(_ints(wave)[slot, NEXT])
    assert slot == -1, "the free list ends"
    used = []
    for h in np.flatnonzero(wave.pool.lists[:, SIZE]):
        slots = slots_of(wave, h)
        assert slots[-1] == wave.pool.lists[h, LAST]
        used += slots
    for last in wave.pool.crossings[wave.pool.crossings >= 0].tolist():
        slot = last
        while slot >= 0:
            used.append(slot)
            slot = int(_ints(wave)[slot, NEXT])
    assert sorted(free + used) == list(range(wave.counters[FRESH]))
    assert wave.counters[FRESH] <= len(wave.pool.windows)


def check_vertices(wave, exact: Exact) -> None:
    """No vertex is nearer than it is, nor nearer than its winner makes it."""
    assert (wave.vertices.distance >= exact.vertices * (1 - ROUNDING)).all()
    reached = np.isfinite(wave.vertices.distance)
    assert (wave.vertices.winner_ints[~reached] == -1).all()
    at_source = reached & (wave.vertices.winner_ints[:, ENTRY_EDGE] < 0)
    np.testing.assert_array_equal(
        wave.vertices.winner_ints[at_source, PREDECESSOR], np.flatnonzero(at_source)
    )
    roots = wave.vertices.winner_ints[reached, PREDECESSOR]
    assert (wave.vertices.distance[roots] <= wave.vertices.distance[reached]).all()


def straight_distances(topology, wave) -> np.ndarray:
    """(V,): from the source over each vertex's winning pseudosource, straight from there."""
    found = wave.vertices.distance.copy()
    reached = np.flatnonzero(wave.vertices.winner_ints[:, ENTRY_EDGE] >= 0)
    rows = topology.geometry[wave.vertices.winner_ints[reached, ENTRY_EDGE]]
    apex = rows[:, LENGTH_LEFT, None] * rows[:, [COS_LEFT, SIN_LEFT]]
    onward = np.linalg.norm(apex - wave.vertices.winner[reached], axis=1)
    found[reached] = (
        wave.vertices.distance[wave.vertices.winner_ints[reached, PREDECESSOR]] + onward
    )
    return found


@dataclass(frozen=True)
class Windows:
    """Windows as columns: the half-edge of each, and its row."""

    half_edge: np.ndarray
    rows: np.ndarray
    root: np.ndarray

    def least(self, places: np.ndarray) -> np.ndarray:
        """(W, S): distances at the places (W, S) on their half-edges; infinite outside."""
        b0, b1, sx, sy, sigma = self.rows[:, [B0, B1, SX, SY, SIGMA]].T[:, :, None]
        inside = (b0 <= places) & (places <= b1)
        return np.where(inside, np.hypot(places - sx, sy) + sigma, math.inf)


def windows_of(wave, half_edges=None) -> Windows:
    """The windows in the lists of some half-edges, or of all."""
    if half_edges is None:
        half_edges = np.flatnonzero(wave.pool.lists[:, SIZE])
    slots = [(h, slot) for h in half_edges for slot in slots_of(wave, h)]
    owners, slots = np.array(slots, dtype=np.int64).reshape(-1, 2).T
    return Windows(owners, wave.pool.windows[slots], _ints(wave)[slots, ROOT])


def check_windows(topology, wave, exact: Exact) -> None:
    """Each window lies on its edge, has its source behind it, and promises no less than is true."""
    windows = windows_of(wave)
    length = topology.geometry[windows.half_edge, LENGTH]
    b0, b1, sx, sy, sigma = windows.rows[:, [B0, B1, SX, SY, SIGMA]].T
    assert (b0 >= 0).all()
    assert (b0 <= b1).all()  # equal by rounding: such a window falls to the next trimming
    assert (b1 <= length).all()
    assert (sy <= ROUNDING * np.hypot(sx, length)).all()
    assert (topology.links[windows.half_edge, OPPOSITE] >= 0).all(), "nothing waits at a boundary"
    assert (sigma >= wave.vertices.distance[windows.root]).all(), "pseudosources only come nearer"
    values = windows.least(exact.shares * length[:, None])
    assert (values >= exact.edges[windows.half_edge] * (1 - ROUNDING)).all()


def _least_of(windows: Windows) -> np.ndarray:
    """(W,): the least distance of each window."""
    b0, b1, sx, sy, sigma = windows.rows[:, [B0, B1, SX, SY, SIGMA]].T
    return np.hypot(np.clip(sx, b0, b1) - sx, sy) + sigma


# From step to step ------------------------------------------------------------------------------


def check_survivors(topology, wave, h: int, before: Windows, count: int, limit: float) -> None:
    """Of the list of h, now in scratch, trimming and filters kept what is nearest at each point.

    A path along the edge may stand in for a window.
    """
    length = topology.geometry[h, LENGTH]
    places = np.linspace(0.0, length, 33)
    tail, head = wave.vertices.distance[topology.links[h, [TAIL, HEAD]]]
    along = np.minimum(tail + places, head + length - places)
    survivors = Windows(np.full(count, h), wave.pool.scratch[:count], np.zeros(count))
    promised = before.least(places[None]).min(axis=0)
    kept = np.minimum(survivors.least(places[None]).min(axis=0, initial=math.inf), along)
    within = promised <= limit
    assert (kept[within] <= promised[within] * (1 + ROUNDING)).all()


class Watch:
    """Checks a sweep as it runs: every state, every list that is propagated, and the end."""

    def __init__(self, topology, wave, exact: Exact, limit: float = math.inf) -> None:
        self.topology, self.exact, self.limit = topology, exact, limit
        self.seen = np.full(exact.edges.shape, math.inf)
        """(3F, S): the least that any window promised to a point of an edge, from either side"""
        self._look(wave)

    def _look(self, wave) -> None:
        check_wavefront(self.topology, wave, self.exact)
        ring = ring_of(wave)
        self.due = int(ring[0]) if len(ring) else -1
        if self.due >= 0:
            self.before = windows_of(wave, [self.due])
        self.kept = wave.counters[PROPAGATED]
        windows = windows_of(wave)
        places = self.exact.shares * self.topology.geometry[windows.half_edge, LENGTH][:, None]
        np.minimum.at(self.seen, windows.half_edge, windows.least(places))

    def step(self, wave) -> None:
        """Check what a step has done; it was a list where one was due, else a vertex."""
        if self.due >= 0:
            count = int(wave.counters[PROPAGATED] - self.kept)
            check_survivors(self.topology, wave, self.due, self.before, count, self.limit)
        self._look(wave)

    def finish(self, wave) -> None:
        """Check that nothing is left to do within the limit, and that all answers are there."""
        assert wave.counters[RING_SIZE] == 0
        assert (wave.queues.heap_keys[: wave.counters[HEAP_SIZE]] > self.limit).all()
        assert not wave.pool.lists[:, SIZE].any()
        assert wave.counters[FREE_SIZE] == wave.counters[FRESH]
        exact = self.exact.vertices
        near = exact <= self.limit
        assert (wave.vertices.distance[~near] >= exact[~near] * (1.0 - ROUNDING)).all()
        np.testing.assert_allclose(wave.vertices.distance[near], exact[near], rtol=ROUNDING, atol=0)
        straight = straight_distances(self.topology, wave)
        np.testing.assert_allclose(straight[near], exact[near], rtol=ROUNDING, atol=0)
        self._check_edges(wave)

    def _check_edges(self, wave) -> None:
        """Every point of an edge had its distance from a window of one side, or along the edge."""
        links, shares = self.topology.links, self.exact.shares
        opposite = links[:, OPPOSITE]
        inside = opposite >= 0  # there are no windows on a boundary edge
        length = self.topology.geometry[:, LENGTH, None]
        tail, head = (wave.vertices.distance[links[:, column], None] for column in (TAIL, HEAD))
        along = np.minimum(tail + shares * length, head + (1 - shares) * length)
        found = np.minimum(self.seen, along)
        found[inside] = np.minimum(found[inside], self.seen[opposite[inside], ::-1])
        within = inside[:, None] & (self.exact.edges <= self.limit)
        exact = self.exact.edges[within]
        # A sampled point is itself rounded: it shows beside the source, where distances vanish.
        atol = 1e-15 * exact.max(initial=0.0, where=np.isfinite(exact))
        np.testing.assert_allclose(found[within], exact, rtol=ROUNDING, atol=atol)

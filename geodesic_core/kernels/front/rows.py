"""Rows of a table: sweeps from many sources, one after another in one call.

Each sweep leaves the distances of the targets that it reached as entries of its row, and resets
what it touched. So it costs what it touches, whatever the size of the mesh and the number of
targets. The rows of a call share their targets: those of a row are a run of them, its *columns*.

Kinds of sweep differ in how they run. Each hands in its `Kind`, and the kernels here are compiled
for each.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import TOUCHED, WORK
from geodesic_core.kernels.front.sites import Delivery, emit_site, reach_site_inside
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    NEXT_SITE,
    NODE,
    PREDECESSOR,
    SITE,
    WINNER,
    View,
    Wavefront,
    view_of,
)
from geodesic_core.kernels.jit import borrowed, inlined, kernel, pointers
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.tolerances import SEARCH_SLACK

# Columns of Rows.state
ROW = 0  # the row that is being swept, or the next one
LAST_ROW = 1  # one beyond the last row of the call
HAS_BEGUN = 2  # 1 once its sweep has started, else 0
ENTRIES = 3  # found so far
WAITED_FOR = 4  # the first target of the row that may be without a distance
PART = 5  # work after which the sweep looks again how far it has to go, ...
LEFT = 6  # ... and what is left of it
SPENT = 7  # work of the sweep, in whole parts
STATE = 8

FIRST_PART, LARGEST_PART = 10_000, 1_000_000  # units of about 10 ns
GROWTH = 1.25
"""Each part is a quarter of all before it, so that a sweep does not go on for longer than that once
it has found enough."""

WORK_OF_ROW = 100  # units, as above


class Rows(NamedTuple):
    """The rows of a call: R sources, M targets, and room for K entries."""

    sources: Ints
    """(R,): nodes"""
    source_sites: Ints
    """(R,): the first row of a source among those of the sites, or -1"""
    source_components: Ints
    """(R,): connected component"""
    first_columns: Ints
    """(R,): the first target of a row; ..."""
    last_columns: Ints
    """(R,): ... one beyond its last"""
    targets: Ints
    """(M,): nodes"""
    target_components: Ints
    """(M,)"""
    corners: Ints
    """(M, 3): the inner vertices around each target, or itself"""
    reaches: Floats
    """(M, 3): how far each is, mesh units"""
    next_target: Ints
    """(M,): the next target of the same node; -1 for none"""
    first_target: Ints
    """(N,): the first target of each node; -1 for none"""
    ends: Longs
    """(R,): entries up to the end of each row that is done"""
    columns: Ints
    """(K,): the target of each entry"""
    distances: Floats
    """(K,): its distance, mesh units"""
    limit: Floats
    """(1,): how far the present sweep still has to go, mesh units; infinite before that is known"""
    state: Longs
    """(STATE,): ROW … SPENT"""
    max_distance: float
    """Limit of all rows, mesh units"""
    wanted: int
    """Nearest targets of each row that are wanted; others may have too large distances, or none"""
    ends_early: bool
    """Whether a sweep ends once it has found what is wanted"""
    most_work: int
    """Work after which a sweep counts as one that never ends"""


class Kind(NamedTuple):
    """Four kernels of a kind of sweep."""

    delivery: Delivery
    run: Callable[[View, int], Outcome]
    """(wave, budget): run the sweep for a slice of work"""
    first_site: Callable[[View, int], int]
    """(wave, face): the row of the first site to reach in a face, or -1"""
    forget: Callable[[Topology, Wavefront], None]
    """(topology, wavefront): reset what the sweep touched, but for sites"""


@kernel
def advance(
    topology: Topology, wavefront: Wavefront, bounds: Bounds, table: Rows, budget: int, kind: Kind
) -> Outcome:
    """Sweep row after row for a slice of about ``budget`` units; return the outcome.

    The bounds have the limit of the rows where that is finite: `NARROWED` and `ROWS_DONE` tell that
    it may have changed, `ROWS_DONE` and `ROWS_FULL` that entries are to be taken out. A sweep does
    not depend on the slices. Modifies the wavefront and the rows.
    """
    room = len(table.columns) - len(table.targets)
    topology, wavefront, rows = borrowed(topology), borrowed(wavefront), pointers(table)
    wave, state = view_of(topology, wavefront, bounds), rows.state
    spent, first, outcome = 0, state[ROW], Outcome.FINISHED
    while state[ROW] < state[LAST_ROW]:
        if not state[HAS_BEGUN]:
            begin(wave, rows, kind.delivery)
        outcome = kind.run(wave, min(state[LEFT], budget - spent))
        spent += wave.counters[WORK]
        state[LEFT] -= wave.counters[WORK]
        if outcome == Outcome.RUNNING and state[LEFT] <= 0:
            outcome = next_part(wave, rows)
        if outcome == Outcome.RUNNING and spent < budget:
            continue
        if outcome != Outcome.FINISHED:
            break
        if state[ENTRIES] > room:
            outcome = Outcome.ROWS_FULL
            break
        spent += WORK_OF_ROW + wave.counters[TOUCHED]
        was_narrowed = rows.limit[0] < math.inf
        finish(wave, rows, kind)
        kind.forget(topology, wavefront)
        if was_narrowed or spent >= budget:
            outcome = Outcome.ROWS_DONE
            break
    wave.counters[WORK] = spent
    if outcome == Outcome.RUNNING and state[ROW] > first:
        return Outcome.ROWS_DONE
    return outcome


@kernel
def link_targets(targets: Ints, first_target: Ints, next_target: Ints) -> None:
    """Chain the targets of each node, as `Rows` has them, in their order.

    Modifies ``first_target`` (N,), which holds -1, and ``next_target`` (M,).
    """
    for i in range(len(targets) - 1, -1, -1):
        next_target[i] = first_target[targets[i]]
        first_target[targets[i]] = i


@kernel
def begin(wave: View, rows: Rows, delivery: Delivery) -> None:
    """Start the sweep of a row, unless none of its targets can be reached.

    Modifies the wavefront and the state of the rows.
    """
    vertices, state = wave.vertices, rows.state
    row = state[ROW]
    node, last = rows.sources[row], rows.last_columns[row]
    state[HAS_BEGUN], state[SPENT] = 1, 0
    state[PART] = state[LEFT] = FIRST_PART
    state[WAITED_FOR] = next_connected(rows, row, rows.first_columns[row])
    if state[WAITED_FOR] == last:
        return
    if node < wave.sizes.vertices:
        delivery.start_at(wave, node, 0.0)
        return
    vertices.distance[node] = 0.0
    vertices.winner_ints[WINNER * node + PREDECESSOR] = node
    for k in range(rows.source_sites[row], end_of_site(wave, rows.source_sites[row])):
        emit_site(wave, k, delivery)


@kernel
def end_of_site(wave: View, k: int) -> int:
    """Return the row after the last one of the site of row k; k where that is -1."""
    sites, end = wave.sites, k
    node = sites.ints[SITE * k + NODE] if k >= 0 else -1
    while 0 <= end < wave.sizes.sites and sites.ints[SITE * end + NODE] == node:
        end += 1
    return end


@inlined
def next_connected(rows: Rows, row: int, target: int) -> int:
    """Return the first column of a row, from a target on, that is connected to its source."""
    while target < rows.last_columns[row]:
        if rows.target_components[target] == rows.source_components[row]:
            break
        target += 1
    return target


@kernel
def next_part(wave: View, rows: Rows) -> Outcome:
    """Begin the next part of a sweep: `NARROWED`, `RUNNING`, or `RUNAWAY` after too much work.

    Modifies the limit and the state of the rows.
    """
    state = rows.state
    state[SPENT] += state[PART]
    state[PART] = state[LEFT] = min(int(GROWTH * state[PART]), LARGEST_PART)
    if state[SPENT] > rows.most_work:
        return Outcome.RUNAWAY
    if rows.ends_early:
        limit = wanted_distance(wave, rows) * (1.0 + SEARCH_SLACK)
        if limit < min(rows.limit[0], rows.max_distance):
            rows.limit[0] = limit
            return Outcome.NARROWED
    return Outcome.RUNNING


@kernel
def wanted_distance(wave: View, rows: Rows) -> float:
    """Return how far the sweep of the present row has to go at most, by what it knows so far.

    A distance known so far is that of a path: nothing beyond it can be nearer. While a target that
    counts has none, there is no limit: so it is looked at first. Modifies the state of the rows.
    """
    state = rows.state
    row, count, connected = state[ROW], 0, 0
    first, last = rows.first_columns[row], rows.last_columns[row]
    if rows.wanted >= last - first:
        target = state[WAITED_FOR]
        while target < last and known_distance(wave, rows, target) < math.inf:
            target = next_connected(rows, row, target + 1)
        state[WAITED_FOR] = target
        if target < last:
            return math.inf
    known = np.empty(last - first)
    target = next_connected(rows, row, first)
    while target < last:
        distance = known_distance(wave, rows, target)
        if distance < math.inf:
            known[count] = distance
            count += 1
        connected += 1
        target = next_connected(rows, row, target + 1)
    wanted = min(rows.wanted, connected)
    if count < wanted:
        return math.inf
    return nth_least(known, count, wanted - 1)


@kernel
def nth_least(values: Floats, count: int, n: int) -> float:
    """Return the n-th least of the first ``count`` values, from 0 (Hoare's selection). O(count).

    ``np.partition`` would take six seconds to compile. Reorders the values.
    """
    low, high = 0, count - 1
    while low < high:
        pivot, i, j = values[n], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if j < n:
            low = i
        if n < i:
            high = j
    return float(values[n])


@inlined
def known_distance(wave: View, rows: Rows, target: int) -> float:
    """Return an upper bound of the distance of a target; in a face, past one of its corners."""
    distance, node = wave.vertices.distance, rows.targets[target]
    known = distance[node]
    if node >= wave.sizes.vertices:
        for i in range(3):
            known = min(
                known, distance[rows.corners[3 * target + i]] + rows.reaches[3 * target + i]
            )
    return float(known)


@kernel
def finish(wave: View, rows: Rows, kind: Kind) -> None:
    """Write the entries of a row whose sweep is done, and go on to the next row.

    Resets the sites that the sweep reached. Modifies the rows.
    """
    vertices, state = wave.vertices, rows.state
    for i in range(wave.counters[TOUCHED]):
        v = vertices.touched[i]
        if vertices.distance[v] <= rows.max_distance:
            put_entries(rows, v, vertices.distance[v])
    if wave.sizes.sites > 0:
        finish_sites(wave, rows, kind)
    rows.ends[state[ROW]] = state[ENTRIES]
    state[ROW] += 1
    state[HAS_BEGUN], rows.limit[0] = 0, math.inf


@kernel
def finish_sites(wave: View, rows: Rows, kind: Kind) -> None:
    """Offer sites the paths that cross no edge, write their entries, and reset them.

    They are in faces of vertices that the sweep touched.
    """
    mesh, sites, vertices = wave.mesh, wave.sites, wave.vertices
    row = rows.state[ROW]
    first = rows.source_sites[row]
    last = end_of_site(wave, first)
    for is_reached in range(2):
        for i in range(wave.counters[TOUCHED]):
            v = vertices.touched[i]
            for c in range(mesh.first_corner[v], mesh.first_corner[v + 1]):
                k = kind.first_site(wave, mesh.corners[c] // 3)
                while k >= 0:
                    if is_reached:
                        take_site(wave, rows, sites.ints[SITE * k + NODE])
                    else:
                        reach_site_inside(wave, k, first, last, kind.delivery)
                    k = sites.ints[SITE * k + NEXT_SITE]
    if rows.sources[row] >= wave.sizes.vertices:
        reset_site(wave, rows.sources[row])


@kernel
def take_site(wave: View, rows: Rows, node: int) -> None:
    """Write the entries of a site, which has a row for each of its faces, and reset it."""
    distance = wave.vertices.distance[node]
    if distance < math.inf:
        if distance <= rows.max_distance:
            put_entries(rows, node, distance)
        reset_site(wave, node)


@kernel
def reset_site(wave: View, node: int) -> None:
    """Make a site one that is not reached. Modifies the node."""
    vertices = wave.vertices
    vertices.distance[node] = math.inf
    vertices.winner_ints[WINNER * node + ENTRY_EDGE] = -1
    vertices.winner_ints[WINNER * node + PREDECESSOR] = -1


@inlined
def put_entries(rows: Rows, node: int, distance: float) -> None:
    """Write an entry for each column of the present row that is at a node. Modifies the rows."""
    state = rows.state
    row, target = state[ROW], rows.first_target[node]
    while target >= 0:
        if rows.first_columns[row] <= target < rows.last_columns[row]:
            rows.columns[state[ENTRIES]] = target
            rows.distances[state[ENTRIES]] = distance
            state[ENTRIES] += 1
        target = rows.next_target[target]

"""The state of a sweep: caller-owned arrays, and the same as raw pointers for the kernels.

Lists of windows: every half-edge has a singly linked list of the windows that wait to cross its
face, ordered along the edge. Rows come from a pool with a last-in-first-out free list, which keeps
the rows in use within a cache's reach.
"""

import math
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs, Singles, aligned_rows
from geodesic_core.kernels.jit import inlined, kernel, pointer
from geodesic_core.kernels.mesh.half_edges import PINCHED, SEAM, Topology
from geodesic_core.kernels.sweep.window import WIDTH

# Columns of Wavefront.lists, a row per half-edge
SIZE = 0  # number of windows
FIRST = 1  # slot of the first window; without meaning in an empty list
LAST = 2
MARKS = 3  # below, and from SITE_SHIFT on 1 + the row of the first site to reach in its face
LIST = 4

IN_RING = 1  # the mark of a half-edge that is in the ring
RETAINED = 2  # of one whose windows are kept as they are propagated
SITE_SHIFT = 2

# Columns of Wavefront.site_ints, a row per site and face that it belongs to
NODE = 0  # its number among vertices and sites
FACE = 1
NEXT_SITE = 2  # row of the next site to reach in the same face; -1 at the end
SITE = 3

# Columns of Wavefront.piece_ints (the first two of those above) and piece_ends, a row per piece of
# a curve and face that it lies in
SEGMENT = 2
SEGMENT_END = 3  # barycentric coordinates of the one end from 0 on, of the other from here on
SEGMENT_ENDS = 6

# Columns of Wavefront.winner_ints, a row per node: the vertices, after them sites and pieces
ENTRY_EDGE = 0  # half-edge whose apex the vertex is and whose window reached it; -1 at a source
PREDECESSOR = 1  # node of that window's pseudosource; -1 where unreached, itself at a source
WINNER = 2

# Status of a vertex
FAR = 0
FRONT = 1  # shares a face with a vertex that is done
SETTLED = 2  # has left the heap

# Columns of Wavefront.light, a row per vertex: angles in its unfolded fan
LIT_FROM = 0  # the range of directions in which pseudosources are seen; empty if PREDECESSOR > TO
LIT_TO = 1
SENT_FROM = 2  # the same when windows were last emitted
SENT_TO = 3
SENT_AT = 4  # and the vertex's distance then; infinite before
LIGHT = 5

# Columns of Wavefront.merges (float64) and merge_ints (int32), a row per merge
SPLIT = 0  # position on the half-edge: left of it the first window counts, right of it the second
LEFT = 1  # SX, SY, SIGMA of the first window
RIGHT = 4  # of the second
MERGE = 7
MERGED_ON = 0  # half-edge
LEFT_REFERENCE = 1  # what was merged into the first window before; see `window`
RIGHT_REFERENCE = 2
MERGE_INTS = 3

LANDMARKS = 16  # of a mesh, at most: a cache line of distances per vertex

# Counters (after the queues' three)
FREE_FIRST = 3  # free list
FREE_SIZE = 4
FRESH = 5  # rows of the pool from here on were never used
SETTLED_VERTICES = 6
CREATED = 7  # windows, in all
KEPT = 8  # windows that survived trimming and were propagated
PEAK = 9  # windows alive at once, at most
WORK = 10  # done in this slice, about 10 ns each
MERGES = 11  # recorded for backtracing
TOUCHED = 12  # vertices
RETAINED_ROWS = 13  # of `kept`
COUNTERS = 16


class PruningBounds(NamedTuple):
    """What a pruned sweep is after (section 5): paths through a start, not longer than a limit.

    Lower bounds come from straight distances to the start, from landmarks and, where a sweep has
    been before, from its values, up to the ceiling within which it pruned nothing.
    """

    position: Floats
    """(3,): of the start"""
    limit: float
    """How long a path may be in all, mesh units; infinite where nothing is pruned"""
    landmarks: Singles
    """(V, LANDMARKS): distances from landmarks, or (0, LANDMARKS)"""
    least: Floats
    """(LANDMARKS,): lower bounds of the start's exact distances from the landmarks"""
    most: Floats
    """(LANDMARKS,): upper bounds of the same"""
    landmark_count: int
    known: Floats
    """(V,): distances of an earlier sweep, or (0,)"""
    ceiling: float
    """The limit of that sweep"""


def pruning_toward(
    position: Floats, limit: float, known: Floats | None = None, ceiling: float = math.inf
) -> PruningBounds:
    """Return a goal of which no landmarks are known."""
    return PruningBounds(
        position=position,
        limit=limit,
        landmarks=np.empty((0, LANDMARKS), np.float32),
        least=np.zeros(LANDMARKS),
        most=np.zeros(LANDMARKS),
        landmark_count=0,
        known=np.empty(0) if known is None else known,
        ceiling=ceiling,
    )


NO_PRUNING = pruning_toward(np.zeros(3), math.inf)
"""Of a sweep that is not pruned."""


class Sites(NamedTuple):
    """Points that are no vertices, and pieces of curves, as a sweep needs them; see `sites`."""

    nodes: int
    """How many points and pieces"""
    ints: Ints
    """(S, 3): NODE, FACE, NEXT_SITE; a site's rows follow each other, in the order of the nodes"""
    weights: Floats
    """(S, 3): barycentric, at the corners of the face"""
    windows: int
    """How many windows they may emit, at most"""
    piece_ints: Ints
    """(P, 2): NODE, FACE; a piece's rows follow each other, its node comes after all points'"""
    piece_ends: Floats
    """(P, 6): barycentric, of both ends"""


NO_SITES = Sites(
    0,
    np.empty((0, SITE), np.int32),
    np.empty((0, 3)),
    0,
    np.empty((0, SEGMENT), np.int32),
    np.empty((0, SEGMENT_ENDS)),
)


class Bounds(NamedTuple):
    """What a sweep keeps to."""

    max_distance: float
    """Windows wholly beyond it are dropped; mesh units, may be infinite"""
    relative_error: float
    """A window may fall short of the exact distance by this share of it, ..."""
    absolute_error: float
    """... and by no more than this; mesh units"""
    merging: tuple[int, ...]
    """Empty in an exact sweep. Its length is part of its type: kernels are compiled twice, and the
    exact ones carry nothing of merging"""
    goal: PruningBounds
    strips: tuple[int, ...]
    """Empty where no source is a curve; the same for windows that are strips"""
    first_piece: int
    """The first node that is a piece of a curve, if there are any"""


def exact_bounds(max_distance: float, goal: PruningBounds = NO_PRUNING) -> Bounds:
    """Return the bounds of a sweep that never merges."""
    return Bounds(max_distance, 0.0, 0.0, (), goal, (), 0)


def merging_bounds(
    max_distance: float,
    relative_error: float,
    absolute_error: float,
    goal: PruningBounds = NO_PRUNING,
) -> Bounds:
    """Return the bounds of a sweep that merges windows within both errors."""
    return Bounds(max_distance, relative_error, absolute_error, (1,), goal, (), 0)


def with_parallel_windows(bounds: Bounds, first_piece: int) -> Bounds:
    """Return the bounds of the same sweep from curves whose pieces are the nodes from there on."""
    return bounds._replace(strips=(1,), first_piece=first_piece)


class Wavefront(NamedTuple):
    """All that changes while a sweep runs; N counts vertices, sites and pieces."""

    distance: Floats
    """(N,): least distance known, infinite where unreached; final when the sweep has finished"""
    winner: Floats
    """(N, 2): unfolded pseudosource of the winning window, in the frame of its ENTRY_EDGE"""
    winner_ints: Ints
    """(N, 2): ENTRY_EDGE, PREDECESSOR"""
    status: Flags
    """(V,): FAR, FRONT or SETTLED"""
    origin: Ints
    """(N,): index of the source that the node had its distance from when it was last improved"""
    heap: Ints
    heap_keys: Floats
    heap_place: Ints
    ring: Ints
    lists: Ints
    """(3F, 4): SIZE, FIRST, LAST, MARKS"""
    windows: Floats
    """(P, 8): the pool, see `window`"""
    scratch: Floats
    """(S, 8): the list that is being propagated"""
    counters: Longs
    site_ints: Ints
    """(S, 3): NODE, FACE, NEXT_SITE; the sources' rows first"""
    site_weights: Floats
    """(S, 3): barycentric, at the corners of the face"""
    piece_ints: Ints
    """(P, 2): NODE, FACE"""
    piece_ends: Floats
    """(P, 6): barycentric, of both ends"""
    touched: Ints
    """(V,): the vertices that are not as they were at first"""
    heuristic: Floats
    """(V,): lower bound of the rest of a path from a touched vertex on; empty unless pruned"""
    kept: Floats
    """(K, 8): windows that crossed a RETAINED half-edge, as in the pool, NEXT the half-edge;
    or empty"""
    passed: Ints
    """(3F,): slot of what last passed an irregular edge, by its lowest half-edge; -1 at the end;
    empty where there are none"""
    # The following are empty unless the sweep merges.
    upper: Floats
    """(V,): upper bound of the exact distance"""
    light: Floats
    """(V, 5): LIT_FROM, LIT_TO, SENT_FROM, SENT_TO, SENT_AT"""
    reference: Ints
    """(N,): REFERENCE of the winning window"""
    runs: Flags
    """(3F,): how often the half-edge's list was propagated"""
    merges: Floats
    """(M, 7): SPLIT, LEFT, RIGHT; empty also where no paths are wanted"""
    merge_ints: Ints
    """(M, 3): MERGED_ON, LEFT_REFERENCE, RIGHT_REFERENCE"""


class View(NamedTuple):
    """A Topology and a Wavefront as raw pointers; plain arrays when the JIT is off."""

    positions: Any
    geometry: Any
    links: Any
    first_corner: Any
    corners: Any
    corner_angles: Any
    total_angle: Any
    flags: Any
    distance: Any
    winner: Any
    winner_ints: Any
    status: Any
    origin: Any
    heap: Any
    heap_keys: Any
    heap_place: Any
    ring: Any
    lists: Any
    windows: Any
    window_ints: Any
    scratch: Any
    scratch_ints: Any
    counters: Any
    site_ints: Any
    site_weights: Any
    touched: Any
    heuristic: Any
    kept: Any
    kept_ints: Any
    known: Any
    landmarks: Any
    start: Any
    least: Any
    most: Any
    passed: Any
    upper: Any
    light: Any
    reference: Any
    runs: Any
    merges: Any
    merge_ints: Any
    vertex_count: int
    site_count: int
    ring_capacity: int
    pool: int
    scratch_size: int
    keep_capacity: int
    merge_capacity: int
    max_distance: float
    relative_error: float
    absolute_error: float
    merging: tuple[int, ...]
    strips: tuple[int, ...]
    first_piece: int
    pruned: bool
    irregular: bool
    limit: float
    landmark_count: int
    knows: bool
    ceiling: float


@kernel
def view_of(topology: Any, wave: Any, bounds: Any) -> Any:
    """Return the View of two tuples of arrays, which the caller must hold meanwhile."""
    return View(
        pointer(topology.positions),
        pointer(topology.geometry),
        pointer(topology.links),
        pointer(topology.first_corner),
        pointer(topology.corners),
        pointer(topology.corner_angles),
        pointer(topology.total_angle),
        pointer(topology.flags),
        pointer(wave.distance),
        pointer(wave.winner),
        pointer(wave.winner_ints),
        pointer(wave.status),
        pointer(wave.origin),
        pointer(wave.heap),
        pointer(wave.heap_keys),
        pointer(wave.heap_place),
        pointer(wave.ring),
        pointer(wave.lists),
        pointer(wave.windows),
        pointer(wave.windows.view(np.int32)),
        pointer(wave.scratch),
        pointer(wave.scratch.view(np.int32)),
        pointer(wave.counters),
        pointer(wave.site_ints),
        pointer(wave.site_weights),
        pointer(wave.touched),
        pointer(wave.heuristic),
        pointer(wave.kept),
        pointer(wave.kept.view(np.int32)),
        pointer(bounds.goal.known),
        pointer(bounds.goal.landmarks),
        pointer(bounds.goal.position),
        pointer(bounds.goal.least),
        pointer(bounds.goal.most),
        pointer(wave.passed),
        pointer(wave.upper),
        pointer(wave.light),
        pointer(wave.reference),
        pointer(wave.runs),
        pointer(wave.merges),
        pointer(wave.merge_ints),
        topology.total_angle.shape[0],
        wave.site_ints.shape[0],
        wave.ring.shape[0],
        wave.windows.shape[0],
        wave.scratch.shape[0],
        wave.kept.shape[0],
        wave.merges.shape[0],
        bounds.max_distance,
        bounds.relative_error,
        bounds.absolute_error,
        bounds.merging,
        bounds.strips,
        bounds.first_piece,
        wave.heuristic.shape[0] > 0,
        wave.passed.shape[0] > 0,
        bounds.goal.limit,
        bounds.goal.landmark_count,
        bounds.goal.known.shape[0] > 0,
        bounds.goal.ceiling,
    )


@inlined
def merging(wave: Any) -> bool:
    """Whether the sweep merges windows; known when it is compiled."""
    return len(wave.merging) > 0


@inlined
def source_weight(wave: Any, root: int) -> float:
    """SW of a window with this root: 0 for a strip, which comes from a piece of a curve, else 1."""
    if len(wave.strips) > 0 and root >= wave.first_piece:
        return 0.0
    return 1.0


def new_wavefront(
    topology: Topology,
    sites: Sites = NO_SITES,
    *,
    merges: bool = False,
    paths: bool = False,
    windows: Flags | None = None,
    pruned: bool = False,
) -> Wavefront:
    """Allocate the state of one sweep: O(V + F), nothing reached yet.

    With ``paths``, a sweep that merges records what it merges, for backtracing. ``windows`` (F,)
    are the faces for which the sweep keeps the windows that it propagates into them.
    """
    vertices, half_edges = len(topology.total_angle), len(topology.links)
    nodes = vertices + sites.nodes
    irregular = bool((topology.flags & (SEAM | PINCHED)).any())
    merged_vertices, merged_nodes = (vertices, nodes) if merges else (0, 0)
    counters = np.zeros(COUNTERS, np.int64)
    counters[FREE_FIRST] = -1
    lists = np.zeros((half_edges, LIST), np.int32)
    if windows is not None:
        lists[:, MARKS] = np.repeat(np.where(windows, RETAINED, 0), 3)
    return Wavefront(
        distance=np.full(nodes, np.inf),
        winner=np.empty((nodes, 2)),
        winner_ints=np.full((nodes, WINNER), -1, np.int32),
        status=np.zeros(vertices, np.uint8),
        origin=np.zeros(nodes, np.int32),
        heap=np.empty(vertices, np.int32),
        heap_keys=np.empty(vertices),
        heap_place=np.full(vertices, -1, np.int32),
        ring=np.empty(half_edges, np.int32),
        lists=lists,
        windows=aligned_rows(1024 + sites.windows, WIDTH, np.float64),
        scratch=aligned_rows(256, WIDTH, np.float64),
        counters=counters,
        site_ints=sites.ints.copy(),
        site_weights=sites.weights,
        piece_ints=sites.piece_ints,
        piece_ends=sites.piece_ends,
        touched=np.empty(vertices, np.int32),
        heuristic=np.empty(vertices if pruned else 0),
        kept=aligned_rows(0 if windows is None else 4096, WIDTH, np.float64),
        passed=np.full(half_edges if irregular else 0, -1, np.int32),
        upper=np.full(merged_vertices, np.inf),
        light=np.tile([1.0, -1.0, 1.0, -1.0, np.inf], (merged_vertices, 1)),
        reference=np.full(merged_nodes, -1, np.int32),
        runs=np.zeros(half_edges if merges else 0, np.uint8),
        merges=np.empty((1024 if paths else 0, MERGE)),
        merge_ints=np.empty((1024 if paths else 0, MERGE_INTS), np.int32),
    )


def with_sites(wave: Wavefront, sites: Sites) -> Wavefront:
    """Return the wavefront, which has room for as many nodes, with other sites."""
    return wave._replace(site_ints=sites.ints, site_weights=sites.weights)


def with_larger_pool(wave: Wavefront) -> Wavefront:
    """Return the wavefront with twice the windows."""
    windows = aligned_rows(2 * len(wave.windows), WIDTH, np.float64)
    windows[: len(wave.windows)] = wave.windows
    return wave._replace(windows=windows)


def with_larger_scratch(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room for lists twice as long."""
    return wave._replace(scratch=aligned_rows(2 * len(wave.scratch), WIDTH, np.float64))


def with_more_retained(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room to keep twice the windows."""
    kept = aligned_rows(2 * len(wave.kept), WIDTH, np.float64)
    kept[: len(wave.kept)] = wave.kept
    return wave._replace(kept=kept)


def with_more_merges(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room for twice the merges."""
    room = 2 * len(wave.merges)
    merges, merge_ints = np.empty((room, MERGE)), np.empty((room, MERGE_INTS), np.int32)
    merges[: len(wave.merges)] = wave.merges
    merge_ints[: len(wave.merges)] = wave.merge_ints
    return wave._replace(merges=merges, merge_ints=merge_ints)


def bytes_of(wave: Wavefront) -> int:
    """Memory of the state."""
    return sum(map(_NBYTES, wave))


_NBYTES = attrgetter("nbytes")

"""The state of a sweep: caller-owned arrays in groups, and the same as pointers for kernels.

Each group is a named tuple of arrays. `Wavefront` holds those that change in a sweep. A kernel that
is called from Python takes the mesh, the wavefront and the bounds and makes them a `View`: the same
groups, with pointers in place of arrays. So each field is defined once, in its group, for all kinds
of sweep. What a kind has no use for is `ABSENT`: kernels compiled for it do not carry it.

Windows wait in one of two ways. In most sweeps every half-edge has a singly linked list of those
that are to cross its face, ordered along the edge. A fast sweep has `Places` instead.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import ABSENT, Counts, Flags, Floats, Ints, Longs, aligned_rows
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import new_counters
from geodesic_core.kernels.jit import inlined, kernel, pointers, rows_of
from geodesic_core.kernels.mesh.half_edges import PINCHED, SEAM, Topology

WIDTH = 8  # columns of a row of windows, float64: a cache line

# Columns of Pool.lists, a row per half-edge
SIZE = 0  # number of windows
FIRST = 1  # slot of the first window; without meaning in an empty list
LAST = 2
MARKS = 3  # below, and from SITE_SHIFT on 1 + the row of the first site to reach in its face
LIST = 4

IN_RING = 1  # the mark of a half-edge that is in the ring
RETAINED = 2  # of one whose windows are retained as they are propagated
SITE_SHIFT = 2

# Columns of Sites.ints, a row per site and face that it belongs to
NODE = 0  # its number among vertices and sites
FACE = 1
NEXT_SITE = 2  # row of the next site to reach in the same face; -1 at the end
SITE = 3

# Columns of Sites.segment_ints (the first two of those above) and segment_ends, a row per segment
# of a curve and face that it lies in
SEGMENT = 2
SEGMENT_END = 3  # barycentric coordinates of the one end from 0 on, of the other from here on
SEGMENT_ENDS = 6

# Columns of Vertices.winner_ints, a row per node: the vertices, after them sites and segments
ENTRY_EDGE = 0  # half-edge whose apex the vertex is and whose window reached it; -1 at a source
PREDECESSOR = 1  # node of that window's pseudosource; -1 where unreached, itself at a source
WINNER = 2

# Status of a vertex
FAR = 0  # the sweep has not come near yet
SEEN = 1  # it is among the touched vertices
FRONT = 2  # shares a face with a settled vertex
SETTLED = 3  # has left the heap

# Columns of Vertices.light, a row per vertex: angles in its unfolded fan
LIT_FROM = 0  # the range of directions in which pseudosources are seen; empty if LIT_FROM > LIT_TO
LIT_TO = 1
SENT_FROM = 2  # the same when windows were last emitted
SENT_TO = 3
SENT_AT = 4  # and the vertex's distance then; infinite before
LIGHT = 5

# Columns of Merges.floats and Merges.ints, a row per merge
SPLIT = 0  # position on the half-edge: left of it the first window counts, right of it the second
LEFT = 1  # SX, SY, SIGMA of the first window
RIGHT = 4  # of the second
MERGE = 7
MERGED_ON = 0  # half-edge
LEFT_REFERENCE = 1  # reference of the first window before; see `window`
RIGHT_REFERENCE = 2
MERGE_INTS = 3


class Sites(NamedTuple):
    """Points that are no vertices, and segments of curves, as nodes; see `surface_points`."""

    nodes: int
    """Number of points and segments"""
    ints: Ints
    """(S, 3): NODE, FACE, NEXT_SITE; a site's rows follow each other, in the order of the nodes;
    the sources' rows come first"""
    weights: Floats
    """(S, 3): barycentric, at the corners of the face"""
    windows: int
    """Number of windows they may emit, at most"""
    segment_ints: Ints
    """(P, 2): NODE, FACE; a segment's rows follow each other, its node comes after all points'"""
    segment_ends: Floats
    """(P, 6): barycentric, of both ends"""


NO_SITES = Sites(
    0,
    np.empty((0, SITE), np.int32),
    np.empty((0, 3)),
    0,
    np.empty((0, SEGMENT), np.int32),
    np.empty((0, SEGMENT_ENDS)),
)


class Queues(NamedTuple):
    """The heap of vertices and the ring of half-edges, see `queues`; ABSENT from a fast sweep."""

    heap: Ints
    """(V,): vertices, the first HEAP_SIZE of them in use"""
    heap_keys: Floats
    """(V,): their keys"""
    heap_place: Ints
    """(V,): place in the heap by vertex, or -1"""
    ring: Ints
    """(3F,): half-edges, RING_SIZE of them in use from RING_HEAD on"""


class Pool(NamedTuple):
    """All windows: those that wait, in rows with a free list; those in scratch; those retained."""

    windows: Floats
    """(P, 8): those that wait, see `window`"""
    # The following are ABSENT from a fast sweep.
    lists: Ints
    """(3F, 4): SIZE, FIRST, LAST, MARKS"""
    scratch: Floats
    """(S, 8): the list that is being propagated"""
    retained: Floats
    """(K, 8): windows that crossed a RETAINED half-edge, as in the pool, NEXT the half-edge;
    or empty"""
    crossings: Ints
    """(3F,): crossing history: slot of the last window over an irregular edge, by its lowest
    half-edge; -1 at the end; empty where there are none"""
    runs: Counts
    """(3F,): how often the half-edge's list was propagated"""


class Merges(NamedTuple):
    """The record of merges; empty unless the sweep merges and paths are wanted."""

    floats: Floats
    """(M, 7): SPLIT, LEFT, RIGHT"""
    ints: Ints
    """(M, 3): MERGED_ON, LEFT_REFERENCE, RIGHT_REFERENCE"""


class Places(NamedTuple):
    """Where the windows of a fast sweep are compared, and where they wait; ABSENT from others.

    Each half-edge has K places, points at equal distances.
    """

    values: Floats
    """(3F, K): least distance offered at each place of a half-edge"""
    at_large: Flags
    """(3F,): windows that went on without a place"""
    buckets: Ints
    """(BUCKETS, 2): see `buckets`"""
    first_site: Ints
    """(F,): row of the first site to reach in a face, -1 for none; or empty"""
    per_edge: int
    """K: 1 to 8"""
    buckets_per_unit: float
    """1 / width of a bucket, mesh units"""


class Vertices(NamedTuple):
    """Vertices as they are reached; N counts sites and segments as well, V vertices alone."""

    distance: Floats
    """(N,): least distance known, infinite where unreached; final when the sweep has finished"""
    winner: Floats
    """(N, 2): unfolded pseudosource of the winning window, in the frame of its ENTRY_EDGE"""
    winner_ints: Ints
    """(N, 2): ENTRY_EDGE, PREDECESSOR"""
    source_index: Ints
    """(N,): index of the source that the node had its distance from when it was last improved"""
    crossing: Floats
    """(N,): where the path to the node crosses its ENTRY_EDGE, mesh units from the tail; NaN where
    it begins in the same face and crosses none; empty but in fast sweeps, for lines are straight"""
    reference: Ints
    """(N,): REFERENCE of the winning window; empty unless the sweep merges"""
    # The following are empty unless the sweep is directed.
    turn: Floats
    """(N,): turn of the winning window, radians; NaN where the way crosses no edge, or bends"""
    mirrored: Flags
    """(N,): whether its frame is seen in the mirror"""
    touched: Ints
    """(V,): the vertices that are not as they were at first"""
    # The following are ABSENT from a fast sweep.
    status: Flags
    """(V,): FAR, SEEN, FRONT or SETTLED"""
    heuristic: Floats
    """(V,): lower bound of the rest of a path from a touched vertex on; empty unless pruned"""
    # The following are empty unless the sweep merges.
    upper: Floats
    """(V,): upper bound of the exact distance"""
    light: Floats
    """(V, 5): LIT_FROM, LIT_TO, SENT_FROM, SENT_TO, SENT_AT"""


class Wavefront(NamedTuple):
    """All that changes while a sweep runs."""

    queues: Queues
    pool: Pool
    places: Places
    vertices: Vertices
    merges: Merges
    sites: Sites
    counters: Longs
    """(COUNTERS,): see `counters`"""


def _new_merges(count: int) -> Merges:
    return Merges(np.empty((count, MERGE)), np.empty((count, MERGE_INTS), np.int32))


NO_MERGES = _new_merges(0)
NO_POOL = Pool(*[ABSENT] * len(Pool._fields))
NO_QUEUES = Queues(*[ABSENT] * len(Queues._fields))
NO_PLACES = Places(*[ABSENT] * len(Places._fields))


class Sizes(NamedTuple):
    """Rows of arrays, which a pointer does not tell; ABSENT where the array is."""

    vertices: int
    ring: int
    windows: int
    scratch: int
    retained: int
    crossings: int
    merges: int
    heuristic: int
    known: int
    sites: int
    segments: int
    first_site: int


class View(NamedTuple):
    """All that a kernel sees of a sweep: arrays as raw pointers, or flat when the JIT is off."""

    mesh: Topology
    queues: Queues
    pool: Pool
    places: Places
    vertices: Vertices
    merges: Merges
    sites: Sites
    counters: Longs
    bounds: Bounds
    sizes: Sizes


@inlined
def sizes_of(topology: Topology, wavefront: Wavefront, bounds: Bounds) -> Sizes:
    """Return the Sizes of two groups of arrays."""
    pool, sites = wavefront.pool, wavefront.sites
    return Sizes(
        vertices=rows_of(topology.total_angle),
        ring=rows_of(wavefront.queues.ring),
        windows=rows_of(pool.windows),
        scratch=rows_of(pool.scratch),
        retained=rows_of(pool.retained),
        crossings=rows_of(pool.crossings),
        merges=rows_of(wavefront.merges.floats),
        heuristic=rows_of(wavefront.vertices.heuristic),
        known=rows_of(bounds.pruning.known),
        sites=rows_of(sites.ints),
        segments=rows_of(sites.segment_ints),
        first_site=rows_of(wavefront.places.first_site),
    )


@kernel
def view_of(topology: Topology, wavefront: Wavefront, bounds: Bounds) -> View:
    """Return the View of groups of arrays, which the caller must hold meanwhile."""
    view: View = pointers(
        View(
            topology,
            wavefront.queues,
            wavefront.pool,
            wavefront.places,
            wavefront.vertices,
            wavefront.merges,
            wavefront.sites,
            wavefront.counters,
            bounds,
            sizes_of(topology, wavefront, bounds),
        )
    )
    return view


@inlined
def merging(wave: View) -> bool:
    """Whether the sweep merges windows; known when it is compiled."""
    return len(wave.bounds.merging) > 0


@inlined
def directed(wave: View) -> bool:
    """Whether windows carry directions; known when it is compiled."""
    return len(wave.bounds.directed) > 0


@inlined
def mirrors(wave: View) -> bool:
    """Whether they may carry them into the mirror; known when it is compiled."""
    return len(wave.bounds.directed) > 1


@inlined
def source_weight(wave: View, root: int) -> float:
    """SW of a window with this root: 0 for a parallel one, which comes from a segment, else 1."""
    if len(wave.bounds.parallel) > 0 and root >= wave.bounds.first_segment:
        return 0.0
    return 1.0


@inlined
def is_pruned(wave: View) -> bool:
    """Whether the sweep looks for paths of limited length only (section 5)."""
    return wave.sizes.heuristic > 0


def new_wavefront(
    topology: Topology,
    sites: Sites = NO_SITES,
    *,
    merges: bool = False,
    paths: bool = False,
    windows: Flags | None = None,
    pruned: bool = False,
    directed: bool = False,
) -> Wavefront:
    """Allocate the state of one sweep: O(V + F), nothing reached yet.

    With ``paths``, a sweep that merges records what it merges, for backtracing. ``windows`` (F,)
    are the faces for which the sweep retains the windows that it propagates into them.
    """
    vertices, half_edges = len(topology.total_angle), len(topology.links)
    nodes = vertices + sites.nodes
    merged_vertices, merged_nodes = (vertices, nodes) if merges else (0, 0)
    return Wavefront(
        queues=Queues(
            heap=np.empty(vertices, np.int32),
            heap_keys=np.empty(vertices),
            heap_place=np.full(vertices, -1, np.int32),
            ring=np.empty(half_edges, np.int32),
        ),
        pool=_new_pool(topology, sites, windows),
        places=NO_PLACES,
        vertices=new_vertices(nodes)._replace(
            reference=np.full(merged_nodes, -1, np.int32),
            turn=np.empty(nodes if directed else 0),
            mirrored=np.zeros(nodes if directed else 0, np.uint8),
            status=np.zeros(vertices, np.uint8),
            touched=np.empty(vertices, np.int32),
            heuristic=np.empty(vertices if pruned else 0),
            upper=np.full(merged_vertices, np.inf),
            light=np.tile([1.0, -1.0, 1.0, -1.0, np.inf], (merged_vertices, 1)),
        ),
        merges=_new_merges(1024) if paths else NO_MERGES,
        sites=sites._replace(ints=sites.ints.copy()),
        counters=new_counters(),
    )


def new_vertices(nodes: int) -> Vertices:
    """Allocate what any sweep tells of its nodes, nothing reached yet; the rest is absent."""
    return Vertices(
        distance=np.full(nodes, np.inf),
        winner=np.zeros((nodes, 2)),
        winner_ints=np.full((nodes, WINNER), -1, np.int32),
        source_index=np.zeros(nodes, np.int32),
        crossing=np.empty(0),
        reference=np.empty(0, np.int32),
        turn=np.empty(0),
        mirrored=np.empty(0, np.uint8),
        status=ABSENT,
        touched=ABSENT,
        heuristic=ABSENT,
        upper=ABSENT,
        light=ABSENT,
    )


FOUND = ("distance", "winner", "winner_ints", "crossing", "reference")
"""Names of the arrays of `Vertices` that hold the results of a sweep."""


def found(arrays: Mapping[str, Any]) -> Vertices:
    """Return what a sweep has found, by name, without what only a running one needs."""
    rest = dict.fromkeys(Vertices._fields, ABSENT)
    return Vertices(**rest | {name: arrays[name] for name in FOUND})


def _new_pool(topology: Topology, sites: Sites, windows: Flags | None) -> Pool:
    half_edges = len(topology.links)
    irregular = bool((topology.flags & (SEAM | PINCHED)).any())
    lists = np.zeros((half_edges, LIST), np.int32)
    if windows is not None:
        lists[:, MARKS] = np.repeat(np.where(windows, RETAINED, 0), 3)
    return Pool(
        windows=aligned_rows(1024 + sites.windows, WIDTH, np.float64),
        lists=lists,
        scratch=aligned_rows(256, WIDTH, np.float64),
        retained=aligned_rows(0 if windows is None else 4096, WIDTH, np.float64),
        crossings=np.full(half_edges if irregular else 0, -1, np.int32),
        runs=np.zeros(half_edges, np.uint16),
    )


def with_sites(wave: Wavefront, sites: Sites) -> Wavefront:
    """Return the wavefront, which has room for as many nodes, with other sites."""
    return wave._replace(sites=sites)


def with_larger_pool(wave: Wavefront) -> Wavefront:
    """Return the wavefront with twice the windows."""
    return wave._replace(pool=wave.pool._replace(windows=_doubled(wave.pool.windows)))


def with_larger_scratch(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room for lists twice as long."""
    return wave._replace(pool=wave.pool._replace(scratch=_doubled(wave.pool.scratch)))


def with_more_retained(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room to retain twice the windows."""
    return wave._replace(pool=wave.pool._replace(retained=_doubled(wave.pool.retained)))


def with_more_merges(wave: Wavefront) -> Wavefront:
    """Return the wavefront with room for twice the merges."""
    count = len(wave.merges.floats)
    larger = _new_merges(2 * count)
    larger.floats[:count], larger.ints[:count] = wave.merges
    return wave._replace(merges=larger)


def _doubled(windows: Floats) -> Floats:
    """Return rows of windows with room for as many more."""
    larger = aligned_rows(2 * len(windows), WIDTH, np.float64)
    larger[: len(windows)] = windows
    return larger


def bytes_of(wave: Wavefront) -> int:
    """Memory of the state."""
    *groups, counters = wave
    return counters.nbytes + sum([getattr(part, "nbytes", 0) for group in groups for part in group])

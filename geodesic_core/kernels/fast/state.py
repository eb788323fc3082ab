"""The state of a fast sweep: caller-owned arrays, and the same as pointers for kernels.

A fast sweep keeps no lists of windows. It judges them at the *places* of a half-edge, K points at
equal distances: each place holds the least distance of all windows that were offered to the
half-edge. A window that is the nearest at some place waits in a *bucket* until its half-edge is
crossed, and is forgotten then. All distances are lengths of paths that exist.

A row of the pool is a `window` of the exact sweep, with some columns of its own.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs, aligned_rows
from geodesic_core.kernels.front.state import FACE, NEXT_SITE, WINNER, Sites
from geodesic_core.kernels.front.window import WIDTH
from geodesic_core.kernels.jit import kernel, pointers
from geodesic_core.kernels.mesh.half_edges import Topology

# Columns of a row besides those of `window`: one of float64, two of int32
BUCKET = 5  # in which it is due, counted from distance 0
HALF_EDGE = 12  # that it is to cross; -1 - v where vertex v is to emit all around, from SIGMA
WON = 13  # bits of the places at which it was the nearest

# Columns of Wavefront.buckets
FIRST = 0  # row of the first window, -1 if there is none
LAST = 1
BUCKET_ENDS = 2

BUCKETS = 1024
"""Buckets in the ring; windows beyond wait in a chain."""

# Counters
FREE_FIRST = 0  # row of the first free one, -1 if there is none
FREE_SIZE = 1
FRESH = 2  # rows of the pool from here on were never used
CURRENT = 3  # bucket that is being emptied, counted from distance 0
IN_RING = 4  # windows that wait in the ring
FAR_FIRST = 5  # row of the first window beyond the ring, -1 if there is none
FAR_BUCKET = 6  # the nearest bucket of those
WORK = 7  # windows crossed, or dropped, in this slice
REACHED = 8  # vertices
CREATED = 9  # windows, in all
CROSSED = 10
PEAK = 11  # rows in use at once, at most
COUNTERS = 16


class FastBounds(NamedTuple):
    """The limits of a fast sweep."""

    max_distance: float
    """Windows wholly beyond it are dropped; mesh units, may be infinite"""
    places: int
    """Of each half-edge: 1 to 8"""
    buckets_per_unit: float
    """1 / width of a bucket, mesh units"""
    merging: tuple[int, ...]
    """Always empty: windows are as in an exact sweep; see `bounds.Bounds`"""
    parallel: tuple[int, ...]
    """As in `bounds.Bounds`"""
    first_segment: int


class Wavefront(NamedTuple):
    """All that changes while a fast sweep runs; N counts sites and segments, V vertices alone."""

    values: Floats
    """(3F, K): least distance offered at each place of a half-edge"""
    windows: Floats
    """(P, 8): the windows that wait"""
    buckets: Ints
    """(BUCKETS, 2): FIRST, LAST"""
    distance: Floats
    """(N,): least distance known, infinite where unreached"""
    winner: Floats
    """(N, 2): as in `sweep.state.Vertices`"""
    winner_ints: Ints
    """(N, 2): as in `sweep.state.Vertices`"""
    crossing: Floats
    """(N,): where the path to the node crosses its ENTRY_EDGE, mesh units from the tail; NaN where
    it begins in the same face and crosses none"""
    source_index: Ints
    """(N,): as in `sweep.state.Vertices`"""
    sites: Sites
    at_large: Flags
    """(3F,): windows that went on without a place"""
    first_site: Ints
    """(F,): row of the first site to reach in a face, -1 for none; or empty"""
    counters: Longs
    """(COUNTERS,): FREE_FIRST … PEAK"""


class Sizes(NamedTuple):
    """Rows of arrays, which a pointer does not tell."""

    vertices: int
    windows: int
    sites: int
    segments: int
    first_site: int


class View(NamedTuple):
    """All that a kernel sees of a fast sweep: arrays as raw pointers."""

    mesh: Topology
    front: Wavefront
    bounds: FastBounds
    sizes: Sizes


@kernel
def view_of(topology: Any, wavefront: Any, bounds: Any) -> Any:
    """Return the View of groups of arrays, which the caller must hold meanwhile."""
    sizes = Sizes(
        vertices=topology.total_angle.shape[0],
        windows=wavefront.windows.shape[0],
        sites=wavefront.sites.ints.shape[0],
        segments=wavefront.sites.segment_ints.shape[0],
        first_site=wavefront.first_site.shape[0],
    )
    return pointers(View(topology, wavefront, bounds, sizes))


def new_wavefront(topology: Topology, sites: Sites, places: int, first_target: int) -> Wavefront:
    """Allocate the state of one sweep: O(V + F K), nothing reached yet.

    The sites from row ``first_target`` on are reached by the windows that cross their faces.
    """
    half_edges, nodes = len(topology.links), len(topology.total_angle) + sites.nodes
    counters = np.zeros(COUNTERS, np.int64)
    counters[[FREE_FIRST, FAR_FIRST]] = -1
    own, first_site = sites.ints.copy(), np.empty(0, np.int32)
    if first_target < len(own):
        first_site = np.full(half_edges // 3, -1, np.int32)
        for row in range(first_target, len(own)):
            face = own[row, FACE]
            own[row, NEXT_SITE], first_site[face] = first_site[face], row
    return Wavefront(
        values=np.full((half_edges, places), np.inf),
        windows=aligned_rows(4096 + sites.windows, WIDTH, np.float64),
        buckets=np.full((BUCKETS, BUCKET_ENDS), -1, np.int32),
        distance=np.full(nodes, np.inf),
        winner=np.zeros((nodes, 2)),
        winner_ints=np.full((nodes, WINNER), -1, np.int32),
        crossing=np.zeros(nodes),
        source_index=np.zeros(nodes, np.int32),
        sites=sites._replace(ints=own),
        at_large=np.zeros(half_edges, np.uint8),
        first_site=first_site,
        counters=counters,
    )


def with_larger_pool(front: Wavefront) -> Wavefront:
    """Return the wavefront with room for twice the windows."""
    larger = aligned_rows(2 * len(front.windows), WIDTH, np.float64)
    larger[: len(front.windows)] = front.windows
    return front._replace(windows=larger)


def bytes_of(front: Wavefront) -> int:
    """Memory of the state."""
    arrays = [part for part in front if isinstance(part, np.ndarray)]
    return sum(array.nbytes for array in arrays)

"""The state of a fast sweep, which keeps no lists of windows.

It judges windows at the *places* of a half-edge: each holds the least distance of all windows that
were offered to the half-edge. A window that is the nearest at some place waits in a *bucket* until
its half-edge is crossed, and is forgotten then. All distances are lengths of paths that exist.
"""

import numpy as np

from geodesic_core.arrays import aligned_rows
from geodesic_core.kernels.front.bounds import Bounds
from geodesic_core.kernels.front.counters import new_counters
from geodesic_core.kernels.front.state import (
    FACE,
    NEXT_SITE,
    NO_MERGES,
    NO_POOL,
    NO_QUEUES,
    WIDTH,
    Places,
    Sites,
    Wavefront,
    new_vertices,
)
from geodesic_core.kernels.mesh.half_edges import Topology

# Columns of Places.buckets
FIRST = 0  # slot of the first window, -1 if there is none
LAST = 1
BUCKET_ENDS = 2

BUCKETS = 1024
"""Buckets in the ring; windows beyond wait in a chain."""


def fast_bounds(bounds: Bounds) -> Bounds:
    """Return the bounds of a fast sweep for the question of another one."""
    return bounds._replace(merging=())


def new_wavefront(
    topology: Topology,
    sites: Sites,
    places: int,
    bucket_width: float,
    first_target: int,
    *,
    pruned: bool = False,
) -> Wavefront:
    """Allocate the state of one sweep: O(V + F K), nothing reached yet.

    ``places`` is the number K of places of a half-edge, ``bucket_width`` in mesh units. The sites
    from row ``first_target`` on are reached by the windows that cross their faces.
    """
    half_edges, vertices = len(topology.links), len(topology.total_angle)
    nodes = vertices + sites.nodes
    own, first_site = sites.ints.copy(), np.empty(0, np.int32)
    if first_target < len(own):
        first_site = np.full(half_edges // 3, -1, np.int32)
        for row in range(first_target, len(own)):
            face = own[row, FACE]
            own[row, NEXT_SITE], first_site[face] = first_site[face], row
    return Wavefront(
        queues=NO_QUEUES,
        pool=NO_POOL._replace(windows=aligned_rows(4096 + sites.windows, WIDTH, np.float64)),
        places=Places(
            values=np.full((half_edges, places), np.inf),
            at_large=np.zeros(half_edges, np.uint8),
            buckets=np.full((BUCKETS, BUCKET_ENDS), -1, np.int32),
            first_site=first_site,
            per_edge=places,
            buckets_per_unit=1.0 / bucket_width if bucket_width > 0.0 else 1.0,
        ),
        vertices=new_vertices(nodes)._replace(
            crossing=np.zeros(nodes),
            touched=np.empty(vertices, np.int32),
            heuristic=np.empty(vertices if pruned else 0),
        ),
        merges=NO_MERGES,
        sites=sites._replace(ints=own),
        counters=new_counters(),
    )

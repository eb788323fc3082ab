"""What answers say of a sweep."""

from collections.abc import Mapping
from typing import Any

import geodesic_core as gc


def stats_of(stats: gc.SweepStats) -> Mapping[str, Any]:
    """Return what an answer says: it is the same in every run; seconds are in `Server-Timing`."""
    return {name: value for name, value in stats.as_dict().items() if name != "seconds"}


def likely_stats(mesh: gc.TriangleMesh, share: float) -> Mapping[str, Any]:
    """Return numbers of about as many digits, for a sweep over a share of the mesh."""
    faces = int(share * len(mesh.faces)) + 1
    windows = round(faces**1.5)
    each = windows / mesh.edge_count
    return stats_of(gc.SweepStats(windows, windows, faces, each, each, 100 * faces, 0.0))

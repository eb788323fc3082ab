"""The order of sources in which a symmetric table sweeps least."""

import numpy as np

from geodesic_core.arrays import Floats, Longs


def sweep_order(positions: Floats) -> Longs:
    """Return the points from the outside of the longest extent inwards, (n,) int64.

    A sweep ends at the farthest point that comes after its source. So the points that are left are
    to be near each other: on a sphere this order sweeps five sixths of the surface on average, on
    a long surface half of it. O(n log n).

    Parameters
    ----------
    positions
        (n, 3), mesh units.
    """
    centred = positions - positions.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return np.argsort(centred @ axes[:, -1], kind="stable")

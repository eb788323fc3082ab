"""The faces around vertices: the first of each, whether they close, and their angles."""

import math

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.mesh.half_edges import BOUNDARY, FANS, Topology


def first_corners(nodes: Ints, count: int) -> Longs:
    """Return the first place of each of ``count`` inner vertices among the corners of faces.

    (count,): number of the corner, three a face; -1 of vertices that no face has.
    """
    flat = nodes.reshape(-1)
    first = np.full(count, -1)
    first[flat[::-1]] = np.arange(len(flat))[::-1]
    return first


def is_open(topology: Topology) -> Flags:
    """Return at which inner vertices the surface does not close around, (V,)."""
    open_: Flags = (topology.flags & (BOUNDARY | FANS)) != 0
    return open_


def scales_of(topology: Topology) -> Floats:
    """Return the angle in the tangent plane for one of the surface, at each inner vertex, (V,).

    Angles are stretched or shrunk to a full turn, at a boundary only where they sum to more.
    """
    total = topology.total_angle
    is_scaled = np.where(is_open(topology), total > 2.0 * math.pi, total > 0.0)
    return np.divide(2.0 * math.pi, total, out=np.ones_like(total), where=is_scaled)

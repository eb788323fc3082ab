"""Points of edges that are nearer than NEAR, made one."""

from geodesic_core.arrays import Flags, Longs
from geodesic_core.kernels.cutting.predicates import NEAR
from geodesic_core.kernels.jit import kernel


@kernel
def merge_along(edges: Longs, steps: Longs, is_kept: Flags, heads: Longs) -> None:
    """Fill for each point of an edge the one that it becomes: itself, or one that is NEAR.

    Points are sorted by edge and by step. Those that are kept become no other one, and each that is
    left is NEAR none before it: so a row of points does not shrink to one.
    """
    last = -1
    for i in range(len(edges)):
        heads[i] = i
        if not is_kept[i]:
            if last >= 0 and is_near(edges, steps, last, i):
                heads[i] = last
            j = i + 1
            while heads[i] == i and j < len(edges) and is_near(edges, steps, i, j):
                heads[i] = j if is_kept[j] else i
                j += 1
        if heads[i] == i:
            last = i


@kernel
def is_near(edges: Longs, steps: Longs, i: int, j: int) -> bool:
    """Whether two points, the earlier one first, are on one edge and NEAR."""
    return edges[i] == edges[j] and steps[j] - steps[i] <= NEAR

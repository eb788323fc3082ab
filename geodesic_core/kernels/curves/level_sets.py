"""Level sets of values at vertices, which are linear on each face."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.curves.chains import Chains
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import HEAD, TAIL, next_around


@kernel
def chain_level_set(topology: Any, values: Floats, level: float) -> tuple[Ints, Chains]:
    """Return the segments of a level in each face as chains, and the half-edges of their nodes.

    ``values`` are at inner vertices. What is at the level counts as below it. So a line follows the
    rim of a plateau at its height, and passes through vertices and along edges at the level where
    values rise. It has the lower values on its left. Faces with values that are not finite have no
    segment. O(F).
    """
    links = topology.links
    count, chain_count = 0, 0
    number = np.full(len(links), -1, np.int32)
    half_edges = np.empty(len(links), np.int32)
    chains = Chains(
        np.empty((2 * (len(links) // 3), 3)),
        np.arange(len(links) // 3 + 1) * 2,
        np.empty((len(links) // 3, 2), np.int32),
        np.empty(len(links) // 3, np.int32),
    )
    for h in range(len(links)):
        low, high = values[links[h, TAIL]], values[links[h, HEAD]]
        if number[h] >= 0 or not crosses(low, high, level):
            continue
        half_edges[count], g = h, h
        while True:
            number[g] = count
            g = next_around(links, g)
            if g < 0 or g == h:
                break
        count += 1
    for face in range(len(links) // 3):
        if not has_segment(links, number, values, face):
            continue
        for k in range(3):
            h, following = 3 * face + k, (k + 1) % 3
            if number[h] >= 0:
                tail, head = values[links[h, TAIL]], values[links[h, HEAD]]
                side = 0 if tail <= level else 1  # where it enters the face, and leaves it
                low, high = min(tail, head), max(tail, head)
                row = 2 * chain_count + side
                # By halves: a difference may be beyond all numbers.
                share = (0.5 * level - 0.5 * low) / (0.5 * high - 0.5 * low)
                chains.weights[row, k] = share if side == 1 else 1.0 - share
                chains.weights[row, following] = 1.0 - share if side == 1 else share
                chains.weights[row, (k + 2) % 3] = 0.0
                chains.nodes[chain_count, side] = number[h]
        chains.faces[chain_count] = face
        chain_count += 1
    return half_edges[:count], Chains(
        chains.weights[: 2 * chain_count],
        chains.first[: chain_count + 1],
        chains.nodes[:chain_count],
        chains.faces[:chain_count],
    )


@kernel
def crosses(low: float, high: float, level: float) -> bool:
    """Tell whether a level is between two finite values, or is the lower of them."""
    is_finite = np.isfinite(low) and np.isfinite(high)
    return is_finite and (low <= level) != (high <= level)


@kernel
def has_segment(links: Ints, number: Ints, values: Floats, face: int) -> bool:
    """Tell whether a level passes through a face, whose values must all be finite."""
    crossings = 0
    for h in range(3 * face, 3 * face + 3):
        if not np.isfinite(values[links[h, TAIL]]):
            return False
        crossings += number[h] >= 0
    return crossings == 2

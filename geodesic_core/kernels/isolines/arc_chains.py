"""The arcs of a level in each face, joined to each other and to crossings: chains of points."""

import math
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.curves.chains import (
    ChainRows,
    first_chains,
    room_for_chains,
    with_chain,
)
from geodesic_core.kernels.curves.conics import END, START, Q, is_line, point_on
from geodesic_core.kernels.curves.crossings import crossings_around, put_crossing
from geodesic_core.kernels.curves.face_points import copy_weights, put_in_face
from geodesic_core.kernels.curves.joining import (
    LooseEnds,
    join,
    put_crossings,
    put_end,
    room_for_ends,
)
from geodesic_core.kernels.curves.rows import ROWS, with_room
from geodesic_core.kernels.isolines.cuts import is_within
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import TAIL


@kernel
def ends_in_face(
    topology: Any, distance: Floats, arcs: Floats, crossings: Any, face: int, level: float
) -> tuple[LooseEnds, LooseEnds]:
    """Return the ends in a face, and the starts: those of its arcs first, then its crossings.

    ``crossings`` are those around the face. The i-th end and the i-th start are those of arc i.
    """
    ends = room_for_ends(len(arcs) + len(crossings.ids))
    starts = room_for_ends(len(arcs) + len(crossings.ids))
    for i in range(len(arcs)):
        x, y = point_on(arcs[i], arcs[i, END])
        put_end(ends, i, x, y, i)
        x, y = point_on(arcs[i], arcs[i, START])
        put_end(starts, i, x, y, i)
    is_nearer = is_within(distance, topology.links[3 * face, TAIL], level)
    count = put_crossings(crossings, is_nearer, ends, starts, len(arcs))
    return (
        LooseEnds(ends.places[:count], ends.ids[:count]),
        LooseEnds(starts.places[:count], starts.ids[:count]),
    )


@kernel
def step_of(radius: float, chord_error: float) -> float:
    """Angle of a chord that strays from its circle by an error, at most a third of the circle."""
    return 4.0 * math.asin(min(math.sqrt(0.5 * chord_error / radius), 0.5))


@kernel
def trace_arc(
    geometry: Floats, face: int, arc: Floats, error: float, weights: Floats, count: int
) -> Any:
    """Append an arc's points to ``weights``, both ends included; return them and their number."""
    width, chords = arc[END] - arc[START], 1
    if not is_line(arc):
        chords = max(math.ceil(width / step_of(arc[Q], error)), 1)
    weights = with_room(weights, count + chords + 1)
    for i in range(chords + 1):
        x, y = point_on(arc, arc[START] + width * (i / chords))
        put_in_face(geometry, face, x, y, weights, count + i)
    return weights, count + chords + 1


@kernel
def chain_arcs(
    topology: Any, distance: Floats, cuts: Any, crossings: Any, level: float, chord_error: float,
    first: int, last: int,
) -> tuple[Floats, ChainRows]:  # fmt: skip
    """Join the arcs of each of the cut faces from row ``first`` up to ``last`` to chains.

    Returns the weights of all chains' points, and the chains. O(n²) for n arcs in a face.
    """
    geometry = topology.geometry
    weights, count = np.empty((4 * ROWS, 3)), 0
    chains, chain_count = room_for_chains(ROWS), 0
    for k in range(first, last):
        face, arcs = cuts.faces[k], cuts.arcs[cuts.first_arc[k] : cuts.first_arc[k + 1]]
        around = crossings_around(geometry, crossings, face, k)
        ends, starts = ends_in_face(topology, distance, arcs, around, face, level)
        joined, done = join(ends.places, starts.places), np.zeros(len(arcs), np.uint8)
        for e in range(len(arcs), len(joined)):  # chains that come in over an edge
            begin, u, s = count, ends.ids[e], joined[e]
            weights = with_room(weights, count + 1)
            put_crossing(geometry, crossings, u, k, weights, count)
            count += 1
            while s < len(arcs):
                weights, count = trace_arc(geometry, face, arcs[s], chord_error, weights, count)
                done[s] = 1
                s = joined[s]
            v = starts.ids[s]
            weights = with_room(weights, count + 1)
            put_crossing(geometry, crossings, v, k, weights, count)
            count += 1
            chains = with_chain(chains, chain_count, count - begin, face, u, v)
            chain_count += 1
        for i in range(len(arcs)):  # chains that are closed within the face
            if done[i]:
                continue
            begin, s = count, i
            while not done[s]:
                weights, count = trace_arc(geometry, face, arcs[s], chord_error, weights, count)
                done[s] = 1
                s = joined[s]
            weights = with_room(weights, count + 1)
            copy_weights(weights, begin, weights, count)
            count += 1
            chains = with_chain(chains, chain_count, count - begin, face, -1, -1)
            chain_count += 1
    return weights[:count], first_chains(chains, chain_count)

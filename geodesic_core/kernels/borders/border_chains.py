"""The borders in each face: bisectors, and straight pieces where they do not meet, as chains."""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.kernels.borders.bisectors import LEFT, RIGHT
from geodesic_core.kernels.borders.gaps import close_gaps, root_of
from geodesic_core.kernels.borders.outlines import bisectors_inside, gaps_between
from geodesic_core.kernels.curves.chains import (
    ChainRows,
    first_chains,
    room_for_chains,
    with_chain,
)
from geodesic_core.kernels.curves.conics import END, START, is_line, point_on, strays
from geodesic_core.kernels.curves.crossings import crossings_around, put_crossing
from geodesic_core.kernels.curves.face_points import put_in_face
from geodesic_core.kernels.curves.rows import ROWS, copy_rows, with_room
from geodesic_core.kernels.jit import borrowed, kernel

DEPTH = 24
"""Times that a bisector is halved at most: until its pieces are a millionth of it."""


class FaceNodes(NamedTuple):
    """The nodes of a face: both ends of each bisector, then crossings, then hubs."""

    inner: int
    """Number of ends, and the first crossing among the nodes"""
    crossings: Ints
    """(n,): the number of each crossing"""
    parent: Ints
    """By node, the one that it is united with, or itself; see `root_of`"""
    places: Floats
    """(N, 2): in the frame of the face's first half-edge"""


class TracedBorders(NamedTuple):
    """The borders in some faces, from node to node: a crossing, or a point in the face."""

    weights: Floats
    """(N, 3): the points of all chains, by their weights in its face"""
    chains: ChainRows
    """Nodes below the number of crossings are these"""
    sources: Ints
    """(c, 2): of the territories on both sides of each chain, the lower first"""
    next_node: int
    """The next free number of a node"""


@kernel
def trace_bisector(
    geometry: Floats, face: int, curve: Floats, error: float, weights: Floats, count: int
) -> Any:
    """Append the points of a bisector to ``weights``, but for its ends; return both.

    Pieces that may stray farther from their chords than ``error`` are halved.
    """
    if is_line(curve):
        return weights, count
    stack = np.empty((DEPTH + 2, 2))
    start, top = curve[START], 0
    stack[0, 0], stack[0, 1] = curve[END], 0.0
    while top >= 0:
        end, depth = stack[top, 0], stack[top, 1]
        if depth < DEPTH and strays(curve, start, end, error) > error:
            stack[top, 1] = depth + 1.0
            stack[top + 1, 0], stack[top + 1, 1] = 0.5 * (start + end), depth + 1.0
            top += 1
            continue
        if top > 0:
            x, y = point_on(curve, end)
            weights = with_room(weights, count + 1)
            put_in_face(geometry, face, x, y, weights, count)
            count += 1
        start, top = end, top - 1
    return weights, count


@kernel
def trace_borders(
    topology: Any, territories: Any, labelled: Any, near: float, chord_error: float, first: int,
    last: int, next_node: int,
) -> TracedBorders:  # fmt: skip
    """Trace the borders of two sources in each of the faces from row ``first`` up to ``last``.

    Nodes in faces have numbers from ``next_node`` on. Ends nearer than ``near``, mesh units, are
    one. O(n³) for n bisectors in a face.
    """
    topology, territories = borrowed(topology), borrowed(territories)
    geometry, labelled = topology.geometry, borrowed(labelled)
    weights, count = np.empty((4 * ROWS, 3)), 0
    chains, sources, chain_count = room_for_chains(ROWS), np.empty((ROWS, 2), np.int32), 0
    for k in range(first, last):
        face = territories.faces[k]
        curves = bisectors_inside(topology, territories, labelled, face, k, near)
        own, straight = nodes_of_face(topology, labelled, face, k, curves, near)
        for i in range(len(curves) + len(straight)):
            u, v, left, right = ends_of_piece(curves, straight, own.parent, i)
            if min(left, right) < 0:
                continue
            begin, weights = count, with_room(weights, count + 1)
            put_node(geometry, labelled, face, k, own, u, weights, count)
            count += 1
            if i < len(curves):
                weights, count = trace_bisector(
                    geometry, face, curves[i], chord_error, weights, count
                )
            weights = with_room(weights, count + 1)
            put_node(geometry, labelled, face, k, own, v, weights, count)
            count += 1
            chains = with_chain(
                chains, chain_count, count - begin, face,
                global_node(own, u, next_node), global_node(own, v, next_node),
            )  # fmt: skip
            sources = with_room(sources, chain_count + 1)
            sources[chain_count, 0], sources[chain_count, 1] = min(left, right), max(left, right)
            chain_count += 1
        next_node += len(own.places)
    chains = first_chains(chains, chain_count)
    return TracedBorders(weights[:count], chains, sources[:chain_count], next_node)


@kernel
def nodes_of_face(
    topology: Any, labelled: Any, face: int, k: int, curves: Floats, near: float
) -> tuple[FaceNodes, Ints]:
    """Return the nodes of the k-th face, which has these bisectors, and its straight pieces.

    The pieces, and ``near``, are as in `close_gaps`.
    """
    around = crossings_around(topology.geometry, labelled.crossings, face, k)
    inner = 2 * len(curves)
    at = np.empty((inner + len(around.ids), 2))
    for b in range(len(curves)):
        at[2 * b, 0], at[2 * b, 1] = point_on(curves[b], curves[b, START])
        at[2 * b + 1, 0], at[2 * b + 1, 1] = point_on(curves[b], curves[b, END])
    copy_rows(around.places, at, inner)
    gaps = gaps_between(curves, labelled.sources, around, at)
    parent, straight, places = close_gaps(gaps, at, len(around.ids), near)
    return FaceNodes(inner, around.ids, parent, places), straight


@kernel
def ends_of_piece(
    curves: Floats, straight: Ints, parent: Ints, i: int
) -> tuple[int, int, int, int]:
    """Return the nodes of piece i, and the sources on its left and right; bisectors come first."""
    s = i - len(curves)
    if s >= 0:
        u, v = root_of(parent, straight[s, 0]), root_of(parent, straight[s, 1])
        return u, v, straight[s, 2], straight[s, 3]
    u, v = root_of(parent, 2 * i), root_of(parent, 2 * i + 1)
    return u, v, int(curves[i, LEFT]), int(curves[i, RIGHT])


@kernel
def crossing_of(nodes: FaceNodes, node: int) -> int:
    """Return the number of the crossing that a node of a face is, -1 if it is none."""
    place = node - nodes.inner
    return nodes.crossings[place] if 0 <= place < len(nodes.crossings) else -1


@kernel
def global_node(nodes: FaceNodes, node: int, next_node: int) -> int:
    """Return the number of a node of a face among those of all faces."""
    crossing = crossing_of(nodes, node)
    return crossing if crossing >= 0 else next_node + node


@kernel
def put_node(
    geometry: Floats, labelled: Any, face: int, k: int, nodes: FaceNodes, node: int,
    weights: Floats, count: int,
) -> None:  # fmt: skip
    """Write the weights of a node of the k-th face to row ``count``."""
    nodes, crossing = borrowed(nodes), crossing_of(nodes, node)
    if crossing >= 0:
        put_crossing(geometry, labelled.crossings, crossing, k, weights, count)
    else:
        x, y = nodes.places[node, 0], nodes.places[node, 1]
        put_in_face(geometry, face, x, y, weights, count)

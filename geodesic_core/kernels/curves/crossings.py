"""Crossings of lines with edges: each edge has one list of them, which all its faces share.

So a line that leaves a face at a crossing enters the next face at the same point, to the bit. Each
crossing is given by an edge and a place on it, whatever the lines are. Faces are those that lines
may pass; they have rows, and their half-edges have three rows for each of theirs.
"""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.kernels.curves.rows import with_room
from geodesic_core.kernels.jit import inlined, kernel
from geodesic_core.kernels.mesh.half_edges import LENGTH, TAIL, half_edge_in_face, next_around


class Crossings(NamedTuple):
    """The crossings of lines with the edges of n faces, each edge once."""

    positions: Floats
    """(C,): distance from the tail of the edge's first half-edge; ascending on each edge"""
    half_edges: Ints
    """(C,): that half-edge"""
    first: Ints
    """(3n,): first crossing on the edge of each half-edge of the faces"""
    number: Ints
    """(3n,): number of crossings on that edge"""
    turned: Flags
    """(3n,): whether the half-edge runs against the edge's first one"""


class FaceCrossings(NamedTuple):
    """The crossings around one face, counter-clockwise."""

    places: Floats
    """(c, 2): in the frame of the face's first half-edge"""
    ids: Ints
    """(c,): their numbers among all crossings"""
    turned: Flags
    """(c,): whether the face's half-edge runs against the edge's first one"""


@kernel
def faces_at(links: Ints, h: int) -> int:
    """Return how many faces the edge of h has."""
    count, g = 1, next_around(links, h)
    while g >= 0 and g != h:
        count += 1
        g = next_around(links, g)
    return count


@inlined
def row_of_half_edge(row_of: Ints, h: int) -> int:
    """Return the row of a half-edge, negative where its face has none."""
    return 3 * row_of[h // 3] + h % 3


@kernel
def is_first_of_edge(links: Ints, row_of: Ints, h: int) -> bool:
    """Whether h has the first row of all half-edges of its edge."""
    own, g = row_of_half_edge(row_of, h), next_around(links, h)
    while g >= 0 and g != h:
        if 0 <= row_of_half_edge(row_of, g) < own:
            return False
        g = next_around(links, g)
    return True


@kernel
def add_faces_across(
    links: Ints, h: int, known: int, row_of: Ints, found: Ints, count: int
) -> tuple[Ints, int]:
    """Append the faces across the edge of h that have no row to ``found``; return both.

    Their rows, from ``known`` on, are written to ``row_of``.
    """
    g = next_around(links, h)
    while g >= 0 and g != h:
        if row_of[g // 3] < 0:
            found = with_room(found, count + 1)
            found[count], row_of[g // 3] = g // 3, known + count
            count += 1
        g = next_around(links, g)
    return found, count


@kernel
def number_crossings(
    links: Ints, row_of: Ints, faces: int, positions: Floats, half_edges: Ints
) -> Crossings:
    """Return crossings with their numbers for each half-edge of ``faces`` faces.

    ``positions`` and ``half_edges`` are as `Crossings` has them. Crossings of one edge follow one
    another, on the first half-edge of the edge by row (`is_first_of_edge`).
    """
    first, number = np.zeros(3 * faces, np.int32), np.zeros(3 * faces, np.int32)
    turned, begin = np.zeros(3 * faces, np.uint8), 0
    while begin < len(positions):
        h, end = half_edges[begin], begin + 1
        while end < len(positions) and half_edges[end] == h:
            end += 1
        g = h
        while True:
            row = row_of_half_edge(row_of, g)
            if row >= 0:
                first[row], number[row] = begin, end - begin
                turned[row] = links[g, TAIL] != links[h, TAIL]
            g = next_around(links, g)
            if g < 0 or g == h:
                break
        begin = end
    return Crossings(positions, half_edges, first, number, turned)


@inlined
def crossing_along(crossings: Any, row: int, j: int, length: float) -> tuple[int, float]:
    """Return the j-th crossing along the half-edge with a row, and its distance from the tail."""
    if crossings.turned[row]:
        c = crossings.first[row] + crossings.number[row] - 1 - j
        return c, length - crossings.positions[c]
    c = crossings.first[row] + j
    return c, crossings.positions[c]


@kernel
def crossings_around(geometry: Floats, crossings: Any, face: int, row: int) -> FaceCrossings:
    """Return the crossings around a face, which has a row, from its first half-edge on."""
    room, count = 0, 0
    for i in range(3 * row, 3 * row + 3):
        room += crossings.number[i]
    places, ids, turned = np.empty((room, 2)), np.empty(room, np.int32), np.empty(room, np.uint8)
    for i in range(3):
        h, own = 3 * face + i, 3 * row + i
        ox, oy, ux, uy = half_edge_in_face(geometry, h)
        for j in range(crossings.number[own]):
            ids[count], x = crossing_along(crossings, own, j, geometry[h, LENGTH])
            places[count, 0], places[count, 1] = ox + x * ux, oy + x * uy
            turned[count] = crossings.turned[own]
            count += 1
    return FaceCrossings(places, ids, turned)


@kernel
def put_crossing(
    geometry: Floats, crossings: Any, c: int, row: int, weights: Floats, count: int
) -> None:
    """Write the weights that a crossing has in a face, which has a row, to row ``count``.

    Both ends of the edge have the same weights in all of its faces, to the bit.
    """
    i = 0
    while not 0 <= c - crossings.first[3 * row + i] < crossings.number[3 * row + i]:
        i += 1
    share = min(crossings.positions[c] / geometry[crossings.half_edges[c], LENGTH], 1.0)
    is_turned = crossings.turned[3 * row + i]
    weights[count, i] = share if is_turned else 1.0 - share
    weights[count, (i + 1) % 3] = 1.0 - share if is_turned else share
    weights[count, (i + 2) % 3] = 0.0

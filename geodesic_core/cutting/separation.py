"""A mesh taken apart along curves: a vertex for each fan of faces between them."""

from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Longs
from geodesic_core.mesh.degeneracies import lowest_joined, of_three_vertices

_NEXT = np.array([1, 2, 0])


class Separated(NamedTuple):
    """Faces with the vertices that they have once taken apart."""

    faces: Longs
    """(F, 3)"""
    copied: Longs
    """(N,): the vertex of which each new one is a copy"""
    shut: Longs
    """(S, 2): edges of curves that are still joined, as both of their ends are; lower end first"""


def keys_of(edges: Any) -> Longs:
    """Return a number for each edge (E, 2), whichever way it runs."""
    keys: Longs = edges.min(axis=1).astype(np.int64) << 32 | edges.max(axis=1)
    return keys


def edges_of(keys: Longs) -> Longs:
    """Return the edges (E, 2) that have these numbers, lower end first."""
    return np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1)


def joined_half_edges(faces: Longs, is_open: Any) -> tuple[Longs, Longs]:
    """Return pairs of half-edges (3F) of one edge, but for those that are open."""
    keys = keys_of(ends_of(faces))
    closed = np.flatnonzero(~is_open)
    order = closed[np.argsort(keys[closed], kind="stable")]
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    return order[same], order[same + 1]


def ends_of(faces: Longs) -> Longs:
    """Return the ends of the half-edges of faces, (3F, 2)."""
    return np.stack([faces, faces[:, _NEXT]], axis=-1).reshape(-1, 2)


def is_on_curve(faces: Longs, curve_edges: Longs) -> Any:
    """Tell which half-edges (3F) of faces are edges of curves."""
    return np.isin(keys_of(ends_of(faces)), keys_of(curve_edges))


def parts_of(faces: Longs, curve_edges: Longs) -> Longs:
    """Return the part of each face (F,): faces that edges other than those of curves join."""
    rows = np.flatnonzero(of_three_vertices(faces))
    surface = faces[rows]
    h, g = joined_half_edges(surface, is_on_curve(surface, curve_edges))
    pairs = np.stack([rows[h // 3], rows[g // 3]], axis=1)
    parts: Longs = np.unique(lowest_joined(len(faces), pairs), return_inverse=True)[1]
    return parts


def separated(faces: Longs, count: int, curve_edges: Longs) -> Separated:
    """Return faces (F, 3) of ``count`` vertices, taken apart along edges of curves.

    The fan of a vertex that has the lowest face keeps its number. Vertices off all curves stay
    whole, whatever their fans.
    """
    is_met = np.zeros(count, bool)
    is_met[curve_edges] = True
    rows = np.flatnonzero(is_met[faces].any(axis=1))
    rows = rows[of_three_vertices(faces[rows])]
    near = faces[rows]
    is_open, tails = is_on_curve(near, curve_edges), near.reshape(-1)
    at_curve = is_met[tails]
    fans = _fans_of(near, is_open)
    numbers, copied = _numbers_of(fans[at_curve], tails[at_curve], count)
    new = tails.copy()
    new[at_curve] = numbers
    taken = faces.copy()
    taken[rows] = new.reshape(-1, 3)
    _, index, times = np.unique(
        keys_of(ends_of(taken[rows])[is_open]), return_index=True, return_counts=True
    )
    shut = keys_of(ends_of(near)[is_open])[index[times > 1]]
    return Separated(taken, copied, edges_of(np.unique(shut)))


def _fans_of(faces: Longs, is_open: Any) -> Longs:
    """Return the fan of each corner (3F), by its lowest corner: faces that no open edge parts."""
    tails = faces.reshape(-1)
    h, g = joined_half_edges(faces, is_open)
    after_h, after_g = (3 * (e // 3) + _NEXT[e % 3] for e in (h, g))
    runs_along = tails[h] == tails[g]
    at_tail = np.stack([h, np.where(runs_along, g, after_g)], axis=1)
    at_head = np.stack([after_h, np.where(runs_along, after_g, g)], axis=1)
    return lowest_joined(len(tails), np.concatenate([at_tail, at_head]))


def _numbers_of(fans: Longs, vertices: Longs, count: int) -> tuple[Longs, Longs]:
    """Return the number of each corner's vertex, and the vertices that those from ``count`` copy.

    The first fan of a vertex has its number.
    """
    _, corner, fan = np.unique(fans, return_index=True, return_inverse=True)
    numbers = vertices[corner]
    is_copy = np.ones(len(corner), bool)
    is_copy[np.unique(numbers, return_index=True)[1]] = False
    copied = numbers[is_copy]
    numbers[is_copy] = count + np.arange(len(copied))
    return numbers[fan], copied


def halved(faces: Longs, face_of: Longs, edges: Longs, first: int) -> tuple[Longs, Longs]:
    """Return faces with edges (S, 2) halved by vertices from number ``first`` on, and their origin.

    A face of several such edges is halved several times.
    """
    keys = keys_of(edges)
    order = np.argsort(keys)
    while True:
        own = keys_of(ends_of(faces)).reshape(-1, 3)
        place = order[np.searchsorted(keys, own, sorter=order).clip(max=len(keys) - 1)]
        is_due = keys[place] == own
        rows = np.flatnonzero(is_due.any(axis=1))
        if len(rows) == 0:
            by_face = np.argsort(face_of, kind="stable")
            return faces[by_face], face_of[by_face]
        k = is_due[rows].argmax(axis=1)
        a, b, c = (faces[rows, (k + i) % 3] for i in range(3))
        middle = first + place[rows, k]
        faces = np.concatenate([faces, np.stack([middle, b, c], axis=1)])
        faces[rows] = np.stack([a, middle, c], axis=1)
        face_of = np.append(face_of, face_of[rows])

"""Distances on meshes of needles along one line, in the limit where needles have no width.

Such a needle is its longest edge: of its three edges, places at one position are one place. What is
left is a graph, in which distances differ from those of needles of width w by a few w at each.
"""

import itertools

import numpy as np

from tests.support.oracles.graph import all_pairs


def distance_matrix(along, faces, points=()) -> np.ndarray:
    """Distances between the vertices, at positions ``along`` (V,), and after them ``points``.

    A point is a face of ``faces`` (F, 3) and its position.
    """
    positions = np.unique([*along, *(x for _, x in points)]).tolist()
    edges = {tuple(sorted(pair)) for face in faces for pair in itertools.combinations(face, 2)}
    parent: dict = {}

    def place(edge, x):
        """One name of the place at x on an edge: the vertex at an end, or the edge and x."""
        key = next((v for v in edge if along[v] == x), (edge, x))
        while parent.setdefault(key, key) != key:
            key = parent[key]
        return key

    def places(edge):
        lo, hi = sorted(along[v] for v in edge)
        return [x for x in positions if lo <= x <= hi]

    def edges_at(face, x):
        pairs = (tuple(sorted(pair)) for pair in itertools.combinations(face, 2))
        return [edge for edge in pairs if x in places(edge)]

    for face in faces:
        for x in positions:
            for edge, other in itertools.pairwise(edges_at(face, x)):
                parent[place(edge, x)] = place(other, x)
    nodes = [place((v, v), along[v]) for v in range(len(along))]
    nodes += [place(edges_at(faces[f], x)[0], x) for f, x in points]
    steps = [
        (place(edge, x), place(edge, y), y - x)
        for edge in edges
        for x, y in itertools.pairwise(places(edge))
    ]
    number = {
        key: n
        for n, key in enumerate(
            dict.fromkeys([*nodes, *(s[0] for s in steps), *(s[1] for s in steps)])
        )
    }
    direct = np.full((len(number), len(number)), np.inf)
    np.fill_diagonal(direct, 0.0)
    for a, b, length in steps:
        direct[number[a], number[b]] = direct[number[b], number[a]] = length
    chosen = [number[node] for node in nodes]
    return all_pairs(direct)[np.ix_(chosen, chosen)]

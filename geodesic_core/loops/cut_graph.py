"""Cut graphs: the edges along which a surface is cut to become a disc, and words along them.

The faces are joined to a disc by a tree of edges that are crossed (the *dual tree*). All other
edges are the cut graph. A tree of these, which reaches all vertices, leaves some over: each of them
is a *letter*. A path is told up to homotopy by the letters that it crosses: by its *word*. To cross
an edge of the tree is to cross all edges that hang on it, so that it has a word as well (Eppstein,
*Dynamic Generators of Topologically Embedded Graphs*, 2003).

All boundary vertices count as one. Without a boundary one relation is left, the *relator*: the word
of a walk around the root of the tree.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.mesh.half_edges import BOUNDARY, HEAD, OPPOSITE, TAIL, Topology
from geodesic_core.loops.words import Word, inverse, reduced


class CutGraph(NamedTuple):
    """Words of the half-edges of a surface, of one component."""

    words: tuple[Word, ...]
    """The words that half-edges have, the empty one first"""
    word_of: Longs
    """(3F,): the word of entering a face over each half-edge"""
    relator: Word
    """Empty where there is a boundary"""


def cut_graph(topology: Topology, edges: Longs, distances: Floats) -> CutGraph:
    """Return the cut graph far from a point, of a component with two sides.

    ``edges`` holds one half-edge of each of its edges between two faces, ``distances`` (V,) those
    of the inner vertices from the point.
    """
    links = topology.links
    opposite = links[edges, OPPOSITE].astype(np.int64)
    far = distances[links[edges, TAIL]] + distances[links[edges, HEAD]]
    in_disc = spanning(edges // 3, opposite // 3, np.argsort(far, kind="stable"))
    edges, far = edges[~in_disc], far[~in_disc]
    is_rim = (topology.flags & BOUNDARY) != 0
    nodes = np.where(is_rim, len(is_rim), np.arange(len(is_rim)))
    tails, heads = nodes[links[edges, TAIL]], nodes[links[edges, HEAD]]
    in_tree = spanning(tails, heads, np.argsort(-far, kind="stable"))
    letters = edges[~in_tree]
    word_by_half_edge: dict[int, Word] = {}
    for i, h in enumerate(letters.tolist(), start=1):
        word_by_half_edge[h] = (i,)
        word_by_half_edge[int(links[h, OPPOSITE])] = (-i,)
    is_closed = not is_rim[links[edges, TAIL]].any() and not is_rim[links[edges, HEAD]].any()
    root = int(tails[0]) if is_closed and len(edges) else len(is_rim)
    tree = np.concatenate([edges[in_tree], links[edges[in_tree], OPPOSITE]])
    up = half_edges_up(tree, nodes[links[tree, TAIL]], nodes[links[tree, HEAD]], [root])
    for v in _from_the_leaves(links, letters, nodes, up, root):
        h = int(up[v])
        word = inverse(_word_around(links, h, word_by_half_edge))
        word_by_half_edge[h] = word
        word_by_half_edge[int(links[h, OPPOSITE])] = inverse(word)
    relator: Word = ()
    if is_closed and len(letters):
        h = int(topology.corners[topology.first_corner[root]])
        word = word_by_half_edge.get(h, ()) + _word_around(links, h, word_by_half_edge)
        relator = reduced(word, cyclic=True)
    words = ((), *sorted(set(word_by_half_edge.values()) - {()}))
    numbers = {word: i for i, word in enumerate(words)}
    word_of = np.zeros(len(links), np.int64)
    for h, word in word_by_half_edge.items():
        word_of[h] = numbers[word]
    return CutGraph(words, word_of, relator)


def spanning(starts: Longs, ends: Longs, order: Longs) -> NDArray[np.bool_]:
    """Tell which edges of a graph are in its minimal spanning forest, the first in order least."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    size = int(max(starts.max(initial=0), ends.max(initial=0))) + 1
    pairs = np.sort(np.stack([starts, ends], axis=1)[order], axis=1)
    # Of several edges between two nodes the first one, and no loops
    _, rank = np.unique(pairs[:, 0] * size + pairs[:, 1], return_index=True)
    rank = rank[pairs[rank, 0] != pairs[rank, 1]]
    graph = coo_array((rank + 1.0, pairs[rank].T), shape=(size, size)).tocsr()
    chosen = np.zeros(len(order), bool)
    chosen[order[minimum_spanning_tree(graph).data.astype(np.int64) - 1]] = True
    return chosen


def half_edges_up(half_edges: Longs, starts: Longs, ends: Longs, roots: Sequence[int]) -> Longs:
    """Return for each node of a forest the half-edge that leads to its parent, -1 at roots.

    ``half_edges`` has both of each edge, which lead from a node ``starts`` to one ``ends``.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    size = int(max(starts.max(initial=0), *roots)) + 1
    graph = coo_array((np.ones(len(starts)), (starts, ends)), shape=(size, size)).tocsr()
    up = np.full(size, -1)
    for root in roots:
        _, parent = breadth_first_order(graph, root, directed=True)
        is_up = parent[starts] == ends
        up[starts[is_up]] = half_edges[is_up]
    return up


def _from_the_leaves(links: Ints, letters: Longs, nodes: Longs, up: Longs, root: int) -> list[int]:
    """Return the vertices between letters and the root, each after those that hang on it."""
    depth: dict[int, int] = {root: 0}
    for v in nodes[links[letters][:, [TAIL, HEAD]]].reshape(-1).tolist():
        way, u = [], v
        while u not in depth:
            way.append(u)
            u = int(nodes[links[up[u], HEAD]])
        for below in reversed(way):
            depth[below] = depth[u] + 1
            u = below
    return sorted(depth.keys() - {root}, key=lambda v: -depth[v])


def _word_around(links: Ints, start: int, words: dict[int, Word]) -> Word:
    """Return the word of a walk counter-clockwise around the tail of a half-edge, from there on."""
    word: Word = ()
    h = start
    while True:
        h = int(links[h - 1 if h % 3 else h + 2, OPPOSITE])  # over the half-edge before
        if h == start:
            return reduced(word)
        word += words.get(h, ())

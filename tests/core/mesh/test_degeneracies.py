"""Degeneracies, each against an oracle."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geodesic_core.mesh.degeneracies import lowest_joined


@pytest.mark.parametrize("edge_count", [0, 1, 30, 90, 400])
def test_joined_vertices_have_the_lowest_of_their_component(edge_count: int) -> None:
    rng = np.random.default_rng(edge_count)
    ends = np.sort(rng.integers(0, 100, (edge_count, 2)), axis=1)
    edges = np.unique(ends[ends[:, 0] < ends[:, 1]], axis=0)
    graph = coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(100, 100))
    label = connected_components(graph, directed=False)[1]
    lowest = [np.flatnonzero(label == label[vertex])[0] for vertex in range(100)]
    assert lowest_joined(100, edges).tolist() == lowest


def test_a_chain_in_any_order_has_one_lowest_vertex() -> None:
    """Each link joins two long parts, so that labels have far to go."""
    places = np.random.default_rng(0).permutation(1000)
    links = np.sort(np.stack([places[:-1], places[1:]], axis=1), axis=1)
    edges = links[np.lexsort(links.T)]
    assert lowest_joined(1002, edges).tolist() == [0] * 1000 + [1000, 1001]

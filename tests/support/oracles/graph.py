"""Shortest paths on graphs, and the edge graph of a mesh."""

import heapq
from collections.abc import Iterable, Mapping

import numpy as np

Neighbours = Mapping[int, Iterable[tuple[int, float]]]


def edge_lengths(vertices, faces) -> dict[tuple[int, int], float]:
    """Length of each undirected edge (low vertex, high vertex)."""
    points = np.asarray(vertices, dtype=float)
    edges = {
        (min(a, b), max(a, b))
        for face in np.asarray(faces).tolist()
        for a, b in zip(face, face[1:] + face[:1], strict=True)
    }
    return {(a, b): float(np.linalg.norm(points[a] - points[b])) for a, b in sorted(edges)}


def edge_graph(vertices, faces) -> dict[int, list[tuple[int, float]]]:
    graph: dict[int, list[tuple[int, float]]] = {v: [] for v in range(len(vertices))}
    for (a, b), length in edge_lengths(vertices, faces).items():
        graph[a].append((b, length))
        graph[b].append((a, length))
    return graph


def dijkstra(graph: Neighbours, starts: Mapping[int, float], size: int) -> np.ndarray:
    """Distance of each of ``size`` nodes from the starts (node -> start distance)."""
    distances = np.full(size, np.inf)
    queue = [(distance, node) for node, distance in starts.items()]
    heapq.heapify(queue)
    while queue:
        distance, node = heapq.heappop(queue)
        if distance >= distances[node]:
            continue
        distances[node] = distance
        for other, length in graph[node]:
            if distance + length < distances[other]:
                heapq.heappush(queue, (distance + length, other))
    return distances


def edge_distances(vertices, faces, source: int) -> np.ndarray:
    """Dijkstra on the edges of a mesh: never below the geodesic distance."""
    return dijkstra(edge_graph(vertices, faces), {source: 0.0}, len(vertices))


def all_pairs(direct: np.ndarray) -> np.ndarray:
    """Close a matrix of direct distances under composition (Floyd and Warshall)."""
    distances = np.minimum(direct, direct.T)
    np.fill_diagonal(distances, 0.0)
    for k in range(len(distances)):
        np.minimum(distances, distances[:, k, None] + distances[None, k, :], out=distances)
    return distances

"""Shortest paths among polygonal obstacles in the plane, by the visibility graph.

For planar meshes whose vertices have *integer* coordinates: every predicate is exact. A segment is
free if no part of it leaves the union of the (closed) faces.
"""

import itertools
import math

import numpy as np

from tests.support.oracles.graph import all_pairs

MOST = 2**29
"""Bound of coordinates: sums of two products of their differences fit in 64 bits."""


def distance_matrix(points, faces) -> np.ndarray:
    """Exact distances (V, V) within the union of the faces; ``points`` are pairs of integers."""
    points, faces = np.asarray(points).astype(np.int64), np.asarray(faces)
    walls, triangles = points[_boundary(faces)], points[faces]
    direct = np.full((len(points), len(points)), np.inf)
    for i in range(len(points)):
        for j in np.flatnonzero(_are_free(points[[i]], points[:i], walls, triangles)):
            direct[i, j] = direct[j, i] = math.dist(points[i], points[j])
    return all_pairs(direct)


def distances_to_segment(points, faces, start, end) -> np.ndarray:
    """Exact distances (V,) from a segment within the union of the faces; all by integers.

    The last piece of a shortest path leaves a vertex for the nearest point of the segment: were
    there a wall in between, the path would bend at a vertex of that wall first.
    """
    points, faces = np.asarray(points).astype(np.int64), np.asarray(faces)
    start, way = np.array(start), np.subtract(end, start)
    # In units of 1 / scale, the nearest points of the segment have integer coordinates, too.
    scale = way @ way
    feet = scale * start + np.clip((points - start) @ way, 0, scale)[:, None] * way
    fine, walls, triangles = scale * points, scale * points[_boundary(faces)], scale * points[faces]
    straight = np.full(len(points), np.inf)
    for i in np.flatnonzero(_are_free(fine, feet, walls, triangles)):
        straight[i] = math.dist(points[i], feet[i] / scale)
    return (distance_matrix(points, faces) + straight).min(axis=1)


def _boundary(faces) -> list[tuple[int, int]]:
    """Edges with a face on one side only."""
    seen: dict[tuple[int, int], int] = {}
    for a, b, c in faces.tolist():
        for u, v in ((a, b), (b, c), (c, a)):
            edge = (min(u, v), max(u, v))
            seen[edge] = seen.get(edge, 0) + 1
    return [edge for edge, count in seen.items() if count == 1]


def _are_free(p, q, walls, triangles) -> np.ndarray:
    """Whether segments from p to q (N, 2) are free, among walls (W, 2, 2), on triangles (F, 3, 2).

    One that crosses no wall is either inside or outside between any two ends of walls on it: the
    middle tells.
    """
    assert max(np.abs(array).max(initial=0) for array in (p, q, walls, triangles)) < MOST
    p, q = np.broadcast_arrays(p, q)
    a, b = walls[:, 0], walls[:, 1]
    pa, pb = (np.sign(_side(p[:, None], q[:, None], end)) for end in (a, b))
    ap, aq = (np.sign(_side(a, b, end[:, None])) for end in (p, q))
    free = ~((pa * pb < 0) & (ap * aq < 0)).any(axis=1)
    # Where points lie on a segment: 0 at p, at q the square of its length.
    length = ((q - p) ** 2).sum(axis=1).tolist()
    along = np.hstack([((end - p[:, None]) * (q - p)[:, None]).sum(axis=2) for end in (a, b)])
    is_on_line = np.hstack([pa, pb]) == 0
    segment, middle = [], []
    for n in np.flatnonzero(free):
        cuts = {0, length[n], *along[n, is_on_line[n]].tolist()}
        cuts = sorted(cut for cut in cuts if 0 <= cut <= length[n])
        for low, high in itertools.pairwise(cuts):
            segment.append(n)
            middle.append((low + high, 2 * length[n]))
    share, whole = np.array(middle, dtype=object).reshape(-1, 2).T
    segment = np.array(segment, dtype=int)
    is_inside = _are_inside(p[segment], q[segment], share, whole, triangles)
    free[segment[~is_inside]] = False
    return free


def _are_inside(p, q, share, whole, triangles) -> np.ndarray:
    """Whether the points p + (q - p) * share / whole are in one of the triangles."""
    a, b = triangles, np.roll(triangles, -1, axis=1)
    at_p, at_q = (_side(a, b, end[:, None, None]) for end in (p, q))
    # Both ends of the others are on the wrong side of one of their edges.
    is_near = (np.maximum(at_p, at_q) >= 0).all(axis=2) | (np.minimum(at_p, at_q) <= 0).all(axis=2)
    point, triangle = np.nonzero(is_near)
    # Python's integers, which have any size
    at_p, at_q = (at[point, triangle].astype(object) for at in (at_p, at_q))
    sides = at_p * (whole - share)[point, None] + at_q * share[point, None]
    holds = (sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)
    inside = np.zeros(len(p), dtype=bool)
    inside[point[holds]] = True
    return inside


def _side(a, b, c) -> np.ndarray:
    """Twice the signed area of triangles: positive where c is on the left of ab."""
    (ax, ay), (bx, by), (cx, cy) = (np.moveaxis(end, -1, 0) for end in (a, b, c))
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

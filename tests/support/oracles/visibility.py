"""Shortest paths among polygonal obstacles in the plane, by the visibility graph.

For planar meshes whose vertices have *integer* coordinates: every predicate is exact. A segment is
free if no part of it leaves the union of the (closed) faces.
"""

import itertools
import math
from fractions import Fraction

import numpy as np

from tests.support.oracles.graph import all_pairs


def distance_matrix(points, faces) -> np.ndarray:
    """Exact distances (V, V) within the union of the faces; ``points`` are pairs of integers."""
    points = [(int(x), int(y)) for x, y in points]
    triangles = [tuple(points[v] for v in face) for face in np.asarray(faces).tolist()]
    walls = _boundary(points, faces)
    direct = np.full((len(points), len(points)), np.inf)
    for i, p in enumerate(points):
        for j, q in enumerate(points[:i]):
            if p == q or _is_free(p, q, walls, triangles):
                direct[i, j] = direct[j, i] = math.dist(p, q)
    return all_pairs(direct)


def distances_to_segment(points, faces, start, end) -> np.ndarray:
    """Exact distances (V,) from a segment within the union of the faces; all by integers.

    The last piece of a shortest path leaves a vertex for the nearest point of the segment: were
    there a wall in between, the path would bend at a vertex of that wall first.
    """
    points = [(int(x), int(y)) for x, y in points]
    triangles = [tuple(points[v] for v in face) for face in np.asarray(faces).tolist()]
    walls, (sx, sy), (dx, dy) = _boundary(points, faces), start, np.subtract(end, start).tolist()
    straight = np.full(len(points), np.inf)
    for i, (x, y) in enumerate(points):
        share = Fraction((x - sx) * dx + (y - sy) * dy, dx * dx + dy * dy)
        foot = _at(start, end, min(max(share, Fraction(0)), Fraction(1)))
        if foot == (x, y) or _is_free((x, y), foot, walls, triangles):
            straight[i] = math.dist((x, y), foot)
    return (distance_matrix(points, faces) + straight).min(axis=1)


def _boundary(points, faces):
    """Segments with a face on one side only."""
    seen: dict[tuple[int, int], int] = {}
    for a, b, c in np.asarray(faces).tolist():
        for u, v in ((a, b), (b, c), (c, a)):
            edge = (min(u, v), max(u, v))
            seen[edge] = seen.get(edge, 0) + 1
    return [(points[u], points[v]) for (u, v), count in seen.items() if count == 1]


def _is_free(p, q, walls, triangles) -> bool:
    cuts = {Fraction(0), Fraction(1)}
    for a, b in walls:
        pa, pb = _side(p, q, a), _side(p, q, b)
        ap, aq = _side(a, b, p), _side(a, b, q)
        if pa * pb < 0 and ap * aq < 0:
            return False
        cuts.update(_share(p, q, end) for end, on in ((a, pa), (b, pb)) if on == 0)
        if ap != aq and pa * pb < 0 and 0 in (ap, aq):
            cuts.add(Fraction(ap, ap - aq))
    cuts = sorted(cut for cut in cuts if 0 <= cut <= 1)
    middles = ((low + high) / 2 for low, high in itertools.pairwise(cuts))
    return all(_is_inside(_at(p, q, middle), triangles) for middle in middles)


def _is_inside(point, triangles) -> bool:
    for a, b, c in triangles:
        sides = (_side(a, b, point), _side(b, c, point), _side(c, a, point))
        if min(sides) >= 0 or max(sides) <= 0:
            return True
    return False


def _side(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _share(p, q, point) -> Fraction:
    """Where a point of the line pq lies on it: 0 at p, 1 at q."""
    axis = 0 if p[0] != q[0] else 1
    return Fraction(point[axis] - p[axis], q[axis] - p[axis])


def _at(p, q, share):
    return (p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]))

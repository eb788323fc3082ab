"""Exact geodesics on any small mesh, by enumerating straight lines over unfolded faces.

A shortest path is a chain of straight pieces between vertices: inside a piece it passes no vertex,
so its faces unfold into one plane, where the piece is a straight line. Hence

1. from *every* vertex, follow the cone of light through each opposite edge, face after face, laid
   out in the plane of the first, and note the straight distance to each vertex that is seen;
2. close the matrix of these distances under composition.

No trimming of windows against one another, no saddle or boundary rules, no orientation: a cone
goes on into every other face at its edge, one, several or none. A vertex on the rim of a cone lies
behind the vertex that bounds the cone, so composition covers it and the tests need no tolerance.

The one cut is provable. Let light from s cross the edge (u, v) between A and B, A nearer to u, and
let U(u) be the length of some path from s to u. If U(u) + |uB| < |sB|, then for each P in AB

    U(u) + |uP| = U(u) + |uB| - |PB| < |sB| - |PB| <= |sP|

and no ray of the cone is a shortest path beyond that edge. The same holds with v and A.

And a cone that lies as one before it does, in the plane and before the same face, is left out: so
sheets upon each other are not gone through in every order.

No light crosses a face of no area. It is glued shut before: its longest edge is the same line as
the two others, so that the third corner cuts all other faces at that edge in two.

Around the tip of a needle light winds for long, and many faces of no area upon each other cut each
other without end: there the answer is not known, and an `UnknownError` says so. Planar points are
complex numbers, with s at the origin. Cost: seconds at 150 faces.
"""

import heapq
import itertools
from typing import NamedTuple

import numpy as np

from tests.support.oracles.graph import all_pairs, dijkstra, edge_graph

SLACK = 1e-12
"""Share of a length by which a cone must be beaten before it is cut: rounding must not cut."""

GRAIN = 1e-12
"""Share of the longest edge up to which cones lie alike."""

NO_AREA = 1e-14
"""Height of a face, as a share of its longest edge, up to which it has no area."""

MOST = 30_000
"""Cones of one source after which it is given up."""


MOST_CUTS = 30
"""Points of cuts after which a mesh is given up."""


class UnknownError(Exception):
    """There are needles that light winds about for too long, or too many faces of no area."""


class Side(NamedTuple):
    """An edge of a face, seen from its first end: the face lies above it."""

    face: int
    tail: int
    head: int
    apex: int
    length: float
    apex_position: complex
    """In the frame with the tail at 0 and the head at ``length``; imaginary part >= 0."""


def distance_matrix(vertices, faces) -> np.ndarray:
    """Exact geodesic distances (V, V) between all vertices; infinite between components."""
    points, faces, wires = _glued(np.asarray(vertices, dtype=float), np.asarray(faces).tolist())
    sides, sides_at = _sides(points, faces)
    graph = edge_graph(points, faces)
    for a, b, length in wires:
        graph[a].append((b, length))
        graph[b].append((a, length))
    direct = np.full((len(points), len(points)), np.inf)
    for source in range(len(points)):
        direct[source] = _straight_distances(source, graph, sides, sides_at)
    return all_pairs(direct)[: len(vertices), : len(vertices)]


def _glued(points, faces) -> tuple[np.ndarray, list[list[int]], list[tuple[int, int, float]]]:
    """Glue faces of no area shut: return the points, the other faces, and what is left of those.

    That are their edges. The one with the longest edge goes first, so that what it cuts of others
    of no area is never longer. A cut has a point of its own in its middle: no edge that is there
    already has its ends by chance.
    """
    count, points, faces, wires = len(points), list(points), [list(face) for face in faces], []

    def length(a, b):
        return float(np.linalg.norm(points[a] - points[b]))

    def ends_and_middle(face):
        return max(itertools.permutations(face), key=lambda abc: length(*abc[:2]))

    def is_flat(face):
        a, b, middle = ends_and_middle(face)
        area = np.linalg.norm(np.cross(points[b] - points[a], points[middle] - points[a]))
        return area <= NO_AREA * length(a, b) ** 2

    def upon_each_other(face):
        return [(u, v) for u, v in itertools.combinations(face, 2) if length(u, v) == 0.0]

    def first(face):
        return bool(upon_each_other(face)), length(*ends_and_middle(face)[:2])

    while flat := [face for face in faces if is_flat(face)]:
        shut = max(flat, key=first)
        a, b, middle = ends_and_middle(shut)
        faces.remove(shut)
        wires += [(u, v, length(u, v)) for u, v in itertools.combinations(shut, 2)]
        for u, v in upon_each_other(shut):
            faces = [[u if corner == v else corner for corner in face] for face in faces]
        if upon_each_other(shut):
            faces = [face for face in faces if len(set(face)) == 3]
            continue
        for face in [face for face in faces if {a, b} <= set(face)]:
            faces.remove(face)
            (third,) = set(face) - {a, b}
            if third != middle:
                cut = len(points)
                if cut == MOST_CUTS + count:
                    raise UnknownError
                points.append((points[middle] + points[third]) / 2.0)
                faces += [[a, middle, cut], [middle, b, cut], [b, third, cut], [third, a, cut]]
    return np.array(points), faces, wires


def _sides(vertices, faces) -> tuple[list[Side], dict[tuple[int, int], list[Side]]]:
    """Each edge of each face in both directions, and those of each directed edge."""
    points = np.asarray(vertices, dtype=float)
    sides = []
    for number, (a, b, c) in enumerate(np.asarray(faces).tolist()):
        for tail, head, apex in ((a, b, c), (b, c, a), (c, a, b), (b, a, c), (c, b, a), (a, c, b)):
            along, across = points[head] - points[tail], points[apex] - points[tail]
            length = float(np.linalg.norm(along))
            height = float(np.linalg.norm(np.cross(along, across))) / length
            position = complex(float(along @ across) / length, height)
            sides.append(Side(number, tail, head, apex, length, position))
    sides_at: dict[tuple[int, int], list[Side]] = {}
    for side in sides:
        sides_at.setdefault((side.tail, side.head), []).append(side)
    return sides, sides_at


def _straight_distances(source, graph, sides, sides_at) -> list[float]:
    """Upper bounds of the distances from the source, exact where the path is one straight piece."""
    bounds = dijkstra(graph, {source: 0.0}, len(graph)).tolist()
    cones: list[tuple] = []
    number = itertools.count()
    grain = GRAIN * max((side.length for side in sides), default=1.0)
    seen: set[tuple] = set()

    def shine(face, tail, head, length, start, direction, left, right):
        """Note the cone between the rays to ``left`` and ``right`` if it lights the edge.

        The tail is at ``start``, the head in unit ``direction``, the source on the right of it.
        """
        if _cross(right, left) <= 0:
            return
        a = min(max(_crossing(left, start, direction, otherwise=0.0), 0.0), length)
        b = min(max(_crossing(right, start, direction, otherwise=length), a), length)
        to_a, to_b = abs(start + a * direction), abs(start + b * direction)
        beaten_by_tail = bounds[tail] + b < to_b * (1 - SLACK)
        beaten_by_head = bounds[head] + length - a < to_a * (1 - SLACK)
        ends = (start, start + length * direction, start + a * direction, start + b * direction)
        laid = tuple(round(x / grain) for end in ends for x in (end.real, end.imag))
        if not (beaten_by_tail or beaten_by_head) and (face, tail, head, laid) not in seen:
            seen.add((face, tail, head, laid))
            cone = (face, tail, head, start, direction, left, right)
            heapq.heappush(cones, (min(to_a, to_b), next(number), cone))
            if len(seen) > MOST:
                raise UnknownError

    for side in sides:
        if side.apex == source:
            start = -side.apex_position.conjugate()
            end = start + side.length
            shine(side.face, side.tail, side.head, side.length, start, 1 + 0j, start, end)
    while cones:
        _, _, (face, tail, head, start, direction, left, right) = heapq.heappop(cones)
        for side in sides_at[tail, head]:
            if side.face == face:
                continue
            apex = start + direction * side.apex_position
            if _cross(right, apex) >= 0 and _cross(apex, left) >= 0:
                bounds[side.apex] = min(bounds[side.apex], abs(apex))
            to_apex, to_head = side.apex_position, side.length - side.apex_position
            beyond = (
                (tail, side.apex, start, to_apex, left, _rightmost(apex, right)),
                (side.apex, head, apex, to_head, _leftmost(apex, left), right),
            )
            for first, second, corner, step, new_left, new_right in beyond:
                turned = direction * step / abs(step)
                shine(side.face, first, second, abs(step), corner, turned, new_left, new_right)
    return bounds


def _cross(a: complex, b: complex) -> float:
    """Positive where b is to the left of a."""
    return a.real * b.imag - a.imag * b.real


def _crossing(ray: complex, start: complex, direction: complex, *, otherwise: float) -> float:
    """How far along the line the ray from the origin meets it; ``otherwise`` if it only grazes."""
    slope = _cross(ray, direction)
    return -_cross(ray, start) / slope if slope < 0 else otherwise


def _rightmost(apex: complex, right: complex) -> complex:
    """Right rim of the light that falls left of the apex."""
    return apex if _cross(right, apex) > 0 else right


def _leftmost(apex: complex, left: complex) -> complex:
    """Left rim of the light that falls right of the apex."""
    return apex if _cross(apex, left) > 0 else left

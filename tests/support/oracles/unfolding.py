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

And of cones that lie alike, in the plane and behind the same face, only one goes on: so sheets upon
each other are not gone through in every order.

No light crosses a face of no area. It is glued shut before: its longest edge is the same line as
the two others, so that the third corner cuts all other faces at that edge in two.

Around the tip of a needle light winds for long, and many faces of no area upon each other cut each
other without end: there the answer is not known, and an `UnknownError` says so. Planar points are
complex numbers, with s at the origin. The cones of all sources go on together, face by face, as
arrays. Cost: a tenth of a second at 150 faces.
"""

import itertools
from typing import NamedTuple

import numpy as np

from tests.support.oracles.graph import all_pairs, edge_lengths

SLACK = 1e-12
"""Share of a length by which a cone must be beaten before it is cut: rounding must not cut."""

GRAIN = 1e-12
"""Share of the longest edge up to which cones lie alike."""

NO_AREA = 1e-14
"""Height of a face, as a share of its longest edge, up to which it has no area."""

MOST = 30_000
"""Cones of one source after which a mesh is given up."""

MOST_FACES = 3_000
"""Faces that light goes through after which a mesh is given up; of thousands, none needs 500."""

MOST_CUTS = 30
"""Points of cuts after which a mesh is given up."""


class UnknownError(Exception):
    """There are needles that light winds about for too long, or too many faces of no area."""


class Sides(NamedTuple):
    """The edges of faces, each seen from both of its ends (6F): the face lies above the edge."""

    face: np.ndarray
    tail: np.ndarray
    head: np.ndarray
    apex: np.ndarray
    length: np.ndarray
    apex_position: np.ndarray
    """In the frame with the tail at 0 and the head at ``length``; imaginary part >= 0."""


class Cones(NamedTuple):
    """Light that leaves faces through edges, each in a plane with its source at 0: arrays (N,)."""

    source: np.ndarray
    side: np.ndarray
    """The edge, as a side of the face that the light leaves."""
    start: np.ndarray
    """The tail of the edge."""
    direction: np.ndarray
    """That of the edge, of length 1; the source is on its right."""
    left: np.ndarray
    right: np.ndarray
    """The rays that bound the light."""

    def of(self, chosen) -> "Cones":
        return Cones(*(column[chosen] for column in self))


def distance_matrix(vertices, faces) -> np.ndarray:
    """Exact geodesic distances (V, V) between all vertices; infinite between components."""
    points, faces, wires = _glued(np.asarray(vertices, dtype=float), np.asarray(faces).tolist())
    direct = np.full((len(points), len(points)), np.inf)
    edges = [(a, b, length) for (a, b), length in edge_lengths(points, faces).items()]
    for a, b, length in edges + wires:
        direct[a, b] = min(direct[a, b], length)
    if faces:
        _shine(_sides(points, faces), direct)
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

    def upon_each_other(face):
        return [(u, v) for u, v in itertools.combinations(face, 2) if length(u, v) == 0.0]

    def first(face):
        return bool(upon_each_other(face)), length(*ends_and_middle(face)[:2])

    while flat := _flat(points, faces):
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


def _flat(points, faces) -> list[list[int]]:
    """Those of the faces that have no area."""
    corners = np.array(points)[np.array(faces, dtype=int).reshape(-1, 3)]
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return [faces[n] for n in np.flatnonzero(area <= NO_AREA * longest**2)]


def _sides(points, faces) -> Sides:
    """Six of each face; the first three in the order of the face."""
    around = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2), (2, 1, 0), (0, 2, 1)]
    tail, head, apex = np.array(faces)[:, around].reshape(-1, 3).T
    along, across = points[head] - points[tail], points[apex] - points[tail]
    length = np.linalg.norm(along, axis=1)
    height = np.linalg.norm(np.cross(along, across), axis=1) / length
    position = (along * across).sum(axis=1) / length + 1j * height
    return Sides(np.repeat(np.arange(len(faces)), 6), tail, head, apex, length, position)


def _shine(sides, direct) -> None:
    """Note in ``direct`` (V, V) how far vertices are that see each other.

    All cones of all sources go on at the same time, face by face.
    """
    neighbours, beyond = _neighbours(sides), _beyond(sides)
    bounds = all_pairs(direct)
    count = np.zeros(len(direct), dtype=int)
    cones = _first_cones(sides)
    for _ in range(MOST_FACES):
        cones = cones.of(_is_needed(cones, sides, bounds))
        if neighbours.shape[1] > 1:  # else there are no sheets upon each other
            cones = cones.of(_unlike(cones, sides))
        count += np.bincount(cones.source, minlength=len(count))
        if len(cones.source) == 0:
            return
        if count.max() > MOST:
            raise UnknownError

        cone, which = np.nonzero(neighbours[cones.side] >= 0)
        side, cones = neighbours[cones.side[cone], which], cones.of(cone)
        source, _, start, direction, left, right = cones
        apex = start + direction * sides.apex_position[side]
        is_lit = (_cross(right, apex) >= 0) & (_cross(apex, left) >= 0)
        seen = source[is_lit], sides.apex[side[is_lit]]
        np.minimum.at(direct, seen, abs(apex[is_lit]))
        if (direct[seen] < bounds[seen] * (1 - SLACK)).any():
            bounds = all_pairs(direct)

        # Through the edge on the left of the apex, and through the one on its right
        to_apex = sides.apex_position[side]
        to_head = sides.length[side] - to_apex
        first, second = beyond[side].T
        rightmost = np.where(_cross(right, apex) > 0, apex, right)
        leftmost = np.where(_cross(apex, left) > 0, apex, left)
        before = Cones(source, first, start, direction * to_apex / abs(to_apex), left, rightmost)
        behind = Cones(source, second, apex, direction * to_head / abs(to_head), leftmost, right)
        cones = Cones(*map(np.concatenate, zip(before, behind, strict=True)))
    raise UnknownError


def _neighbours(sides) -> np.ndarray:
    """(6F, N): the same edge as side of other faces, from the same end; -1 where there are none."""
    sides_at: dict[tuple[int, int], list[int]] = {}
    edges = list(zip(sides.tail.tolist(), sides.head.tolist(), strict=True))
    for n, edge in enumerate(edges):
        sides_at.setdefault(edge, []).append(n)
    table = np.full((len(edges), max(map(len, sides_at.values())) - 1), -1)
    for n, edge in enumerate(edges):
        others = [other for other in sides_at[edge] if other != n]
        table[n, : len(others)] = others
    return table


def _beyond(sides) -> np.ndarray:
    """(6F, 2): the other sides of the face, from the tail to the apex and on to the head."""
    rows = list(zip(*(column.tolist() for column in sides[:4]), strict=True))
    number = {(face, tail, head): n for n, (face, tail, head, _) in enumerate(rows)}
    return np.array([(number[f, tail, a], number[f, a, head]) for f, tail, head, a in rows])


def _first_cones(sides) -> Cones:
    """From each corner of each face through the opposite edge."""
    number = np.arange(len(sides.face))
    number = number[number % 6 < 3]  # from the other end of the edge, it is the mirror image
    start = -sides.apex_position[number].conj()
    end = start + sides.length[number]
    return Cones(sides.apex[number], number, start, np.ones_like(start), start, end)


def _is_needed(cones, sides, bounds) -> np.ndarray:
    """Whether there is light between the rays, and shortest paths may go on with it."""
    source, side, start, direction, left, right = cones
    a, b = _lit(cones, sides)
    to_a, to_b = abs(start + a * direction), abs(start + b * direction)
    beaten_by_tail = bounds[source, sides.tail[side]] + b < to_b * (1 - SLACK)
    beaten_by_head = bounds[source, sides.head[side]] + sides.length[side] - a < to_a * (1 - SLACK)
    return (_cross(right, left) > 0) & ~beaten_by_tail & ~beaten_by_head


def _unlike(cones, sides) -> np.ndarray:
    """The numbers of cones, of those that lie alike only one."""
    length = sides.length[cones.side]
    places = np.stack([np.zeros_like(length), length, *_lit(cones, sides)])
    laid = (cones.start + places * cones.direction) / (GRAIN * sides.length.max())
    rows = np.vstack([cones.source, cones.side, np.rint(laid.real), np.rint(laid.imag)])
    return np.unique(rows, axis=1, return_index=True)[1]


def _lit(cones, sides) -> tuple[np.ndarray, np.ndarray]:
    """Where light begins and ends on the edge, from its tail."""
    _, side, start, direction, left, right = cones
    length = sides.length[side]
    a = _crossing(left, start, direction, otherwise=np.zeros(len(side))).clip(0.0, length)
    return a, _crossing(right, start, direction, otherwise=length).clip(a, length)


def _cross(a, b) -> np.ndarray:
    """Positive where b is to the left of a; complex arrays, as all positions here."""
    return a.real * b.imag - a.imag * b.real


def _crossing(ray, start, direction, *, otherwise) -> np.ndarray:
    """How far along the line the ray from the origin meets it; ``otherwise`` if it only grazes."""
    slope = _cross(ray, direction)
    return np.divide(-_cross(ray, start), slope, out=otherwise.copy(), where=slope < 0)

"""Check a certificate of geodesic distances: from the mesh, the sources, and the file alone.

    geodesic-verify MESH CERTIFICATE --source 0 --source f12:0.2,0.3,0.5@1.5

Needs numpy, and nothing else: this file can be copied, read and run by itself. A source is a
vertex, or a face with three barycentric weights, and perhaps a start distance behind @. It is never
taken from the certificate, since an empty list of sources would pass anything.

**What is proved.** The certificate gives a function f on the edges, in pieces. Along an edge, from
its lower vertex, the pieces follow each other without gaps, t from 0 to 1. On a piece f is
sigma + sqrt((x - a)^2 + h^2), where x = t * length. Each vertex has a value. Let tau of a face be
at least f(q) - f(p) - |pq| for all p and q on its rim, and f(q) - c - |sq| for a source s in it
that starts at c. A path from a source to a vertex v crosses faces. Each crossing raises f by its
length and tau at most. Where it crosses a face more than once, the straight way from the first
point in the face to the last is no longer. So the path is at least f(v) less the sum of tau over
all faces long. And it is at least t <= f(v) less the sum over some faces long, all those with a
source inside among them, where f on the rims of the others is at least t plus that sum: before it
enters one of those, it is as long.

**Rounding.** The numbers of the mesh and of the file are taken as exact. Whatever is computed from
them is a ball: a midpoint and a radius, which takes in the rounding of each operation. Only IEEE
addition, multiplication, division and square root are relied on.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np

U = 2.0**-53
"""Relative rounding of an operation in double precision"""
UP = 1.0 + 2.0**-48
"""Makes up for the rounding of radii"""
TINY = 1e-140
"""Absolute rounding, where numbers underflow"""
HUGE = 1e100
"""Larger numbers are refused, and NaN: squares could overflow, and NaN compares as false"""
LONG: Any = np.longdouble if np.finfo(np.longdouble).nmant == 63 else np.float64
"""Extended precision, where the machine has it"""
BLOCK = 4096
"""Faces that are checked at once"""

PLY_TYPES = {
    name: code
    for code, names in {
        "i1": "char int8",
        "u1": "uchar uint8",
        "i2": "short int16",
        "u2": "ushort uint16",
        "i4": "int int32",
        "u4": "uint uint32",
        "f4": "float float32",
        "f8": "double float64",
    }.items()
    for name in names.split()
}

Array = Any  # of numpy; this file is read by people, and checked with meshes


class Refused(Exception):
    """The file is no certificate of these distances, or the mesh is none that can be checked."""


def refuse_unless(holds: bool, why: str) -> None:
    """Raise `Refused` with a reason unless something holds."""
    if not holds:
        raise Refused(why)


class Ball:
    """Real numbers, each within ``r`` of ``m``."""

    __slots__ = ("m", "r")

    def __init__(self, m: Array, r: Array = 0.0) -> None:
        self.m, self.r = m, r

    def __add__(self, other: "Ball") -> "Ball":
        m = self.m + other.m
        return Ball(m, (self.r + other.r + unit(m) * np.abs(m)) * UP)

    def __sub__(self, other: "Ball") -> "Ball":
        m = self.m - other.m
        return Ball(m, (self.r + other.r + unit(m) * np.abs(m)) * UP)

    def __mul__(self, other: "Ball") -> "Ball":
        m = self.m * other.m
        r = np.abs(self.m) * other.r + self.r * (np.abs(other.m) + other.r)
        return Ball(m, (r + unit(m) * np.abs(m) + TINY) * UP)

    def __truediv__(self, other: "Ball") -> "Ball":
        m, low = self.m / other.m, np.abs(other.m) - other.r
        refuse_unless(bool((low > 0).all()), "an edge or a face is too small to be divided by")
        return Ball(m, ((self.r + np.abs(m) * other.r) / low + unit(m) * np.abs(m) + TINY) * UP)

    def __abs__(self) -> "Ball":
        return Ball(np.abs(self.m), self.r)

    def __getitem__(self, i: Array) -> "Ball":
        return Ball(self.m[i], self.r[i] if np.ndim(self.r) else self.r)

    @property
    def high(self) -> Array:
        """Upper bounds, in double precision."""
        bound = self.m + self.r
        return bound + 4 * U * np.abs(bound)

    @property
    def low(self) -> Array:
        """Lower bounds."""
        bound = self.m - self.r
        return bound - 4 * U * np.abs(bound)


def unit(m: Array) -> float:
    """Relative rounding of an operation on these numbers."""
    return 2.0**-64 if LONG is not np.float64 and m.dtype == LONG else U


def exact(m: Array) -> Ball:
    """Return numbers that are what they are."""
    return Ball(m, np.zeros(np.shape(m)))


def difference(a: Array, b: Array) -> Ball:
    """Return a - b of exact numbers."""
    m = a - b
    return Ball(m, unit(m) * np.abs(m) * UP)


def root(square: Ball) -> Ball:
    """Return the square root of numbers that are 0 at least."""
    m = np.sqrt(np.maximum(square.m, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where(square.r < 0.5 * square.m, square.r / m, np.sqrt(square.r) + m)
    return Ball(m, (r + 2 * unit(m) * m + TINY) * UP)


def norm(*parts: Ball) -> Ball:
    """Return the length of vectors: its error is that of the parts, and its own rounding."""
    m = np.sqrt(sum(part.m * part.m for part in parts))
    return Ball(m, (sum(part.r for part in parts) + 8 * unit(m) * m + TINY) * UP)


def where(flag: Array, a: Ball, b: Ball) -> Ball:
    """Return a where the flag is set, else b."""
    return Ball(np.where(flag, a.m, b.m), np.where(flag, a.r, b.r))


class Source(NamedTuple):
    """A vertex, or a point of a face, and the distance at which paths start there."""

    vertex: int
    """-1 for none"""
    face: int
    weights: tuple[float, float, float]
    start: float


class Surface:
    """Triangles in space, or given by the lengths of their edges 01, 12 and 20."""

    def __init__(
        self,
        vertices: Array,
        faces: Array,
        lengths: Array = None,
        values: Array = None,
        barriers: Array = (),
    ) -> None:
        """Take (V, 3) positions or None, (F, 3) faces, and (F, 3) lengths or None.

        Lengths, if given, are what distances are measured by. No path crosses the ``barriers``,
        some of the faces. Faces at whose corners the ``values`` are infinite are left out as well:
        no path leads there.
        """
        self.given = np.ascontiguousarray(faces, np.int64)
        refuse_unless(self.given.ndim == 2 and self.given.shape[1] == 3, "faces are no triangles")
        refuse_unless(self.given.size > 0 and self.given.min() >= 0, "there are no faces")
        measures = np.asarray(vertices if lengths is None else lengths, np.float64)
        self.vertices = measures if lengths is None else None
        self.count = int(self.given.max()) + 1
        for per_vertex in (values, vertices):
            self.count = self.count if per_vertex is None else len(per_vertex)
        refuse_unless(self.given.max() < self.count, "a face names a vertex that does not exist")
        shape = (self.count, 3) if lengths is None else self.given.shape
        refuse_unless(measures.shape == shape, "positions or lengths do not go with the faces")
        refuse_unless(
            bool((np.abs(measures) <= HUGE).all()), "a number of the mesh is out of range"
        )
        barriers, rows = np.asarray(barriers, np.int64), np.arange(len(self.given))
        refuse_unless(bool(np.isin(barriers, rows).all()), "a barrier is no face")
        self.label = self._labels(measures, np.setdiff1d(rows, barriers))
        faces = self.label[self.given]
        values = np.zeros(self.count) if values is None else _numbers(values)
        refuse_unless(values.shape == (self.count,), "there is not one value a vertex")
        is_kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        is_kept[barriers] = False
        kept = np.flatnonzero(is_kept)
        is_open = np.isposinf(values[faces[kept]])
        refuse_unless(
            bool((is_open.all(axis=1) == is_open.any(axis=1)).all()), "a face is reached in part"
        )
        self.kept = kept[~is_open.any(axis=1)]
        self.faces = faces[self.kept]
        ends = np.sort(np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2), axis=2)
        keys = ends[..., 0] * self.count + ends[..., 1]
        _, first, of_face = np.unique(keys.ravel(), return_index=True, return_inverse=True)
        self.edges, self.of_face = ends.reshape(-1, 2)[first], of_face.reshape(-1, 3)
        self.is_rim = np.bincount(of_face.ravel(), minlength=len(first)) == 1
        if lengths is None:
            place = measures.astype(LONG)[self.edges]
            step = difference(place[:, 1], place[:, 0])
            self.long_length = norm(*(step[:, k] for k in range(3)))
        else:
            given = measures[self.kept]
            refuse_unless(
                bool((given.ravel()[first][of_face] == given.ravel()).all()), "two lengths"
            )
            self.long_length = exact(given.ravel()[first].astype(LONG))
        m = self.long_length.m.astype(float)
        self.length = Ball(m, (self.long_length.r.astype(float) + U * m) * UP)
        refuse_unless(bool((self.length.low > 0).all()), "an edge has no length")

    def _labels(self, measures: Array, free: Array) -> Array:
        """Return for each vertex the lowest of those joined to it by edges of no length.

        Only edges of free faces join them.
        """
        label = np.arange(self.count)
        tail, head = self.given[free].ravel(), np.roll(self.given[free], -1, axis=1).ravel()
        if self.vertices is None:
            joined = measures[free].ravel() == 0.0
        else:
            joined = (measures[tail] == measures[head]).all(axis=1)
        tail, head = tail[joined], head[joined]
        while (label[tail] != label[head]).any():
            lowest = np.minimum(label[tail], label[head])
            np.minimum.at(label, tail, lowest)
            np.minimum.at(label, head, lowest)
            label = label[label]
        return label

    def corner(self, rows: Array, c: int) -> tuple[Array, Array, Ball, Ball]:
        """Return at corner c of some faces the edge out, the edge in, and cosine and sine."""
        out, into = self.of_face[rows, c], self.of_face[rows, (c + 2) % 3]
        x, y = self.length[out], self.length[into]
        if self.vertices is None:
            z = self.length[self.of_face[rows, (c + 1) % 3]]
            two = Ball(np.float64(2.0))
            cosine = (x * x + (y - z) * (y + z)) / (two * x * y)
            # Heron's formula as Kahan writes it, the longest side first
            order = np.argsort(np.stack([x.m, y.m, z.m]), axis=0)
            m, r = (np.stack([getattr(side, part) for side in (x, y, z)]) for part in ("m", "r"))
            sides = [
                Ball(*(np.take_along_axis(a, order[k : k + 1], 0)[0] for a in (m, r)))
                for k in range(3)
            ]
            least, middle, most = sides
            across = (most + (middle + least)) * (least - (most - middle))
            across = across * ((least + (most - middle)) * (most + (middle - least)))
            return out, into, cosine, root(across) / (two * x * y)
        at = self.vertices[self.faces[rows, c]]
        d, e = (difference(self.vertices[self.faces[rows, (c + k) % 3]], at) for k in (1, 2))
        dot = d[:, 0] * e[:, 0] + d[:, 1] * e[:, 1] + d[:, 2] * e[:, 2]
        normal = [
            d[:, (k + 1) % 3] * e[:, (k + 2) % 3] - d[:, (k + 2) % 3] * e[:, (k + 1) % 3]
            for k in range(3)
        ]
        return out, into, dot / (x * y), norm(*normal) / (x * y)

    def places(self, rows: Array, c: int, weights: Array) -> tuple[Ball, Ball]:
        """Return points of faces in the plane: corner c at the origin, its edge out along x."""
        out, into, cosine, sine = self.corner(rows, c)
        along, up = exact(weights[:, (c + 1) % 3]), exact(weights[:, (c + 2) % 3])
        up = up * self.length[into]
        return along * self.length[out] + up * cosine, up * sine


def above(j: list[Ball], s: list[Ball], left: Ball, right: Ball) -> Array:
    """Upper bound of the largest f_j - f_s on [left, right]; each by its foot, height and sigma.

    The difference of two cones has its maximum at an end, or where both apexes are in line with
    the point. There it is the distance of the apexes, which bounds it everywhere.
    """
    (aj, hj, sj), (a, h, sigma) = j, s
    ends = [((sj - sigma) + (norm(x - aj, hj) - norm(x - a, h))).high for x in (left, right)]
    worst = np.maximum(*ends)
    sides = [(aj - x) * h - (a - x) * hj for x in (left, right)]
    is_apart = (sides[0].low > 0) & (sides[1].low > 0) | (sides[0].high < 0) & (sides[1].high < 0)
    is_beyond = (aj.high >= a.low) & (left.low <= a.high) | (aj.low <= a.high) & (
        right.high >= a.low
    )
    is_inside = ~is_apart & is_beyond & ((hj - h).high >= 0)
    apexes = ((sj - sigma) + norm(aj - a, hj - h)).high
    return np.where(is_inside, np.maximum(worst, apexes), worst)


def straight_part(
    a: Ball, h: Ball, b0: Ball, b1: Ball, cosine: Ball, sine: Ball
) -> tuple[Array, Array]:
    """Return where the rays of a piece meet the other edge, at distances from the corner.

    The apex is taken on the far side of the piece's edge: distances to the edge stay. Up to the
    first number the shortest way through the piece bends at b0, from the second on at b1.
    """
    k0, e0 = (a - b0) * sine + h * cosine, b0 * h
    k1, e1 = (a - b1) * sine + h * cosine, b1 * h
    with np.errstate(all="ignore"):
        c0 = np.where(k0.high > 0, np.maximum(e0.low, 0) / k0.high * (1 - 8 * U), np.inf)
        c1 = np.where(k1.low > 0, np.maximum(e1.high, 0) / k1.low * (1 + 8 * U), np.inf)
    return c0, c1


class Pieces:
    """The function of a certificate: its pieces along the edges, and its values at vertices."""

    def __init__(self, surface: Surface, given: dict[str, Array]) -> None:
        """Take the arrays of a file, and refuse what is no function on the edges of the surface."""
        self.surface, edges, is_rim = surface, surface.edges, surface.is_rim
        names = ("values", "pieces", "a", "h", "sigma", "t")
        refuse_unless(given.keys() >= set(names), "the file has no function on the edges")
        values, pieces, a, h, sigma, t1 = (_numbers(given[name]) for name in names)
        refuse_unless(bool((np.abs(pieces) <= 1e9).all()), "a number of pieces is out of range")
        count = pieces.astype(np.int64)
        refuse_unless(values.shape == (surface.count,), "there is not one value a vertex")
        refuse_unless(count.shape == (len(edges),), "there is not one number of pieces an edge")
        refuse_unless(
            bool((count >= 0).all() and (count[~is_rim] > 0).all()), "an edge has no pieces"
        )
        refuse_unless(bool((count[is_rim] == 0).all()), "an edge of one face has pieces")
        n = int(count.sum())
        for x in (a, h, sigma, t1):
            refuse_unless(x.shape == (n,), "the pieces are not as many as their numbers say")
            refuse_unless(bool((np.abs(x) <= HUGE).all()), "a number of a piece is out of range")
        refuse_unless(
            bool((np.abs(values[surface.faces]) <= HUGE).all()), "a value is out of range"
        )
        refuse_unless(bool((h >= 0).all()), "a height is below zero")
        self.values, start = values, np.concatenate([[0], np.cumsum(count)])
        edge = np.repeat(np.arange(len(edges)), count)
        is_first, is_last = np.zeros(n, bool), np.zeros(n, bool)
        is_first[start[:-1][count > 0]] = True
        is_last[start[1:][count > 0] - 1] = True
        t0 = np.where(is_first, 0.0, np.roll(t1, 1))
        refuse_unless(bool((t1[is_last] == 1.0).all() and (t0 <= t1).all()), "pieces leave gaps")
        # On a boundary edge only f at its ends is needed, as no path crosses it. Each end stands in
        # as a piece of no extent. The foot of the far end is rounded.
        rim = np.repeat(np.flatnonzero(is_rim), 2)
        side = np.tile([0.0, 1.0], len(rim) // 2)
        order = np.argsort(np.concatenate([edge, rim]), kind="stable")
        length, none = surface.length, np.zeros(len(rim))
        self.a = np.concatenate([a, side * length.m[rim]])[order]
        self.h = np.concatenate([h, none])[order]
        ends = values[edges[rim, side.astype(int)]]
        self.sigma = Ball(
            np.concatenate([sigma, ends])[order],
            np.concatenate([np.zeros(n), side * length.r[rim]])[order],
        )
        self.t0, self.t1 = (np.concatenate([t, side])[order] for t in (t0, t1))
        self.count = np.where(is_rim, 2, count)
        self.start = np.concatenate([[0], np.cumsum(self.count)])
        refuse_unless(len(edges) < 1 << 24, "more edges than the search for pieces is made for")
        self.key = 2.0 * np.repeat(np.arange(len(edges)), self.count) + self.t1

    def jumps(self) -> Array:
        """Return bounds of f(q) - f(p) - |pq| for p and q on one edge, for each edge.

        f rises no faster along a piece than distances do. So the bound is the largest sum of the
        jumps from p to q, each with its sign: the largest difference of two of their partial sums.
        There is one at each end of an edge as well, to the value of the vertex. There are many
        pieces, whose rounding adds up: hence extended precision.
        """
        surface, values = self.surface, self.values.astype(LONG)
        inner = np.flatnonzero(~surface.is_rim)
        edges, count = surface.edges, self.count[inner]
        edge = np.repeat(inner, count)
        k = np.arange(len(edge)) + np.repeat(self.start[inner] - np.cumsum(count) + count, count)
        first = np.cumsum(count) - count
        length, foot, height, base = (
            surface.long_length[edge],
            *(exact(x[k].astype(LONG)) for x in (self.a, self.h, self.sigma.m)),
        )
        f0, f1 = (
            base + norm(exact(t[k].astype(LONG)) * length - foot, height)
            for t in (self.t0, self.t1)
        )
        v0, v1 = (exact(values[edges[inner, k]]) for k in (0, 1))
        before = Ball(np.roll(f1.m, 1), np.roll(f1.r, 1))
        before.m[first], before.r[first] = v0.m, v0.r
        last = first + count - 1
        jump, end = f0 - before, v1 - f1[last]
        # Of all partial sums, those of one edge are compared, from what comes before the first jump
        total, known = np.cumsum(jump.m), np.add.reduceat(jump.r, first) + end.r
        start = total[first] - jump.m[first]
        at_end = total[last] + end.m
        most = np.maximum(np.maximum.reduceat(total, first), np.maximum(start, at_end))
        least = np.minimum(np.minimum.reduceat(total, first), np.minimum(start, at_end))
        rounded = known + (count + 4) * unit(total) * 2 * (
            np.abs(total).max(initial=0) + np.abs(end.m)
        )
        jumps = np.zeros(len(edges))
        jumps[inner] = ((most - least) + rounded).astype(float) * (1 + 1e-9)
        rim = surface.is_rim
        step = abs(difference(*(self.values[edges[rim, k]] for k in (0, 1)))) - surface.length[rim]
        jumps[rim] = np.maximum(step.high, 0)
        return jumps

    def least(self) -> Array:
        """Return lower bounds of f on the rim of each face, where paths may cross it."""
        surface, length = self.surface, self.surface.length
        edge = np.repeat(np.arange(len(self.count)), self.count)
        ends = (t * length.m[edge] for t in (self.t0, self.t1))
        f = self.sigma.m + np.hypot(np.clip(self.a, *ends) - self.a, self.h)
        size = np.abs(self.sigma.m) + np.abs(self.a) + self.h + length.high[edge]
        f = f - (self.sigma.r + length.r[edge] + 16 * U * size + TINY) * UP
        on_edges = np.minimum.reduceat(f, self.start[:-1])[surface.of_face].min(axis=1)
        return np.minimum(on_edges, self.values[surface.faces].min(axis=1))

    def rows(self, k: Array, e: Array, from_lower: Array) -> tuple[Any, Ball, Ball]:
        """Return pieces k, on edges e, measured from their lower or upper end: cone, and extent."""
        length = self.surface.length[e]
        foot = where(from_lower, exact(self.a[k]), length - exact(self.a[k]))
        one = np.where(from_lower, 0.0, U)
        u0 = Ball(np.where(from_lower, self.t0[k], 1 - self.t1[k]), one)
        u1 = Ball(np.where(from_lower, self.t1[k], 1 - self.t0[k]), one)
        return (foot, exact(self.h[k]), self.sigma[k]), u0 * length, u1 * length

    def worst(
        self,
        worst: Array,
        k: Array,
        g: Array,
        low: Array,
        cone: Sequence[Ball],
        x0: Array,
        x1: Array,
    ) -> None:
        """Raise ``worst[k]`` to bounds of f - cone on parts [x0, x1] of edges g.

        The parts are measured from the lower vertex of an edge where ``low`` is set.
        """
        length = self.surface.length.m[g]
        u0, u1 = np.clip(x0 / length, -1, 2), np.clip(x1 / length, -1, 2)
        u0, u1 = np.where(low, u0, 1 - u1), np.where(low, u1, 1 - u0)
        j0 = np.searchsorted(self.key, 2.0 * g + np.maximum(u0 - 1e-7, -0.5), "left")
        j1 = np.searchsorted(self.key, 2.0 * g + np.minimum(u1 + 1e-7, 1.5), "left") + 1
        j0, j1 = np.maximum(j0, self.start[g]), np.minimum(j1, self.start[g + 1])
        many = np.maximum(j1 - j0, 0)
        z = np.repeat(np.arange(len(g)), many)
        j = np.arange(len(z)) - np.repeat(np.cumsum(many) - many, many) + j0[z]
        piece, left, right = self.rows(j, g[z], low[z])
        x0, x1 = x0[z], x1[z]
        meets = (x0 < right.high) & (x1 > left.low) | (x0 <= right.high) & (x1 == np.inf)
        z, left, right, x0, x1 = z[meets], left[meets], right[meets], x0[meets], x1[meets]
        left, right = (
            where(x0 > left.low, exact(x0), left),
            where(x1 < right.high, exact(x1), right),
        )
        values = above([p[meets] for p in piece], [c[z] for c in cone], left, right)
        np.maximum.at(worst, k[z], values)

    def across(self, corner: Array, e: Array, g: Array, cosine: Ball, sine: Ball) -> Array:
        """Bounds of f(q) - f(p) - |pq| for p on e and q on g, edges at a corner of each face.

        The least f(p) + |pq| is straight through a piece, or bends between two pieces where both
        bend, or at the far end of e. At the corner itself the jumps along g bound it. Where only
        one of two neighbours bends at their common end, the other is nearer, but for the jump
        there.
        """
        number, worst = self.count[e], np.full(len(e), -np.inf)
        k = np.repeat(np.arange(len(e)), number)
        nth = np.arange(len(k)) - np.repeat(np.cumsum(number) - number, number)
        ek = e[k]
        low = self.surface.edges[ek, 0] == corner[k]
        i = np.where(low, self.start[ek] + nth, self.start[ek + 1] - 1 - nth)  # from the corner on
        (a, h, sigma), b0, b1 = self.rows(i, ek, low)
        c, s = cosine[k], sine[k]
        c0, c1 = straight_part(a, h, b0, b1, c, s)
        refuse_unless(not (np.isnan(c0) | np.isnan(c1)).any(), "a bound is no number")
        alone = self.surface.is_rim[ek]  # its neighbour is not beside it
        c0[alone], c1[alone] = -1.0, np.inf
        foot, height = a * c - h * s, abs(a * s + h * c)
        is_last = np.zeros(len(k), bool)
        is_last[np.cumsum(number) - 1] = True
        until = np.where(is_last, np.inf, np.roll(c0, -1))
        bent = (b1 * c, b1 * s, sigma + norm(b1 - a, h))
        for rows, cone, x0, x1 in (
            (np.flatnonzero(c0 < c1), (foot, height, sigma), c0, c1),
            (np.flatnonzero(c1 < until), bent, c1, until),
        ):
            at = g[k[rows]]
            is_low = self.surface.edges[at, 0] == corner[k[rows]]
            part = [ball[rows] for ball in cone]
            self.worst(worst, k[rows], at, is_low, part, x0[rows], x1[rows])
        return worst


def _numbers(given: Array) -> Array:
    """Return an array of a file as numbers in double precision."""
    try:
        return np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise Refused("an array holds something else than numbers") from None


class Proof(NamedTuple):
    """What a certificate proves."""

    lower: Array
    """(V,) lower bounds of the distances; infinite where no path leads from a source"""
    tau: Array
    """(F,) bounds of tau; 0 for faces that are left out"""


def rises_and_jumps(surface: Surface, function: Pieces) -> tuple[Array, Array]:
    """Return bounds of f(q) - f(p) - |pq|, 0 at least: by face, p and q on two edges; by edge."""
    tau = np.zeros(len(surface.faces))
    for lo in range(0, len(tau), BLOCK):
        rows = np.arange(lo, min(lo + BLOCK, len(tau)))
        for c in range(3):
            out, into, cosine, sine = surface.corner(rows, c)
            for e, g in ((out, into), (into, out)):
                worst = function.across(surface.faces[rows, c], e, g, cosine, sine)
                np.maximum.at(tau, rows, worst)
    return tau, function.jumps()


def prove(
    surface: Surface,
    sources: list[Source],
    given: dict[str, Array],
    bounds: Callable[[Surface, Pieces], tuple[Array, Array]] = rises_and_jumps,
) -> Proof:
    """Return lower bounds of all distances, by the function of a certificate.

    The sources belong to the question: they are never taken from the file. The library has
    ``bounds`` of its own, which are faster.
    """
    refuse_unless(len(sources) > 0, "there are no sources")
    function = Pieces(surface, given)
    tau, jumps = bounds(surface, function)
    least = function.least()
    least[_rise_from_sources(surface, function, sources, tau)] = -np.inf
    tau = (tau + jumps[surface.of_face].sum(axis=1)) * UP
    is_reached = np.zeros(surface.count, bool)
    is_reached[surface.faces] = True
    rank, values = np.argsort(least), np.where(is_reached, function.values, np.inf)
    sums = np.concatenate([[0.0], np.cumsum(tau[rank])]) * (1 + 1e-9)
    with np.errstate(invalid="ignore"):
        beyond = least[rank] - sums[:-1]
        beyond = beyond - 4 * U * np.abs(beyond)
        before = np.concatenate([[-np.inf], np.fmax.accumulate(beyond - sums[:-1])])
        inside = np.searchsorted(np.fmax.accumulate(beyond), values)
        lower = np.maximum(values - sums[inside], before[inside])
        lower = lower - 4 * U * np.abs(lower)
    lower = np.where(is_reached, lower, np.inf)[surface.label]
    lower = np.maximum(lower, min(source.start for source in sources))
    for source in sorted(sources, key=lambda each: each.start):  # may be at a vertex of no face
        if source.vertex >= 0:
            is_here = surface.label == surface.label[source.vertex]
            lower[is_here & np.isinf(lower)] = source.start
    refuse_unless(not np.isnan(lower).any() and not np.isnan(tau).any(), "a bound is no number")
    by_face = np.zeros(len(surface.given))
    by_face[surface.kept] = tau
    return Proof(lower, by_face)


def _rise_from_sources(
    surface: Surface, function: Pieces, sources: list[Source], tau: Array
) -> Array:
    """Raise tau to the largest f(q) - c - |sq| of each face with a source s; return these faces."""
    found = [np.empty(0, np.int64)]
    for number, source in enumerate(sources):
        refuse_unless(0 <= source.start <= HUGE, f"the start distance of source {number} is none")
        if source.vertex >= 0:
            refuse_unless(source.vertex < surface.count, f"source {number} is no vertex")
            is_low = function.values[surface.label[source.vertex]] <= source.start
            refuse_unless(bool(is_low), f"the value at source {number} is above its start distance")
            continue
        refuse_unless(0 <= source.face < len(surface.given), f"source {number} is in no face")
        weights = np.array(source.weights, np.float64)
        off = abs(weights.sum() - 1)
        refuse_unless(
            bool((weights >= 0).all() and off <= 1e-12), f"source {number} is no point of its face"
        )
        nodes = surface.label[surface.given[source.face]]
        carried = np.bincount(nodes, weights, surface.count)
        held = np.flatnonzero(carried > 0)
        has_all = np.isin(surface.faces, held).sum(axis=1) == len(held)
        if len(held) == 3:
            has_all &= surface.kept == source.face
        rows = np.flatnonzero(has_all)
        refuse_unless(len(rows) > 0, f"source {number} is in no face")
        for c in range(3):
            x, y = surface.places(rows, c, carried[surface.faces[rows]])
            slack = exact(np.full(len(rows), (off + 4 * U) * 4 * surface.length.m.max()))
            out, start = surface.of_face[rows, c], np.full(len(rows), source.start)
            is_low = surface.edges[out, 0] == surface.faces[rows, c]
            cone = (x, abs(y), exact(start) - slack)
            worst = np.full(len(rows), -np.inf)
            until = np.full(len(rows), np.inf)
            function.worst(worst, np.arange(len(rows)), out, is_low, cone, -until, until)
            np.maximum.at(tau, rows, worst)
        found.append(rows)
    return np.concatenate(found)


class Paths(NamedTuple):
    """Paths from sources to vertices, by their segments, each within a face."""

    first: Array
    """(N + 1,): the first segment of each path; those of the next one follow"""
    faces: Array
    """(K,): the face of each segment"""
    tails: Array
    """(K, 3): where it begins, by weights at the corners of the face"""
    heads: Array
    """(K, 3): where it ends"""


def measure(surface: Surface, sources: list[Source], paths: Paths) -> tuple[Array, Array]:
    """Return the vertices at which paths end, and upper bounds of their distances."""
    first, faces = (np.asarray(array, np.int64) for array in (paths.first, paths.faces))
    ends = [np.asarray(array, np.float64) for array in (paths.tails, paths.heads)]
    refuse_unless(first.ndim == 1 and len(first) > 1 and first[0] == 0, "there are no paths")
    refuse_unless(bool((np.diff(first) > 0).all()) and first[-1] == len(faces), "a path has no end")
    row = np.full(len(surface.given), -1)
    row[surface.kept] = np.arange(len(surface.kept))
    refuse_unless(bool(((faces >= 0) & (faces < len(row))).all()), "a path is in no face")
    rows = row[faces]
    refuse_unless(bool((rows >= 0).all()), "a path crosses a face that is none")
    total, places, carriers = np.zeros(len(faces)), [], []
    for weights in ends:
        off = np.abs(weights.sum(axis=1) - 1)
        holds = weights.shape == (len(faces), 3) and (weights >= 0).all() and (off <= 1e-12).all()
        refuse_unless(bool(holds), "a point of a path is beside its face")
        places.append(surface.places(rows, 0, weights))
        total += (off + 4 * U) * 4 * surface.length.high[surface.of_face[rows]].max(axis=1)
        carriers.append(_carriers(surface.faces[rows], weights))
    (x0, y0), (x1, y1) = places
    total += norm(x1 - x0, y1 - y0).high
    goes_on = np.ones(len(faces), bool)
    goes_on[first[:-1]] = False
    here, before = np.flatnonzero(goes_on), np.flatnonzero(goes_on) - 1
    for head, tail in zip(carriers[1], carriers[0], strict=True):
        refuse_unless(bool((head[before] == tail[here]).all()), "a path has a gap")
    nodes, weights = (part[first[1:] - 1] for part in carriers[1])
    refuse_unless(bool((weights[:, 2] == 1).all()), "a path does not end at a vertex")
    begins = [part[first[:-1]] for part in carriers[0]]
    lengths = np.add.reduceat(total, first[:-1]) * (1 + 4 * U * (np.diff(first) + 2))
    return nodes[:, 2], (lengths + _starts(surface, sources, begins)) * (1 + 4 * U)


def _carriers(corners: Array, weights: Array) -> tuple[Array, Array]:
    """Return the vertices that carry points, in order and -1 where not, and their weights."""
    nodes = np.where(weights > 0, corners, -1)
    order = np.argsort(nodes, axis=1)
    return np.take_along_axis(nodes, order, 1), np.take_along_axis(weights, order, 1)


def _starts(surface: Surface, sources: list[Source], begins: list[Array]) -> Array:
    """Return the least start distance of the sources at which paths begin."""
    starts = np.full(len(begins[0]), np.inf)
    for source in sources:
        corners, weights = np.full((1, 3), surface.label[max(source.vertex, 0)]), np.eye(3)[2:]
        if source.vertex < 0:
            corners = surface.label[surface.given[[source.face]]]
            weights = np.array([source.weights], np.float64)
        nodes, weights = _carriers(corners, weights)
        is_here = ((begins[0] == nodes) & (begins[1] == weights)).all(axis=1)
        starts = np.where(is_here, np.minimum(starts, source.start), starts)
    refuse_unless(bool(np.isfinite(starts).all()), "a path does not begin at a source")
    return starts


def read_ply(path: Path) -> tuple[Array, Array]:
    """Return vertices and faces of a PLY file whose only list is that of the corners of a face."""
    header, _, body = path.read_bytes().partition(b"end_header")
    body = body[body.index(b"\n") + 1 :]
    words = [line.split() for line in header.decode("ascii").splitlines()]
    order = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}[words[1][1]]
    elements: list[tuple[str, int, list[Any]]] = []
    for line in words:
        if line[0] == "element":
            elements.append((line[1], int(line[2]), []))
        elif line[0] == "property" and line[1] == "list":
            size, corner = (order + PLY_TYPES[name] for name in line[2:4])
            elements[-1][2].extend([("size", size), ("corners", corner, (3,))])
        elif line[0] == "property":
            elements[-1][2].append((line[2], order + PLY_TYPES[line[1]]))
    tables = {}
    lines = body.decode("ascii").splitlines() if order == "=" else []
    for name, count, fields in elements:
        row = np.dtype(fields)
        if order == "=":
            tables[name] = np.loadtxt(lines[:count], row, ndmin=1)
            lines = lines[count:]
        else:
            tables[name] = np.frombuffer(body, row, count)
            body = body[count * row.itemsize :]
    vertices, faces = tables["vertex"], tables["face"]
    refuse_unless(bool((faces["size"] == 3).all()), "the mesh has faces that are no triangles")
    positions = [vertices[axis].astype(np.float64) for axis in "xyz"]
    return np.stack(positions, axis=1), faces["corners"].astype(np.int64)


def read_mesh(path: Path) -> tuple[Array, Array, Array]:
    """Return vertices, faces and lengths of a mesh in an OBJ, OFF or PLY file, or an archive."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as mesh:
            return tuple(mesh.get(name) for name in ("vertices", "faces", "lengths"))
    if path.suffix == ".ply":
        return *read_ply(path), None
    lines = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    lines = [line for line in lines if line]
    if path.suffix == ".obj":
        vertices = [[float(x) for x in line[1:4]] for line in lines if line[0] == "v"]
        corners = [[x.split("/")[0] for x in line[1:]] for line in lines if line[0] == "f"]
        faces = [
            [int(x) - 1 if int(x) > 0 else int(x) + len(vertices) for x in face] for face in corners
        ]
    else:
        refuse_unless(
            path.suffix == ".off" and lines[0] == ["OFF"], f"{path} is no .obj, .off, .ply or .npz"
        )
        count, many = int(lines[1][0]), int(lines[1][1])
        vertices = [[float(x) for x in line[:3]] for line in lines[2 : 2 + count]]
        faces = [[int(x) for x in line[1 : 1 + int(line[0])]] for line in lines[2 + count :][:many]]
    refuse_unless(all(len(face) == 3 for face in faces), "the mesh has faces that are no triangles")
    return np.array(vertices), np.array(faces), None


def parse_source(text: str) -> Source:
    """Return the source that a text stands for: 12, v12 or f7:0.2,0.3,0.5, perhaps with @start."""
    point, _, start = text.partition("@")
    if not point.startswith("f"):
        return Source(int(point.removeprefix("v")), -1, (0.0, 0.0, 0.0), float(start or 0))
    face, _, weights = point[1:].partition(":")
    u, v, w = (float(x) for x in weights.split(","))
    return Source(-1, int(face), (u, v, w), float(start or 0))


def parser() -> argparse.ArgumentParser:
    """Return what reads the mesh, the certificate and the question from a command line."""
    arguments = argparse.ArgumentParser(description="Check a certificate of geodesic distances.")
    arguments.add_argument("mesh", type=Path, help="an .obj, .off, .ply or .npz file")
    arguments.add_argument("certificate", type=Path)
    arguments.add_argument("--source", type=parse_source, action="append", required=True)
    arguments.add_argument("--barriers", default="", help="faces that no path crosses, as 3,5,8")
    return arguments


def check(options: argparse.Namespace) -> tuple[Surface, dict[str, Array], Proof, Array, Array]:
    """Return the surface, the file, what it proves, and where measured paths end and how long."""
    try:
        vertices, faces, lengths = read_mesh(options.mesh)
        with np.load(options.certificate, allow_pickle=False) as file:
            given = dict(file)
        blocked = np.array([int(x) for x in options.barriers.split(",") if x], np.int64)
        surface = Surface(vertices, faces, lengths, given.get("values"), blocked)
        proof = prove(surface, options.source, given)
        paths = Paths(*(given[f"path_{name}"] for name in Paths._fields))
        return surface, given, proof, *measure(surface, options.source, paths)
    except (OSError, ValueError, KeyError, IndexError, BadZipFile) as error:
        raise Refused(f"{type(error).__name__}: {error}") from None


def main() -> int:
    """Check a certificate, and tell what it proves. Return 0, or 1 where it proves nothing."""
    try:
        _, _, proof, ends, upper = check(parser().parse_args())
    except Refused as error:
        print(f"refused: {error}", file=sys.stderr)
        return 1
    gaps, face = upper - proof.lower[ends], int(proof.tau.argmax())
    worst, largest = int(gaps.argmax()), upper.max()
    print(f"proved    {np.isfinite(proof.lower).sum()} lower bounds, by {len(proof.tau)} faces")
    print(f"measured  {len(ends)} paths, the longest {largest:.17g}")
    print(
        f"gap       {gaps[worst]:.3g}, {gaps[worst] / largest:.3g} of that, at vertex {ends[worst]}"
    )
    print(f"worst     face {face}: {proof.tau[face] / largest:.3g} of that")
    return 0


if __name__ == "__main__":
    sys.exit(main())

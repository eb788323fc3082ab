"""Geodesic distances that geometry knows by heart, or by a ruler on the unfolded surface."""

import itertools
import math
from functools import cache
from typing import NamedTuple

import numpy as np

REGULAR = {
    # The distances from a vertex to all others for edge length 1: straight lines over nets.
    "tetrahedron": [0, 1, 1, 1],
    "octahedron": [0, 1, 1, 1, 1, math.sqrt(3)],
    "cube": [0, 1, 1, 1, math.sqrt(2), math.sqrt(2), math.sqrt(2), math.sqrt(5)],
    "icosahedron": [0, *[1] * 5, *[math.sqrt(3)] * 5, math.sqrt(7)],
}


def plane(points, source) -> np.ndarray:
    """Distances in a convex planar domain, or between points of an unfolded convex strip."""
    points = np.asarray(points, dtype=float)
    return np.linalg.norm(points - points[source], axis=1)


def around(chart, source, girth: float) -> np.ndarray:
    """Distances on an open cylinder or prism, whose chart (way around, height) has this girth."""
    chart = np.asarray(chart, dtype=float)
    way = np.abs(chart[:, 0] - chart[source, 0]) % girth
    return np.hypot(np.minimum(way, girth - way), chart[:, 1] - chart[source, 1])


def cone(polar, source, total_angle: float) -> np.ndarray:
    """Distances on a cone of any total angle, also above 2 pi: polar points (radius, angle)."""
    radius, angle = np.asarray(polar, dtype=float).T
    turn = np.abs(angle - angle[source]) % total_angle
    turn = np.minimum(turn, total_angle - turn)
    # The half-angle form of the law of cosines keeps its digits where the points are close.
    half = np.sin(np.minimum(turn, math.pi) / 2)
    chord = np.sqrt((radius - radius[source]) ** 2 + 4 * radius * radius[source] * half**2)
    return np.where(turn >= math.pi, radius + radius[source], chord)


def box(size, start, end) -> np.ndarray:
    """Distances over the surface of the box [0, size] from one of its points to others (..., 3).

    Rolls the box over its edges in every order that visits no face twice, and draws straight lines
    on the floor. One counts only if it crosses every edge that was rolled over: then it is a path.
    A shortest path on a convex body visits no face twice, so the least of them is the distance.
    """
    size, start, end = (np.asarray(x, dtype=float) for x in (size, start, end))
    ends = end.reshape(-1, 3)
    best = np.full(len(ends), math.inf)
    for axis, high in itertools.product(range(3), (False, True)):
        if start[axis] == size[axis] * high:
            rolls = _rolls(tuple(size.tolist()), axis, high)
            here = (start - rolls.origin[0]) @ rolls.frame[0]
            stands_on = size[rolls.axis] * rolls.high
            of_end, roll = np.nonzero(ends[:, rolls.axis] == stands_on)
            offset = ends[of_end] - rolls.origin[roll]
            there = rolls.anchor[roll] + np.einsum("nk,nkd->nd", offset, rolls.frame[roll])
            edges = np.moveaxis(rolls.edges[roll], 2, 0)
            crosses = _meet(here, there[:, None], *edges) | np.isnan(edges[0, ..., 0])
            is_path = crosses.all(axis=1)
            length = np.linalg.norm(there[is_path] - here, axis=1)
            np.minimum.at(best, of_end[is_path], length)
    return best.reshape(end.shape[:-1])[()]


class _Rolls(NamedTuple):
    """Where the box stands after each order of rolling: the columns of its floors (N, ...)."""

    axis: np.ndarray
    high: np.ndarray
    origin: np.ndarray
    anchor: np.ndarray
    frame: np.ndarray
    edges: np.ndarray
    """(N, 5, 2, 2): the laid-out ends of those that were rolled over; NaN beyond the last"""


@cache
def _rolls(size, axis, high) -> _Rolls:
    """Every order of rolling a box that stands on a face; the first one is not to roll at all."""
    found = []

    def roll(floor, visited, edges):
        missing = np.full((5 - len(edges), 2, 2), math.nan)
        columns = floor.axis, floor.high, floor.origin, floor.anchor, floor.frame
        found.append((*columns, [*edges, *missing]))
        for axis, high in itertools.product(range(3), (False, True)):
            if axis != floor.axis and (axis, high) not in visited:
                rolled, edge = floor.roll_over(axis, high)
                roll(rolled, visited | {(axis, high)}, [*edges, edge])

    roll(_Floor(np.array(size), axis, high), {(axis, high)}, [])
    return _Rolls(*map(np.array, zip(*found, strict=True)))


class _Floor:
    """A box that stands on one of its faces: maps points of that face to the plane."""

    def __init__(self, size, axis, high, origin=None, anchor=None, frame=None):
        self.size, self.axis, self.high = size, axis, high
        self.origin = np.zeros(3) if origin is None else origin
        self.anchor = np.zeros(2) if anchor is None else anchor
        first, second = (k for k in range(3) if k != axis)
        self.frame = np.zeros((3, 2)) if frame is None else frame
        if frame is None:
            self.frame[first, 0] = self.frame[second, 1] = 1.0

    def lay(self, point):
        return self.anchor + (point - self.origin) @ self.frame

    def roll_over(self, axis, high):
        """Stand on the neighbouring face; also the laid-out ends of the edge between them."""
        edge_point = np.zeros(3)
        edge_point[self.axis] = self.size[self.axis] * self.high
        edge_point[axis] = self.size[axis] * high
        along = 3 - axis - self.axis
        frame = np.zeros((3, 2))
        frame[along] = self.frame[along]
        # What pointed out of the old face within the plane is where the new face now extends: away
        # from the old face along the new one.
        outward = self.frame[axis] * (1 if high else -1)
        frame[self.axis] = outward * (-1 if self.high else 1)
        floor = _Floor(self.size, axis, high, edge_point, self.lay(edge_point), frame)
        far_end = edge_point.copy()
        far_end[along] = self.size[along]
        return floor, (self.lay(edge_point), self.lay(far_end))


def _meet(p, q, a, b) -> np.ndarray:
    """Whether the segments pq meet the segments ab; ends count, up to rounding."""

    def side(u, v, w):
        (ux, uy), (vx, vy), (wx, wy) = (np.moveaxis(end, -1, 0) for end in (u, v, w))
        return (vx - ux) * (wy - uy) - (vy - uy) * (wx - ux)

    slack = 1e-12 * (1.0 + np.linalg.norm(q - p, axis=-1)) ** 2
    return (side(p, q, a) * side(p, q, b) <= slack) & (side(a, b, p) * side(a, b, q) <= slack)

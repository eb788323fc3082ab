"""A tree of boxes over points: which of them are near each other, or near an edge.

Node 1 holds all points, and node i is halved into 2 i and 2 i + 1, across the widest side of its
box. No list of pairs is ever made: there may be as many as points, squared.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.jit import kernel
from geodesic_core.tolerances import NEARLY_JOINED

_LEAF = 8
"""Points of a node that is not halved, at most."""
_DEPTH = 64
"""Nodes that are yet to be visited, at most: one for each level of the tree, and one more."""
_NO_STEP = 1e-200
"""Mesh units between two coordinates up to which they count as equal: its inverse is a number."""


class PointTree(NamedTuple):
    """Points in the order of the tree's leaves, and the boxes of its nodes."""

    points: Floats
    """(N, 3) mesh units"""
    order: Ints
    """(N,): the caller's number of each"""
    boxes: Floats
    """(nodes, 6): lowest and highest corner of each node's points; row 0 is unused"""


def tree_of(points: Floats) -> PointTree:
    """Return the tree of (N, 3) points, one or more; O(N log N)."""
    levels = max(0, math.ceil(math.log2(len(points) / _LEAF)))
    boxes, order = np.zeros((2 << levels, 6)), np.arange(len(points), dtype=np.int32)
    halve(points, order, boxes)
    return PointTree(points[order], order, boxes)


@kernel
def span(node: int, count: int) -> tuple[int, int]:
    """Return the places in the tree's order at which the points of a node start and end."""
    level = 0
    while node >> (level + 1):
        level += 1
    place = node - (1 << level)
    return (place * count) >> level, ((place + 1) * count) >> level


@kernel
def halve(points: Floats, order: Ints, boxes: Floats) -> None:
    """Sort ``order`` into the order of the tree, and fill ``boxes``."""
    for node in range(1, len(boxes)):
        start, end = span(node, len(order))
        widest, width = 0, -1.0
        for axis in range(3):
            low, high = math.inf, -math.inf
            for i in range(start, end):
                low, high = min(low, points[order[i], axis]), max(high, points[order[i], axis])
            boxes[node, axis], boxes[node, 3 + axis] = low, high
            if high - low > width:
                widest, width = axis, high - low
        if 2 * node < len(boxes):
            part(points, widest, order, start, end - 1, span(2 * node, len(order))[1])


@kernel
def part(points: Floats, axis: int, order: Ints, low: int, high: int, middle: int) -> None:
    """Sort ``order[low : high + 1]`` so far that no point before ``middle`` is beyond a later one.

    Hoare's selection, O(high - low) with pivots at random: meshes come in any order.
    """
    random = 1
    while low < high:
        random = (random * 1103515245 + 12345) & 0x7FFFFFFF
        pivot = points[order[low + random % (high - low + 1)], axis]
        i, j = low, high
        while i <= j:
            while points[order[i], axis] < pivot:
                i += 1
            while points[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break


@kernel
def from_box(boxes: Floats, node: int, points: Floats, i: int) -> float:
    """Return the distance of a point from the box of a node."""
    squared = 0.0
    for axis in range(3):
        low, high = boxes[node, axis] - points[i, axis], points[i, axis] - boxes[node, 3 + axis]
        beyond = max(low, high, 0.0)
        squared += beyond * beyond
    return math.sqrt(squared)


@kernel
def apart(points: Floats, i: int, j: int) -> float:
    """Return the distance of two points."""
    squared = 0.0
    for axis in range(3):
        squared += (points[j, axis] - points[i, axis]) ** 2
    return math.sqrt(squared)


# Points that steps of a limited length join ------------------------------------------------------


@kernel
def root_of(joined: Longs, i: int) -> int:
    """Return the lowest number known to be joined to i."""
    while joined[i] != i:
        joined[i] = joined[joined[i]]
        i = joined[i]
    return i


@kernel
def join(joined: Longs, i: int, j: int) -> None:
    """Join two numbers, and all that are joined to them."""
    i, j = root_of(joined, i), root_of(joined, j)
    joined[max(i, j)] = min(i, j)


@kernel
def join_within(tree: Any, step: float, joined: Longs) -> None:
    """Make ``joined`` each point's lowest that steps no longer than ``step`` lead to.

    It begins as 0 … N - 1. Numbers are the caller's. Points in a box whose diagonal is no longer
    than a step are joined at once, and a point looks into no such box that it is joined to: what is
    dense takes no longer.
    """
    count, order, boxes = len(tree.order), tree.order, tree.boxes
    dense = np.zeros(len(boxes), np.uint8)
    for node in range(1, len(boxes)):
        diagonal = 0.0
        for axis in range(3):
            diagonal += (boxes[node, 3 + axis] - boxes[node, axis]) ** 2
        if dense[node >> 1]:
            dense[node] = 1
        elif math.sqrt(diagonal) <= step:
            dense[node] = 1
            start, end = span(node, count)
            for i in range(start + 1, end):
                join(joined, order[i - 1], order[i])
    stack = np.empty(_DEPTH, np.int64)
    for i in range(count):
        stack[0], size = 1, 1
        while size > 0:
            size -= 1
            node = stack[size]
            if from_box(boxes, node, tree.points, i) > step:
                continue
            start, end = span(node, count)
            if dense[node] and root_of(joined, order[start]) == root_of(joined, order[i]):
                continue
            if 2 * node < len(boxes):
                stack[size], stack[size + 1] = 2 * node, 2 * node + 1
                size += 2
                continue
            for j in range(start, end):
                if apart(tree.points, i, j) <= step:
                    join(joined, order[i], order[j])
    for i in range(count):
        joined[i] = root_of(joined, i)


# Points within a reach of their own --------------------------------------------------------------


@kernel
def widest_reach(reach: Floats, boxes: Floats) -> Floats:
    """Return the largest reach of the points of each node; ``reach`` is in the tree's order."""
    widest = np.full(len(boxes), -1.0)
    for node in range(len(boxes) - 1, 0, -1):
        update_reach(reach, widest, node)
    return widest


@kernel
def update_reach(reach: Floats, widest: Floats, node: int) -> None:
    """Set ``widest`` of a node from its halves, or from its points."""
    if 2 * node < len(widest):
        widest[node] = max(widest[2 * node], widest[2 * node + 1])
        return
    start, end = span(node, len(reach))
    widest[node] = -1.0
    for i in range(start, end):
        widest[node] = max(widest[node], reach[i])


@kernel
def find_nearest(tree: Any, reach: Floats, nearest: Longs, distance: Floats) -> None:
    """Fill each point's nearest other one that is within the reach of both, or -1; its distance.

    All in the tree's order. Halves are visited nearest first.
    """
    points, boxes = tree.points, tree.boxes
    widest, stack = widest_reach(reach, boxes), np.empty(_DEPTH, np.int64)
    for i in range(len(points)):
        nearest[i], distance[i] = -1, reach[i]
        stack[0], size = 1, 1
        while size > 0:
            size -= 1
            node = stack[size]
            if from_box(boxes, node, points, i) > min(distance[i], widest[node]):
                continue
            if 2 * node < len(boxes):
                near = 2 * node
                if from_box(boxes, near, points, i) > from_box(boxes, near + 1, points, i):
                    near += 1
                stack[size], stack[size + 1] = near ^ 1, near
                size += 2
                continue
            start, end = span(node, len(points))
            for j in range(start, end):
                length = apart(points, i, j)
                if j != i and length <= min(distance[i], reach[j]):
                    nearest[i], distance[i] = j, length


@kernel
def find_on_edges(tree: Any, reach: Floats, edges: Longs, widths: Floats, found: Longs) -> None:
    """Fill the edge that each point lies on, within its reach and the edge's width, or -1.

    ``edges`` are (E, 2) places in the tree's order. A point is on none of which it is an end, nor
    on the parts of an edge next to its ends, NEARLY_JOINED of its length. A point that is found has
    no ``reach`` any more, so that a bundle of edges looks for it once.
    """
    points, boxes = tree.points, tree.boxes
    widest, stack = widest_reach(reach, boxes), np.empty(_DEPTH, np.int64)
    inverse = np.empty(3)
    for i in range(len(points)):
        found[i] = -1
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        for axis in range(3):
            step = points[b, axis] - points[a, axis]
            inverse[axis] = 1.0 / step if abs(step) > _NO_STEP else 1.0 / _NO_STEP
        stack[0], size = 1, 1
        while size > 0:
            size -= 1
            node = stack[size]
            limit = min(widths[e], widest[node])
            if limit < 0.0 or not meets_box(points, a, inverse, boxes, node, limit):
                continue
            if 2 * node < len(boxes):
                stack[size], stack[size + 1] = 2 * node, 2 * node + 1
                size += 2
                continue
            start, end = span(node, len(points))
            for i in range(start, end):
                if i not in (a, b) and from_inside(points, a, b, i) <= min(widths[e], reach[i]):
                    found[i], reach[i] = e, -1.0
            update_reach(reach, widest, node)
            while node > 1 and widest[node >> 1] > max(widest[node], widest[node ^ 1]):
                node >>= 1
                update_reach(reach, widest, node)


@kernel
def meets_box(
    points: Floats, a: int, inverse: Floats, boxes: Floats, node: int, limit: float
) -> bool:
    """Whether the inside of an edge from a meets the box of a node, which is wider by the limit.

    ``inverse`` is 1 / (b - a) on each axis.
    """
    low, high = NEARLY_JOINED, 1.0 - NEARLY_JOINED
    for axis in range(3):
        enter = (boxes[node, axis] - limit - points[a, axis]) * inverse[axis]
        leave = (boxes[node, 3 + axis] + limit - points[a, axis]) * inverse[axis]
        low, high = max(low, min(enter, leave)), min(high, max(enter, leave))
    return low <= high


@kernel
def from_inside(points: Floats, a: int, b: int, i: int) -> float:
    """Return the distance of a point from the inside of an edge; infinite next to its ends."""
    along, squared = 0.0, 0.0
    for axis in range(3):
        step = points[b, axis] - points[a, axis]
        along += step * (points[i, axis] - points[a, axis])
        squared += step * step
    t = along / squared
    if not NEARLY_JOINED <= t <= 1.0 - NEARLY_JOINED:
        return math.inf
    beside = 0.0
    for axis in range(3):
        foot = points[a, axis] + t * (points[b, axis] - points[a, axis])
        beside += (points[i, axis] - foot) ** 2
    return math.sqrt(beside)

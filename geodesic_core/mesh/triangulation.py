"""Triangulation of polygons, in place, with a map from triangles back to polygons.

A polygon is a fan from its first or its second corner where all triangles of the fan point the same
way; else manifold3d cuts it, as seen along its normal. So a flat polygon, convex or not, becomes
the very surface that it encloses. Every polygon gives at least one triangle: one with fewer than
three different corners gives one that repeats a vertex.
"""

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.tolerances import FAN

Flags = NDArray[np.bool_]


def triangulated(vertices: Floats, corners: Longs, sizes: Longs) -> tuple[Longs, Longs | None]:
    """Return the triangles of polygons, and the polygon of each.

    Parameters
    ----------
    vertices
        (V, 3) finite, mesh units.
    corners
        (C,) vertex indices of all polygons, one polygon after the other.
    sizes
        (P,) how many corners each has, 1 or more.

    Returns
    -------
    faces, face_map
        (F, 3), and (F,) or None where each polygon became one triangle. O(C), where fans
        do; manifold3d takes O(n log n) in practice.
    """
    if (sizes == 3).all():
        return corners.reshape(-1, 3), None
    corners, sizes = _without_stutter(corners, sizes)
    counts = np.maximum(sizes - 2, 1)
    faces = np.empty((int(counts.sum()), 3), np.int64)
    first_corner, first_face = np.cumsum(sizes) - sizes, np.cumsum(counts) - counts
    for size in np.unique(sizes):
        those = np.flatnonzero(sizes == size)
        rows = corners[first_corner[those, None] + np.arange(size)]
        targets = first_face[those, None] + np.arange(max(size - 2, 1))
        # Two corners, or one, repeat their last.
        faces[targets] = (
            _cut(vertices, rows) if size > 3 else rows[:, None, [0, min(size - 1, 1), -1]]
        )
    if (counts == 1).all():
        return faces, None
    return faces, np.repeat(np.arange(len(sizes)), counts)


def _without_stutter(corners: Longs, sizes: Longs) -> tuple[Longs, Longs]:
    """Leave out, of polygons of four corners or more, those that repeat the one before."""
    owner = np.repeat(np.arange(len(sizes)), sizes)
    last = np.cumsum(sizes) - 1
    before = np.roll(corners, 1)
    before[last - sizes + 1] = corners[last]
    gone = (corners == before) & (sizes > 3)[owner]
    all_gone = np.bincount(owner[gone], minlength=len(sizes)) == sizes
    gone[last[all_gone]] = False  # a polygon of one vertex
    stay = ~gone
    return corners[stay], np.bincount(owner[stay], minlength=len(sizes))


def _cut(vertices: Floats, rows: Longs) -> Longs:
    """Return the (P, n - 2, 3) triangles of polygons of n corners each."""
    flat = _projected(vertices[rows])
    faces = _fan(rows, 0)
    others = np.flatnonzero(~_is_fan(flat, 0))
    is_second = _is_fan(flat[others], 1)
    second = others[is_second]
    faces[second] = _fan(rows[second], 1)
    for polygon in others[~is_second]:
        triangles = _clipped(flat[polygon])
        if len(triangles) == rows.shape[1] - 2:  # else it crosses itself: any fan is as good
            faces[polygon] = rows[polygon][triangles]
    return faces


def _projected(points: Floats) -> Floats:
    """Return the (P, n, 2) corners, counter-clockwise, in the coordinate plane they face most.

    Their coordinates stay the file's own: what is on one line remains so, to the bit.
    """
    points = points - points[:, :1]
    size = np.abs(points).max(axis=(1, 2), keepdims=True)
    points /= np.where(size > 0.0, size, 1.0)
    normals = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
    away = np.abs(normals).argmax(axis=1)
    each = np.arange(len(points))
    axes = np.stack([(away + 1) % 3, (away + 2) % 3], axis=1)
    axes[normals[each, away] < 0.0] = axes[normals[each, away] < 0.0, ::-1]
    projected: Floats = np.take_along_axis(points, axes[:, None, :], axis=2)
    return projected


def _fan(rows: Longs, start: int) -> Longs:
    rows = np.roll(rows, -start, axis=1)
    tips = np.broadcast_to(rows[:, :1], (len(rows), rows.shape[1] - 2))
    return np.stack([tips, rows[:, 1:-1], rows[:, 2:]], axis=2)


def _is_fan(flat: Floats, start: int) -> Flags:
    """Tell which polygons are the fan from a corner: its triangles point the same way."""
    flat = np.roll(flat, -start, axis=1)
    spokes = flat[:, 1:] - flat[:, :1]
    areas = spokes[:, :-1, 0] * spokes[:, 1:, 1] - spokes[:, :-1, 1] * spokes[:, 1:, 0]
    is_fan: Flags = (areas > FAN * areas.sum(axis=1, keepdims=True)).all(axis=1)
    return is_fan


def _clipped(flat: Floats) -> list[tuple[int, int, int]]:
    """Return triangles of a polygon, counter-clockwise.

    Where corners are in line, manifold3d makes slivers. They take in the triangle beyond their
    longest edge.
    """
    import manifold3d

    cut = manifold3d.triangulate([flat])
    apex: dict[tuple[int, int], int] = {}  # of the triangle on the left of each directed edge
    for triangle in cut.tolist():
        _put(apex, tuple(triangle))
    _without_slivers(apex, flat)
    return [(a, b, c) for (a, b), c in apex.items() if a < min(b, c)]


def _put(apex: dict[tuple[int, int], int], triangle: tuple[int, int, int]) -> None:
    a, b, c = triangle
    apex[a, b], apex[b, c], apex[c, a] = c, a, b


def _without_slivers(apex: dict[tuple[int, int], int], flat: Floats) -> None:
    """Flip the longest edge of each triangle of no area, where it is no side of the polygon."""
    points = [complex(x, y) for x, y in flat]

    def is_sliver(triangle: tuple[int, int, int]) -> bool:
        a, b, c = (points[i] for i in triangle)
        u, w = b - a, c - a
        return u.real * w.imag - u.imag * w.real <= FAN * whole

    x, y = flat.T
    whole = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    slivers = [
        t for t in ((a, b, c) for (a, b), c in apex.items() if a < min(b, c)) if is_sliver(t)
    ]
    for _ in range(4 * len(points)):  # slivers beside slivers take a few turns
        if not slivers:
            return
        a, b, c = slivers.pop()
        if apex.get((a, b)) != c:
            continue  # gone meanwhile
        sides = ((a, b, c), (b, c, a), (c, a, b))
        a, b, c = max(sides, key=lambda side: abs(points[side[1]] - points[side[0]]))
        beyond = apex.get((b, a))
        if beyond is None:
            continue
        del apex[a, b], apex[b, a]
        for triangle in ((a, beyond, c), (beyond, b, c)):
            _put(apex, triangle)
            if is_sliver(triangle):
                slivers.append(triangle)

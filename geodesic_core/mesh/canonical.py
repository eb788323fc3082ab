"""Canonical points: one spelling for each point of the surface, the same weights to the bit.

A point is a vertex, lies on an edge or inside a face. Weights that are rounding become zero, and
points on an edge are told apart up to `EDGE_STEPS` only, so that 0.3 from one end and 0.7 from the
other are one.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.errors import InvalidArgument, InvalidPoint
from geodesic_core.kernels.mesh.half_edges import APEX, HEAD, Topology, next_around, previous
from geodesic_core.mesh.surface_point import Curve, Point, Points, Source, SurfacePoint
from geodesic_core.tolerances import EDGE_STEPS, ROUNDED_SUM, WEIGHT, WEIGHT_ERROR
from geodesic_core.validation import is_index, is_number, unboxed


def at_vertex(topology: Topology, faces: Ints, vertex: int) -> SurfacePoint:
    """Return the point at a vertex, in the lowest of its faces.

    Of several vertices that edges of no length join, it is the lowest.
    """
    node = int(topology.inner_vertex[vertex])
    vertex = int(topology.outer_vertex[node])
    corners = topology.corners[topology.first_corner[node] : topology.first_corner[node + 1]]
    if len(corners) == 0:
        return SurfacePoint.vertex(vertex)
    face = min(topology.outer_face[corners // 3].tolist())
    u, v, w = (float(v == node) for v in topology.inner_vertex[faces[face]].tolist())
    return SurfacePoint(face, (u, v, w), vertex)


def in_face(
    topology: Topology, faces: Ints, inner_face: Ints, face: int, weights: Sequence[float]
) -> SurfacePoint | None:
    """Return the point of a face that has these weights, which may be rounded.

    None where it is in no face of the surface: the face is blocked, or an edge of no length has
    left of it an edge that no other face has.
    """
    cleaned = [float(weight) if weight > WEIGHT else 0.0 for weight in weights]
    total = math.fsum(cleaned)
    if abs(total - 1.0) <= ROUNDED_SUM:
        total = 1.0
    u, v, w = (weight / total for weight in cleaned)
    if 0.0 not in cleaned and inner_face[face] >= 0:
        return SurfacePoint(face, (u, v, w))
    share: dict[int, float] = {}
    for node, part in zip(topology.inner_vertex[faces[face]].tolist(), (u, v, w), strict=True):
        if part > 0.0:
            share[node] = share.get(node, 0.0) + part
    if len(share) == 1:
        return at_vertex(topology, faces, int(topology.outer_vertex[next(iter(share))]))
    if len(share) == 2:
        return _on_edge(topology, faces, share)
    return SurfacePoint(face, (u, v, w)) if inner_face[face] >= 0 else None


def on_edge(topology: Topology, faces: Ints, start: int, end: int, t: float) -> SurfacePoint | None:
    """Return the point at share ``t`` of the edge between two vertices; None if there is none."""
    u, v = topology.inner_vertex[[start, end]].tolist()
    if u == v:  # an edge of no length, or none
        return at_vertex(topology, faces, start) if start != end else None
    return _on_edge(topology, faces, {u: 1.0 - t, v: t})


_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors (…, 3): numpy's own takes ten times as long for few."""
    product: Floats = a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]
    return product


def weights_of(point: Floats, corners: Floats, snap: float) -> list[float]:
    """Return the weights of a point of a face, zero where it is nearer than ``snap`` to an edge.

    Inside, each from the height above its edge. On an edge, from the position along it: on the
    longest of several, as at the tip of a sliver, where heights are rounding.
    """
    edges = corners[_NEXT] - corners  # from each corner to the next
    away = point - corners
    normal = cross(edges[0], edges[1])
    area = float(np.linalg.norm(normal))  # twice
    lengths = np.linalg.norm(edges, axis=1)
    # Height times length, by edge.
    parts = cross(edges, away) @ normal / area if area > 0.0 else np.zeros(3)
    is_near = parts <= snap * lengths
    if is_near.any():
        i = int(np.argmax(np.where(is_near, lengths, -1.0)))
        share = float(away[i] @ edges[i]) / lengths[i] ** 2
        weights = np.zeros(3)
        weights[i], weights[(i + 1) % 3] = 1.0 - share, share
    else:
        weights = parts[_NEXT] / area  # what is above an edge is the share of its apex
    for corner in np.flatnonzero(np.linalg.norm(away, axis=1) <= snap):
        weights = np.eye(3)[corner]  # of two corners, the one within reach takes all
    return [max(float(weight), 0.0) for weight in weights]


def check_index(index: Any, count: int, kind: str, name: str) -> None:
    """Refuse what is not the index of one of ``count`` vertices or faces.

    Raises
    ------
    InvalidPoint
        Negative indices are refused, too.
    """
    if not is_index(index):
        if kind == "face":
            raise InvalidPoint(f"the {name} is in face {index!r}; a face id is an integer")
        raise InvalidPoint(
            f"the {name} is {index!r}; it must be a vertex index (an integer) or a SurfacePoint"
            f"{remedy(index)}"
        )
    if not 0 <= index < count:
        many = "vertices" if kind == "vertex" else f"{kind}s"
        raise InvalidPoint(
            f"the {name} is {kind} {index}, but {many} are numbered 0 to {count - 1}"
        )


def remedy(value: Any) -> str:
    """Return the end of a refusal: what helps a caller who gave this for a point."""
    if isinstance(value, Source | Curve):
        return (
            "; curves and start distances are for the sources of exact_distance, "
            "approximate_distance and fast_distance"
        )
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):  # rows of different lengths
        return ""
    if array.dtype.kind == "b":
        return "; for a mask, give numpy.flatnonzero(mask)"
    is_integer = array.dtype.kind in "iu"
    if array.dtype.kind == "f" or (is_integer and array.shape[-1:] == (3,)):
        return "; for a position, give mesh.locate([x, y, z])"
    return "; for nested indices, give numpy.ravel(indices)" if is_integer else ""


def check_weights(weights: Any, face: int, name: str) -> None:
    """Refuse weights that are not a point of a face.

    Raises
    ------
    InvalidPoint
        They are not three numbers; one is negative, or their sum is not one, beyond rounding.
    """
    is_sound = (
        isinstance(weights, Sequence | np.ndarray)
        and len(weights) == 3
        and all(map(is_number, weights))
        and min(weights) >= -WEIGHT_ERROR
        and abs(sum(weights) - 1.0) <= WEIGHT_ERROR
    )
    if not is_sound:
        raise InvalidPoint(
            f"the {name} has the weights {weights!r} in face {face}: they must be three numbers, "
            f"0 or more, whose sum is 1"
        )


def _on_edge(topology: Topology, faces: Ints, share: dict[int, float]) -> SurfacePoint | None:
    """Return the point with these weights of two inner vertices; None if no edge joins them."""
    h = _half_edge_between(topology, *share)
    if h is None:
        return None
    outer = {int(topology.outer_vertex[node]): weight for node, weight in share.items()}
    low, high = sorted(outer)
    upper = round(outer[high] / (outer[low] + outer[high]) * EDGE_STEPS) / EDGE_STEPS
    if upper in (0.0, 1.0):
        return at_vertex(topology, faces, low if upper == 0.0 else high)
    face = min(int(topology.outer_face[g // 3]) for g in half_edges_around(topology.links, h))
    placed = {low: 1.0 - upper, high: upper}
    corners = topology.outer_vertex[topology.inner_vertex[faces[face]]]
    u, v, w = (placed.get(corner, 0.0) for corner in corners.tolist())
    return SurfacePoint(face, (u, v, w))


def _half_edge_between(topology: Topology, u: int, v: int) -> int | None:
    """Return a half-edge of the edge that joins two inner vertices, in either direction."""
    corners = topology.corners[topology.first_corner[u] : topology.first_corner[u + 1]]
    leaving = corners[topology.links[corners, HEAD] == v]
    if len(leaving):
        return int(leaving[0])
    beside = corners[topology.links[corners, APEX] == v]
    return int(previous(beside[0])) if len(beside) else None


def half_edges_around(links: Ints, h: int) -> Iterator[int]:
    """Yield the half-edges of the edge of h, one for each of its faces, h first."""
    g = h
    while True:
        yield g
        g = int(next_around(links, g))
        if g < 0 or g == h:
            return


def each_of(points: Points, name: str) -> Iterable[Point]:
    """Return one point or several as several; ``name`` is how messages call one of them.

    Raises
    ------
    InvalidArgument
        They are neither.
    """
    points = unboxed(points)
    if isinstance(points, SurfacePoint | int | np.integer) and not isinstance(points, bool):
        return [points]
    if isinstance(points, str | bytes) or not isinstance(points, Iterable):
        raise InvalidArgument(
            f"{name}s is {points!r}; it must be a point, or a sequence of points{remedy(points)}"
        )
    return points


def as_given(points: Points, found: Any) -> Any:
    """Return what was found of each of some points: by itself where one point was given."""
    return found[0] if isinstance(unboxed(points), SurfacePoint | int | np.integer) else found

"""Points of curves in whole numbers: at vertices, on edges and in faces, alike from all faces."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.cutting.lines import Line
from geodesic_core.cutting.separation import edges_of, ends_of, keys_of
from geodesic_core.errors import InvalidMesh
from geodesic_core.kernels.cutting.merging import merge_along
from geodesic_core.kernels.cutting.predicates import NEAR, STEPS
from geodesic_core.mesh.degeneracies import of_three_vertices
from geodesic_core.mesh.triangle_mesh import TriangleMesh

AT_VERTEX, ON_EDGE, IN_FACE = 1, 2, 3
"""Kinds of points: the number of weights that are not 0"""


class Surroundings(NamedTuple):
    """The faces that have curves in them, and those beside them; R of them, and their E edges."""

    faces: Longs
    """(R,) ascending"""
    corners: Longs
    """(R, 3): vertices"""
    edges: Longs
    """(R, 3): number i is the edge from corner i to corner i + 1"""
    ends: Longs
    """(E, 2): vertices, the lower one first"""


class EdgePoints(NamedTuple):
    """Points that split edges, in the order in which they were made."""

    edges: Longs
    """(P,)"""
    steps: Longs
    """(P,): weight of the higher vertex, in steps of 1 / STEPS"""


class CurvePoints(NamedTuple):
    """The N points of all curves, one after another; those of a closed one begin and end it."""

    rows: Longs
    """(N,): of their faces among the surroundings; without meaning at vertices"""
    steps: Longs
    """(N, 3): weights in these faces, in steps"""
    kinds: Longs
    """(N,): AT_VERTEX, ON_EDGE or IN_FACE"""
    elements: Longs
    """(N,): the vertex; the number among `EdgePoints`; or the row of the face"""


class CurveSegments(NamedTuple):
    """The S segments of all curves."""

    starts: Longs
    """(S,): among the points"""
    ends: Longs
    """(S,)"""
    rows: Longs
    """(S,): of their faces among the surroundings"""
    curves: Longs
    """(S,)"""


def surroundings_of(mesh: TriangleMesh, lines: Sequence[Line]) -> Surroundings:
    """Return the surroundings of lines: each face that has two vertices or more of theirs.

    Raises
    ------
    InvalidMesh
        Curves meet an edge of no length.
    """
    crossed = np.unique(np.concatenate([line.faces for line in lines]))
    at_points = [mesh.faces[line.location_faces][line.location_weights > 0.0] for line in lines]
    own = np.unique(np.concatenate([mesh.faces[crossed].reshape(-1), *at_points])).astype(np.int64)
    _check_ends_apart(mesh, own)
    is_own = np.zeros(len(mesh.vertices), bool)
    is_own[own] = True
    faces = np.flatnonzero(is_own[mesh.faces].sum(axis=1) >= 2)
    faces = faces[of_three_vertices(mesh.faces[faces])]
    corners = mesh.faces[faces].astype(np.int64)
    keys, edges = np.unique(keys_of(ends_of(corners)), return_inverse=True)
    return Surroundings(faces, corners, edges.reshape(-1, 3), edges_of(keys))


def _check_ends_apart(mesh: TriangleMesh, vertices: Longs) -> None:
    """Refuse vertices that an edge of no length joins to others."""
    inner = mesh.topology.inner_vertex
    joined = vertices[np.bincount(inner, minlength=len(inner))[inner[vertices]] > 1]
    if len(joined):
        raise InvalidMesh(
            f"the curves meet vertex {joined[0]}, which an edge of zero length joins to another "
            'one: make them one by TriangleMesh(vertices, faces, merge="exact")',
            kind="vertex",
            elements=joined[:10].tolist(),
        )


def no_edge_points() -> EdgePoints:
    """Return no points."""
    return EdgePoints(np.empty(0, np.int64), np.empty(0, np.int64))


def with_points(known: EdgePoints, edges: Longs, steps: Longs) -> tuple[EdgePoints, Longs]:
    """Return points with some more, and the number that each of these has got.

    Those that are NEAR are one; known ones stay where they are.
    """
    count = len(known.edges)
    every = EdgePoints(np.append(known.edges, edges), np.append(known.steps, steps))
    order = np.lexsort((every.steps, every.edges))
    heads = np.empty(len(order), np.int64)
    is_kept = (order < count).astype(np.uint8)
    merge_along(every.edges[order], every.steps[order], is_kept, heads)
    head_of = np.empty(len(order), np.int64)
    head_of[order] = order[heads]
    is_added = head_of == np.arange(len(order))
    number = np.cumsum(is_added) - 1
    points = EdgePoints(every.edges[is_added], every.steps[is_added])
    return points, number[head_of[count:]]


def in_steps(weights: Floats) -> Longs:
    """Return weights (N, 3) in whole steps whose sum is STEPS; those that are NEAR 0 are 0."""
    steps = np.rint(weights * STEPS).astype(np.int64)
    steps[steps <= NEAR] = 0
    rows, largest = np.arange(len(steps)), steps.argmax(axis=1)
    steps[rows, largest] += STEPS - steps.sum(axis=1)
    return steps


def snapped_of(lines: Sequence[Line]) -> Longs:
    """Return pairs of a line and a point of it that is NEAR a vertex or an edge, not on it (P, 2).

    It snaps there. Segments between other points pass no vertex that NEAR.
    """
    pairs = [
        (i, k)
        for i, line in enumerate(lines)
        for k in np.flatnonzero(
            ((line.location_weights > 0.0) & (in_steps(line.location_weights) == 0)).any(axis=1)
        ).tolist()
    ]
    return np.array(pairs, np.int64).reshape(-1, 2)


def points_of(
    mesh: TriangleMesh, around: Surroundings, lines: Sequence[Line]
) -> tuple[CurvePoints, EdgePoints]:
    """Return the points of lines, and those of them that split edges."""
    faces = np.concatenate([line.location_faces for line in lines])
    rows = np.searchsorted(around.faces, faces)
    steps = in_steps(np.concatenate([line.location_weights for line in lines]))
    kinds = (steps > 0).sum(axis=1)
    elements = rows.copy()
    at_vertex, on_edge = kinds == AT_VERTEX, np.flatnonzero(kinds == ON_EDGE)
    elements[at_vertex] = mesh.faces[faces[at_vertex], steps[at_vertex].argmax(axis=1)]
    tails = (steps[on_edge].argmin(axis=1) + 1) % 3
    edges, along = on_edges(around, rows[on_edge], tails, steps[on_edge])
    edge_points, elements[on_edge] = with_points(no_edge_points(), edges, along)
    return CurvePoints(rows, steps, kinds, elements), edge_points


def on_edges(around: Surroundings, rows: Longs, tails: Longs, steps: Longs) -> tuple[Longs, Longs]:
    """Return the edges that begin at corners of faces, and how far up them points of these are."""
    heads, each = (tails + 1) % 3, np.arange(len(rows))
    is_forward = around.corners[rows, tails] < around.corners[rows, heads]
    return around.edges[rows, tails], np.where(is_forward, steps[each, heads], steps[each, tails])


def segments_of(around: Surroundings, lines: Sequence[Line]) -> CurveSegments:
    """Return the segments of lines."""
    sizes = [len(line.location_faces) for line in lines]
    first = np.cumsum([0, *sizes])[:-1]
    counts = [len(line.faces) for line in lines]
    curves = np.repeat(np.arange(len(lines)), counts)
    starts = np.concatenate(
        [begin + np.arange(count) for begin, count in zip(first, counts, strict=True)]
    )
    place = starts - first[curves]
    ends = first[curves] + (place + 1) % np.array(sizes)[curves]
    rows = np.searchsorted(around.faces, np.concatenate([line.faces for line in lines]))
    return CurveSegments(starts, ends, rows, curves)

"""The faces that curves cross, triangulated anew: the kernel called until all faces agree."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.cutting.whole_numbers import (
    AT_VERTEX,
    IN_FACE,
    ON_EDGE,
    CurvePoints,
    CurveSegments,
    EdgePoints,
    Surroundings,
    on_edges,
    with_points,
)
from geodesic_core.errors import InternalError, InvalidPoint
from geodesic_core.kernels.curves.rows import ROWS
from geodesic_core.kernels.cutting.faces import (
    CHILDREN,
    EDGES,
    MADE,
    ROW,
    WISHES,
    Patch,
    Pieces,
    Work,
    cut_faces,
)
from geodesic_core.kernels.cutting.predicates import STEPS
from geodesic_core.kernels.cutting.segments import Segments
from geodesic_core.kernels.cutting.triangulation import Triangulation
from geodesic_core.kernels.outcome import Outcome

_BUDGET = 20_000
"""Steps of a slice, about 50 ms"""
_ROUNDS = 50
"""Rounds in which faces ask for points on their edges, at most; three have been seen"""
_SUPERSEDED = -1


class Children(NamedTuple):
    """The triangles that take the place of faces. Names below 0 are those of `made`, -1 - i."""

    triangles: Longs
    """(C, 4): row of the face, ascending, and names of corners"""
    curve_edges: Longs
    """(K, 4): row, names of both ends, and the curve, for each curve that an edge belongs to"""
    made: Longs
    """(M, 3): row and place of each point in a face, as `predicates` has places; those that are
    used no more have the row -1"""
    edge_points: EdgePoints
    """Number i has the name V + i"""


def retriangulated(
    around: Surroundings,
    points: CurvePoints,
    segments: CurveSegments,
    edge_points: EdgePoints,
    shapes: Floats,
    vertex_count: int,
    control: Control,
) -> Children:
    """Return the triangles of all faces that curves cross.

    Where curves cross on an edge but for rounding, all faces of the edge are cut again with the
    crossing as one of its points.

    Raises
    ------
    InternalError
        A face cannot be cut: a defect.
    InvalidPoint
        The ends of a segment have no face in common.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    pieces = Pieces(_table(3), _table(4), _table(4), _table(3), _zeros(4))
    patch = _patch_of(around, points, segments, edge_points, shapes, vertex_count)
    rows = _rows_to_cut(patch)
    for _ in range(_ROUNDS):
        pieces = _cut(patch, rows, around, pieces, control)
        wished = _taken(pieces.wishes, pieces.sizes, WISHES)
        if len(wished) == 0:
            return Children(
                _sorted(_taken(pieces.children, pieces.sizes, CHILDREN)),
                _sorted(_taken(pieces.edges, pieces.sizes, EDGES)),
                _taken(pieces.made, pieces.sizes, MADE),
                edge_points,
            )
        edges, along = _edges_of(around, wished)
        edge_points, _ = with_points(edge_points, edges, along)
        rows = np.flatnonzero(np.isin(around.edges, edges).any(axis=1))
        _supersede(pieces, rows)
        patch = _patch_of(around, points, segments, edge_points, shapes, vertex_count)
    raise InternalError(
        f"face {around.faces[wished[0, 0]]} and its neighbours do not agree on their edges; "
        "please report this mesh and these curves"
    )


def _zeros(count: int) -> Longs:
    return np.zeros(count, np.int64)


def _table(width: int) -> Longs:
    return np.empty((ROWS, width), np.int64)


def _taken(array: Longs, sizes: Longs, which: int) -> Longs:
    return array[: sizes[which]]


def _sorted(rows: Longs) -> Longs:
    """Return the rows of faces that are not superseded, by face."""
    rows = rows[rows[:, 0] != _SUPERSEDED]
    found: Longs = rows[np.argsort(rows[:, 0], kind="stable")]
    return found


def _supersede(pieces: Pieces, rows: Longs) -> None:
    """Mark what has come of rows that are to be cut again, and forget wishes."""
    for array, which in ((pieces.made, MADE), (pieces.children, CHILDREN), (pieces.edges, EDGES)):
        of_row = _taken(array, pieces.sizes, which)[:, 0]
        of_row[np.isin(of_row, rows)] = _SUPERSEDED
    pieces.sizes[WISHES] = 0


def _edges_of(around: Surroundings, wished: Longs) -> tuple[Longs, Longs]:
    """Return the edges that places on the borders of faces are on, and how far up they are."""
    rows, x, y = wished.T
    steps = np.stack([STEPS - x - y, x, y], axis=1)
    return on_edges(around, rows, (steps.argmin(axis=1) + 1) % 3, steps)


def _rows_to_cut(patch: Patch) -> Longs:
    """Return the faces that have a point on an edge, a point inside or a segment."""
    split = np.diff(patch.edge_first) > 0
    has = (np.diff(patch.inner_first) > 0) | (np.diff(patch.segment_first) > 0)
    return np.flatnonzero(split[patch.edges].any(axis=1) | has)


def _cut(
    patch: Patch, rows: Longs, around: Surroundings, pieces: Pieces, control: Control
) -> Pieces:
    """Return the pieces with those of some faces."""
    names, leaving, tails, twins, claims = (np.empty(ROWS, np.int64) for _ in range(5))
    triangulation = Triangulation(_table(2), names, leaving, tails, twins, claims, _zeros(2))
    work = Work(triangulation, Segments(_table(3), _table(2), _zeros(3)), _zeros(2))
    outcome = int(Outcome.RUNNING)
    while outcome == Outcome.RUNNING:
        control.checkpoint(work.at[ROW] / max(len(rows), 1))
        control.check_memory(sum(map(_nbytes, (patch, work.triangulation, work.segments, pieces))))
        work, pieces, outcome = cut_faces(patch, rows, work, pieces, _BUDGET)
    if outcome != Outcome.FINISHED:
        face = around.faces[rows[work.at[ROW]]]
        raise InternalError(
            f"face {face} cannot be cut along these curves; please report them with this mesh"
        )
    return pieces


def _nbytes(arrays: Sequence[Any]) -> int:
    return sum(array.nbytes for array in arrays)


def _first_of(elements: Longs, count: int) -> Longs:
    """Return where each of ``count`` elements begins among sorted ones; where the last one ends."""
    return np.concatenate([_zeros(1), np.cumsum(np.bincount(elements, minlength=count))])


def _patch_of(
    around: Surroundings,
    points: CurvePoints,
    segments: CurveSegments,
    edge_points: EdgePoints,
    shapes: Floats,
    vertex_count: int,
) -> Patch:
    """Return the faces with their points and segments as the kernel has them."""
    order = np.lexsort((edge_points.steps, edge_points.edges))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    edge_first = _first_of(edge_points.edges, len(around.ends))
    inside = np.flatnonzero(points.kinds == IN_FACE)
    inside = inside[np.argsort(points.rows[inside], kind="stable")]
    inner_first = _first_of(points.rows[inside], len(around.faces))
    inner_rank = np.empty(len(points.rows), np.int64)
    inner_rank[inside] = np.arange(len(inside))
    places = _Places(around, points, edge_first, rank, inner_first, inner_rank)
    rows, starts, ends = places.of(segments)
    by_row = np.argsort(rows, kind="stable")
    return Patch(
        around.corners,
        around.edges,
        shapes,
        edge_first,
        np.stack([edge_points.steps[order], vertex_count + order], axis=1),
        inner_first,
        points.steps[inside, 1:].copy(),
        _first_of(rows, len(around.faces)),
        np.stack([starts, ends, segments.curves], axis=1)[by_row],
    )


class _Places(NamedTuple):
    """Numbers of points within faces, as `Patch.segments` has them."""

    around: Surroundings
    points: CurvePoints
    edge_first: Longs
    rank: Longs
    inner_first: Longs
    inner_rank: Longs

    def of(self, segments: CurveSegments) -> tuple[Longs, Longs, Longs]:
        """Return the rows of segments, and the numbers of both ends there.

        Raises
        ------
        InvalidPoint
            Points are in faces that do not meet.
        """
        rows = segments.rows.copy()
        starts, ends = self.within(segments.starts, rows), self.within(segments.ends, rows)
        for i in np.flatnonzero((starts < 0) | (ends < 0)).tolist():
            every = np.arange(len(self.around.faces))
            here, there = (
                self.within(np.full(len(every), point), every)
                for point in (segments.starts[i], segments.ends[i])
            )
            shared = np.flatnonzero((here >= 0) & (there >= 0))
            if len(shared) == 0:
                curve = segments.curves[i]
                point = segments.starts[i] - segments.starts[segments.curves == curve].min()
                raise InvalidPoint(
                    f"the points {point} and {point + 1} of curve {curve} have no face in common; "
                    "add the points where the curve crosses edges: a shortest path has them"
                )
            rows[i], starts[i], ends[i] = shared[0], here[shared[0]], there[shared[0]]
        return rows, starts, ends

    def within(self, points: Longs, rows: Longs) -> Longs:
        """Return the numbers of points in faces; -1 of those that are not there."""
        kinds, elements = self.points.kinds[points], self.points.elements[points]
        corners, edges = self.around.corners[rows], self.around.edges[rows]
        counts = np.diff(self.edge_first)[edges]
        number = np.full(len(points), -1)
        found, corner = _column_of(corners, elements)
        number = np.where((kinds == AT_VERTEX) & found, corner, number)
        on_edge = kinds == ON_EDGE
        edge_point = np.where(on_edge, elements, 0)
        if len(self.rank):
            found, k = _column_of(edges, self.edges_of(edge_point))
            each = np.arange(len(points))
            is_forward = corners[each, k] < corners[each, (k + 1) % 3]
            place = self.rank[edge_point] - self.edge_first[edges[each, k]]
            place = np.where(is_forward, place, counts[each, k] - 1 - place)
            before = (np.cumsum(counts, axis=1) - counts)[each, k]
            number = np.where(on_edge & found, 3 + before + place, number)
        is_inside = (kinds == IN_FACE) & (elements == rows)
        inner = self.inner_rank[points] - self.inner_first[rows]
        return np.where(is_inside, 3 + counts.sum(axis=1) + inner, number)

    def edges_of(self, edge_points: Longs) -> Longs:
        """Return the edges of points that split edges."""
        edges: Longs = np.searchsorted(self.edge_first, self.rank[edge_points], side="right") - 1
        return edges


def _column_of(table: Longs, elements: Longs) -> tuple[Any, Longs]:
    """Return whether each row of a table has an element, and in which column."""
    same = table == elements[:, None]
    return same.any(axis=1), same.argmax(axis=1)

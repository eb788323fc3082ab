"""The result of a cut: the new mesh, and the way from one mesh to the other."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.cutting.locations import Locations, weights_in
from geodesic_core.cutting.separation import parts_of
from geodesic_core.cutting.shapes import lengths_of, sides_of
from geodesic_core.errors import InvalidArgument
from geodesic_core.mesh.canonical import as_given, each_of
from geodesic_core.mesh.surface_point import Points, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.reprs import as_table


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A mesh of which curves are edges, and where all of it was on the old one.

    V' vertices and F' faces. The old V vertices keep their numbers and positions.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> cut = gc.cut(mesh, gc.shortest_path(mesh, 1, 2))
    >>> cut
    CutMesh(8 vertices, 4 faces, 2 parts)
    >>> cut.face_of.tolist()
    [0, 0, 1, 1]
    """

    old: TriangleMesh
    """The mesh that was cut."""
    vertices: Floats
    """(V', 3) positions, mesh units."""
    faces: Ints
    """(F', 3) int32: vertices; in the order of the old faces, and wound as they are."""
    face_of: Longs
    """(F',) int64, ascending: the old face that each one is of."""
    curve_edges: Longs
    """(E, 2) int64: the edges of all curves, each once, lower end first. Where the mesh is
    separated, ends are the vertices that `copy_of` leads to."""
    edge_curves: Longs
    """(P, 2) int64: numbers of a row of `curve_edges` and of a curve to which it belongs; one for
    each curve that runs along an edge, by edge."""
    copy_of: Longs
    """(V',) int64: the vertex that each one was before curves were opened, itself for most."""
    snapped: Longs
    """(P, 2) int64: numbers of a curve and of a point of it that is within 2**-30 of a vertex or an
    edge, as a weight, and not on it: the curve runs through that instead."""
    _locations: Locations

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The cut mesh as a `TriangleMesh`; faces of blocked ones are blocked. O(V' + F')."""
        if self.old.lengths is None:
            mesh = TriangleMesh(self.vertices, self.faces)
        else:
            vertices = self.vertices if self.old.has_positions else None
            lengths = self._lengths(self.old.lengths)
            mesh = TriangleMesh.from_lengths(self.faces, lengths, vertices)
        blocked = np.flatnonzero(np.isin(self.face_of, self.old.barriers))
        return mesh.with_barriers(blocked) if len(blocked) else mesh

    def _lengths(self, old_lengths: Floats) -> Floats:
        """Return the lengths of edges within the old faces, (F', 3)."""
        lengths = old_lengths[self.face_of]
        sizes = np.bincount(self.face_of, minlength=len(self.old.faces))
        rows = np.flatnonzero(sizes[self.face_of] > 1)
        sides = sides_of(self.old, self.face_of[rows])
        weights = [self._weights(self.faces[rows, k], self.face_of[rows]) for k in range(3)]
        for k in range(3):
            lengths[rows, k] = lengths_of(sides, weights[(k + 1) % 3] - weights[k])
        return lengths

    def _weights(self, vertices: Any, faces: Longs) -> Floats:
        """Return the weights of vertices in old faces."""
        return weights_in(self._locations, self.old.faces, self.copy_of[vertices], faces)

    @cached_property
    def location_faces(self) -> Longs:
        """(V',) int64: an old face that holds each vertex, the lowest; -1 for none."""
        old = self.old
        lowest = np.full(len(old.vertices), -1)
        surface = np.flatnonzero(old.inner_face >= 0)[::-1]
        lowest[old.faces[surface].reshape(-1)] = np.repeat(surface, 3)
        found: Longs = np.append(lowest, self._locations.faces)[self.copy_of]
        return found

    @cached_property
    def location_weights(self) -> Floats:
        """(V', 3) float64: weights in that face, multiples of 2**-41; 0 where there is none."""
        weights = np.zeros((len(self.vertices), 3))
        rows = np.flatnonzero(self.location_faces >= 0)
        weights[rows] = self._weights(rows, self.location_faces[rows])
        return weights

    @cached_property
    def location_of(self) -> tuple[SurfacePoint, ...]:
        """Where each of the V' vertices is on the old mesh; canonical. O(V')."""
        return tuple(map(self._location, range(len(self.vertices))))

    def _location(self, vertex: int) -> SurfacePoint:
        """Return where a vertex is on the old mesh."""
        number = int(self.copy_of[vertex])
        if number < len(self.old.vertices):
            return self.old.point(number)
        u, v, w = self._locations.weights[number - len(self.old.vertices)].tolist()
        face = int(self._locations.faces[number - len(self.old.vertices)])
        return self.old.point(SurfacePoint.face(face, (u, v, w)))

    @cached_property
    def parts(self) -> Longs:
        """(F',) int64: the part that each face belongs to, numbered by its lowest face.

        Faces of a part are joined across edges that are no edges of curves; barriers do not part
        them. Many curves that cross enclose many small parts.
        """
        return parts_of(self.copy_of[self.faces], self.curve_edges)

    def to_old(self, points: Points) -> Any:
        """Return a point of the cut mesh, or several, as points of the old one.

        Parameters
        ----------
        points
            One or more: vertex indices or `SurfacePoint`, of `mesh`.

        Returns
        -------
        SurfacePoint or list of SurfacePoint
            Canonical.

        Raises
        ------
        InvalidArgument, InvalidPoint
            They are no points of the cut mesh.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
        >>> cut = gc.cut(mesh, gc.shortest_path(mesh, 1, 2))
        >>> [str(point) for point in cut.to_old([3, 4])]
        ['vertex 3', 'the point (0.5, 0.0, 0.5) of face 0']
        """
        given = [self.mesh.point(p, f"point {i}") for i, p in enumerate(each_of(points, "point"))]
        return as_given(points, [self._to_old(point) for point in given])

    def _to_old(self, point: SurfacePoint) -> SurfacePoint:
        if point.vertex_index is not None:
            return self._location(point.vertex_index)
        face = self.face_of[[point.face_index] * 3]
        u, v, w = (point.barycentric @ self._weights(self.faces[point.face_index], face)).tolist()
        return self.old.point(SurfacePoint.face(int(face[0]), (u, v, w)))

    def to_new(self, points: Points) -> Any:
        """Return a point of the old mesh, or several, as points of the cut one.

        Parameters
        ----------
        points
            One or more: vertex indices or `SurfacePoint`, of the old mesh.

        Returns
        -------
        SurfacePoint or list of SurfacePoint
            Canonical on `mesh`. Of a point on a curve that was opened, one of several.

        Raises
        ------
        InvalidArgument, InvalidPoint
            They are no points of the old mesh.

        Notes
        -----
        O(faces that took the place of the point's).

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
        >>> cut = gc.cut(mesh, gc.shortest_path(mesh, 1, 2))
        >>> str(cut.to_new(gc.SurfacePoint.face(0, (0.75, 0.125, 0.125))))
        'the point (0.25, 0.625, 0.125) of face 1'
        """
        given = [self.old.point(p, f"point {i}") for i, p in enumerate(each_of(points, "point"))]
        return as_given(points, [self._to_new(point) for point in given])

    def _to_new(self, point: SurfacePoint) -> SurfacePoint:
        if point.vertex_index is not None:
            return self.mesh.point(point.vertex_index)
        face = point.face_index
        first, end = np.searchsorted(self.face_of, [face, face + 1]).tolist()
        corners = self.faces[first:end].reshape(-1)
        places = self._weights(corners, np.full(len(corners), face)).reshape(-1, 3, 3)
        shares = np.stack(
            [
                _areas(np.array(point.barycentric), places[:, k - 2], places[:, k - 1])
                for k in range(3)
            ],
            axis=1,
        )
        shares /= shares.sum(axis=1, keepdims=True)
        child = int(shares.min(axis=1).argmax())
        weights = shares[child].clip(min=0.0)
        u, v, w = (weights / weights.sum()).tolist()
        return self.mesh.point(SurfacePoint.face(first + child, (u, v, w)))

    def carry(self, values: ArrayLike, of: Literal["vertices", "faces"] | None = None) -> Any:
        """Return values of the old mesh's vertices or faces for those of the cut mesh.

        Parameters
        ----------
        values
            (V, …) or (F, …) numbers.
        of
            What they belong to; None where their number tells it.

        Returns
        -------
        numpy.ndarray
            (V', …) float64, interpolated linearly in the old faces, old vertices with their own
            values; or (F', …), of the type of the values, with each face's old value.

        Raises
        ------
        InvalidArgument
            Their number is not that of the old vertices or faces, or is that of both.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
        >>> cut = gc.cut(mesh, gc.shortest_path(mesh, 1, 2), separate=False)
        >>> cut.carry([0.0, 1.0, 2.0, 3.0]).tolist()
        [0.0, 1.0, 2.0, 3.0, 1.5]
        >>> cut.carry([10, 20]).tolist()
        [10, 10, 20, 20]
        """
        array = np.asarray(values)
        counts = {"vertices": len(self.old.vertices), "faces": len(self.old.faces)}
        fitting = [name for name, count in counts.items() if array.shape[:1] == (count,)]
        chosen = fitting if of is None else [name for name in fitting if name == of]
        if len(chosen) != 1 or array.dtype.kind not in "biufc":
            raise InvalidArgument(
                f"values have shape {array.shape} and type {array.dtype}; they must be numbers, "
                f"{counts['vertices']} for vertices or {counts['faces']} for faces"
                + ('; name which, of="vertices" or "faces"' if len(chosen) > 1 else "")
            )
        return array[self.face_of] if chosen == ["faces"] else self._interpolated(array)

    def _interpolated(self, values: NDArray[Any]) -> Any:
        """Return values of old vertices for new ones; NaN counts only where a corner has weight."""
        weights = self._locations.weights.reshape(-1, 3, *[1] * (values.ndim - 1))
        at_corners = values[self.old.faces[self._locations.faces]]
        parts = np.where(weights > 0.0, weights * at_corners, 0.0)
        return np.concatenate([values, parts.sum(axis=1)])[self.copy_of]

    def __repr__(self) -> str:
        return (
            f"CutMesh({len(self.vertices)} vertices, {len(self.faces)} faces, "
            f"{int(self.parts.max()) + 1} parts)"
        )

    def _repr_html_(self) -> str:
        sizes = {"vertices": len(self.vertices), "faces": len(self.faces)}
        edges = {"edges of curves": len(self.curve_edges)}
        return as_table("CutMesh", sizes | edges | {"parts": int(self.parts.max()) + 1})


def _areas(point: Floats, start: Floats, end: Floats) -> Floats:
    """Return twice the areas between a point and edges, in the plane of the last two weights."""
    a, b = start[:, 1:] - point[1:], end[:, 1:] - point[1:]
    areas: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return areas

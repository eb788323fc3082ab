"""Many vertices as points: in arrays, since a point for each would take longer than a sweep."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, overload

import numpy as np

from geodesic_core.arrays import Ints, Longs
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class VertexPoints(Sequence[SurfacePoint]):
    """Vertices of a mesh, each of which becomes a canonical point where it is asked for."""

    def __init__(self, mesh: TriangleMesh, vertices: Ints) -> None:
        self._mesh = mesh
        self.vertices = vertices
        """(N,) int32"""

    @classmethod
    def of(cls, mesh: TriangleMesh, points: Iterable[Any]) -> "VertexPoints | None":
        """Return the points that are vertex indices, all in range; None for others."""
        if isinstance(points, range):
            indices = np.arange(points.start, points.stop, points.step)
        elif isinstance(points, np.ndarray) and points.ndim == 1:
            indices = points
        elif isinstance(points, list | tuple) and all(type(point) is int for point in points):
            try:
                indices = np.array(points, np.int64)
            except OverflowError:
                return None
        else:
            return None
        is_whole = np.issubdtype(indices.dtype, np.integer)
        if not is_whole or not len(indices):
            return None
        if indices.min() < 0 or indices.max() >= len(mesh.vertices):
            return None
        return cls(mesh, indices.astype(np.int32))

    def __len__(self) -> int:
        return len(self.vertices)

    @overload
    def __getitem__(self, index: int) -> SurfacePoint: ...
    @overload
    def __getitem__(self, index: slice) -> "VertexPoints": ...
    def __getitem__(self, index: int | slice) -> "SurfacePoint | VertexPoints":
        if isinstance(index, slice):
            return VertexPoints(self._mesh, self.vertices[index])
        return self._mesh.point(int(self.vertices[index]))

    def __iter__(self) -> Iterator[SurfacePoint]:
        return map(self._mesh.point, self.vertices.tolist())

    def __eq__(self, other: object) -> bool:
        if isinstance(other, VertexPoints):
            return np.array_equal(self.vertices, other.vertices)
        return isinstance(other, Sequence) and vertices_of(other).tolist() == self.vertices.tolist()

    __hash__ = None  # type: ignore[assignment]

    def take(self, indices: Longs) -> "VertexPoints":
        """Return some of the points, in another order."""
        return VertexPoints(self._mesh, self.vertices[indices])


def vertices_of(points: Sequence[SurfacePoint]) -> Ints:
    """Return the vertex that each canonical point is, (N,) int32; -1 for another point."""
    if isinstance(points, VertexPoints):
        return points.vertices
    vertices = (point.vertex_index for point in points)
    return np.array([-1 if vertex is None else vertex for vertex in vertices], np.int32)

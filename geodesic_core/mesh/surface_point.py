"""Points of the surface, at a vertex, on an edge or inside a face; and sources made of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidPoint
from geodesic_core.validation import is_index, is_number

if TYPE_CHECKING:  # which is made of points
    from geodesic_core.mesh.surface_curve import SurfaceCurve

UNPLACED = -1
"""The face of a vertex that was named without a mesh, or belongs to no face."""

Weights = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SurfacePoint:
    """A point of the surface, by its barycentric coordinates in a face.

    Points from a mesh are canonical: the face is the lowest that contains the point,
    ``vertex_index`` is set exactly where the point is a vertex, and all spellings of a point on an
    edge are the same.

    Parameters
    ----------
    face_index
        Face id; -1 for a vertex that was named without a mesh.
    barycentric
        Weights of the face's three corners; they sum to one.
    vertex_index
        The vertex at this point, if there is one.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> mesh.position(gc.SurfacePoint(0, (0.5, 0.25, 0.25))).tolist()
    [0.5, 0.25, 0.0]
    """

    face_index: int
    """Face id; -1 for a vertex that was named without a mesh."""
    barycentric: Weights
    """Weights of the face's three corners; they sum to one."""
    vertex_index: int | None = None
    """The vertex that this point is, if it is one."""

    def __str__(self) -> str:
        if self.vertex_index is not None:
            return f"vertex {self.vertex_index}"
        return f"the point {self.barycentric} of face {self.face_index}"

    @classmethod
    def vertex(cls, index: int) -> "SurfacePoint":
        """Return the point at a vertex.

        Parameters
        ----------
        index
            Vertex index.

        Returns
        -------
        SurfacePoint
            Not bound to a mesh; `TriangleMesh.point` makes it canonical.

        Raises
        ------
        InvalidPoint
            The index is not an integer.

        Examples
        --------
        >>> str(gc.SurfacePoint.vertex(7))
        'vertex 7'
        """
        if not is_index(index):
            raise InvalidPoint(f"the vertex is {index!r}; it must be an integer")
        return cls(UNPLACED, (1.0, 0.0, 0.0), index)

    @classmethod
    def edge(cls, face: int, corner: int, t: float) -> "SurfacePoint":
        """Return the point at share ``t`` of the way from a corner of a face to its next corner.

        Parameters
        ----------
        face
            Face id.
        corner
            0, 1 or 2: the corner of the face at which the edge begins.
        t
            Share of the way, 0 to 1.

        Returns
        -------
        SurfacePoint
            Not bound to a mesh; `TriangleMesh.point` makes it canonical.

        Raises
        ------
        InvalidPoint
            The corner is not 0, 1 or 2, or the share is no number.

        Examples
        --------
        >>> gc.SurfacePoint.edge(12, corner=1, t=0.25).barycentric
        (0.0, 0.75, 0.25)
        """
        if not is_number(t):
            raise InvalidPoint(f"t is {t!r}; it must be a number from 0 to 1")
        match corner:
            case 0:
                return cls(face, (1.0 - t, t, 0.0))
            case 1:
                return cls(face, (0.0, 1.0 - t, t))
            case 2:
                return cls(face, (t, 0.0, 1.0 - t))
        raise InvalidPoint(f"the corner of face {face} is {corner!r}; it must be 0, 1 or 2")

    @classmethod
    def face(cls, index: int, barycentric: Weights) -> "SurfacePoint":
        """Return the point of a face with these weights of its corners.

        Parameters
        ----------
        index
            Face id.
        barycentric
            Three weights, 0 or more, whose sum is 1.

        Returns
        -------
        SurfacePoint
            Not bound to a mesh; `TriangleMesh.point` checks it and makes it canonical.

        Examples
        --------
        >>> str(gc.SurfacePoint.face(12, (0.2, 0.3, 0.5)))
        'the point (0.2, 0.3, 0.5) of face 12'
        """
        return cls(index, barycentric)


Point = int | np.integer[Any] | SurfacePoint
"""Either way to write a point: a vertex by its index."""

Points = Point | Sequence[Point] | NDArray[np.integer[Any]]
"""One point or several."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A polyline on the surface; as a source, distances start at all of its points.

    Each segment is straight, and lies in a face that both of its ends belong to. To join points
    that are farther apart, find the `shortest_path` with these points as waypoints: it is a
    `SurfaceCurve`, which can be a source itself. A closed curve ends where it begins.

    Parameters
    ----------
    points
        Vertex indices or `SurfacePoint`, at least one.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> side = gc.Curve([0, 1])  # the lower edge of the square
    >>> gc.exact_distance(mesh, side).distances.tolist()
    [0.0, 0.0, 1.0, 1.0]
    """

    points: Sequence[Point]


@dataclass(frozen=True, slots=True)
class Source:
    """A point or a curve, and the distance at which it starts.

    Parameters
    ----------
    point
        A vertex index, a `SurfacePoint`, a `Curve` or a `SurfaceCurve`.
    start_distance
        Mesh units, finite, 0 or more; added to every distance from this source.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, gc.Source(0, start_distance=0.5)).distances.round(3).tolist()
    [0.5, 1.5, 1.5, 1.914]
    """

    point: "Point | Curve | SurfaceCurve"
    start_distance: float = 0.0

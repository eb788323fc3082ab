"""Triangle meshes: validated, frozen, with their topology."""

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NoReturn, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core import plotting
from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import (
    InvalidArgument,
    InvalidMesh,
    InvalidPoint,
    NoHeight,
    NotEmbedded,
)
from geodesic_core.kernels.mesh import build
from geodesic_core.kernels.mesh.half_edges import (
    LENGTH,
    LENGTH_LEFT,
    SIN_LEFT,
    TAIL,
    Embedding,
    Topology,
)
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.mesh import canonical
from geodesic_core.mesh.boundaries import boundaries_of
from geodesic_core.mesh.closest_point import NearestFace
from geodesic_core.mesh.curve import curve_on
from geodesic_core.mesh.degeneracies import (
    edges_of_no_length,
    lowest_joined,
    merged,
    of_three_vertices,
)
from geodesic_core.mesh.edge_lengths import as_edge_lengths
from geodesic_core.mesh.height_field import HeightField
from geodesic_core.mesh.report import NAMED, MeshReport, report_of, warnings_of
from geodesic_core.mesh.surface_curve import SurfaceCurve, draw_over
from geodesic_core.mesh.surface_point import Point, SurfacePoint
from geodesic_core.mesh.tangent_frames import TangentFrames, tangent_frames_of
from geodesic_core.mesh.triangulation import triangulated
from geodesic_core.mesh.validation import (
    as_faces,
    as_polygons,
    as_vertices,
    check_corners,
    check_vertices,
)
from geodesic_core.plotting import Camera
from geodesic_core.reprs import as_table
from geodesic_core.tolerances import (
    ROUGH,
    ROUGH_VERTICES,
    ROUNDED_COORDINATE,
    SHARP_SADDLE,
    SHORTEST_EDGE,
    SNAP,
    WEIGHT_ERROR,
)
from geodesic_core.validation import as_barriers, as_limit, as_places, is_number, unboxed

Merge = Literal["none", "exact"] | float
"""Which vertices become one: none, those at one position, or those within a distance."""


class TriangleMesh:
    """A triangle mesh, checked and prepared for geodesics.

    Parameters
    ----------
    vertices
        (V, 3) positions, mesh units; finite.
    faces
        (F, 3) vertex indices, integers. Neighbours may be wound differently, and an edge may have
        any number of faces.
    merge
        ``"exact"`` merges vertices at equal positions, in order of first appearance;
        `vertex_map` then leads from given to merged vertices. ``"none"`` keeps them apart. A
        distance, mesh units, merges vertices that are no farther apart, and so all those that steps
        of this length lead to, from vertex to vertex: the first of them keeps its position. Give
        less than the shortest edge, since edges that are no longer than the distance collapse.

    Raises
    ------
    InvalidMesh
        Naming the elements at fault: wrong shape or type, NaN or infinity, an index out of range,
        no face with three vertices at different positions, an edge shorter than 1e-50.
    InvalidArgument
        ``merge`` is neither ``"none"`` nor ``"exact"``, nor a finite number, 0 or more.

    Notes
    -----
    The arrays are copied once, and read-only. Vertices and faces keep the caller's order; the
    topology has an internal order, which is never visible. A face that repeats a vertex keeps its
    number, but is not part of the surface: it joins nothing, and no point lies in it. To block
    other faces as well, see `with_barriers`. An edge of zero length, in a face of three different
    vertices, makes its ends one point of the surface: the distance between them is 0. Its face
    shrinks to an edge, whose points belong to the other faces of that edge, or to a point.
    Preparing costs O(V + F) time, and memory of about 365 bytes a face.

    Examples
    --------
    >>> corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]
    >>> gc.TriangleMesh(corners, [[0, 1, 3], [0, 3, 2]])
    TriangleMesh(4 vertices, 2 faces)
    """

    vertices: Floats
    """(V, 3) float64, read-only; mesh units."""
    faces: Ints
    """(F, 3) int32, read-only."""
    vertex_map: Longs | None
    """(given vertices,) int64: the vertex that each given one became; None where none moved."""
    face_map: Longs | None
    """(F,) int64: the polygon that each face came from; None where each polygon is one face."""
    lengths: Floats | None
    """(F, 3) float64, read-only, mesh units: the lengths of edges that the mesh was given, from
    corner i to corner i + 1; None where they are the distances of its vertices."""
    embedding: Embedding
    """Half-edges and positions, see `geodesic_core.kernels.mesh.half_edges`."""
    _notes: tuple[str, ...]

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, merge: Merge = "none") -> None:
        self._build(as_vertices(vertices), as_faces(faces), None, merge, ())

    @classmethod
    def from_polygons(
        cls,
        vertices: ArrayLike,
        corners: ArrayLike,
        sizes: ArrayLike,
        merge: Merge = "none",
        notes: Sequence[str] = (),
    ) -> "TriangleMesh":
        """Return the mesh of polygons, each cut into triangles in its place.

        `face_map` leads from faces to polygons. One of fewer than three different corners becomes
        one face that repeats a vertex.

        Parameters
        ----------
        vertices
            (V, 3) positions, mesh units; finite.
        corners
            (C,) vertex indices of all polygons, one polygon after the other.
        sizes
            (P,) number of corners of each polygon, 1 or more.
        merge
            As for `TriangleMesh`.
        notes
            Sentences that `warnings` begin with.

        Returns
        -------
        TriangleMesh
            Of one triangle or more for each polygon, in their order.

        Raises
        ------
        InvalidMesh, InvalidArgument
            As for `TriangleMesh`.

        Examples
        --------
        >>> square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
        >>> mesh = gc.TriangleMesh.from_polygons(square, corners=[0, 1, 2, 3], sizes=[4])
        >>> mesh.faces.tolist(), mesh.face_map.tolist()
        ([[0, 1, 2], [0, 2, 3]], [0, 0])
        """
        points = as_vertices(vertices)
        check_vertices(points)
        flat, counts = as_polygons(corners, sizes)
        check_corners(flat, counts, len(points))
        faces, face_map = triangulated(points, flat, counts)
        mesh = cls.__new__(cls)
        mesh._build(points, faces, face_map, merge, notes)
        return mesh

    @classmethod
    def from_lengths(
        cls, faces: ArrayLike, lengths: ArrayLike, vertices: ArrayLike | None = None
    ) -> "TriangleMesh":
        """Return the surface whose edges have these lengths, wherever it lies, if it lies anywhere.

        Distances, paths, log maps, lines and all else on the surface need no more: a flat torus, a
        cone, an averaged cortex. What needs space, such as `locate` and pictures, needs
        ``vertices`` as well. Two faces share an edge where they share two vertices: so two edges
        between the same vertices, as on a torus two cells wide, cannot be given.

        Parameters
        ----------
        faces
            (F, 3) vertex indices, integers; as for `TriangleMesh`.
        lengths
            (F, 3) mesh units: number i of a face is that of its edge from corner i to corner i + 1.
        vertices
            (V, 3) positions to draw the surface at, which need not have these lengths. None for
            none: then vertices are numbered up to the highest that a face has, and are 3 F at most.

        Returns
        -------
        TriangleMesh
            Without ``vertices`` its own are NaN.

        Raises
        ------
        InvalidMesh
            Naming the elements at fault: as for `TriangleMesh`; a length that is NaN, infinite or
            shorter than 1e-50; a face with one side longer than the other two; an edge on whose
            length two faces disagree.

        Notes
        -----
        O(V + F). A face whose sides add up to the third has no area, and is treated as such faces
        are anywhere. Lengths may be off by 1e-9 of themselves.

        Examples
        --------
        >>> tetrahedron = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
        >>> mesh = gc.TriangleMesh.from_lengths(tetrahedron, np.ones((4, 3)))
        >>> gc.exact_distance(mesh, 0).distances.tolist()
        [0.0, 1.0, 1.0, 1.0]
        """
        triangles = as_faces(faces)
        points = None if vertices is None else as_vertices(vertices)
        most = min(int(triangles.max()) + 1, triangles.size)  # a face can name any number
        count = most if points is None else len(points)
        if points is not None:
            check_vertices(points)
        check_corners(triangles.reshape(-1), np.full(len(triangles), 3), count)
        own = as_edge_lengths(lengths, triangles)
        if points is None:
            points = np.full((count, 3), np.nan)
        mesh = cls.__new__(cls)
        everywhere = np.arange(len(triangles))
        outer = triangles.astype(np.int32)
        mesh._hold(points, outer, None, None, _prepared(points, outer, everywhere, own), (), own)
        return mesh

    def with_lengths(self, lengths: ArrayLike) -> "TriangleMesh":
        """Return this mesh with other lengths of its edges, and the same vertices to draw it at.

        Parameters
        ----------
        lengths
            (F, 3) mesh units, as for `from_lengths`.

        Returns
        -------
        TriangleMesh
            With the same faces blocked; vertices keep their numbers, also those at one position.

        Raises
        ------
        InvalidMesh
            As for `from_lengths`.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> wide = mesh.with_lengths([[2.0, 1.0, 5**0.5], [5**0.5, 2.0, 1.0]])
        >>> gc.exact_distance(wide, 0).distances.round(3).tolist()
        [0.0, 2.0, 1.0, 2.236]
        """
        own = as_edge_lengths(lengths, self.faces.astype(np.int64))
        return self._among(np.setdiff1d(np.arange(len(self.faces)), self.barriers), own)

    def _among(self, free: Longs, lengths: Floats | None) -> "TriangleMesh":
        """Return this mesh with these faces free and all others blocked, and these lengths."""
        mesh = TriangleMesh.__new__(TriangleMesh)
        embedding = _prepared(self.vertices - self.origin, self.faces, free, lengths)
        mesh._hold(
            self.vertices,
            self.faces,
            self.vertex_map,
            self.face_map,
            embedding,
            self._notes,
            lengths,
        )
        return mesh

    def _build(
        self,
        points: Floats,
        triangles: Longs,
        face_map: Longs | None,
        merge: Merge,
        notes: Sequence[str],
    ) -> None:
        outcome, _ = build.check_arrays(points, triangles)
        if outcome != Outcome.FINISHED:
            check_vertices(points)
            check_corners(triangles.reshape(-1), np.full(len(triangles), 3), len(points))
        vertex_map: Longs | None = None
        if merge != "none":
            points, vertex_map = merged(points, _merging_distance(merge))
            triangles = vertex_map[triangles]
        faces = triangles.astype(np.int32)
        everywhere = np.arange(len(faces))
        embedding = _prepared(points - build.origin_of(points, faces), faces, everywhere, None)
        self._hold(points, faces, vertex_map, face_map, embedding, notes)

    def _hold(
        self,
        vertices: Floats,
        faces: Ints,
        vertex_map: Longs | None,
        face_map: Longs | None,
        embedding: Embedding,
        notes: Sequence[str] = (),
        lengths: Floats | None = None,
    ) -> None:
        self.__dict__.update(
            vertices=_frozen(vertices),
            faces=_frozen(faces),
            vertex_map=None if vertex_map is None else _frozen(vertex_map),
            face_map=None if face_map is None else _frozen(face_map),
            lengths=None if lengths is None else _frozen(lengths),
            embedding=_frozen_embedding(embedding),
            _notes=tuple(notes),
        )

    def __setattr__(self, name: str, value: object) -> NoReturn:
        """Refuse a change: the topology and results would still be those of the mesh before."""
        raise AttributeError(
            f"{name} cannot be set: a TriangleMesh does not change. Make another one, "
            "TriangleMesh(vertices, faces)"
        )

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "TriangleMesh":
        """Return the mesh whose `arrays` these are; trusted, not checked.

        Parameters
        ----------
        arrays
            The arrays of `arrays`, by name; they may be memory-mapped.

        Returns
        -------
        TriangleMesh
            The same mesh, without preparing it again.

        Raises
        ------
        InvalidArgument
            There is a name that `arrays` does not give: for a mesh of your own use the constructor.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> gc.TriangleMesh.from_arrays(mesh.arrays())
        TriangleMesh(4 vertices, 2 faces)
        """
        unknown = sorted(arrays.keys() - _ARRAYS)
        if unknown:
            raise InvalidArgument(
                f"from_arrays does not know {', '.join(unknown)}: it takes what mesh.arrays() "
                "returned; make a mesh of your own by TriangleMesh(vertices, faces)"
            )
        mesh = cls.__new__(cls)
        mesh._hold(
            arrays["vertices"],
            arrays["faces"],
            arrays.get("vertex_map"),
            arrays.get("face_map"),
            Embedding(
                Topology(**{name: arrays[name] for name in Topology._fields}), arrays["positions"]
            ),
            (),
            arrays.get("lengths"),
        )
        return mesh

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, the prepared topology included, for a store.

        Returns
        -------
        dict of str to numpy.ndarray
            Read-only; ``"vertices"`` (V, 3) float64, ``"faces"`` (F, 3) int32, maps where there are
            any, and those of the topology.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> mesh.arrays()["faces"].tolist()
        [[0, 1, 3], [0, 3, 2]]
        """
        arrays: dict[str, NDArray[Any]] = {"vertices": self.vertices, "faces": self.faces}
        if self.vertex_map is not None:
            arrays["vertex_map"] = self.vertex_map
        if self.face_map is not None:
            arrays["face_map"] = self.face_map
        if self.lengths is not None:
            arrays["lengths"] = self.lengths
        return arrays | {"positions": self.positions} | self.topology._asdict()

    def with_barriers(self, barriers: Iterable[int]) -> "TriangleMesh":
        """Return this mesh with some faces blocked, as holes; paths may bend at their corners.

        All methods and solvers accept it, and all vertices and faces keep their numbers. Paths may
        run along an edge between a blocked and a free face, and pass through a corner that free
        faces share. A point cannot lie in blocked faces alone. A vertex whose faces are all blocked
        is isolated: it reaches only itself.

        Parameters
        ----------
        barriers
            Ids of triangles, in any order (those of polygons are found in `face_map`). Faces that
            are blocked already stay so.

        Returns
        -------
        TriangleMesh
            Sharing vertices and faces with this one; this one if no face is added.

        Raises
        ------
        InvalidArgument
            They are not ids of faces, or leave no face free.

        Notes
        -----
        O(V + F): the time of `TriangleMesh` without its checks. The result is not cached: keep it
        for further calls with the same barriers.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> gc.exact_distance(mesh.with_barriers([0]), 0).distances.round(3).tolist()
        [0.0, inf, 1.0, 1.414]
        """
        blocked = as_barriers(barriers, len(self.faces))
        added = np.setdiff1d(blocked[of_three_vertices(self.faces[blocked])], self.barriers)
        if len(added) == 0:
            return self
        free = np.setdiff1d(np.arange(len(self.faces)), np.union1d(self.barriers, added))
        if (self.inner_face[free] < 0).all():
            raise InvalidArgument("the barriers block every face: there is no surface left")
        return self._among(free, self.lengths)

    @property
    def topology(self) -> Topology:
        """Half-edges and lengths: the surface as sweeps know it, wherever it lies in space."""
        return self.embedding.topology

    @property
    def positions(self) -> Floats:
        """(V, 3) float64: the topology's vertices, mesh units from `origin`."""
        return self.embedding.positions

    @cached_property
    def barriers(self) -> Longs:
        """(B,) int64: the faces that are blocked, ascending; see `with_barriers`."""
        outside = np.flatnonzero((self.inner_face < 0) & of_three_vertices(self.faces))
        nodes = self.topology.inner_vertex[self.faces[outside]]
        # A free face would have joined the ends of its edges of no length.
        is_apart = nodes != np.roll(nodes, -1, axis=1)
        is_blocked = of_three_vertices(nodes) | (is_apart & self._have_no_length(outside)).any(
            axis=1
        )
        blocked: Longs = outside[is_blocked]
        return blocked

    def _have_no_length(self, faces: Longs) -> NDArray[np.bool_]:
        """Return which edges of faces have no length, (N, 3), from corner i to corner i + 1."""
        if self.lengths is not None:
            have_none: NDArray[np.bool_] = self.lengths[faces] == 0.0
        else:
            corners = self.vertices[self.faces[faces]]
            have_none = (corners == np.roll(corners, -1, axis=1)).all(axis=2)
        return have_none

    @cached_property
    def nbytes(self) -> int:
        """Memory of all arrays, bytes."""
        return sum(array.nbytes for array in self.arrays().values())

    @property
    def components(self) -> Ints:
        """(V,) int32: the connected component of each vertex."""
        return self.topology.component

    @cached_property
    def component_sizes(self) -> Longs:
        """(C,) int64: the number of vertices of each connected component."""
        return np.bincount(self.components)

    @cached_property
    def inner_face(self) -> Ints:
        """(F,) int32: the topology's number of each face; -1 of one that is not in the surface.

        Such a face repeats a vertex, has an edge of no length, or is blocked.
        """
        inner = np.full(len(self.faces), -1, np.int32)
        outer = self.topology.outer_face
        inner[outer] = np.arange(len(outer), dtype=np.int32)
        return inner

    @cached_property
    def face_areas(self) -> Floats:
        """(F,) float64, mesh units squared: area of each face; 0 of one that is not in the surface.

        By the lengths of its edges where these were given.
        """
        geometry = self.topology.geometry[::3]
        areas = np.zeros(len(self.faces))
        areas[self.topology.outer_face] = (
            0.5 * geometry[:, LENGTH] * geometry[:, LENGTH_LEFT] * geometry[:, SIN_LEFT]
        )
        return areas

    @cached_property
    def is_rough(self) -> bool:
        """Whether it has enough sharp saddles that merging windows saves no time.

        On such a mesh `approximate_distance` returns exact distances.
        """
        excess = self.topology.total_angle - 2.0 * math.pi
        if len(excess) < ROUGH_VERTICES:
            return False
        return bool((excess > SHARP_SADDLE).mean() >= ROUGH)

    @property
    def defining_arrays(self) -> tuple[NDArray[Any], ...]:
        """The arrays that it was made from, but for barriers: what identifies it."""
        given = (self.vertices, self.faces)
        return given if self.lengths is None else (*given, self.lengths)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of what it was made from and of its barriers, hexadecimal."""
        digest = hashlib.sha256()
        for array in (*self.defining_arrays, self.barriers):
            digest.update(np.ascontiguousarray(array).data.cast("B") if array.size else b"-")
        return digest.hexdigest()

    @cached_property
    def has_positions(self) -> bool:
        """Whether its vertices have positions, and are not given by lengths alone."""
        return not np.isnan(self.vertices[0, 0])

    def require_positions(self, name: str) -> None:
        """Refuse what needs positions in space, of this name, where there are none.

        Parameters
        ----------
        name
            What the caller asked for.

        Raises
        ------
        NotEmbedded
            The mesh is given by lengths alone.

        Examples
        --------
        >>> gc.samples.plane(2).require_positions("a picture")
        """
        if not self.has_positions:
            raise NotEmbedded(
                f"{name} needs positions in space, and this mesh has lengths alone: give it "
                "vertices as well"
            )

    def require_embedded(self, name: str) -> None:
        """Refuse what needs vertices whose distances are the lengths of the edges.

        Parameters
        ----------
        name
            What the caller asked for.

        Raises
        ------
        NotEmbedded
            The mesh is given by lengths.

        Examples
        --------
        >>> gc.samples.plane(2).require_embedded("a gradient")
        """
        if self.lengths is not None:
            raise NotEmbedded(
                f"{name} is a vector in space, which a surface given by its lengths does not have: "
                "use angles, as those of a log map"
            )

    @cached_property
    def positions_for_bounds(self) -> Floats:
        """(V, 3): whose straight distances never exceed those on the surface.

        That is `positions`; all 0 where lengths are given, which may be shorter.
        """
        return self.positions if self.lengths is None else _frozen(np.zeros_like(self.positions))

    def position_for_bounds(self, point: SurfacePoint) -> Floats:
        """Return the position of a canonical point to compare with `positions_for_bounds`.

        Parameters
        ----------
        point
            As `point` and `locate` return it.

        Returns
        -------
        numpy.ndarray
            (3,) float64, mesh units.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> mesh.position_for_bounds(mesh.point_on_edge(0, 1, 0.25)).tolist()
        [0.25, 0.0, 0.0]
        """
        return self.position_from_origin(point) if self.lengths is None else np.zeros(3)

    @cached_property
    def extent(self) -> float:
        """Size of the surface, by which lengths on it round, mesh units.

        That is the `diagonal`; where lengths are given, that of a square of the same area, or the
        longest edge where that is longer.
        """
        if self.lengths is None:
            return self.diagonal
        longest = float(self.topology.geometry[:, LENGTH].max())
        return max(math.sqrt(2.0 * float(self.face_areas.sum())), longest)

    @cached_property
    def origin(self) -> Floats:
        """(3,) mesh units: what `positions` are measured from (`build.origin_of`)."""
        if not self.has_positions:
            return np.zeros(3)
        v = self.topology.links[0, TAIL]  # a vertex of the surface: both differences are exact
        origin: Floats = self.vertices[self.topology.outer_vertex[v]] - self.positions[v]
        return origin

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, mesh units."""
        return float(np.linalg.norm([axis.max() - axis.min() for axis in self.vertices.T]))

    @cached_property
    def _surface(self) -> Longs:
        """The faces that are part of the surface."""
        return np.flatnonzero(self.inner_face >= 0)

    @cached_property
    def _nearest_face(self) -> NearestFace:
        return NearestFace(self.vertices - self.origin, self.faces, self._surface)

    @cached_property
    def _height_field(self) -> HeightField:
        return HeightField(self.vertices - self.origin, self.faces, self._surface)

    @overload
    def locate(
        self, position: Sequence[float], max_distance: float | None = None
    ) -> SurfacePoint: ...
    @overload
    def locate(self, position: ArrayLike, max_distance: float | None = None) -> Any: ...
    def locate(self, position: ArrayLike, max_distance: float | None = None) -> Any:
        """Return the point of the surface nearest to a position, or those nearest to several.

        Parameters
        ----------
        position
            (3,) or (N, 3) mesh units.
        max_distance
            Largest distance of the surface, mesh units; None for no limit.

        Returns
        -------
        SurfacePoint or list of SurfacePoint
            Canonical.

        Raises
        ------
        InvalidPoint
            A position is not three finite numbers in the range that vertices may have, or the
            surface is farther away than ``max_distance``.
        InvalidArgument
            The distance is not a number, 0 or more.
        MissingExtra
            libigl is not installed; the extra ``locate`` brings it.

        Notes
        -----
        A point within 1e-12 of the bounding box from a vertex or an edge counts as on it, and the
        surface may be as much beyond ``max_distance``: that is rounding. The first call builds a
        search tree, O(F log F); each position takes O(log F) in practice.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> str(mesh.locate([0.25, 0.5, 1.0]))
        'the point (0.5, 0.25, 0.25) of face 1'
        >>> [point.face_index for point in mesh.locate([[0.25, 0.5, 1.0], [0.5, 0.25, 1.0]])]
        [1, 0]
        """
        self.require_positions("locate")
        places, is_one = as_places("position", position, 3)
        limit = as_limit(max_distance)
        found = [self._located(place, limit, name) for name, place in places]
        return found[0] if is_one else found

    def _located(self, wanted: Floats, limit: float, name: str) -> SurfacePoint:
        face, point, distance = self._nearest_face(wanted - self.origin)
        snap = self._snap_at(point)
        if distance > limit + snap:
            raise InvalidPoint(
                f"the nearest point of the surface is {distance:g} away from the {name}, "
                f"{wanted.tolist()}, which is more than max_distance = {limit:g}"
            )
        corners = self.vertices[self.faces[face]] - self.origin
        return self._point_in_face(face, canonical.weights_of(point, corners, snap), name)

    def _snap_at(self, point: Floats) -> float:
        largest = float(np.abs(point + self.origin).max())
        return max(SNAP * self.diagonal, ROUNDED_COORDINATE * largest)

    @overload
    def locate_xy(self, place: Sequence[float]) -> SurfacePoint: ...
    @overload
    def locate_xy(self, place: ArrayLike) -> Any: ...
    def locate_xy(self, place: ArrayLike) -> Any:
        """Return the point of a height field above or below a place in the plane, or several.

        Parameters
        ----------
        place
            (2,) or (N, 2) mesh units: x and y.

        Returns
        -------
        SurfacePoint or list of SurfacePoint
            Canonical.

        Raises
        ------
        InvalidArgument
            The surface is not a height over the plane: a face is upright or turned over, or it has
            several heights at a place.
        NoHeight
            The surface is not there.
        InvalidPoint
            A place is not two finite numbers.
        MissingExtra
            libigl is not installed; the extra ``locate`` brings it.

        Notes
        -----
        As `locate`.

        Examples
        --------
        >>> slope = gc.TriangleMesh([[0, 0, 0], [4, 0, 4], [0, 4, 0]], [[0, 1, 2]])
        >>> slope.position(slope.locate_xy([1.0, 2.0])).tolist()
        [1.0, 2.0, 1.0]
        """
        self.require_positions("locate_xy")
        places, is_one = as_places("place", place, 2)
        found = [self._located_above(each, name) for name, each in places]
        return found[0] if is_one else found

    def _located_above(self, wanted: Floats, name: str) -> SurfacePoint:
        away = wanted - self.origin[:2]
        snap = self._snap_at(np.append(away, 0.0))
        found = self._height_field(away, snap)
        if found is None:
            raise NoHeight(f"the surface is not above or below the {name}, {wanted.tolist()}")
        face, point = found
        corners = (self.vertices[self.faces[face]] - self.origin) * [1.0, 1.0, 0.0]
        return self._point_in_face(face, canonical.weights_of(point, corners, snap), name)

    def point(self, point: Point, name: str = "point") -> SurfacePoint:
        """Return a point in its canonical form, the same to the bit for all spellings of it.

        Parameters
        ----------
        point
            A vertex index or a `SurfacePoint`.
        name
            Name of the point in messages.

        Returns
        -------
        SurfacePoint
            Canonical.

        Raises
        ------
        InvalidPoint
            It is not a point of this mesh.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> mesh.point(gc.SurfacePoint.edge(1, 0, 1.0)) == mesh.point(3)  # the end of an edge
        True
        """
        index: Any = unboxed(point)
        if isinstance(point, SurfacePoint):
            if point.vertex_index is None:
                canonical.check_index(point.face_index, len(self.faces), "face", name)
                canonical.check_weights(point.barycentric, point.face_index, name)
                return self._point_in_face(point.face_index, point.barycentric, name)
            index = point.vertex_index
        canonical.check_index(index, len(self.vertices), "vertex", name)
        return canonical.at_vertex(self.topology, self.faces, int(index))

    def _point_in_face(self, face: int, weights: Sequence[float], name: str) -> SurfacePoint:
        if self.inner_face[face] < 0 and not of_three_vertices(self.faces[[face]])[0]:
            raise InvalidPoint(
                f"the {name} is in face {face}, which repeats a vertex and is not part of the "
                "surface"
            )
        point = canonical.in_face(self.topology, self.faces, self.inner_face, face, weights)
        if point is None and face in self.barriers:
            raise InvalidPoint(
                f"the {name} lies in face {face}, which is blocked, and in no free face"
            )
        if point is None:
            raise InvalidPoint(
                f"the {name} is in face {face}, which has an edge of zero length and is not part "
                "of the surface: its other two edges coincide and belong to no other face"
            )
        return point

    def point_on_edge(self, start: int, end: int, t: float) -> SurfacePoint:
        """Return the canonical point at share ``t`` of the way between the ends of an edge.

        Parameters
        ----------
        start, end
            Vertex indices; an edge of the surface joins them.
        t
            Share of the way from the first to the second, 0 to 1.

        Returns
        -------
        SurfacePoint
            Canonical.

        Raises
        ------
        InvalidPoint
            One of the two is not a vertex, no edge of the surface joins them, or ``t`` is not from
            0 to 1.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> mesh.point_on_edge(0, 1, 0.25) == mesh.point_on_edge(1, 0, 0.75)
        True
        """
        for vertex in (start, end):
            canonical.check_index(vertex, len(self.vertices), "vertex", "end of the edge")
        if not is_number(t) or not -WEIGHT_ERROR <= t <= 1.0 + WEIGHT_ERROR:
            raise InvalidPoint(f"t is {t!r}; it must be a number from 0 to 1")
        share = min(max(float(t), 0.0), 1.0)
        point = canonical.on_edge(self.topology, self.faces, start, end, share)
        if point is None:
            kind = "edge of a free face" if len(self.barriers) else "edge"
            raise InvalidPoint(f"no {kind} joins the vertices {start} and {end}")
        return point

    def position(self, point: Point) -> Floats:
        """Return the position of a point; of a vertex exactly the mesh's own.

        Parameters
        ----------
        point
            A vertex index or a `SurfacePoint`.

        Returns
        -------
        numpy.ndarray
            (3,) float64, mesh units.

        Raises
        ------
        InvalidPoint
            It is not a point of this mesh.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles

        >>> mesh.position(mesh.point_on_edge(0, 1, 0.25)).tolist()
        [0.25, 0.0, 0.0]
        """
        self.require_positions("position")
        if isinstance(point, SurfacePoint) and point.vertex_index is None:
            point = self.point(point)
            if point.vertex_index is None:
                return self.origin + self.position_from_origin(point)
        vertex = point.vertex_index if isinstance(point, SurfacePoint) else unboxed(point)
        canonical.check_index(vertex, len(self.vertices), "vertex", "point")
        position: Floats = self.vertices[vertex]
        return position

    def position_from_origin(self, point: SurfacePoint) -> Floats:
        """Return the position of a canonical point less `origin`.

        Parameters
        ----------
        point
            As `point` and `locate` return it.

        Returns
        -------
        numpy.ndarray
            (3,) float64, mesh units.

        Examples
        --------
        >>> corners = [[5e6, 0.0, 0.0], [5e6 + 1.0, 0.0, 0.0], [5e6, 1.0, 0.0]]
        >>> mesh = gc.TriangleMesh(corners, [[0, 1, 2]])

        >>> mesh.position_from_origin(mesh.point_on_edge(0, 1, 0.25)).tolist()
        [0.25, 0.0, 0.0]
        """
        position: Floats
        if point.vertex_index is not None:
            position = self.vertices[point.vertex_index] - self.origin
            return position
        # Not a matrix product, whose last bit depends on where its arrays lie in memory.
        weights = np.array(point.barycentric)[:, None]
        corners = self.vertices[self.faces[point.face_index]] - self.origin
        position = (weights * corners).sum(axis=0)
        return position

    @cached_property
    def edge_count(self) -> int:
        """Number of edges."""
        return int(build.count_edges(self.topology.links))

    @cached_property
    def report(self) -> MeshReport:
        """Counts and defects; O(V log V + F log F), computed once."""
        return report_of(
            self.vertices,
            self.faces,
            self.face_map,
            self.embedding,
            lengths=self.lengths,
        )

    def boundaries(self) -> list[SurfaceCurve]:
        """Return the boundary of the surface as curves, longest first.

        They run along boundary edges with the surface on their left, as its faces are wound. They
        are closed, but for those that end at an edge of three faces or more. Where fans of faces
        meet at a vertex, several pass it. Blocked faces are no part of the surface: their rim is a
        boundary.

        Returns
        -------
        list of SurfaceCurve
            None for a surface without boundary.

        Notes
        -----
        O(F).

        Examples
        --------
        >>> (rim,) = gc.samples.plane(2).boundaries()
        >>> rim.closed, rim.length, rim.points[:, :2].tolist()
        (True, 4.0, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        """
        return boundaries_of(self)

    def curve(self, points: Sequence[Point], closed: bool = False) -> SurfaceCurve:
        """Return the curve through some points of the surface.

        Parameters
        ----------
        points
            One or more vertex indices or `SurfacePoint`, each in one face with the next.
        closed
            Whether it leads from the last point back to the first, which shares a face with it.

        Returns
        -------
        SurfaceCurve
            Straight from each point to the next. Points that repeat are left out.

        Raises
        ------
        InvalidArgument
            There are no points.
        InvalidPoint
            One is not a point of this mesh, or shares no free face with the next.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
        >>> mesh.curve([0, 1, 3], closed=True).length == 2.0 + 2.0**0.5
        True
        """
        return curve_on(self, points, closed=closed)

    def tangent_frames(self) -> TangentFrames:
        """Return a tangent plane at each vertex, in which angles on the surface become vectors.

        Returns
        -------
        TangentFrames
            Computed once, O(V + F).

        Examples
        --------
        >>> gc.samples.plane(2).tangent_frames().normals.tolist()[0]
        [0.0, 0.0, 1.0]
        """
        self.require_positions("a tangent frame")
        return self._tangent_frames

    @cached_property
    def _tangent_frames(self) -> TangentFrames:
        return tangent_frames_of(self.vertices, self.faces, self.inner_face, self.topology)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on the defects of this mesh and their remedies, for its user."""
        return (*self._notes, *warnings_of(self.report))

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy needs: all but the search tree of `locate`, which is built again."""
        return {name: value for name, value in self.__dict__.items() if name != "_nearest_face"}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Become a copy; pickle and `copy` forget that arrays are read-only."""
        for name, value in state.items():
            self.__dict__[name] = _frozen(value) if isinstance(value, np.ndarray) else value
        self.__dict__["embedding"] = _frozen_embedding(self.embedding)

    def to_trimesh(self) -> Any:
        """Return the mesh as one of trimesh, with the same numbers of vertices and faces.

        Returns
        -------
        trimesh.Trimesh
            With copies of the arrays.

        Examples
        --------
        >>> gc.samples.sphere(80).to_trimesh().is_watertight
        True
        """
        import trimesh

        self.require_positions("a mesh of trimesh")
        return trimesh.Trimesh(self.vertices.copy(), self.faces.copy(), process=False)

    def to_pyvista(self) -> Any:
        """Return the mesh as one of PyVista, with the same numbers of vertices and faces.

        Returns
        -------
        pyvista.PolyData
            With copies of the arrays.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.

        Examples
        --------
        >>> gc.samples.sphere(80).to_pyvista().n_points
        42
        """
        self.require_positions("a picture")
        return plotting.surface_of(self.vertices, self.faces, "TriangleMesh.to_pyvista")

    def plot(
        self,
        paths: Iterable[SurfaceCurve] = (),
        points: Iterable[Point] = (),
        *,
        camera: Camera | None = None,
        title: str | None = None,
        save: str | Path | None = None,
    ) -> None:
        """Draw the surface: in a window, in a notebook, or into a file.

        Parameters
        ----------
        paths, points
            Curves of any kind, and points, to draw on it.
        camera
            ``"iso"``, or the axis from which one looks: ``"+z"``, ``"-x"``…; by default ``"iso"``,
            and the flat side of what is flat.
        title
            A line above the picture.
        save
            A file to draw into, without a window: ``.png``, ``.jpg``, ``.tif`` or ``.bmp``.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.
        InvalidArgument
            The suffix is not that of a picture, the file cannot be written, or there is no such
            camera.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "mesh.png"
        >>> mesh = gc.samples.plane(50)
        >>> mesh.plot(mesh.boundaries(), [0], save=file)
        >>> file.exists()
        True
        """
        with plotting.picture(save, camera, title, "TriangleMesh.plot") as plotter:
            plotting.draw_surface(plotter, self.to_pyvista())
            draw_over(self, plotter, paths, points)

    def __repr__(self) -> str:
        blocked = f", {len(self.barriers)} of them blocked" if len(self.barriers) else ""
        return f"TriangleMesh({len(self.vertices)} vertices, {len(self.faces)} faces{blocked})"

    def _repr_html_(self) -> str:
        sides = " × ".join(f"{side:.6g}" for side in np.ptp(self.vertices, axis=0))
        facts = {"vertices": len(self.vertices), "faces": len(self.faces), "size": sides}
        if len(self.barriers):
            facts["blocked faces"] = len(self.barriers)
        return as_table("TriangleMesh", facts | {"memory": f"{self.nbytes / 1e6:.1f} MB"})


_ARRAYS = {"vertices", "faces", "vertex_map", "face_map", "positions", "lengths"} | {
    *Topology._fields
}
"""Names of the arrays of a mesh"""


def _merging_distance(merge: Merge) -> float:
    """Return the distance within which vertices are merged.

    Raises
    ------
    InvalidArgument
        It is no way of merging.
    """
    distance = 0.0 if isinstance(merge, str) and merge == "exact" else unboxed(merge)
    if not is_number(distance) or not 0.0 <= distance < math.inf:
        raise InvalidArgument(
            f"merge is {merge!r}; it must be 'none', 'exact' or a distance, 0 or more"
        )
    return float(distance)


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return the array read-only: the kernels are compiled for that type alone."""
    frozen = np.ascontiguousarray(array).view(np.ndarray)
    frozen.flags.writeable = False
    return frozen


def _frozen_embedding(embedding: Embedding) -> Embedding:
    topology = Topology(*(_frozen(array) for array in embedding.topology))
    return Embedding(topology, _frozen(embedding.positions))


def _prepared(vertices: Floats, faces: Ints, free: Longs, lengths: Floats | None) -> Embedding:
    """Return the surface of the faces that are not blocked; ``vertices`` less the origin."""
    if lengths is not None:
        surface = _surface_of(faces, free)
        embedding = build.empty_embedding(len(vertices), len(surface))
        build.build_by_lengths(vertices, faces[surface], lengths[surface], embedding)
        embedding.topology.outer_face[:] = surface[embedding.topology.outer_face]
        return embedding
    embedding, outcome, bad = _built(vertices, faces, free)
    if outcome == Outcome.TOO_SHORT:
        joined = lowest_joined(len(vertices), edges_of_no_length(vertices, faces[free]))
        embedding, outcome, bad = _built(vertices, joined[faces].astype(np.int32), free)
        topology = embedding.topology
        topology.inner_vertex[:] = topology.inner_vertex[joined]
        # Renumbered without the components of vertices that joined others.
        topology.component[:] = np.unique(topology.component[joined], return_inverse=True)[1]
    if outcome == Outcome.TOO_SHORT:
        face = int(embedding.topology.outer_face[bad])
        raise InvalidMesh(
            f"face {face} is {faces[face].tolist()} and has an edge shorter than "
            f"{SHORTEST_EDGE:g}: scale the mesh, or merge the edge's vertices",
            kind="face",
            elements=[face],
        )
    return embedding


def _surface_of(faces: Ints, free: Longs) -> Longs:
    """Return the free faces that have three different vertices."""
    surface = free[of_three_vertices(faces.take(free, axis=0))]  # take: four times as fast as []
    if len(surface) == 0:
        raise InvalidMesh(
            "each face repeats a vertex or has an edge of zero length: there is no surface",
            kind="face",
            elements=free[:NAMED].tolist(),
        )
    return surface


def _built(vertices: Floats, faces: Ints, free: Longs) -> tuple[Embedding, int, int]:
    """Return the surface of those faces that have three different vertices, and the outcome."""
    surface = _surface_of(faces, free)
    embedding = build.empty_embedding(len(vertices), len(surface))
    outcome, bad = build.build_topology(vertices, faces.take(surface, axis=0), embedding)
    outer_face = embedding.topology.outer_face
    outer_face[:] = surface[outer_face]
    return embedding, outcome, bad

"""The triangle mesh: validated, frozen, with its topology."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core import canonical
from geodesic_core.arguments import as_limit, is_number
from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InvalidArgument, InvalidMesh, InvalidPoint
from geodesic_core.kernels import topology as kernels
from geodesic_core.kernels.topology import Topology
from geodesic_core.nearest_face import NearestFace
from geodesic_core.surface_point import SurfacePoint
from geodesic_core.tolerances import SNAP, WEIGHT_ERROR

Merge = Literal["none", "exact"]

_SAMPLE = 10
"""Ids named in a message or a report, at most."""


@dataclass(frozen=True, slots=True)
class Sample:
    """How many elements of a kind there are, and the ids of the first ten."""

    count: int
    ids: tuple[int, ...]

    @classmethod
    def of(cls, ids: NDArray[Any]) -> "Sample":
        """Return the sample of an array of ids."""
        return cls(len(ids), tuple(ids[:_SAMPLE].tolist()))


@dataclass(frozen=True, slots=True)
class MeshReport:
    """What was found in a mesh: the counts a user checks before trusting an answer."""

    vertices: int
    faces: int
    edges: int
    components: int
    """Connected components with at least one face."""
    boundary_loops: int
    euler_characteristic: int
    """V - E + F, isolated vertices not counted."""
    saddle_vertices: int
    boundary_vertices: int
    bow_tie_vertices: Sample
    """Vertices where several fans of faces meet."""
    isolated_vertices: Sample
    """Vertices of no face."""
    degenerate_faces: Sample
    """Faces of zero area."""
    non_manifold_edges: Sample
    inconsistent_orientation: bool
    bounds: tuple[tuple[float, ...], tuple[float, ...]]
    """Lowest and highest corner of the bounding box, mesh units."""
    mean_edge_length: float
    """Mesh units."""

    def as_dict(self) -> dict[str, Any]:
        """Return the report as what JSON can hold."""
        return asdict(self)


class TriangleMesh:
    """A triangle mesh, checked and prepared for geodesics.

    Parameters
    ----------
    vertices
        (V, 3) positions, mesh units; finite.
    faces
        (F, 3) vertex indices, integers; counter-clockwise seen from outside.
    merge
        ``"exact"`` merges vertices at equal positions, in order of first appearance;
        `vertex_map` then leads from given to merged vertices. ``"none"`` keeps them apart.

    Raises
    ------
    InvalidMesh
        Naming the elements at fault: wrong shape or type, NaN or infinity, an index out of range, a
        face that repeats a vertex or has an edge of no length, an edge of three faces or more,
        neighbours of inconsistent orientation.

    Notes
    -----
    The arrays are copied once, and read-only. Vertices and faces keep the caller's order: the
    topology's own, nearer in memory, shows nowhere. Preparing costs O(V + F) time, and memory of
    about 365 bytes a face.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, merge: Merge = "none") -> None:
        points, triangles = _as_vertices(vertices), _as_faces(faces)
        _refuse_bad_elements(points, triangles)
        vertex_map: Longs | None = None
        if merge == "exact":
            points, vertex_map = _merge_equal(points)
            triangles = vertex_map[triangles]
            _refuse_bad_elements(points, triangles)
        elif merge != "none":
            raise InvalidArgument(f"merge is {merge!r}; it must be 'none' or 'exact'")
        self._hold(points, triangles.astype(np.int32), vertex_map, _prepare(points, triangles))

    def _hold(
        self, vertices: Floats, faces: Ints, vertex_map: Longs | None, topology: Topology
    ) -> None:
        self.vertices = _frozen(vertices)
        """(V, 3) float64, read-only; mesh units."""
        self.faces = _frozen(faces)
        """(F, 3) int32, read-only."""
        self.vertex_map = None if vertex_map is None else _frozen(vertex_map)
        """(given vertices,) int64: the vertex that each given one became; None where none moved."""
        self.topology = Topology(*(_frozen(array) for array in topology))
        """Half-edges and flat geometry, see `geodesic_core.kernels.topology`."""

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "TriangleMesh":
        """Return the mesh whose `arrays` these are; trusted, not checked; may be memory-mapped."""
        mesh = cls.__new__(cls)
        mesh._hold(
            arrays["vertices"],
            arrays["faces"],
            arrays.get("vertex_map"),
            Topology(**{name: arrays[name] for name in Topology._fields}),
        )
        return mesh

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, the prepared topology included: what a store keeps."""
        arrays: dict[str, NDArray[Any]] = {"vertices": self.vertices, "faces": self.faces}
        if self.vertex_map is not None:
            arrays["vertex_map"] = self.vertex_map
        return arrays | self.topology._asdict()

    @property
    def nbytes(self) -> int:
        """Memory of all arrays, bytes."""
        return sum(array.nbytes for array in self.arrays().values())

    @property
    def components(self) -> Ints:
        """(V,) int32: the connected component of each vertex."""
        return self.topology.component

    @cached_property
    def inner_face(self) -> Ints:
        """(F,) int32: the topology's number of each face."""
        inner = np.empty(len(self.faces), np.int32)
        inner[self.topology.outer_face] = np.arange(len(inner), dtype=np.int32)
        return inner

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, mesh units."""
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))

    @cached_property
    def _nearest_face(self) -> NearestFace:
        return NearestFace(self.vertices, self.faces)

    def locate(self, position: ArrayLike, max_distance: float | None = None) -> SurfacePoint:
        """Return the point of the surface nearest to a position.

        Parameters
        ----------
        position
            (3,) mesh units.
        max_distance
            How far the surface may be, mesh units.

        Raises
        ------
        InvalidPoint
            The position is not three numbers of a size that vertices may have, or the surface is
            farther away.
        InvalidArgument
            The distance is not a number, 0 or more.

        Notes
        -----
        What lies within 1e-12 of the bounding box from a vertex or an edge counts as on it. The
        first call builds a search tree, O(F log F).
        """
        try:
            place = np.asarray(position, dtype=np.float64)
        except (TypeError, ValueError):
            place = np.empty(0)
        largest = kernels.LARGEST_COORDINATE
        if place.shape != (3,) or not (np.abs(place) <= largest).all():
            raise InvalidPoint(
                f"the position is {position!r}; it must be three finite numbers, at most "
                f"{largest:g} in size"
            )
        limit = as_limit(max_distance)
        face, point, distance = self._nearest_face(place)
        if distance > limit:
            raise InvalidPoint(
                f"the nearest point of the surface is {distance:g} away from {place.tolist()}, "
                f"which is more than max_distance = {limit:g}"
            )
        weights = canonical.weights_of(point, self.vertices[self.faces[face]], SNAP * self.diagonal)
        return self._point_in_face(face, weights)

    def point(self, point: int | SurfacePoint, name: str = "point") -> SurfacePoint:
        """Return a point in its one spelling: all that name the same come out equal, to the bit.

        Raises
        ------
        InvalidPoint
            It is not a point of this mesh; ``name`` is how the message calls it.
        """
        index: Any = point
        if isinstance(point, SurfacePoint):
            if point.vertex_index is None:
                canonical.check_index(point.face_index, len(self.faces), "face", name)
                canonical.check_weights(point.barycentric, point.face_index, name)
                return self._point_in_face(point.face_index, point.barycentric)
            index = point.vertex_index
        canonical.check_index(index, len(self.vertices), "vertex", name)
        return canonical.at_vertex(self.topology, self.faces, int(index))

    def _point_in_face(self, face: int, weights: Sequence[float]) -> SurfacePoint:
        return canonical.in_face(self.topology, self.faces, self.inner_face, face, weights)

    def point_on_edge(self, start: int, end: int, t: float) -> SurfacePoint:
        """Return the canonical point at share ``t`` of the way between the ends of an edge.

        Raises
        ------
        InvalidPoint
            The two are no vertices, no edge joins them, or ``t`` is not from 0 to 1.
        """
        for vertex in (start, end):
            canonical.check_index(vertex, len(self.vertices), "vertex", "end of the edge")
        if not is_number(t) or not -WEIGHT_ERROR <= t <= 1.0 + WEIGHT_ERROR:
            raise InvalidPoint(f"t is {t!r}; it must be a number from 0 to 1")
        point = canonical.on_edge(self.topology, start, end, float(t))
        if point is None:
            raise InvalidPoint(f"no edge joins the vertices {start} and {end}")
        return self.point(point)

    def position(self, point: int | SurfacePoint) -> Floats:
        """Return the (3,) position of a point, mesh units; of a vertex exactly the mesh's own.

        Raises
        ------
        InvalidPoint
            It is not a point of this mesh.
        """
        place = self.point(point)
        position: Floats
        if place.vertex_index is not None:
            position = self.vertices[place.vertex_index]
        else:
            position = np.array(place.barycentric) @ self.vertices[self.faces[place.face_index]]
        return position

    @cached_property
    def edge_count(self) -> int:
        """Number of edges."""
        return int(kernels.count_edges(self.topology.links))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of this mesh, a sentence each, with the remedy."""
        report = self.report
        found = []
        if report.components > 1:
            found.append(
                f"The mesh has {report.components} connected components: vertices of other "
                f"components than the source's are unreachable."
            )
            if self.vertex_map is None and len(_merge_equal(self.vertices)[0]) < report.vertices:
                found.append(
                    "Some vertices lie at equal positions but are kept apart, which may be what "
                    "disconnects the mesh; merge='exact' joins them."
                )
        if report.isolated_vertices.count:
            found.append(
                f"{report.isolated_vertices.count} vertices belong to no face and are unreachable; "
                f"the first is vertex {report.isolated_vertices.ids[0]}."
            )
        if report.degenerate_faces.count:
            found.append(
                f"{report.degenerate_faces.count} faces have no area; the first is face "
                f"{report.degenerate_faces.ids[0]}."
            )
        if report.bow_tie_vertices.count:
            found.append(
                f"At {report.bow_tie_vertices.count} vertices several fans of faces meet; the "
                f"first is vertex {report.bow_tie_vertices.ids[0]}. Paths may pass through them."
            )
        return tuple(found)

    @cached_property
    def report(self) -> MeshReport:
        """Counts and defects; O(V + F), computed once."""
        topology = self.topology
        inner = topology.inner_vertex
        used = (np.diff(topology.first_corner) > 0)[inner]
        flags = topology.flags[inner]
        edges = self.edge_count
        lengths = topology.geometry[:, kernels.LENGTH]
        shared = topology.links[:, kernels.OPPOSITE] >= 0
        flat = topology.geometry[::3, kernels.SIN_LEFT] == 0.0
        return MeshReport(
            vertices=len(self.vertices),
            faces=len(self.faces),
            edges=edges,
            components=len(np.unique(topology.component[used])),
            boundary_loops=int(kernels.count_boundary_loops(topology.links)),
            euler_characteristic=int(np.count_nonzero(used)) - edges + len(self.faces),
            saddle_vertices=int(np.count_nonzero(flags & kernels.SADDLE)),
            boundary_vertices=int(np.count_nonzero(flags & kernels.BOUNDARY)),
            bow_tie_vertices=Sample.of(np.flatnonzero(flags & kernels.FANS)),
            isolated_vertices=Sample.of(np.flatnonzero(~used)),
            degenerate_faces=Sample.of(np.sort(topology.outer_face[flat])),
            non_manifold_edges=Sample(0, ()),  # refused, until the sweep can cross them
            inconsistent_orientation=False,  # likewise
            bounds=(
                tuple(self.vertices.min(axis=0).tolist()),
                tuple(self.vertices.max(axis=0).tolist()),
            ),
            mean_edge_length=float((lengths.sum() - 0.5 * lengths[shared].sum()) / edges),
        )

    def __repr__(self) -> str:
        return f"TriangleMesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return the array read-only: the kernels are compiled for that type alone."""
    frozen = np.ascontiguousarray(array).view(np.ndarray)
    frozen.flags.writeable = False
    return frozen


def _as_vertices(vertices: ArrayLike) -> Floats:
    try:
        given = np.asarray(vertices)
        array = np.array(given, dtype=np.float64, order="C") if given.dtype.kind in "fiuO" else None
    except (TypeError, ValueError) as error:
        raise InvalidMesh(f"vertices are not real numbers: {error}", kind="vertex") from error
    if array is None:  # text and complex numbers: numpy would convert them
        raise InvalidMesh(
            f"vertices have type {given.dtype}; they must be real numbers", kind="vertex"
        )
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidMesh(f"vertices have shape {array.shape}; it must be (V, 3)", kind="vertex")
    return array


def _as_faces(faces: ArrayLike) -> Longs:
    try:
        array = np.asarray(faces)
    except ValueError as error:
        raise InvalidMesh(f"faces are not triangles: {error}", kind="face") from error
    if array.size == 0:
        raise InvalidMesh("the mesh has no faces", kind="face")
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidMesh(
            f"faces have shape {array.shape}; it must be (F, 3): triangulate polygons first",
            kind="face",
        )
    if array.dtype.kind not in "iu":
        raise InvalidMesh(
            f"faces have type {array.dtype}; vertex indices must be integers", kind="face"
        )
    return np.array(array, dtype=np.int64, order="C")


def _refuse_bad_elements(vertices: Floats, faces: Longs) -> None:
    outcome, _ = kernels.check_arrays(vertices, faces)
    if outcome == kernels.SOUND:
        return
    if outcome in (kernels.NOT_FINITE, kernels.TOO_LARGE):
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero(~(np.abs(vertices) <= kernels.LARGEST_COORDINATE).all(axis=1))
        first = vertices[bad[0]].tolist()
        raise InvalidMesh(
            f"vertex {bad[0]} is at {first}: coordinates must be finite and at most "
            f"{kernels.LARGEST_COORDINATE:g} in size{_and_more(bad)}",
            kind="vertex",
            elements=bad[:_SAMPLE].tolist(),
        )
    if outcome == kernels.OUT_OF_RANGE:
        bad = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
        raise InvalidMesh(
            f"face {bad[0]} is {faces[bad[0]].tolist()}, but vertices are numbered 0 to "
            f"{len(vertices) - 1}{_and_more(bad)}",
            kind="face",
            elements=bad[:_SAMPLE].tolist(),
        )
    a, b, c = faces.T
    bad = np.flatnonzero((a == b) | (b == c) | (c == a))
    raise InvalidMesh(
        f"face {bad[0]} is {faces[bad[0]].tolist()} and repeats a vertex: remove it"
        f"{_and_more(bad)}",
        kind="face",
        elements=bad[:_SAMPLE].tolist(),
    )


def _prepare(vertices: Floats, faces: Longs) -> Topology:
    topology = kernels.empty_topology(len(vertices), len(faces))
    triangles = faces.astype(np.int32)
    outcome, bad = kernels.build_topology(vertices, triangles, topology)
    if outcome == kernels.TOO_SHORT:
        face = int(topology.outer_face[bad])
        raise InvalidMesh(
            f"face {face} is {faces[face].tolist()} and has an edge of length zero (or below "
            f"{kernels.SHORTEST_EDGE:g}): two of its vertices lie at one position; remove the face",
            kind="face",
            elements=[face],
        )
    return topology


def _and_more(bad: Sequence[Any] | NDArray[Any]) -> str:
    return f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""


def _merge_equal(vertices: Floats) -> tuple[Floats, Longs]:
    """Return the distinct positions in order of first appearance, and where each vertex went."""
    points = vertices + 0.0  # -0.0 equals 0.0
    order = np.lexsort(points.T)
    new = np.ones(len(points), bool)
    new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    group = np.cumsum(new) - 1
    # lexsort is stable: the first of a group is the lowest vertex.
    first = order[new]
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    vertex_map = np.empty(len(points), np.int64)
    vertex_map[order] = rank[group]
    return vertices[np.sort(first)], vertex_map

"""Errors: every refusal and every early stop of the library.

They form a tree::

    GeodesicError
    ├── InvalidMesh             the vertices, the faces or the file cannot be used
    │   ├── UnknownFileType     neither name nor content tell how to read a file
    │   ├── TooManyFaces        more than the caller allows
    │   ├── TooManyVertices     more than the caller allows
    │   └── FileTooLarge        more bytes than the caller allows
    ├── InvalidPoint            a source or target that is not on the mesh
    │   ├── NoHeight            a place on the map where the surface is not
    │   └── NoTangentPlane      a point of the mesh where directions have no meaning
    ├── InvalidArgument         any other argument out of its domain
    │   ├── NoDirection         a vector that has no direction on the surface
    │   ├── NoLoop              loops asked for where every one shrinks to a point
    │   ├── OtherSurface        values by vertex, or by face, that are those of another surface
    │   ├── NoSuchLabel         a label or a region that no vertex of a surface has
    │   ├── InvalidPolygon      a polygon that crosses itself, or lies off the surface
    │   ├── UnsuitableCrs       a coordinate reference system that is not known, or of no use
    │   └── NotEmbedded         what needs space, asked of a mesh given by the lengths of its edges
    ├── NoPath                  not connected, or farther than a limit (``reason``)
    ├── Cancelled               the caller asked the sweep to stop
    ├── DeadlineExceeded        the time the caller granted is over
    ├── MemoryLimitExceeded     the memory the caller granted does not suffice
    ├── MissingExtra            a package is not installed that few calls need; an ImportError too
    └── InternalError           a broken invariant: a defect of this library, please report it

What is valid, but hardly meant, is a warning of Python's, see `warnings`::

    GeodesicWarning
    ├── EmptyBarrier            a label that blocks no face
    ├── EmptyParcel             a parcel that has no vertex in the region
    ├── NotWgs84                GeoJSON in other coordinates than RFC 7946 has
    └── BlockedSource           a source that no path leaves, since all of its faces are blocked
"""

from collections.abc import Mapping, Sequence
from typing import Any


class GeodesicError(Exception):
    """Base of all exceptions of this library.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> try:
    ...     gc.exact_distance(mesh, 7)
    ... except gc.GeodesicError as error:
    ...     print(error)
    the source 0 is vertex 7, but vertices are numbered 0 to 3
    """

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle what the error holds, since constructors differ."""
        return _rebuilt, (type(self), self.args, self.__dict__)


def _rebuilt(
    kind: type[GeodesicError], args: tuple[Any, ...], attributes: Mapping[str, Any]
) -> GeodesicError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(attributes)
    return error


class InvalidMesh(GeodesicError):  # noqa: N818 - the contract's names read as the refusal itself
    """A mesh that cannot be used.

    Parameters
    ----------
    message
        The element at fault, and the remedy.
    kind
        Kind of the ids: ``"vertex"``, ``"face"``, ``"edge"`` (pairs of vertices) or ``"file"``.
    elements
        Ids of (at most ten of) the elements at fault.

    Examples
    --------
    >>> gc.TriangleMesh([[0.0, 0.0, 0.0]], [[0, 1, 2]])
    Traceback (most recent call last):
        ...
    geodesic_core.errors.InvalidMesh: face 0 is [0, 1, 2], but vertices are numbered 0 to 0
    """

    def __init__(
        self, message: str, *, kind: str = "file", elements: Sequence[int | tuple[int, int]] = ()
    ) -> None:
        super().__init__(message)
        self.kind = kind
        self.elements = tuple(elements)


class TooManyFaces(InvalidMesh):
    r"""A file with more than ``max_faces`` faces, by its header or by count.

    Parameters
    ----------
    faces
        Number of faces.
    max_faces
        Number allowed.

    Examples
    --------
    >>> text = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    >>> gc.load_mesh(text, "off", max_faces=0)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.TooManyFaces: 1 faces; at most 0 are allowed
    """

    def __init__(self, faces: int, max_faces: int) -> None:
        super().__init__(f"{faces} faces; at most {max_faces} are allowed", kind="face")
        self.faces = faces
        self.max_faces = max_faces


class TooManyVertices(InvalidMesh):
    r"""A file with more than ``max_vertices`` vertices, those without a face included.

    Parameters
    ----------
    vertices
        Number of vertices.
    max_vertices
        Number allowed.

    Examples
    --------
    >>> text = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    >>> gc.load_mesh(text, "off", max_vertices=2)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.TooManyVertices: 3 vertices; at most 2 are allowed
    """

    def __init__(self, vertices: int, max_vertices: int) -> None:
        super().__init__(f"{vertices} vertices; at most {max_vertices} are allowed", kind="vertex")
        self.vertices = vertices
        self.max_vertices = max_vertices


class UnknownFileType(InvalidMesh):
    """A file of which neither its name nor its content tells the type.

    Examples
    --------
    >>> try:
    ...     gc.load_mesh(b"0 0 0", "xyz")
    ... except gc.errors.UnknownFileType as error:
    ...     print(str(error).split(";")[0])
    unknown mesh file type 'xyz'
    """


class FileTooLarge(InvalidMesh):
    """A packed file that has more than ``max_bytes`` once unpacked.

    Parameters
    ----------
    max_bytes
        Number allowed.

    Examples
    --------
    >>> import gzip
    >>> gc.load_mesh(gzip.compress(b"OFF " + bytes(1000)), "off", max_bytes=100)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.FileTooLarge: the file has more than 100 bytes when unpacked
    """

    def __init__(self, max_bytes: int) -> None:
        super().__init__(f"the file has more than {max_bytes} bytes when unpacked")
        self.max_bytes = max_bytes


class InvalidPoint(GeodesicError):  # noqa: N818
    """A source or a target that is not a point of the mesh.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> mesh.point(-1)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.InvalidPoint: the point is vertex -1, but vertices are numbered 0 to 3
    """


class InvalidArgument(GeodesicError):  # noqa: N818
    """An argument outside its domain.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, 0, max_distance=-1.0)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.InvalidArgument: max_distance is -1.0; it must be a number, 0 or more
    """


class NoHeight(InvalidPoint):
    """A place on the map where the surface is not: outside of it, or in a gap.

    Examples
    --------
    >>> try:
    ...     gc.samples.plane(2).locate_xy([2.0, 0.0])
    ... except gc.errors.NoHeight as error:
    ...     print(error)
    the surface is not above or below the place, [2.0, 0.0]
    """


class NoTangentPlane(InvalidPoint):
    """A point where directions have no meaning: several fans of faces meet, or more than two faces.

    Parameters
    ----------
    message
        The sentence for its reader.
    index
        Its number, where lines start at several points.

    Examples
    --------
    >>> mesh = gc.TriangleMesh(np.vstack([np.eye(3), -np.eye(3)]), [[0, 1, 2], [0, 4, 5]])
    >>> try:
    ...     gc.trace(mesh, [1, 0], 0.0, 1.0)
    ... except gc.errors.NoTangentPlane as error:
    ...     print(error.index)
    1
    """

    def __init__(self, message: str, index: int = 0) -> None:
        super().__init__(message)
        self.index = index


class NoDirection(InvalidArgument):
    """A vector that has no direction on the surface: it is zero, or along the normal.

    Parameters
    ----------
    message
        The sentence for its reader.
    index
        Its number, where several are given.

    Examples
    --------
    >>> try:
    ...     gc.trace(gc.samples.plane(2), 0, [0.0, 0.0, 1.0], 1.0)
    ... except gc.errors.NoDirection as error:
    ...     print(error.index)
    0
    """

    def __init__(self, message: str, index: int = 0) -> None:
        super().__init__(message)
        self.index = index


class NoLoop(InvalidArgument):
    """A closed curve that shrinks to a point, or a surface on which every one does.

    Examples
    --------
    >>> sphere = gc.samples.sphere(320)
    >>> try:
    ...     gc.shortest_loop(sphere, 0)
    ... except gc.errors.NoLoop as error:
    ...     print(error)
    every loop on this part of the surface shrinks to a point
    """


class OtherSurface(InvalidArgument):
    """Values that do not belong to a surface: of another subject or resolution, or one by face.

    Parameters
    ----------
    message
        The sentence for its reader.
    found
        Number of values.
    vertices
        Number of vertices of the surface.

    Examples
    --------
    >>> try:
    ...     gc.brain.load_cortex({"left": gc.samples.sphere(80)}, np.ones(80), "passes")
    ... except gc.errors.OtherSurface as error:
    ...     print(error.found, error.vertices)
    80 42
    """

    def __init__(self, message: str, found: int, vertices: int) -> None:
        super().__init__(message)
        self.found = found
        self.vertices = vertices


class NoSuchLabel(InvalidArgument):
    """A label that a file does not have, or one or a region that no vertex is in.

    Examples
    --------
    >>> try:
    ...     gc.brain.load_cortex({"left": gc.samples.sphere(80)}, np.zeros(42), "passes")
    ... except gc.errors.NoSuchLabel as error:
    ...     print(error)
    the roi has no vertex of the left surface
    """


class InvalidPolygon(InvalidArgument):
    """A polygon that crosses itself, has no area, or does not meet the surface.

    Parameters
    ----------
    message
        The sentence for its reader.
    index
        Its number, where several are given.

    Examples
    --------
    >>> square = {"type": "Polygon", "coordinates": [[[2, 2], [3, 2], [3, 3], [2, 2]]]}
    >>> try:
    ...     gc.terrain.burn(gc.samples.plane(2), square, np.inf)
    ... except gc.errors.InvalidPolygon as error:
    ...     print(error.index)
    0
    """

    def __init__(self, message: str, index: int = 0) -> None:
        super().__init__(message)
        self.index = index


class UnsuitableCrs(InvalidArgument):
    """A coordinate reference system that is not known, or whose coordinates are no lengths.

    Examples
    --------
    >>> try:
    ...     gc.terrain.from_dem(np.zeros((2, 2)), (1, 0, 0, 0, -1, 0), crs="EPSG:4326")
    ... except gc.errors.UnsuitableCrs as error:
    ...     print(str(error).split(":")[0])
    coordinates in WGS 84 are no lengths on a map
    """


class NotEmbedded(InvalidArgument):
    """What needs space, asked of a mesh that is given by the lengths of its edges.

    Examples
    --------
    >>> mesh = gc.TriangleMesh.from_lengths([[0, 1, 2]], [[1.0, 1.0, 1.0]])
    >>> try:
    ...     mesh.locate([0.0, 0.0, 0.0])
    ... except gc.errors.NotEmbedded as error:
    ...     print(error)
    locate needs positions in space, and this mesh has lengths alone: give it vertices as well
    """


class NoPath(GeodesicError):  # noqa: N818
    """Points that no path joins.

    Parameters
    ----------
    message
        The points, and the limit.
    reason
        ``"disconnected"``, ``"beyond_max_distance"`` or ``"beyond_max_cost"``.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.shortest_path(mesh, 0, 3, max_distance=1.0)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.NoPath: the path from vertex 0 to vertex 3 is longer than max_distance = 1
    """

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class Cancelled(GeodesicError):  # noqa: N818
    """A call that the caller's ``cancel`` stopped.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, 0, cancel=lambda: True)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.Cancelled: cancelled with 0% done
    """


class DeadlineExceeded(GeodesicError):  # noqa: N818
    """A call that did not finish within ``deadline_s``.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, 0, deadline_s=1e-9)
    Traceback (most recent call last):
        ...
    geodesic_core.errors.DeadlineExceeded: not finished within 1e-09 s: 0% done
    """


class MemoryLimitExceeded(GeodesicError):  # noqa: N818
    """A call that needs more than ``memory_limit`` bytes.

    Parameters
    ----------
    needed
        Bytes that it needs, at least.
    memory_limit
        Bytes granted.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> try:
    ...     gc.exact_distance(mesh, 0, memory_limit=1)
    ... except gc.errors.MemoryLimitExceeded as error:
    ...     print(error.needed > error.memory_limit)
    True
    """

    def __init__(self, needed: int, memory_limit: int) -> None:
        super().__init__(f"the call needs {needed} bytes or more; memory_limit is {memory_limit}")
        self.needed = needed
        self.memory_limit = memory_limit


class MissingExtra(GeodesicError, ImportError):  # noqa: N818
    """A call that needs a package that is not installed; an extra brings it.

    Parameters
    ----------
    call
        The call.
    package
        The package that it needs.
    extra
        The extra of this library that brings it.

    Examples
    --------
    >>> print(gc.errors.MissingExtra("mesh.locate", "libigl", "locate"))
    mesh.locate needs libigl: pip install 'geodesic-core[locate]'
    """

    def __init__(self, call: str, package: str, extra: str) -> None:
        super().__init__(f"{call} needs {package}: pip install 'geodesic-core[{extra}]'")
        self.extra = extra


class InternalError(GeodesicError):
    """An invariant of the algorithm that does not hold: a defect of this library.

    Examples
    --------
    >>> issubclass(gc.errors.InternalError, gc.GeodesicError)
    True
    """


class GeodesicWarning(UserWarning):
    """Base of all warnings of this library.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter("ignore", gc.errors.GeodesicWarning)
    """


class EmptyBarrier(GeodesicWarning):
    """A label that is to be a barrier, and blocks no face.

    Examples
    --------
    >>> issubclass(gc.errors.EmptyBarrier, UserWarning)
    True
    """


class EmptyParcel(GeodesicWarning):
    """Parcels that have vertices, but none in the region.

    Examples
    --------
    >>> issubclass(gc.errors.EmptyParcel, UserWarning)
    True
    """


class NotWgs84(GeodesicWarning):
    """GeoJSON in the coordinates of a surface whose CRS is not known, where WGS 84 is expected.

    Examples
    --------
    >>> issubclass(gc.errors.NotWgs84, UserWarning)
    True
    """


class BlockedSource(GeodesicWarning):
    """A source all of whose faces are blocked: no path leaves it.

    Examples
    --------
    >>> import warnings
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> with warnings.catch_warnings(record=True, action="always") as told:
    ...     field = gc.exact_distance(mesh, 1, barriers=[0])
    >>> print(told[0].message)
    source 0, vertex 1, lies in blocked faces only: no path leaves it
    """

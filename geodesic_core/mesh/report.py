"""Reports on meshes: counts and defects with the ids at fault, and their remedies."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.kernels.mesh.build import trace_boundary
from geodesic_core.kernels.mesh.half_edges import (
    BOUNDARY,
    FANS,
    SADDLE,
    SEAM,
    SIN_LEFT,
    Embedding,
)
from geodesic_core.mesh.degeneracies import (
    edges_of_no_length,
    first_equal,
    of_three_vertices,
    repeated_rows,
)
from geodesic_core.mesh.seams import NO_SEAMS, seams_of

NAMED = 10
"""Ids named in a message or a report, at most."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Number of elements of a kind, and the ids of the first ten; an edge has two ids.

    Examples
    --------
    >>> gc.Sample(2, (4, 7)).ids
    (4, 7)
    """

    count: int
    ids: tuple[int | tuple[int, int], ...]

    @classmethod
    def of(cls, ids: NDArray[Any]) -> "Sample":
        """Return the sample of an array of ids.

        Parameters
        ----------
        ids
            (N,) ids, or (N, 2) of edges; integers.

        Returns
        -------
        Sample
            The number N, and the first ten.

        Examples
        --------
        >>> gc.Sample.of(np.arange(20)).count
        20
        """
        named = ids[:NAMED].tolist()
        return cls(len(ids), tuple(tuple(i) if isinstance(i, list) else i for i in named))


@dataclass(frozen=True, slots=True)
class MeshReport:
    """Counts and defects of a mesh, to check before trusting an answer.

    Examples
    --------
    >>> report = gc.samples.sphere(80).report
    >>> report.components, report.boundary_loops, report.euler_characteristic
    (1, 0, 2)
    """

    vertices: int
    faces: int
    """All faces, including those that are not part of the surface."""
    edges: int
    """Of the surface, to which faces that repeat a vertex or are blocked do not belong."""
    triangulated_polygons: int
    """Polygons that became several faces."""
    components: int
    """Connected components of the surface."""
    component_vertices: Sample
    """The lowest vertex of each component."""
    boundary_loops: int
    euler_characteristic: int
    """V - E + F of the surface; isolated vertices, and faces that are not part of it, do not count.

    Here and below, vertices that are joined by edges of zero length count as one; the lowest stands
    for them.
    """
    saddle_vertices: int
    boundary_vertices: int
    bow_tie_vertices: Sample
    """Vertices where several fans of faces meet, though they lie on no edge of three faces."""
    isolated_vertices: Sample
    """Vertices of no face of the surface."""
    duplicate_vertices: Sample
    """Vertices of the surface at the position of an earlier one."""
    near_vertices: Sample
    """Pairs of border vertices at different positions that are nearly joined: they are a thousand
    times as far apart over the surface, or farther. Each vertex is paired with its nearest."""
    near_distance: float
    """Largest distance between the two vertices of such a pair, mesh units; 0 without any."""
    t_junctions: Sample
    """Border vertices that lie on a border edge of which they are no end."""
    t_junction_edges: Sample
    """The edge that each of them lies on, in the same order."""
    repeated_vertex_faces: Sample
    """Faces that repeat a vertex: they have a number, but are no part of the surface."""
    zero_length_edges: Sample
    """Edges between different vertices at one position: their ends are one point of the surface."""
    collapsed_faces: Sample
    """Faces with such an edge: what is left of them is an edge of other faces, or a vertex."""
    duplicate_faces: Sample
    """Faces with the same three vertices as an earlier one."""
    degenerate_faces: Sample
    """Faces of the surface whose area is zero."""
    non_manifold_edges: Sample
    """Edges of three faces or more, each by its vertices; paths continue into any of the faces."""
    inconsistent_orientation: bool
    misoriented_edges: Sample
    """Edges that both of their faces traverse in the same direction, each by its vertices."""
    bounds: tuple[tuple[float, ...], tuple[float, ...]] | None
    """Lowest and highest corner of the bounding box, mesh units; None without positions."""
    mean_edge_length: float
    """Mesh units."""

    def as_dict(self) -> dict[str, Any]:
        """Return the report by name, in plain types.

        Returns
        -------
        dict
            Values that JSON can hold.

        Examples
        --------
        >>> gc.samples.sphere(80).report.as_dict()["isolated_vertices"]
        {'count': 0, 'ids': ()}
        """
        return asdict(self)


class _Edges(NamedTuple):
    """Edges of some faces, in the order of their vertices."""

    ends: Longs
    """(E, 2), lower vertex first"""
    face_count: Longs
    """(E,)"""
    is_same_way: NDArray[np.bool_]
    """(E,): whether an edge has two faces, which run it the same way"""
    keys: NDArray[np.uint64]
    """(E,): both ends of each in one number"""
    keys_of_sides: NDArray[np.uint64]
    """(3 F,): that of the edge of each side, three a face"""


def _edges_of(faces: Ints) -> _Edges:
    """Return the edges of some faces; O(F log F)."""
    tails, heads = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    keys = np.minimum(tails, heads).astype(np.uint64) << np.uint64(32)
    keys |= np.maximum(tails, heads).astype(np.uint64)
    # To sort numbers takes half the time of sorting their places: the direction is the lowest bit.
    ordered = np.sort(keys << np.uint64(1) | (tails < heads))
    each = ordered >> np.uint64(1)
    first = np.flatnonzero(np.diff(each, prepend=~each[:1]))
    edges, face_count = each[first], np.diff(first, append=len(each))
    upward = np.add.reduceat(ordered & np.uint64(1), first) if len(first) else first
    return _Edges(
        np.stack([edges >> np.uint64(32), edges & np.uint64(2**32 - 1)], axis=1).astype(np.int64),
        face_count,
        (face_count == 2) & (upward != 1),
        edges,
        keys,
    )


def report_of(
    vertices: Floats,
    faces: Ints,
    face_map: Longs | None,
    embedding: Embedding,
    lengths: Floats | None,
) -> MeshReport:
    """Return the report of a mesh; O(V log V + F log F).

    Where it is given by ``lengths`` (F, 3), positions tell nothing of what is joined.
    """
    topology = embedding.topology
    inner = topology.inner_vertex
    lowest_joined = topology.outer_vertex[inner]
    is_used = (np.diff(topology.first_corner) > 0)[inner]
    is_lowest = lowest_joined == np.arange(len(vertices))
    used = np.flatnonzero(is_used & is_lowest)
    flags = np.where(is_lowest, topology.flags[inner], 0)
    flat = topology.geometry[::3, SIN_LEFT] == 0.0
    surface = np.sort(topology.outer_face)
    corners = lowest_joined[faces[surface]]
    is_outside = np.ones(len(faces), bool)
    is_outside[surface] = False
    outside = np.flatnonzero(is_outside)
    is_collapsed = of_three_vertices(faces[outside]) & ~of_three_vertices(inner[faces[outside]])
    collapsed = outside[is_collapsed]
    edges = _edges_of(corners)
    if lengths is None:
        tails, heads = edges.ends.T
        edge_lengths = np.linalg.norm(vertices[heads] - vertices[tails], axis=1)
        first_used = used[first_equal(vertices[used])]
        seams = seams_of(embedding, used, first_used)
    else:
        edge_lengths, first_used, seams = np.empty(len(edges.ends)), used, NO_SEAMS
        places = np.searchsorted(edges.keys, edges.keys_of_sides)
        edge_lengths[places] = lengths[surface].reshape(-1)
    lowest = used[np.unique(topology.component[used], return_index=True)[1]]
    polygons = np.zeros(0) if face_map is None else np.bincount(face_map)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return MeshReport(
        vertices=len(vertices),
        faces=len(faces),
        edges=len(edges.ends),
        triangulated_polygons=int(np.count_nonzero(polygons > 1)),
        components=len(lowest),
        component_vertices=Sample.of(np.sort(lowest)),
        boundary_loops=len(trace_boundary(topology.links)[1]) - 1,
        euler_characteristic=len(used) - len(edges.ends) + len(surface),
        saddle_vertices=int(np.count_nonzero(flags & SADDLE)),
        boundary_vertices=int(np.count_nonzero(flags & BOUNDARY)),
        bow_tie_vertices=Sample.of(np.flatnonzero(flags & (FANS | SEAM) == FANS)),
        isolated_vertices=Sample.of(np.flatnonzero(~is_used)),
        duplicate_vertices=Sample.of(used[first_used != used]),
        near_vertices=Sample.of(seams.near),
        near_distance=float(seams.distances.max(initial=0.0)),
        t_junctions=Sample.of(seams.on_edge),
        t_junction_edges=Sample.of(seams.edges),
        repeated_vertex_faces=Sample.of(outside[~of_three_vertices(faces[outside])]),
        zero_length_edges=Sample.of(edges_of_no_length(vertices, faces[collapsed])),
        collapsed_faces=Sample.of(collapsed),
        duplicate_faces=Sample.of(surface[repeated_rows(np.sort(corners, axis=1))]),
        degenerate_faces=Sample.of(np.sort(topology.outer_face[flat])),
        non_manifold_edges=Sample.of(edges.ends[edges.face_count > 2]),
        inconsistent_orientation=bool(edges.is_same_way.any()),
        misoriented_edges=Sample.of(edges.ends[edges.is_same_way]),
        bounds=None if np.isnan(low[0]) else (tuple(low.tolist()), tuple(high.tolist())),
        mean_edge_length=float(edge_lengths.mean()),
    )


def warnings_of(report: MeshReport) -> Iterator[str]:
    """Yield sentences on the defects of a mesh and their remedies, for its user."""
    yield from _warnings_of_gaps(report)
    yield from _warnings_of_faces(report)
    yield from _warnings_of_seams(report)


def _warnings_of_gaps(report: MeshReport) -> Iterator[str]:
    if report.components > 1:
        yield (
            f"The mesh has {report.components} connected components; their lowest vertices are "
            f"{_list(report.component_vertices)}. Vertices in other components than the source are "
            "unreachable."
        )
    sample = report.duplicate_vertices
    if sample.count:
        yield (
            f"{_vertices(sample.count)} at the position of an earlier vertex but not joined to it: "
            f"no path connects the two there; the first is vertex {sample.ids[0]}. merge='exact' "
            "joins them."
        )
    sample = report.near_vertices
    if sample.count:
        pairs = "1 pair" if sample.count == 1 else f"{sample.count} pairs"
        yield (
            f"{pairs} of border vertices up to {report.near_distance:g} apart but not joined: no "
            f"path connects them there; the first are the vertices {sample.ids[0]}. "
            f"merge={_rounded_up(report.near_distance)} joins them."
        )
    sample = report.t_junctions
    if sample.count:
        yield (
            f"{_vertices(sample.count)} on a border edge without being its end (T-junction): no "
            f"path crosses there; the first is vertex {sample.ids[0]}, on the edge between the "
            f"vertices {report.t_junction_edges.ids[0]}. To join them, split the face of the edge "
            "at the vertex."
        )
    sample = report.isolated_vertices
    if sample.count:
        yield (
            f"{_vertices(sample.count)} in no face and unreachable; the first is vertex "
            f"{sample.ids[0]}."
        )


def _warnings_of_faces(report: MeshReport) -> Iterator[str]:
    sample = report.repeated_vertex_faces
    if sample.count:
        yield (
            f"{_faces(sample.count)} made of fewer than three different vertices and not part of "
            f"the surface; the first is face {sample.ids[0]}."
        )
    sample = report.zero_length_edges
    if sample.count:
        yield (
            f"{_edges(sample.count)} of zero length, with both ends at one point; the first joins "
            f"the vertices {sample.ids[0]}. {_faces(report.collapsed_faces.count)} therefore "
            f"reduced to an edge or a point; the first is face {report.collapsed_faces.ids[0]}."
        )
    sample = report.duplicate_faces
    if sample.count:
        yield (
            f"{_faces(sample.count)} made of the same vertices as an earlier one; the first is "
            f"face {sample.ids[0]}. Distances are the same without them."
        )
    sample = report.degenerate_faces
    if sample.count:
        yield f"{_faces(sample.count)} without area; the first is face {sample.ids[0]}."


def _warnings_of_seams(report: MeshReport) -> Iterator[str]:
    sample = report.non_manifold_edges
    if sample.count:
        yield (
            f"{_edges(sample.count)} shared by three faces or more; the first joins the vertices "
            f"{sample.ids[0]}. Paths may continue into any of these faces."
        )
    sample = report.misoriented_edges
    if sample.count:
        yield (
            f"{_edges(sample.count)} traversed in the same direction by both adjacent faces, whose "
            f"orientation is inconsistent; the first joins the vertices {sample.ids[0]}. Distances "
            "do not depend on the orientation."
        )
    sample = report.bow_tie_vertices
    if sample.count:
        yield (
            f"Several fans of faces meet at {sample.count} "
            f"{'vertex' if sample.count == 1 else 'vertices'}; the first is vertex "
            f"{sample.ids[0]}. Paths may pass through."
        )


def _vertices(count: int) -> str:
    return "1 vertex is" if count == 1 else f"{count} vertices are"


def _faces(count: int) -> str:
    return "1 face is" if count == 1 else f"{count} faces are"


def _edges(count: int) -> str:
    return "1 edge is" if count == 1 else f"{count} edges are"


_SQUARABLE = 1e-150
"""Mesh units: of smaller distances, the square may be no number, and they are found as 0."""


def _rounded_up(distance: float) -> str:
    """Return a distance that is larger, of one digit, or of two."""
    distance = max(distance, _SQUARABLE)
    unit = 10.0 ** math.floor(math.log10(distance))
    return f"{(math.floor(distance / unit) + 1) * unit:g}"


def _list(sample: Sample) -> str:
    return ", ".join(map(str, sample.ids)) + (", …" if sample.count > len(sample.ids) else "")

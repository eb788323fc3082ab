"""Covers: copies of a surface, its sheets, joined to each other across edges.

A path on a cover is one on the surface, and tells by the sheet that it ends in how it has run. The
shortest paths of a cover are therefore the shortest of their kind on the surface.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidMesh
from geodesic_core.kernels.mesh.half_edges import FANS, LENGTH, OPPOSITE, SEAM, TAIL
from geodesic_core.mesh.edge_lengths import weights_in_faces
from geodesic_core.mesh.surface_curve import SurfaceCurve, curve_through
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class Cover(NamedTuple):
    """A surface and a mesh of sheets that lies over it."""

    base: TriangleMesh
    mesh: TriangleMesh
    """Its corners are the inner corners of the base"""
    copies: Longs
    """(F',): sheet * F + inner face of the base that each face lies over"""

    @property
    def base_faces(self) -> Longs:
        """(F',): the inner faces of the base below."""
        faces: Longs = self.copies % (len(self.base.topology.links) // 3)
        return faces

    def lifted(self, point: SurfacePoint, sheet: int) -> SurfacePoint:
        """Return a canonical point of the base in a sheet, where that has all faces beside it."""
        base = self.base
        face = base.inner_face[[point.face_index]].astype(np.int64)
        given = np.array([point.face_index]), np.array([point.barycentric])
        weights = weights_in_faces(base.topology, base.faces, *given, face)
        return self.point_in(int(face[0]), weights[0], sheet)

    def point_in(self, face: int, weights: Floats, sheet: int) -> SurfacePoint:
        """Return the point over one of an inner face of the base, by its weights there."""
        count = len(self.base.topology.links) // 3
        copy = np.searchsorted(self.copies, sheet * count + face)
        return self.mesh.point(SurfacePoint.face(int(copy), tuple(weights.tolist())))

    def lowered(self, path: SurfaceCurve, *, closed: bool = False) -> SurfaceCurve:
        """Return a path on the cover as a curve on the base."""
        faces, located = self.base_faces, path.located
        return curve_through(
            self.base, faces[located.faces], located.weights, faces[path.faces], closed=closed
        )


def cover_of(mesh: TriangleMesh, across: Longs, kept: NDArray[np.bool_], control: Control) -> Cover:
    """Return the cover with some faces of each sheet.

    ``across`` (S, 3F): the sheet into which one comes from a sheet over a half-edge, or -1.
    ``kept`` (F,): the inner faces that sheets have.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says, before it is made.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links, geometry = mesh.topology.links, mesh.topology.geometry
    sheets, faces = len(across), np.flatnonzero(kept)
    control.checkpoint(0.0)
    control.check_memory(sheets * len(faces) * mesh.nbytes // len(kept))
    half_edges = (3 * faces[:, None] + np.arange(3)).reshape(-1)
    count = len(half_edges)
    opposite = links[half_edges, OPPOSITE].astype(np.int64)
    inner = np.flatnonzero((opposite >= 0) & kept[opposite // 3])
    beyond = 3 * np.searchsorted(faces, opposite[inner] // 3) + opposite[inner] % 3
    sheet = np.repeat(np.arange(sheets), len(inner))
    h, opposite = np.tile(inner, sheets), np.tile(beyond, sheets)
    there = across[sheet, half_edges[h]]
    sheet, h, opposite, there = (each[there >= 0] for each in (sheet, h, opposite, there))
    # The tail of a half-edge is the head of its opposite: two corners of one vertex
    ends = sheet * count + h, there * count + _following(opposite)
    graph = coo_array((np.ones(len(h), np.int8), ends), shape=(sheets * count,) * 2)
    _, vertex_of = connected_components(graph, directed=False)
    _, first = np.unique(vertex_of, return_index=True)
    cover_faces = vertex_of.reshape(-1, 3)
    copies = (np.arange(sheets)[:, None] * len(kept) + faces).reshape(-1)
    below = mesh.topology.outer_vertex[links[half_edges[first % count], TAIL]]
    if mesh.lengths is None:
        return Cover(mesh, TriangleMesh(mesh.vertices[below], cover_faces), copies)
    lengths = np.tile(geometry[half_edges, LENGTH].reshape(-1, 3), (sheets, 1))
    vertices = mesh.vertices[below] if mesh.has_positions else None
    return Cover(mesh, TriangleMesh.from_lengths(cover_faces, lengths, vertices), copies)


def _following(h: Longs) -> Longs:
    """Return the half-edges after some in their faces."""
    following: Longs = h - h % 3 + (h + 1) % 3
    return following


def require_two_sided(mesh: TriangleMesh) -> None:
    """Refuse a mesh that is no surface with two sides.

    Raises
    ------
    InvalidMesh
        Somewhere more than two faces meet at an edge, or several fans at a vertex, or the surface
        has one side only.
    """
    topology = mesh.topology
    bad = topology.outer_vertex[np.flatnonzero(topology.flags & (SEAM | FANS))]
    if len(bad):
        raise InvalidMesh(
            f"at vertex {bad.min()} the mesh is no surface with two sides, on which loops are "
            "defined: several fans of faces meet there, or an edge has more than two faces or two "
            "that cannot be wound alike; mesh.report lists such places",
            kind="vertex",
            elements=np.sort(bad)[:10].tolist(),
        )

"""A point of the surface: on a vertex, on an edge or inside a face."""

from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.topology import HEAD, NEXT_CORNER, OPPOSITE, TAIL
from geodesic_core.mesh import TriangleMesh

UNPLACED = -1
"""The face of a vertex that was named without a mesh."""


@dataclass(frozen=True, slots=True)
class SurfacePoint:
    """A point of the surface, by its barycentric coordinates in a face.

    Points that a mesh hands out are canonical: ``face`` is the lowest that contains the point, and
    ``vertex_index`` is set exactly where the point is a vertex.
    """

    face: int
    """Face id; -1 for a vertex that was named without a mesh."""
    barycentric: tuple[float, float, float]
    """Weights of the face's three corners; they sum to one."""
    vertex_index: int | None = None
    """The vertex that this point is, if it is one."""

    @classmethod
    def vertex(cls, index: int) -> "SurfacePoint":
        """Return the point at a vertex."""
        return cls(UNPLACED, (1.0, 0.0, 0.0), index)

    @classmethod
    def at_vertex(cls, mesh: TriangleMesh, index: int) -> "SurfacePoint":
        """Return the canonical point at a vertex that belongs to a face."""
        links = mesh.topology.links
        corner = int(mesh.topology.first_corner[index])
        lowest = corner
        while corner >= 0:
            lowest = min(lowest, corner)
            corner = int(links[corner, NEXT_CORNER])
        weights = [0.0, 0.0, 0.0]
        weights[lowest % 3] = 1.0
        return cls(lowest // 3, (weights[0], weights[1], weights[2]), index)

    @classmethod
    def on_half_edge(cls, mesh: TriangleMesh, half_edge: int, t: float) -> "SurfacePoint":
        """Return the canonical point at ``t`` in [0, 1] from the tail to the head of a half-edge."""
        links = mesh.topology.links
        if t == 0.0 or 1.0 - t in (0.0, 1.0):  # also a t too small to be told from a vertex
            return cls.at_vertex(mesh, int(links[half_edge, TAIL if t < 0.5 else HEAD]))
        opposite = int(links[half_edge, OPPOSITE]) >> 1
        if 0 <= opposite < half_edge:
            half_edge, t = opposite, 1.0 - t
        weights = [0.0, 0.0, 0.0]
        weights[half_edge % 3] = 1.0 - t
        weights[(half_edge + 1) % 3] = t
        return cls(half_edge // 3, (weights[0], weights[1], weights[2]))

    def position(self, mesh: TriangleMesh) -> Floats:
        """Return the (3,) position, mesh units; of a vertex exactly the mesh's own."""
        if self.vertex_index is not None:
            return mesh.vertices[self.vertex_index]
        weights = np.array(self.barycentric)
        position: Floats = weights @ mesh.vertices[mesh.faces[self.face]]
        return position

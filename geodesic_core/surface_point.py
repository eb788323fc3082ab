"""A point of the surface: on a vertex, on an edge or inside a face."""

from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.kernels.topology import (
    HEAD,
    OPPOSITE,
    TAIL,
    outer_half_edge,
)
from geodesic_core.mesh import TriangleMesh

UNPLACED = -1
"""The face of a vertex that was named without a mesh."""

_CORNERS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


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
        topology = mesh.topology
        v = topology.inner_vertex[index]
        corners = topology.corners[topology.first_corner[v] : topology.first_corner[v + 1]]
        lowest = min(outer_half_edge(topology.outer_face, int(h)) for h in corners)
        face, place = divmod(int(lowest), 3)
        return cls(face, _CORNERS[place], index)

    @classmethod
    def on_half_edge(cls, mesh: TriangleMesh, half_edge: int, t: float) -> "SurfacePoint":
        """Return the canonical point at ``t`` in [0, 1] along a half-edge of the topology."""
        topology = mesh.topology
        if t == 0.0 or 1.0 - t in (0.0, 1.0):  # also a t too small to be told from a vertex
            end = topology.links[half_edge, TAIL if t < 0.5 else HEAD]
            return cls.at_vertex(mesh, int(topology.outer_vertex[end]))
        outer = outer_half_edge(topology.outer_face, half_edge)
        opposite = int(topology.links[half_edge, OPPOSITE]) >> 1
        if opposite >= 0:
            other = outer_half_edge(topology.outer_face, opposite)
            if other < outer:
                outer, t = other, 1.0 - t
        weights = [0.0, 0.0, 0.0]
        weights[outer % 3] = 1.0 - t
        weights[(outer + 1) % 3] = t
        return cls(int(outer // 3), (weights[0], weights[1], weights[2]))

    def position(self, mesh: TriangleMesh) -> Floats:
        """Return the (3,) position, mesh units; of a vertex exactly the mesh's own."""
        position: Floats
        if self.vertex_index is not None:
            position = mesh.vertices[self.vertex_index]
        else:
            position = np.array(self.barycentric) @ mesh.vertices[mesh.faces[self.face]]
        return position

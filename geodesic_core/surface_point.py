"""A point of the surface: on a vertex, on an edge or inside a face."""

from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats
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

    def position(self, mesh: TriangleMesh) -> Floats:
        """Return the (3,) position, mesh units; of a vertex exactly the mesh's own."""
        position: Floats
        if self.vertex_index is not None:
            position = mesh.vertices[self.vertex_index]
        else:
            position = np.array(self.barycentric) @ mesh.vertices[mesh.faces[self.face]]
        return position

"""The face nearest to a position, by the tree of boxes of libigl."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.extras import extra


class NearestFace:
    """A search tree over the ``surface``, which is some of the faces of a mesh.

    O(F log F) to build, O(log F) a call in practice.
    """

    def __init__(self, vertices: Floats, faces: Ints, surface: Longs) -> None:
        with extra("locate", "libigl", "TriangleMesh.locate"):
            import igl

        self._surface = surface
        self._arrays = vertices, faces[surface].astype(np.int64)
        self._tree: Any = igl.AABB()
        self._tree.init(*self._arrays)

    def __call__(self, position: Floats) -> tuple[int, Floats, float]:
        """Return the nearest face, the nearest point of it, and its distance, mesh units."""
        squared, faces, points = self._tree.squared_distance(*self._arrays, position[None])
        return int(self._surface[faces[0]]), points[0], float(np.sqrt(squared[0]))

"""Surfaces that are heights over the plane, and their points above places in it."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.errors import InvalidArgument
from geodesic_core.extras import extra
from geodesic_core.mesh.closest_point import NearestFace
from geodesic_core.tolerances import SAME_HEIGHT


class HeightField:
    """The ``surface``, which is some of the faces of a mesh, seen from above.

    O(F log F) to build, O(log F) a place in practice.

    Raises
    ------
    InvalidArgument
        A face is upright, or seen from below where others are seen from above.
    """

    def __init__(self, vertices: Floats, faces: Ints, surface: Longs) -> None:
        corners = vertices[faces[surface]][:, :, :2]
        along, up = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = along[:, 0] * up[:, 1] - along[:, 1] * up[:, 0]
        wrong = surface[area <= 0.0 if area.sum() >= 0.0 else area >= 0.0]
        if len(wrong):
            raise InvalidArgument(
                f"the surface is not a height over the plane: face {wrong[0]} is upright or turned "
                f"over, as are {len(wrong) - 1} more; use locate with a position in space"
            )
        with extra("locate", "libigl", "TriangleMesh.locate_xy"):
            import igl

        flat = vertices * [1.0, 1.0, 0.0]
        self._nearest = NearestFace(flat, faces, surface)
        size = float(np.ptp(vertices, axis=0).max())
        self._below, self._same_height = float(vertices[:, 2].min()) - size, SAME_HEIGHT * size
        self._arrays = vertices, faces[surface].astype(np.int64)
        self._tree: Any = igl.AABB()
        self._tree.init(*self._arrays)

    def __call__(self, place: Floats, snap: float) -> tuple[int, Floats] | None:
        """Return the face above or below a place (2,), and the place on it seen from above.

        None where the surface is farther away than ``snap`` in the plane.

        Raises
        ------
        InvalidArgument
            The surface is there at several heights.
        """
        face, point, distance = self._nearest(np.append(place, 0.0))
        if distance > snap:
            return None
        foot, upwards = [*point[:2], self._below], [0.0, 0.0, 1.0]
        (hits,) = self._tree.intersect_ray(*self._arrays, np.array([foot]), np.array([upwards]))
        heights = [self._height_in(hit[0], foot) for hit in hits] or [0.0]
        if max(heights) - min(heights) > self._same_height:
            raise InvalidArgument(
                f"the surface is not a height over the plane: at {place.tolist()} it has the "
                f"heights {min(heights):g} and {max(heights):g}; use locate with a position in "
                "space"
            )
        return face, point

    def _height_in(self, hit: int, foot: list[float]) -> float:
        """Return the height of a face above a place; the tree rounds its own to float32."""
        vertices, faces = self._arrays
        a, b, c = vertices[faces[hit]]
        x, y, z = np.cross(b - a, c - a)
        return float(a[2] - (x * (foot[0] - a[0]) + y * (foot[1] - a[1])) / z)

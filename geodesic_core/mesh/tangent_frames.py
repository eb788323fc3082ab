"""Tangent planes at the vertices: angles on the surface as vectors in space, and back."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.errors import InvalidArgument
from geodesic_core.kernels.mesh.half_edges import APEX, HEAD, Topology
from geodesic_core.mesh.vertex_frames import first_corners, is_open, scales_of


@dataclass(frozen=True, eq=False)
class TangentFrames:
    """A tangent plane at each vertex, with the axis that angles are measured from.

    The sum of the angles around a vertex is seldom a full turn. In the plane it is stretched or
    shrunk to one, so that no direction is lost; at a boundary only where it is more.

    Examples
    --------
    >>> frames = gc.samples.plane(2).tangent_frames()
    >>> frames.vectors(np.zeros(4)).round(3).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]]
    """

    normals: Floats
    """(V, 3): unit vectors, outward as the lowest face is wound; NaN at vertices of no face"""
    x_axes: Floats
    """(V, 3): unit vectors in the direction of angle 0"""
    y_axes: Floats
    """(V, 3): unit vectors, a quarter turn counter-clockwise of these"""
    total_angles: Floats
    """(V,): sum of the angles of the surface around each vertex, radians"""
    scales: Floats
    """(V,): angle in the plane for one of the surface"""

    def vectors(self, angles: ArrayLike) -> Floats:
        """Return directions on the surface as vectors in space.

        Parameters
        ----------
        angles
            (V,) radians, each in the frame of its vertex.

        Returns
        -------
        numpy.ndarray
            (V, 3) float64, unit vectors in the tangent planes.

        Raises
        ------
        InvalidArgument
            There is not one angle for each vertex.

        Examples
        --------
        >>> frames = gc.samples.plane(2).tangent_frames()
        >>> frames.vectors(np.full(4, np.pi / 2)).round(3).tolist()[0]
        [0.0, 1.0, 0.0]
        """
        turns = self._given("angles", angles, ()) * self.scales
        return np.cos(turns)[:, None] * self.x_axes + np.sin(turns)[:, None] * self.y_axes

    def angles(self, vectors: ArrayLike) -> Floats:
        """Return the directions of vectors in space, projected to the tangent planes.

        Parameters
        ----------
        vectors
            (V, 3), one for each vertex.

        Returns
        -------
        numpy.ndarray
            (V,) float64, radians, from 0 up to the total angle of each vertex; NaN for a vector
            that has no direction in its plane.

        Raises
        ------
        InvalidArgument
            There is not one vector for each vertex.

        Examples
        --------
        >>> frames = gc.samples.plane(2).tangent_frames()
        >>> frames.angles([[0.0, 1.0, 0.0]] * 4).round(3).tolist()[0]
        1.571
        """
        given = self._given("vectors", vectors, (3,))
        x, y = (np.einsum("vk,vk->v", given, axes) for axes in (self.x_axes, self.y_axes))
        turns = np.mod(np.arctan2(y, x), 2.0 * math.pi)
        angles: Floats = np.where(np.hypot(x, y) > 0.0, turns / self.scales, np.nan)
        return angles

    def _given(self, name: str, values: ArrayLike, shape: tuple[int, ...]) -> Floats:
        try:
            array = np.asarray(values, np.float64)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (len(self.normals), *shape):
            expected = " × ".join(map(str, (len(self.normals), *shape)))
            raise InvalidArgument(f"{name} must be {expected} numbers, one row for each vertex")
        return array


def tangent_frames_of(
    vertices: Floats, faces: Ints, inner_face: Ints, topology: Topology
) -> TangentFrames:
    """Return the frames of all vertices of a mesh; O(V + F).

    Angles begin where those of `frames.frame_at` do.
    """
    used = np.flatnonzero(inner_face >= 0)
    nodes = topology.inner_vertex[faces[used]]  # what edges of no length join is one
    places, flat = vertices[topology.outer_vertex], nodes.reshape(-1)
    first = first_corners(nodes, len(vertices))
    ahead = np.arange(len(vertices))
    is_used = first >= 0
    corner = first[is_used]
    ahead[is_used] = flat[corner - corner % 3 + (corner + 1) % 3]
    is_turned_over = _turned_over(nodes, inner_face[used], topology)
    for v in np.flatnonzero(is_open(topology) & is_used).tolist():
        begin, end = topology.first_corner[v], topology.first_corner[v + 1]
        at, column = (end - 1, APEX) if is_turned_over[first[v] // 3] else (begin, HEAD)
        ahead[v] = topology.links[topology.corners[at], column]
    # Neighbours may be wound differently: sum the normals of one side, the lowest face's.
    one_sided = np.where(is_turned_over[:, None], nodes[:, [0, 2, 1]], nodes)
    sides = np.ones(len(vertices))
    sides[is_used] = np.where(is_turned_over[corner // 3], -1.0, 1.0)
    normals = _unit(_normals(places, one_sided) * sides[:, None])
    x_axes = places[ahead] - places
    x_axes = _unit(x_axes - np.einsum("vk,vk->v", x_axes, normals)[:, None] * normals)
    y_axes = np.cross(normals, x_axes)
    by_node = normals, x_axes, y_axes, topology.total_angle, scales_of(topology)
    return TangentFrames(*(array[topology.inner_vertex] for array in by_node))


def _turned_over(nodes: Ints, inner_face: Ints, topology: Topology) -> Flags:
    """Return which faces (F, 3) the topology runs around the other way than the caller."""
    corners = topology.links[:, HEAD].reshape(-1, 3)[inner_face]  # the heads: corners 1, 2, 0
    at = np.argmax(corners == nodes[:, :1], axis=1)
    is_over: Flags = corners[np.arange(len(nodes)), (at + 1) % 3] != nodes[:, 1]
    return is_over


def _normals(vertices: Floats, faces: Ints) -> Floats:
    """Return the normals of the faces around each vertex, weighted by their angles there."""
    normals = np.zeros_like(vertices)
    corners = vertices[faces]
    for i in range(3):
        u, w = (corners[:, (i + k) % 3] - corners[:, i] for k in (1, 2))
        crossed = np.cross(u, w)
        twice_area = np.linalg.norm(crossed, axis=1)
        angles = np.arctan2(twice_area, np.einsum("fk,fk->f", u, w))
        with np.errstate(invalid="ignore", divide="ignore"):
            weighted = np.where(twice_area[:, None] > 0.0, crossed / twice_area[:, None], 0.0)
        np.add.at(normals, faces[:, i], angles[:, None] * weighted)
    return normals


def _unit(vectors: Floats) -> Floats:
    """Return vectors of length 1; NaN for those of none."""
    lengths: Any = np.linalg.norm(vectors, axis=1)[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Floats = vectors / lengths
    return unit

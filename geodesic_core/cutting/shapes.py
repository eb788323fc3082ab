"""Faces laid out flat, and lengths within them."""

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.mesh.triangle_mesh import TriangleMesh


def sides_of(mesh: TriangleMesh, faces: Longs) -> Floats:
    """Return the lengths of the edges of faces from corner i to corner i + 1, (N, 3)."""
    if mesh.lengths is not None:
        given: Floats = mesh.lengths[faces]
        return given
    corners = mesh.vertices[mesh.faces[faces]]
    lengths: Floats = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return lengths


def shapes_of(sides: Floats) -> Floats:
    """Return triangles laid out flat, (N, 3): edge 0, and corner 2 along it and above it.

    Heights by Heron's formula as Kahan has it, which needles do not spoil.
    """
    c, a, b = sides.T
    low, middle, high = np.sort(sides, axis=1).T
    product = (high + (middle + low)) * (low - (high - middle))
    product = product * (low + (high - middle)) * (high + (middle - low))
    base = np.where(c > 0.0, c, 1.0)
    above = 0.5 * np.sqrt(np.maximum(product, 0.0)) / base
    along = 0.5 * (c + (b - a) * (b + a) / base)
    return np.stack([c, along, above], axis=1)


def lengths_of(sides: Floats, steps: Floats) -> Floats:
    """Return the lengths of steps within triangles, given by the changes of weights, (N,).

    A step along an edge is the edge's share, the same in all faces of it.
    """
    c, along, above = shapes_of(sides).T
    inside = np.hypot(steps[:, 1] * c + steps[:, 2] * along, steps[:, 2] * above)
    apex = np.abs(steps).argmin(axis=1)
    each = np.arange(len(steps))
    share, side = np.abs(steps[each, (apex + 1) % 3]), sides[each, (apex + 1) % 3]
    lengths: Floats = np.where(steps[each, apex] == 0.0, share * side, inside)
    return lengths

"""The boundary of a surface, as curves along its edges."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from geodesic_core.arrays import Ints
from geodesic_core.kernels.mesh.build import trace_boundary
from geodesic_core.mesh.surface_curve import SurfaceCurve, length_on, located_in, runs_as_wound

if TYPE_CHECKING:  # which has its boundaries
    from geodesic_core.mesh.triangle_mesh import TriangleMesh


def boundaries_of(mesh: "TriangleMesh") -> list[SurfaceCurve]:
    """Return the curves of boundary edges, longest first; O(F)."""
    half_edges, first, opened = trace_boundary(mesh.topology.links)
    runs = pairwise(first.tolist())
    curves = [_curve_along(mesh, half_edges[lo:hi], i >= opened) for i, (lo, hi) in enumerate(runs)]
    return sorted(curves, key=lambda curve: -curve.length)


def _curve_along(mesh: "TriangleMesh", half_edges: Ints, closed: bool) -> SurfaceCurve:
    """Return the curve through the tails of half-edges, and the last one's head if it is open.

    It runs as the caller's faces do, by its first one: inner faces may be turned over.
    """
    inner, corners = half_edges.astype(np.int64) // 3, half_edges % 3
    faces = mesh.topology.outer_face[inner]
    if not closed:
        inner = np.append(inner, inner[-1])
        corners = np.append(corners, (corners[-1] + 1) % 3)
    located = located_in(mesh, inner, np.eye(3)[corners])
    length = length_on(mesh, located, faces, closed)
    curve = SurfaceCurve(mesh, faces, closed, length, located)
    return curve if runs_as_wound(mesh, int(inner[0])) else curve.reversed()

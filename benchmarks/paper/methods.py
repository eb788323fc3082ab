"""The methods that are compared: exact, within an error, and fast marching."""

from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import potpourri3d as peer

import geodesic_core as gc
from geodesic_core import solvers
from geodesic_core.arrays import Floats, Ints

FEWEST, MOST = 1e-9, 0.5
"""Bounds of the errors that are searched for a number of windows"""


class Errors(NamedTuple):
    """Errors of distances against true ones."""

    largest: float
    """Mesh units"""
    mean: float
    """A share of the distance"""


def errors_of(distances: Floats, true: Floats) -> Errors:
    """Return the largest absolute error, and the mean relative one."""
    away = (true > 0.0) & np.isfinite(true)
    differences = np.abs(distances - true)[away]
    return Errors(float(differences.max()), float((differences / true[away]).mean()))


def marching(vertices: Floats, faces: Ints, source: int) -> Floats:
    """Return the distances of potpourri3d's fast marching, cold."""
    solver = peer.MeshFastMarchingDistanceSolver(vertices, faces)
    distances: Floats = solver.compute_distance([[(source, [])]])
    return distances


@patch.object(solvers, "WIDEST_ERROR", MOST)
def with_windows(mesh: gc.TriangleMesh, source: int, per_edge: float) -> gc.DistanceField | None:
    """Return the field whose error, found by bisection, keeps so many windows per edge on average.

    The exact field where even the least error keeps fewer; None where even the largest keeps more.
    Like the paper's solver, and unlike ours, it uses errors beyond WIDEST_ERROR.
    """
    low, high = FEWEST, MOST
    if gc.approximate_distance(mesh, source, low).stats.windows_per_edge_kept <= per_edge:
        return gc.exact_distance(mesh, source)
    field = gc.approximate_distance(mesh, source, high)
    if field.stats.windows_per_edge_kept > per_edge:
        return None
    for _ in range(24):
        middle = float(np.sqrt(low * high))
        tried = gc.approximate_distance(mesh, source, middle)
        kept = tried.stats.windows_per_edge_kept
        if kept > per_edge:
            low = middle
        else:
            high, field = middle, tried
        if abs(kept / per_edge - 1.0) < 0.005:
            return tried
    return field

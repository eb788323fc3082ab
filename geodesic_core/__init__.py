"""Geodesic distances and shortest paths on triangle meshes, exact or within a chosen error.

The methods of Surazhsky, Surazhsky, Kirsanov, Gortler and Hoppe, *Fast Exact and Approximate
Geodesics on Meshes* (2005). Start at `load_mesh` or `TriangleMesh`, then
`exact_distance` or `approximate_distance`.
"""

from geodesic_core import errors, samples
from geodesic_core.curve import Curve
from geodesic_core.errors import GeodesicError
from geodesic_core.isolines import Isoline
from geodesic_core.matrix import distance_matrix
from geodesic_core.mesh import TriangleMesh
from geodesic_core.mesh_io import load_mesh
from geodesic_core.nearest import Nearest, nearest
from geodesic_core.path import ErrorBound, GeodesicPath, SearchStep
from geodesic_core.report import MeshReport, Sample
from geodesic_core.result import DistanceField, Source, SweepStats
from geodesic_core.solvers import (
    Solver,
    approximate_distance,
    exact_distance,
    shortest_path,
    warm_up,
)
from geodesic_core.surface_point import SurfacePoint

__all__ = [
    "Curve",
    "DistanceField",
    "ErrorBound",
    "GeodesicError",
    "GeodesicPath",
    "Isoline",
    "MeshReport",
    "Nearest",
    "Sample",
    "SearchStep",
    "Solver",
    "Source",
    "SurfacePoint",
    "SweepStats",
    "TriangleMesh",
    "approximate_distance",
    "distance_matrix",
    "errors",
    "exact_distance",
    "load_mesh",
    "nearest",
    "samples",
    "shortest_path",
    "warm_up",
]

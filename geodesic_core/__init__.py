"""Geodesic distances and shortest paths on triangle meshes, exact or within a chosen error.

The methods of Surazhsky, Surazhsky, Kirsanov, Gortler and Hoppe, *Fast Exact and Approximate
Geodesics on Meshes* (2005). Start at `exact_distance` or `shortest_path`. Each function takes a
mesh as a `TriangleMesh`, as arrays, as the path of a file, or as an object of another library
(`as_mesh`). Examples in docstrings assume ``import geodesic_core as gc`` and
``import numpy as np``.

Examples
--------
>>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
>>> gc.exact_distance(mesh, 0).distances.round(3).tolist()
[0.0, 1.0, 1.0, 1.414]
"""

from geodesic_core import brain, errors, samples, terrain
from geodesic_core.compilation import compile_kernels, warm_up
from geodesic_core.control import Control
from geodesic_core.costs.cheapest_path import CheapestPath
from geodesic_core.costs.cost_field import CostField
from geodesic_core.costs.slope_cost import SlopeCost
from geodesic_core.cutting.cut_mesh import CutMesh
from geodesic_core.errors import GeodesicError
from geodesic_core.fields.borders import Border
from geodesic_core.fields.cells import Cells
from geodesic_core.fields.certificate import Certificate
from geodesic_core.fields.distance_field import DistanceField
from geodesic_core.fields.isolines import resolve_chord_error, spaced_levels
from geodesic_core.fields.log_map import LogMap, Polar
from geodesic_core.fields.path import ErrorBound, GeodesicPath, SearchStep
from geodesic_core.fields.scalar_field import ScalarField
from geodesic_core.fields.stored_field import load_field
from geodesic_core.fields.straight_lines import StraightLine
from geodesic_core.fields.sweep_result import Retain, SweepStats
from geodesic_core.fields.sweep_steps import SweepSteps, SweepWindows
from geodesic_core.io.as_mesh import as_mesh
from geodesic_core.io.label import load_label, load_label_vertices
from geodesic_core.io.load import load_mesh
from geodesic_core.matrices.matrix_file import MatrixFile, write_matrix
from geodesic_core.matrices.matrix_parts import MatrixParts
from geodesic_core.mesh.barriers import walled_in
from geodesic_core.mesh.curve import share_a_face
from geodesic_core.mesh.profile import Profile
from geodesic_core.mesh.report import MeshReport, Sample
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.surface_point import Curve, Source, SurfacePoint
from geodesic_core.mesh.tangent_frames import TangentFrames
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.sampling.farthest_points import FarthestPoints
from geodesic_core.sampling.mean_point import MeanPoint
from geodesic_core.sampling.relaxation import RelaxedPoints
from geodesic_core.search.nearest import Nearest
from geodesic_core.solvers import (
    Solver,
    approximate_distance,
    cheapest_path,
    cost_distance,
    cut,
    distance_matrix,
    error_bound,
    exact_distance,
    farthest_points,
    fast_distance,
    handle_loops,
    kernel_digest,
    log_map,
    mean_point,
    nearest,
    paths_around,
    relax_points,
    shortest_loop,
    shortest_path,
    straighten,
    sweep_steps,
    trace,
)
from geodesic_core.tolerances import WEIGHT_ERROR

__all__ = [
    "WEIGHT_ERROR",
    "Border",
    "Cells",
    "Certificate",
    "CheapestPath",
    "Control",
    "CostField",
    "Curve",
    "CutMesh",
    "DistanceField",
    "ErrorBound",
    "FarthestPoints",
    "GeodesicError",
    "GeodesicPath",
    "LogMap",
    "MatrixFile",
    "MatrixParts",
    "MeanPoint",
    "MeshReport",
    "Nearest",
    "Polar",
    "Profile",
    "RelaxedPoints",
    "Retain",
    "Sample",
    "ScalarField",
    "SearchStep",
    "SlopeCost",
    "Solver",
    "Source",
    "StraightLine",
    "SurfaceCurve",
    "SurfacePoint",
    "SweepStats",
    "SweepSteps",
    "SweepWindows",
    "TangentFrames",
    "TriangleMesh",
    "approximate_distance",
    "as_mesh",
    "brain",
    "cheapest_path",
    "compile_kernels",
    "cost_distance",
    "cut",
    "distance_matrix",
    "error_bound",
    "errors",
    "exact_distance",
    "farthest_points",
    "fast_distance",
    "handle_loops",
    "kernel_digest",
    "load_field",
    "load_label",
    "load_label_vertices",
    "load_mesh",
    "log_map",
    "mean_point",
    "nearest",
    "paths_around",
    "relax_points",
    "resolve_chord_error",
    "samples",
    "share_a_face",
    "shortest_loop",
    "shortest_path",
    "spaced_levels",
    "straighten",
    "sweep_steps",
    "terrain",
    "trace",
    "walled_in",
    "warm_up",
    "write_matrix",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)

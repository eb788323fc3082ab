"""What a query is likely to cost: a small model, told by the size of the mesh and the query.

The constants were measured on one core of an AMD EPYC, kernels compiled, on meshes of 10³ to 10⁵
faces: the samples, and scans such as the horse and the dragon of `benchmarks`. Seconds depend on
the machine, and on the shape of a mesh by a factor of 3; bytes depend on neither by more than half.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

import geodesic_core as gc
from app.queries.places import Places, components_of, positions_of
from app.queries.validation import MeshSize
from app.schemas.requests import Accuracy

# Seconds
PER_POINT = 12e-6
"""To find a point of the mesh, and to tell of it."""
PER_POSITION = 60e-6
"""To find the point nearest to a position."""
PER_FACE, PER_WINDOWS = 0.4e-6, 2.5e-9
"""Of an exact sweep: for each of its n faces, and for the windows on it, which are about √n."""
PER_FACE_MERGED = 0.5e-6
"""Of an approximate sweep."""
PER_SWEEP = 0.3e-3
"""To start one and to end it, however short it is."""
PER_FACE_UNSWEPT = 0.03e-6
"""To allocate the state of a face."""
PER_SEARCH, PER_FACE_SEARCHED = 0.5e-3, 0.08e-6
"""For a path between two points: each, and for each face of the mesh."""
PER_WINDOW_KEPT = 50e-9
"""To keep the windows of an exact sweep, for the n√n of n faces: its memory is what takes long."""
PER_FACE_CROSSED, PER_WINDOW_CROSSED = 8e-6, 0.2e-6
"""For each face that an isoline crosses; for √n more, by the windows of an exact sweep."""
PER_FACE_BLOCKED = 0.4e-6
"""To make a mesh with barriers: for each of its faces."""
PER_PATH = 0.3e-3
"""To trace a path and to write it down."""

# Bytes of state, beside the mesh
SWEEP_BYTES, SWEEP_BYTES_PER_FACE = 82_000, 100
MERGING_BYTES_PER_FACE = 120
TRACING_BYTES_PER_FACE, KEEPING_BYTES_PER_FACE = 170, 600
"""Of an approximate sweep, where it keeps what paths need, and where it keeps its windows."""
KEEPING_BYTES = 260_000
"""Room for the first windows that are kept."""
BYTES_OF_WINDOWS_KEPT = 30
"""Of those of an exact sweep, for the n√n of n faces."""
FACES_KEPT = 1.5
"""Faces whose windows isolines need, for each that a level crosses."""
SEARCH_BYTES, SEARCH_BYTES_PER_FACE = 230_000, 275

FACES_ON_LEVEL = 4.0
"""Faces that an isoline crosses, for the √n of n faces: about those of a great circle"""
CROSSINGS = 2.3
"""Edges that a path crosses over the length of one."""
ARC_IN_FACE = 0.45
"""How long a line is in a face that it crosses, in edges."""
PIECES_IN_FACE, PIECES_BY_WINDOWS = 2.0, 0.05
"""Of an isoline, in a face: at least, and for √n more, by the windows of an exact sweep."""


@dataclass(frozen=True)
class Cost:
    """Seconds, and bytes of the state that ``GEODESIC_QUERY_MEMORY_BYTES`` limits."""

    seconds: float
    memory_bytes: int


def sweep_cost(
    faces: int,
    request: Accuracy,
    share: float = 1.0,
    *,
    paths: bool = False,
    crossed: float | None = None,
) -> Cost:
    """Return the cost of a sweep over a share of so many faces, and of what it keeps.

    ``crossed`` is the share of the faces that isolines cross; None where there are to be none.
    """
    memory = SWEEP_BYTES
    if request.method == "exact":
        seconds = _sweep_seconds(share * faces)
        memory += SWEEP_BYTES_PER_FACE * faces
        if crossed is not None:  # it runs a second time, and keeps the windows of those faces then
            windows = min(FACES_KEPT * crossed, share) * faces * math.sqrt(share * faces)
            seconds += seconds + PER_WINDOW_KEPT * windows
            memory += KEEPING_BYTES + round(BYTES_OF_WINDOWS_KEPT * windows)
    else:
        seconds = PER_SWEEP + PER_FACE_MERGED * share * faces
        if crossed is not None:
            memory += KEEPING_BYTES + KEEPING_BYTES_PER_FACE * faces
        else:
            memory += (TRACING_BYTES_PER_FACE if paths else MERGING_BYTES_PER_FACE) * faces
    return Cost(seconds + PER_FACE_UNSWEPT * faces, memory)


def sweeps_cost(faces: int, shares: Sequence[float], threads: int) -> Cost:
    """Return the cost of exact sweeps over shares of so many faces, in some threads."""
    seconds = sum(_sweep_seconds(share * faces) for share in shares)
    memory = SWEEP_BYTES + SWEEP_BYTES_PER_FACE * faces
    return Cost(PER_FACE_UNSWEPT * faces * threads + seconds / threads, memory * threads)


def search_cost(faces: int, count: int) -> Cost:
    """Return the cost of searches between two points each, on so many faces."""
    seconds = count * (PER_SEARCH + PER_FACE_SEARCHED * faces)
    return Cost(seconds, SEARCH_BYTES + SEARCH_BYTES_PER_FACE * faces)


def _sweep_seconds(faces: float) -> float:
    return PER_SWEEP + faces * (PER_FACE + PER_WINDOWS * math.sqrt(faces))


# Lengths, which geodesics are at least and seldom by much


def straight_between(
    mesh: gc.TriangleMesh, sources: Places, targets: Places, max_distance: float | None
) -> NDArray[np.float64]:
    """Return the straight distances (N, M); infinite where there is no path, or none so short."""
    table: NDArray[np.float64] = cdist(positions_of(mesh, sources), positions_of(mesh, targets))
    table[components_of(mesh, sources)[:, None] != components_of(mesh, targets)] = np.inf
    return _limited(table, max_distance)


def straight_along(
    mesh: gc.TriangleMesh, sources: Places, targets: Places, max_distance: float | None
) -> NDArray[np.float64]:
    """Return the same (N,) for pairs."""
    away = np.linalg.norm(positions_of(mesh, sources) - positions_of(mesh, targets), axis=1)
    away[components_of(mesh, sources) != components_of(mesh, targets)] = np.inf
    return _limited(away, max_distance)


def straight_to_nearest(
    mesh: gc.TriangleMesh, sources: Places, targets: Places | None, max_distance: float | None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the straight distances of targets, or of all vertices, and the nearest sources."""
    ends = mesh.vertices if targets is None else positions_of(mesh, targets)
    components = mesh.components if targets is None else components_of(mesh, targets)
    away, nearest = KDTree(positions_of(mesh, sources)).query(ends)
    away[~np.isin(components, components_of(mesh, sources))] = np.inf
    return _limited(away, max_distance), nearest


def share_within(mesh: gc.TriangleMesh, radius: Any) -> Any:
    """Return the share of the surface within a radius of a point, were it flat; of an array too."""
    return _share(radius, _area(mesh))


def rough_share(size: MeshSize, sources: int, radius: float | None) -> float:
    """Return about which share of the surface is within a radius of so many points, or all."""
    if radius is None:
        return 1.0
    area = size.faces * math.sqrt(3.0) / 4.0 * size.edge**2
    return min(1.0, sources * float(_share(radius, area or math.inf)))


def _share(radius: Any, area: float) -> Any:
    with np.errstate(over="ignore"):
        return np.minimum(1.0, math.pi * np.square(radius) / area)


def typical_edge(mesh: gc.TriangleMesh) -> float:
    """Return the length of the edges, were all faces equal and equilateral; mesh units."""
    return math.sqrt(4.0 / math.sqrt(3.0) * _area(mesh) / len(mesh.faces))


def _area(mesh: gc.TriangleMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return area or math.inf


def _limited(away: NDArray[np.float64], max_distance: float | None) -> NDArray[np.float64]:
    if max_distance is not None:
        away[away > max_distance] = np.inf
    return away

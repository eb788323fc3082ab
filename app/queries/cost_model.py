"""The expected cost of a query: a small model of the size of the mesh and of the query.

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

import geodesic_core as gc
from app.queries.points import SurfacePoints, components_of, positions_of
from app.queries.validation import MeshSize
from app.schemas.requests import Accuracy, AccuracyOrEffort

# Seconds
PER_POINT = 12e-6
"""To resolve a point, and to describe it."""
PER_POSITION = 60e-6
"""To find the point nearest to a position."""
PER_FACE, PER_WINDOWS = 0.4e-6, 2.5e-9
"""Of an exact sweep: for each of its n faces, and for the windows on it, which are about √n."""
PER_FACE_MERGED = 0.5e-6
"""Of an approximate sweep."""
PER_FACE_PASSED, PER_PLACE = 0.05e-6, 0.14e-6
"""Of a fast sweep: for each face, and for each of its places, which are as many as the effort."""
PER_SWEEP = 0.3e-3
"""To start and to end a sweep, however short it is."""
PER_FACE_UNSWEPT = 0.03e-6
"""To allocate the state of a face."""
PER_SEARCH, PER_FACE_SEARCHED = 0.5e-3, 0.08e-6
"""For a path between two points: each, and for each face of the mesh."""
PER_WINDOW_RETAINED = 50e-9
"""To retain the windows of an exact sweep, for the n√n of n faces: memory takes most of it."""
PER_FACE_CROSSED, PER_WINDOW_CROSSED = 8e-6, 0.2e-6
"""For each face that an isoline crosses; for √n more, by the windows of an exact sweep."""
PER_FACE_DIVIDED, PER_WINDOW_DIVIDED = 40e-6, 2.5e-6
"""For each face that a border crosses; for √(n / k) more of k sources, by their windows."""
PER_FACE_BLOCKED = 0.4e-6
"""To make a mesh with barriers: for each of its faces."""
PER_PATH = 0.3e-3
"""To trace a path, and to describe it."""

# Bytes of state, beside the mesh
SWEEP_BYTES, SWEEP_BYTES_PER_FACE = 82_000, 100
MERGING_BYTES_PER_FACE = 120
TRACING_BYTES_PER_FACE, RETAINING_BYTES_PER_FACE = 170, 600
"""Of an approximate sweep that retains what paths need, and of one that retains its windows."""
RETAINING_BYTES = 260_000
"""Room for the first windows that are retained."""
BYTES_OF_WINDOWS_RETAINED = 30
"""Of the windows of an exact sweep, for the n√n of n faces."""
FACES_RETAINED = 1.5
"""Faces whose windows isolines need, for each that a level crosses."""
FAST_BYTES, FAST_BYTES_PER_FACE, BYTES_PER_PLACE = 270_000, 28, 24
"""Of a fast sweep: room for the windows that wait; for each face, and for each of its places."""
SEARCH_BYTES, SEARCH_BYTES_PER_FACE = 230_000, 275

SWEPT_FROM = 6
"""Pairs of one point from which on an exact matrix of pairs sweeps; it searches for fewer."""

FACES_ON_LEVEL = 4.0
"""Faces that an isoline crosses, for the √n of n faces: about those of a great circle."""
CROSSINGS = 2.3
"""Edges that a path crosses over the length of one."""
ARC_IN_FACE = 0.45
"""Length of a line in a face that it crosses, in edges."""
SEGMENTS_IN_FACE = 2.3
"""Of an isoline or a border, in a face: at least."""


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
    """Return the cost of a sweep over a share of some faces, and of what it retains.

    ``crossed`` is the share of the faces that isolines cross; None without isolines.
    """
    memory = SWEEP_BYTES
    if request.method == "exact":
        seconds = _sweep_seconds(share * faces)
        memory += SWEEP_BYTES_PER_FACE * faces
        if crossed is not None:  # a second sweep retains the windows of those faces
            windows = min(FACES_RETAINED * crossed, share) * faces * math.sqrt(share * faces)
            seconds += seconds + PER_WINDOW_RETAINED * windows
            memory += RETAINING_BYTES + round(BYTES_OF_WINDOWS_RETAINED * windows)
    elif isinstance(request, AccuracyOrEffort) and request.effort is not None:
        seconds = PER_SWEEP + (PER_FACE_PASSED + PER_PLACE * request.effort) * share * faces
        memory = FAST_BYTES + (FAST_BYTES_PER_FACE + BYTES_PER_PLACE * request.effort) * faces
    else:
        seconds = PER_SWEEP + PER_FACE_MERGED * share * faces
        if crossed is not None:
            memory += RETAINING_BYTES + RETAINING_BYTES_PER_FACE * faces
        else:
            memory += (TRACING_BYTES_PER_FACE if paths else MERGING_BYTES_PER_FACE) * faces
    return Cost(seconds + PER_FACE_UNSWEPT * faces, memory)


def sweeps_cost(faces: int, request: Accuracy, shares: Sequence[float], threads: int) -> Cost:
    """Return the cost of sweeps over shares of some faces, in some threads."""
    seconds = sum(sweep_cost(faces, request, share).seconds for share in shares)
    if request.method == "exact":  # the sweeps of a thread share their state
        seconds -= PER_FACE_UNSWEPT * faces * (len(shares) - threads)
    return Cost(seconds / threads, sweep_cost(faces, request).memory_bytes * threads)


def search_cost(faces: int, count: int) -> Cost:
    """Return the cost of searches between two points each, on some faces."""
    seconds = count * (PER_SEARCH + PER_FACE_SEARCHED * faces)
    return Cost(seconds, SEARCH_BYTES + SEARCH_BYTES_PER_FACE * faces)


def _sweep_seconds(faces: float) -> float:
    return PER_SWEEP + faces * (PER_FACE + PER_WINDOWS * math.sqrt(faces))


# Straight distances: lower bounds of geodesic ones, and seldom much less


def straight_between(
    mesh: gc.TriangleMesh,
    sources: SurfacePoints,
    targets: SurfacePoints,
    max_distance: float | None,
) -> NDArray[np.float64]:
    """Return the straight distances (N, M); infinite between components and beyond the limit."""
    from scipy.spatial.distance import cdist

    table: NDArray[np.float64] = cdist(positions_of(mesh, sources), positions_of(mesh, targets))
    table[components_of(mesh, sources)[:, None] != components_of(mesh, targets)] = np.inf
    return _limited(table, max_distance)


def straight_along(
    mesh: gc.TriangleMesh,
    sources: SurfacePoints,
    targets: SurfacePoints,
    max_distance: float | None,
) -> NDArray[np.float64]:
    """Return the straight distances (N,) of pairs, infinite in the same cases."""
    straight = np.linalg.norm(positions_of(mesh, sources) - positions_of(mesh, targets), axis=1)
    straight[components_of(mesh, sources) != components_of(mesh, targets)] = np.inf
    return _limited(straight, max_distance)


def straight_to_nearest(
    mesh: gc.TriangleMesh,
    sources: SurfacePoints,
    targets: SurfacePoints | None,
    max_distance: float | None,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the straight distances of targets, or of all vertices, and the nearest sources."""
    from scipy.spatial import KDTree

    ends = mesh.vertices if targets is None else positions_of(mesh, targets)
    components = mesh.components if targets is None else components_of(mesh, targets)
    straight, nearest = KDTree(positions_of(mesh, sources)).query(ends)
    straight[~np.isin(components, components_of(mesh, sources))] = np.inf
    return _limited(straight, max_distance), nearest


def share_within(mesh: gc.TriangleMesh, radius: Any) -> Any:
    """Return the share of a flat surface within a radius of a point; elementwise for an array."""
    return _share(radius, _area(mesh))


def share_reached(mesh: gc.TriangleMesh, sources: int, radius: float | None) -> float:
    """Return the share of a flat surface within a radius of some points; 1 without a radius."""
    return 1.0 if radius is None else min(1.0, sources * float(share_within(mesh, radius)))


def rough_share(size: MeshSize, sources: int, radius: float | None) -> float:
    """Return the share of the surface within a radius of some points, about; 1 without a radius."""
    if radius is None:
        return 1.0
    area = size.faces * math.sqrt(3.0) / 4.0 * size.edge**2
    return min(1.0, sources * float(_share(radius, area or math.inf)))


def _share(radius: Any, area: float) -> Any:
    with np.errstate(over="ignore"):
        return np.minimum(1.0, math.pi * np.square(radius) / area)


def typical_edge(mesh: gc.TriangleMesh) -> float:
    """Return the length of an edge (mesh units) if all faces were equal and equilateral."""
    return math.sqrt(4.0 / math.sqrt(3.0) * _area(mesh) / len(mesh.faces))


def _area(mesh: gc.TriangleMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return area or math.inf


def _limited(straight: NDArray[np.float64], max_distance: float | None) -> NDArray[np.float64]:
    if max_distance is not None:
        straight[straight > max_distance] = np.inf
    return straight

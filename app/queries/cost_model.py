"""The seconds that a query takes, about: by them the queue tells small work from long.

The constants were measured on one core of an AMD EPYC, kernels compiled, on meshes of 10³ to 10⁵
faces: the samples, and scans such as the horse and the dragon of `benchmarks`. They depend on the
machine, and on the shape of a mesh by a factor of 3.
"""

import math

from app.queries.validation import MeshSize
from app.schemas.requests import Accuracy, AccuracyOrEffort

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
PER_FACE_CROSSED = 8e-6
"""For each face that an isoline crosses."""
PER_FACE_DIVIDED = 0.2e-3
"""For each face that a border crosses, and the windows over it."""
PER_FACE_BLOCKED = 0.4e-6
"""To make a mesh with barriers: for each of its faces."""
PER_FACE_SCANNED = 0.02e-6
"""To look for the boundary, or for a level of given values: for each face."""
PER_FACE_STORED = 3e-6
"""To make a mesh and to store it: for each of its faces."""
PER_FACE_CERTIFIED = 30e-6
"""To prove distances and to measure paths to all vertices: for each face, however few are swept."""
PER_WINDOW_FOLLOWED = 2e-6
"""To tell the steps of windows: for each of n√n, of n faces."""
PER_PATH = 0.3e-3
"""To trace a path, and to describe it."""
DIRECTED = 1.1
"""Time of a sweep whose windows carry directions, for that of another."""
PER_FACE_TRACED = 2e-6
"""For each face that a straight line crosses, about one for each mean edge of its length."""
SWEEPS_OF_SAMPLES, SWEEPS_OF_ITERATION, SWEEPS_OF_MEAN = 6.0, 1.3, 10.0
"""Of farthest points, in all; of an iteration that relaxes them; of the search for a mean."""
SWEEPS_OF_LOOPS = 6.0
"""Of the shortest loop through a point, and of the loops of handles."""
FACES_ON_LEVEL = 4.0
"""Faces that an isoline crosses, for the √n of n faces: about those of a great circle."""


def sweep_seconds(faces: int, request: Accuracy, share: float) -> float:
    """Return the seconds of a sweep over a share of some faces."""
    swept = share * faces
    if request.method == "exact":
        seconds = PER_SWEEP + swept * (PER_FACE + PER_WINDOWS * math.sqrt(swept))
    elif isinstance(request, AccuracyOrEffort) and request.effort is not None:
        seconds = PER_SWEEP + (PER_FACE_PASSED + PER_PLACE * request.effort) * swept
    else:
        seconds = PER_SWEEP + PER_FACE_MERGED * swept
    return seconds + PER_FACE_UNSWEPT * faces


def faces_crossed(faces: int, lines: float, share: float) -> float:
    """Return the faces that some lines cross, of a share of all."""
    return min(faces, lines * FACES_ON_LEVEL * math.sqrt(faces)) * share


def search_seconds(faces: int, count: int) -> float:
    """Return the seconds of searches between two points each, on some faces."""
    return count * (PER_SEARCH + PER_FACE_SEARCHED * faces)


def share_reached(size: MeshSize, sources: int, radius: float | None) -> float:
    """Return the share of a flat surface within a radius of some points; 1 without a radius."""
    if radius is None:
        return 1.0
    area = size.faces * math.sqrt(3.0) / 4.0 * size.edge**2
    if area == 0.0:
        return 1.0
    return min(1.0, sources * math.pi * radius * radius / area)

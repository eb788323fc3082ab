"""The bounds of a sweep: its limit, the errors granted to merging, and pruning (section 5)."""

import math
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Singles

LANDMARKS = 16  # of a mesh, at most: a cache line of distances per vertex


class PruningBounds(NamedTuple):
    """Limits of a pruned sweep (section 5): it looks for paths through a start, up to a length.

    Lower bounds come from straight distances to the start, from landmarks and, where a sweep has
    been before, from its values, up to the ceiling within which it pruned nothing.
    """

    positions: Floats
    """(V, 3): of the vertices"""
    position: Floats
    """(3,): of the start"""
    limit: float
    """How long a path may be in all, mesh units; infinite where nothing is pruned"""
    landmarks: Singles
    """(V, LANDMARKS): distances from landmarks, or (0, LANDMARKS)"""
    least: Floats
    """(LANDMARKS,): lower bounds of the start's exact distances from the landmarks"""
    most: Floats
    """(LANDMARKS,): upper bounds of the same"""
    landmark_count: int
    known: Floats
    """(V,): distances of an earlier sweep, or (0,)"""
    ceiling: float
    """The limit of that sweep"""


def pruning_toward(
    positions: Floats,
    position: Floats,
    limit: float,
    known: Floats | None = None,
    ceiling: float = math.inf,
) -> PruningBounds:
    """Return the bounds of paths to a position, of which no landmarks are known."""
    return PruningBounds(
        positions=positions,
        position=position,
        limit=limit,
        landmarks=np.empty((0, LANDMARKS), np.float32),
        least=np.zeros(LANDMARKS),
        most=np.zeros(LANDMARKS),
        landmark_count=0,
        known=np.empty(0) if known is None else known,
        ceiling=ceiling,
    )


_NO_POSITIONS = np.empty((0, 3))
_NO_POSITIONS.flags.writeable = False  # as those of meshes: kernels are compiled for that type

NO_PRUNING = pruning_toward(_NO_POSITIONS, np.zeros(3), math.inf)
"""The bounds of a sweep that is not pruned."""


class Bounds(NamedTuple):
    """All limits of a sweep."""

    max_distance: float
    """Windows wholly beyond it are dropped; mesh units, may be infinite"""
    relative_error: float
    """A window may fall short of the exact distance by this share of it, ..."""
    absolute_error: float
    """... and by no more than this; mesh units"""
    merging: tuple[int, ...]
    """Empty in an exact sweep. Its length is part of its type: kernels are compiled twice, and the
    exact ones carry nothing of merging"""
    pruning: PruningBounds
    parallel: tuple[int, ...]
    """Empty where no source is a curve; by its length, as above, where windows may be parallel"""
    first_segment: int
    """The first node that is a segment of a curve, if there are any"""
    directed: tuple[int, ...] = ()
    """Empty unless the windows of an exact sweep carry directions; by its length, as above. Two
    where edges have several faces, so that frames are seen in the mirror: that costs 3 % more"""
    directed_from_bends: bool = False
    """Whether windows that leave a bend carry directions there, as those from sources do"""


def exact_bounds(max_distance: float, pruning: PruningBounds = NO_PRUNING) -> Bounds:
    """Return the bounds of a sweep that never merges."""
    return Bounds(max_distance, 0.0, 0.0, (), pruning, (), 0)


def merging_bounds(
    max_distance: float,
    relative_error: float,
    absolute_error: float,
    pruning: PruningBounds = NO_PRUNING,
) -> Bounds:
    """Return the bounds of a sweep that merges windows within both errors."""
    return Bounds(max_distance, relative_error, absolute_error, (1,), pruning, (), 0)


def without_merging(bounds: Bounds) -> Bounds:
    """Return the bounds of the same sweep, exactly."""
    return bounds._replace(merging=())


def with_directions(bounds: Bounds, mirrors: bool, from_bends: bool) -> Bounds:
    """Return the bounds of the same exact sweep whose windows carry directions."""
    return bounds._replace(directed=(1, 1) if mirrors else (1,), directed_from_bends=from_bends)


def with_parallel_windows(bounds: Bounds, first_segment: int) -> Bounds:
    """Return the bounds of the same sweep from curves whose segments are the nodes from there."""
    return bounds._replace(parallel=(1,), first_segment=first_segment)

"""Distances and paths of any point of the surface, from a field.

An exact field with windows reaches the point by those of its face. Else an exact sweep runs back
from the point to the nearest source, pruned by the field: its values bound the rest of every path
from below, as those of step 2 do in a search between two points (section 5). So only a thin strip
around the answer is swept.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.fields.path import EXACT, GeodesicPath, reversed_path, traced_path
from geodesic_core.fields.sources import Nodes, corners_of, nodes_of
from geodesic_core.fields.sweep import sweep_nodes, winners_of
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.retained.face_windows import FaceWindows, Reach, reach_point
from geodesic_core.kernels.sweep import state
from geodesic_core.kernels.sweep.bounds import Bounds, exact_bounds, pruning_toward
from geodesic_core.kernels.sweep.state import SITE
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SEARCH_SLACK, TIE


class Arrival(NamedTuple):
    """Arrival of windows at a point that is no vertex."""

    distance: float
    """Mesh units; infinite where the point is not reached"""
    source: int
    """Index of the nearest source; -1 where the point is not reached"""
    reach: Reach


def arrival_at(
    mesh: TriangleMesh,
    winners: Winners,
    windows: FaceWindows,
    nodes: Nodes,
    point: SurfacePoint,
    max_distance: float,
) -> Arrival:
    """Return the shortest arrival at a canonical point; O(windows of its faces)."""
    reaches = (
        reach_point(mesh.topology, winners, windows, nodes.first_target, face, np.array(weights))
        for face, weights in weights_by_face(mesh, point).items()
    )
    best = min(reaches, key=lambda reach: reach[0])
    reach = Reach(*best)
    if math.isinf(reach.distance) or reach.distance > max_distance:
        return Arrival(math.inf, -1, reach)
    return Arrival(reach.distance, int(winners.nearest[reach.predecessor]), reach)


def with_target(
    mesh: TriangleMesh, winners: Winners, nodes: Nodes, point: SurfacePoint, arrival: Arrival
) -> tuple[Winners, Nodes, int]:
    """Return winners and nodes with one more node, at the point, and its number; O(V)."""
    node, reach = len(winners.distance), arrival.reach
    faces = weights_by_face(mesh, point)
    rows = np.array([(node, face, -1) for face in faces], np.int32).reshape(-1, SITE)
    return (
        winners._replace(
            nearest=np.append(winners.nearest, np.int32(arrival.source)),
            distance=np.append(winners.distance, arrival.distance),
            winner=np.vstack([winners.winner, [reach.sx, reach.sy]]),
            winner_ints=np.vstack(
                [winners.winner_ints, np.array([reach.entry_edge, reach.predecessor], np.int32)]
            ),
            site_ints=np.vstack([winners.site_ints, rows]),
            site_weights=np.vstack([winners.site_weights, list(faces.values())]),
        ),
        replace(
            nodes,
            points=(*nodes.points, point),
            positions=np.vstack([nodes.positions, mesh.position_from_origin(point)]),
        ),
        node,
    )


class NearestSource(NamedTuple):
    """The source nearest to a point, its exact distance, and how to trace the path from there."""

    source: int
    """Index into the sources of the field; -1 where there is no path"""
    distance: float
    """Mesh units, the source's start distance counted; infinite where there is no path"""
    path: Callable[[], GeodesicPath] | None
    """Traces the path; None where there is none"""


def find_nearest_source(
    mesh: TriangleMesh,
    sources: Sequence[SurfacePoint],
    start_distances: Floats,
    known: Floats,
    bounds: Bounds,
    point: SurfacePoint,
    control: Control,
) -> NearestSource:
    """Return the nearest source of a field whose vertices have the distances ``known``.

    ``bounds`` are those of the field. ``known`` is by inner vertex; more values may follow. O(faces
    in the strip), and O(V + F) for memory.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `run_sweep`.
    """
    nodes = nodes_of(mesh, [(point,)], sources, control)
    corners, reaches = corners_of(mesh, point)
    least = known[: len(mesh.vertices)]
    upper = float((_most(least[corners], bounds) + reaches).min())
    upper = min(
        upper, _within_face(mesh, sources, start_distances, point, control), bounds.max_distance
    )
    if math.isinf(upper):
        return NearestSource(-1, math.inf, None)
    # A vertex beyond the limit of the field is at least as far as that.
    rest = np.minimum(least, bounds.max_distance)
    pruning_bounds = pruning_toward(np.zeros(3), upper * (1.0 + SEARCH_SLACK), rest)
    wave = state.new_wavefront(mesh.topology, nodes.sites, pruned=True)
    control.check_memory(state.bytes_of(wave))
    backward = exact_bounds(math.inf, pruning_bounds)
    wave = sweep_nodes(mesh, wave, nodes, np.zeros(1), backward, control, lambda _: 0.0)
    totals = wave.vertices.distance[nodes.targets] + start_distances
    distance = float(totals.min())
    if distance > bounds.max_distance:
        return NearestSource(-1, math.inf, None)
    nearest = int(np.flatnonzero(totals <= distance * (1.0 + TIE))[0])

    def path() -> GeodesicPath:
        winners = winners_of(wave, np.zeros(len(wave.vertices.distance), np.int32))
        traced = traced_path(mesh, winners, nodes, int(nodes.targets[nearest]), EXACT)
        return reversed_path(traced)

    return NearestSource(nearest, float(totals[nearest]), path)


def _most(least: Floats, bounds: Bounds) -> Floats:
    """Return the largest distances that these values of a field allow."""
    if not bounds.merging:
        return least
    return np.minimum(least / (1.0 - bounds.relative_error), least + bounds.absolute_error)


def _within_face(
    mesh: TriangleMesh,
    sources: Sequence[SurfacePoint],
    starts: Floats,
    point: SurfacePoint,
    control: Control,
) -> float:
    """Return the length of the straight path to the nearest source in the face of a point."""
    position = mesh.position_from_origin(point)
    return min(
        (
            start + float(np.linalg.norm(mesh.position_from_origin(source) - position))
            for source, start in control.watched(zip(sources, starts.tolist(), strict=True))
            if source.face_index == point.face_index
        ),
        default=math.inf,
    )

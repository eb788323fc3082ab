"""How any point is reached by the windows that an exact sweep kept, and the way back from there."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.isolines.face_windows import FaceWindows, Reach, reach_point
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.sweep.state import SITE
from geodesic_core.mesh.curve import weights_by_face
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class Arrival(NamedTuple):
    """How a point that is no vertex is reached."""

    distance: float
    """Mesh units; infinite where the point is not reached"""
    source: int
    """Index of the nearest source; -1 where the point is not reached"""
    reach: Reach


def arrival_at(
    mesh: TriangleMesh,
    winners: Winners,
    kept: FaceWindows,
    nodes: Nodes,
    point: SurfacePoint,
    max_distance: float,
) -> Arrival:
    """Return how a canonical point is reached; O(windows of its faces)."""
    ways = (
        reach_point(mesh.topology, winners, kept, nodes.first_target, face, np.array(weights))
        for face, weights in weights_by_face(mesh, point).items()
    )
    best = min(ways, key=lambda way: way[0])
    reach = Reach(*best)
    if math.isinf(reach.distance) or reach.distance > max_distance:
        return Arrival(math.inf, -1, reach)
    return Arrival(reach.distance, int(winners.nearest[reach.root]), reach)


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
                [winners.winner_ints, np.array([reach.via, reach.root], np.int32)]
            ),
            site_ints=np.vstack([winners.site_ints, rows]),
            site_weights=np.vstack([winners.site_weights, list(faces.values())]),
        ),
        replace(
            nodes,
            points=(*nodes.points, point),
            positions=np.vstack([nodes.positions, mesh.position(point)]),
        ),
        node,
    )

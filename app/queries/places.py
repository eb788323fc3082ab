"""The points of a query on its mesh, and what answers say of them."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.errors import Fault
from app.queries.points import described, resolve
from app.queries.validation import FAULTS_SHOWN, Named, refuse_points
from app.schemas.points import EdgePoint, FacePoint, Point
from geodesic_core.fields.sources import component_of

Places = Sequence[gc.SurfacePoint]


def resolved(
    named: Named, mesh: gc.TriangleMesh, cancel: Callable[[], bool]
) -> list[gc.SurfacePoint]:
    """Return the points of the mesh that are meant, or refuse those that are none."""
    places: list[gc.SurfacePoint] = []
    faults: list[Fault] = []
    for where, point in named:
        checkpoint(cancel)
        try:
            places.append(resolve(mesh, point))
        except gc.errors.InvalidPoint as error:
            faults.append(Fault(f"{where}/{_at_fault(point)}", str(error)))
            if len(faults) == FAULTS_SHOWN:
                break
    if faults:
        raise refuse_points(faults)
    return places


def checkpoint(cancel: Callable[[], bool]) -> None:
    """Stop if the query is to stop."""
    if cancel():
        raise gc.errors.Cancelled("cancelled while points were looked for")


def components_of(mesh: gc.TriangleMesh, places: Places) -> NDArray[np.int64]:
    """Return the connected component of each point."""
    return np.array([component_of(mesh, place) for place in places], np.int64)


def positions_of(mesh: gc.TriangleMesh, places: Places) -> NDArray[np.float64]:
    """Return where points are, mesh units."""
    return np.array([described(mesh, place)["position"] for place in places]).reshape(-1, 3)


def unreachable(missed: NDArray[np.bool_], connected: NDArray[np.bool_]) -> dict[str, int]:
    """Return how many are missed by reason: not connected at all, or too far away."""
    return {
        "disconnected": int(np.count_nonzero(missed & ~connected)),
        "beyond_max_distance": int(np.count_nonzero(missed & connected)),
    }


def _at_fault(point: Point) -> str:
    """Return the member that is wrong with a point whose indices are sound."""
    match point:
        case EdgePoint():
            return "edge"
        case FacePoint():
            return "barycentric"
    return "position"

"""From a point as a client wrote it to the point of a mesh, and what answers say of that."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import geodesic_core as gc
from app.schemas.points import EdgePoint, FacePoint, Point, PositionPoint, VertexPoint


def resolve(mesh: gc.TriangleMesh, point: Point) -> gc.SurfacePoint:
    """Return the point of the mesh that is meant, in its one spelling.

    Raises
    ------
    InvalidPoint
        It is not on the mesh.
    """
    match point:
        case VertexPoint(vertex=vertex):
            return mesh.point(vertex)
        case EdgePoint(edge=(start, end), t=t):
            return mesh.point_on_edge(start, end, t)
        case FacePoint(face=face, barycentric=weights):
            return mesh.point(gc.SurfacePoint.face(face, weights))
        case PositionPoint(position=position, max_distance=limit):
            return mesh.locate(position, limit)


def described(mesh: gc.TriangleMesh, place: gc.SurfacePoint) -> Mapping[str, Any]:
    """Return what answers say of a resolved point: vertex, or face and weights, and position."""
    vertex = place.vertex_index
    if vertex is not None:  # many a query has thousands, and the mesh would check each again
        return {"vertex": vertex, "position": mesh.vertices[vertex].tolist()}
    position = mesh.position(place).tolist()
    return {"face": place.face_index, "barycentric": place.barycentric, "position": position}


def described_origin(
    mesh: gc.TriangleMesh, origin: gc.SurfacePoint | gc.Curve
) -> Mapping[str, Any]:
    """Return what answers say of where paths start: at a resolved point, or on a curve of such."""
    if isinstance(origin, gc.Curve):
        places = cast(Sequence[gc.SurfacePoint], origin.points)
        return {"polyline": [described(mesh, place) for place in places]}
    return described(mesh, origin)


def described_source(mesh: gc.TriangleMesh, source: gc.Source) -> Mapping[str, Any]:
    """Return what answers say of a resolved source: where it is, and what distances start at."""
    origin = described_origin(mesh, cast(gc.SurfacePoint | gc.Curve, source.point))
    return {**origin, "start_distance": source.start_distance}

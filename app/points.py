"""From a point as a client wrote it to the point of a mesh, and what answers say of that."""

from collections.abc import Mapping
from typing import Any

import geodesic_core as gc
from app.schemas import EdgePoint, FacePoint, Point, PositionPoint, VertexPoint


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


def described_source(mesh: gc.TriangleMesh, source: gc.Source) -> Mapping[str, Any]:
    """Return what answers say of a source: its point or its curve, and where it starts."""
    if isinstance(source.point, gc.Curve):
        line = [described(mesh, mesh.point(point)) for point in source.point.points]
        return {"polyline": line, "start_distance": source.start_distance}
    place = described(mesh, mesh.point(source.point))
    return {**place, "start_distance": source.start_distance}

"""Points of a query: from those that a client wrote to those of the mesh, and back into answers."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, islice, pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.errors import Fault
from app.queries.validation import FAULTS_SHOWN, WrittenPoints, invalid_points, naming
from app.schemas.points import (
    Curve,
    EdgePoint,
    FacePoint,
    Point,
    PointOrCurve,
    PositionPoint,
    Source,
    SurfaceCurve,
    VertexPoint,
)

SurfacePoints = Sequence[gc.SurfacePoint]

_GAP = (
    "shares no face with the point before it; add the points where the curve crosses edges: a "
    "shortest path has them"
)

# Points as clients write them


def numbered(pointer: str, points: Sequence[Point]) -> WrittenPoints:
    """Yield the points of a list, each with its pointer."""
    return ((f"{pointer}/{i}", point) for i, point in enumerate(points))


def points_in(pointer: str, written: PointOrCurve | Source) -> WrittenPoints:
    """Yield a point, or those of a curve, each with its pointer."""
    if isinstance(written, Curve):
        return numbered(f"{pointer}/polyline", written.polyline)
    return iter([(pointer, written)])


def points_in_sources(sources: Sequence[Source]) -> WrittenPoints:
    """Yield the points of sources, each with its pointer."""
    return chain.from_iterable(
        points_in(f"/sources/{i}", source) for i, source in enumerate(sources)
    )


def points_in_curves(curves: Sequence[SurfaceCurve]) -> WrittenPoints:
    """Yield the points of curves, each with its pointer."""
    return chain.from_iterable(
        numbered(f"/curves/{i}/polyline", curve.polyline) for i, curve in enumerate(curves)
    )


def point_count(*written: PointOrCurve | Source) -> int:
    """Return the number of points, those of curves counted one by one."""
    return sum(len(each.polyline) if isinstance(each, Curve) else 1 for each in written)


# Points of the mesh


def resolve_points(
    written: WrittenPoints, mesh: gc.TriangleMesh, cancel: Callable[[], bool]
) -> list[gc.SurfacePoint]:
    """Return the canonical point of the mesh for each written one.

    Raises
    ------
    ProblemError
        Some are not on the mesh.
    Cancelled
        ``cancel`` returned True.
    """
    points: list[gc.SurfacePoint] = []
    faults: list[Fault] = []
    for pointer, point in written:
        checkpoint(cancel)
        if not mesh.has_positions and isinstance(point, PositionPoint):
            with naming((gc.errors.NotEmbedded, f"{pointer}/position")):
                mesh.require_positions("a point by its position")
        try:
            points.append(resolve_point(mesh, point))
        except gc.errors.InvalidPoint as error:
            faults.append(Fault(f"{pointer}/{_member_at_fault(point)}", str(error)))
            if len(faults) == FAULTS_SHOWN:
                break
    if faults:
        raise invalid_points(faults)
    return points


FAR_SHARE = 0.05
"""Share of the bounding box's diagonal beyond which a position counts as far from the surface.

Picks on another resolution of a surface, and measured points, lie within some percent of it: the
cortex is 1.5 % of a hemisphere thick. Other units, another frame or a typing error lie beyond.
"""


def notes_on(
    mesh: gc.TriangleMesh,
    written: Iterable[tuple[str, Point]],
    points: SurfacePoints,
    name_of: Callable[[str], str] = str,
) -> Sequence[str]:
    """Return sentences on points that are hardly meant: far from the surface, or walled in.

    ``points`` are the resolved ones, in the order of the ``written``, and maybe others behind. A
    sentence begins with what ``name_of`` makes of the text that comes with a written point.
    """
    pairs = list(zip(written, points, strict=False))
    blocked = set(gc.walled_in(mesh, points[: len(pairs)]))
    notes = []
    for i, ((text, point), found) in enumerate(pairs):
        if i in blocked:
            notes.append(
                f"{name_of(text)}, {found}, lies in blocked faces only: no path leads there."
            )
        elif isinstance(point, PositionPoint) and point.max_distance is None:  # else it is allowed
            distance = float(np.linalg.norm(mesh.position(found) - point.position))
            if distance > FAR_SHARE * mesh.diagonal:
                notes.append(
                    f"{name_of(text)} is {distance:.7g} away from the surface, at "
                    f"{list(point.position)}; the nearest point of the surface was taken."
                )
    more = len(notes) - FAULTS_SHOWN
    return [*notes[:FAULTS_SHOWN], f"The same holds for {more} more points."] if more > 0 else notes


def name_of(pointer: str) -> str:
    """Return how sentences call the point at a pointer, such as ``Source 2`` or ``The target``."""
    name, *numbers = (part for part in pointer.split("/") if part not in ("", "polyline"))
    is_list = name.endswith("s") and bool(numbers)  # and not an axis
    named = f"{name[:-1]} {numbers.pop(0)}" if is_list else f"the {name.replace('_', ' ')}"
    if not numbers:
        return named.capitalize()
    return f"Point {numbers[0]} of {named}"


def checkpoint(cancel: Callable[[], bool]) -> None:
    """Raise ``Cancelled`` if the query is to stop."""
    if cancel():
        raise gc.errors.Cancelled("cancelled while points were looked for")


def to_point_or_curve(
    mesh: gc.TriangleMesh, pointer: str, written: PointOrCurve | Source, points: SurfacePoints
) -> gc.SurfacePoint | gc.Curve:
    """Return a point or a curve for the library, from its resolved points.

    Raises
    ------
    ProblemError
        A piece of the curve lies in no face.
    """
    if not isinstance(written, Curve):
        return points[0]
    _check_gaps(mesh, pointer, points)
    return gc.Curve(tuple(points))


def _check_gaps(mesh: gc.TriangleMesh, pointer: str, points: SurfacePoints) -> None:
    """Refuse a curve with a piece that lies in no face."""
    faults = (
        Fault(f"{pointer}/polyline/{i}", _GAP)
        for i, (start, end) in enumerate(pairwise(points), 1)
        if not gc.share_a_face(mesh, start, end)
    )
    shown = tuple(islice(faults, FAULTS_SHOWN))
    if shown:
        raise invalid_points(shown)


def split_points(curves: Sequence[SurfaceCurve], points: SurfacePoints) -> Sequence[SurfacePoints]:
    """Return the resolved points of each curve."""
    rest = iter(points)
    return [[next(rest) for _ in curve.polyline] for curve in curves]


def to_curves(
    mesh: gc.TriangleMesh, curves: Sequence[SurfaceCurve], points: Sequence[SurfacePoints]
) -> list[gc.SurfaceCurve]:
    """Return curves for the library, from the resolved points of each.

    Raises
    ------
    ProblemError
        A piece of a curve lies in no face.
    """
    found = []
    for i, (curve, own) in enumerate(zip(curves, points, strict=True)):
        place = f"/curves/{i}"
        _check_gaps(mesh, place, own)
        if curve.closed and not gc.share_a_face(mesh, own[-1], own[0]):
            message = "the last point shares no face with the first, so that no segment joins them"
            raise invalid_points([Fault(f"{place}/closed", message)])
        with naming((gc.errors.InvalidPoint, f"{place}/polyline")):
            found.append(mesh.curve(own, curve.closed))
    return found


def to_sources(
    mesh: gc.TriangleMesh, written: Sequence[Source], points: SurfacePoints
) -> list[gc.Source]:
    """Return sources for the library, from their resolved points; raises as `to_point_or_curve`."""
    rest = iter(points)
    return [
        gc.Source(
            to_point_or_curve(
                mesh, f"/sources/{i}", source, tuple(islice(rest, point_count(source)))
            ),
            source.start_distance,
        )
        for i, source in enumerate(written)
    ]


def components_of(mesh: gc.TriangleMesh, points: SurfacePoints) -> NDArray[np.int64]:
    """Return the connected component of each point."""
    vertices = [
        mesh.faces[point.face_index, 0] if point.vertex_index is None else point.vertex_index
        for point in points
    ]
    return mesh.components[np.array(vertices, np.int64)].astype(np.int64)


# Points in answers


def describe_point(mesh: gc.TriangleMesh, point: gc.SurfacePoint) -> Mapping[str, Any]:
    """Return the members of a resolved point: vertex, or face and weights, and any position."""
    vertex = point.vertex_index
    if vertex is not None:  # queries have thousands, and the mesh would check each again
        position = mesh.vertices[vertex].tolist() if mesh.has_positions else None
        return {"vertex": vertex, "position": position}
    position = mesh.position(point).tolist() if mesh.has_positions else None
    return {"face": point.face_index, "barycentric": point.barycentric, "position": position}


def describe_point_or_curve(
    mesh: gc.TriangleMesh, start: gc.SurfacePoint | gc.Curve
) -> Mapping[str, Any]:
    """Return the members of a resolved point, or of a curve of such points."""
    if isinstance(start, gc.Curve):
        points = cast(SurfacePoints, start.points)
        return {"polyline": [describe_point(mesh, point) for point in points]}
    return describe_point(mesh, start)


def describe_source(mesh: gc.TriangleMesh, source: gc.Source) -> Mapping[str, Any]:
    """Return the members of a resolved source: its point or curve, and its start distance."""
    start = describe_point_or_curve(mesh, cast(gc.SurfacePoint | gc.Curve, source.point))
    return {**start, "start_distance": source.start_distance}


def count_unreachable(missed: NDArray[np.bool_], connected: NDArray[np.bool_]) -> dict[str, int]:
    """Return the number of distances that are missing, by reason."""
    return {
        "disconnected": int(np.count_nonzero(missed & ~connected)),
        "beyond_max_distance": int(np.count_nonzero(missed & connected)),
    }


def resolve_point(mesh: gc.TriangleMesh, point: Point) -> gc.SurfacePoint:
    """Return the canonical point for a written one; raises ``InvalidPoint`` off the mesh."""
    match point:
        case VertexPoint(vertex=vertex):
            return mesh.point(vertex)
        case EdgePoint(edge=(start, end), t=t):
            return mesh.point_on_edge(start, end, t)
        case FacePoint(face=face, barycentric=weights):
            return mesh.point(gc.SurfacePoint.face(face, weights))
        case PositionPoint(position=position, max_distance=limit):
            return mesh.locate(position, limit)


def _member_at_fault(point: Point) -> str:
    """Return the member that is wrong with a point whose indices are in range."""
    match point:
        case EdgePoint():
            return "edge"
        case FacePoint():
            return "barycentric"
    return "position"

"""Lines on the surface: the common part of queries for isolines, borders and boundaries."""

from collections.abc import Sequence
from typing import Any

import geodesic_core as gc
from app.encoding import CSV, JSON, OBJ
from app.queries.outline import locations_of, points_of
from app.queries.validation import naming
from app.schemas.requests import AskingForLines

OFFERS: Sequence[str] = JSON, OBJ, CSV
"""Media types that hold lines."""
_VALUES_OF_POINT, _VALUES_OF_LOCATION = 4, 4
"""Values in JSON of a point of a line: its position, and the face of its segment; of a location."""


def resolved_chord_error(mesh: gc.TriangleMesh, chord_error: float | None) -> float:
    """Return the chord error of a request, mesh units, or refuse it; by default the library's."""
    with naming((gc.errors.InvalidArgument, "/chord_error")):
        return gc.resolve_chord_error(mesh, chord_error)


def are_located(mesh: gc.TriangleMesh, request: AskingForLines) -> bool:
    """Tell whether lines have locations: if included, and where they have no points in space."""
    return "locations" in request.include or not mesh.has_positions


def count_values(lines: Sequence[gc.SurfaceCurve], *, located: bool) -> int:
    """Return the number of values of lines in JSON, about."""
    each = _VALUES_OF_POINT + (_VALUES_OF_LOCATION if located else 0)
    return each * sum(len(line.faces) + (not line.closed) for line in lines)


def describe_line(line: gc.SurfaceCurve, *, located: bool) -> dict[str, Any]:
    """Return the members that every line has."""
    described = {
        "closed": line.closed,
        "length": line.length,
        "points": points_of(line),
        "faces": line.faces,
    }
    return described | ({"locations": locations_of(line)} if located else {})

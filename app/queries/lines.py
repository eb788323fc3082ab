"""Lines on the surface: the common part of queries for isolines and for borders."""

from collections.abc import Sequence
from typing import Any

import geodesic_core as gc
from app.encoding import CSV, JSON, OBJ
from app.queries.validation import naming

OFFERS: Sequence[str] = JSON, OBJ, CSV
"""Media types that hold lines."""
VALUES_OF_LINE_POINT = 4
"""Values in JSON of a point of a line: its position, and the face of its segment."""


def resolved_chord_error(mesh: gc.TriangleMesh, chord_error: float | None) -> float:
    """Return the chord error of a request, mesh units, or refuse it; by default the library's."""
    with naming((gc.errors.InvalidArgument, "/chord_error")):
        return gc.resolve_chord_error(mesh, chord_error)


def describe_line(line: gc.Isoline | gc.Border) -> dict[str, Any]:
    """Return the members that every line has."""
    return {
        "closed": line.closed,
        "length": line.length,
        "points": line.points,
        "faces": line.faces,
    }

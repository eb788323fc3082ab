"""The cells of sources."""

import math

import geodesic_core as gc
from app.encoding import CSV, JSON, Answer
from app.queries.accuracy import solve_field
from app.queries.base import VALUES_OF_POINT, ExecutionContext
from app.queries.cost_model import (
    PER_FACE_DIVIDED,
    PER_FACE_STORED,
    faces_crossed,
    sweep_seconds,
)
from app.queries.from_sources import FromSources
from app.queries.lines import resolved_chord_error
from app.queries.points import SurfacePoints, describe_point, describe_source, to_sources
from app.queries.validation import naming
from app.queries.views import table_of_points
from app.schemas.requests import Accuracy, CellsRequest
from app.store.meshes import OpenMesh

EXACT = Accuracy()


class CellsQuery(FromSources[CellsRequest]):
    """Areas, centroids and neighbours of the territories of ``sources``."""

    kind = "cells"
    model = CellsRequest
    offers = JSON, CSV
    hint = "ask for fewer sources at once"

    def value_count(self) -> int:
        """Return the number of values of the sources, the cells and their neighbours, about."""
        return 3 * VALUES_OF_POINT * self.source_count

    def rough_seconds(self) -> float:
        """Return the cost of three sweeps to the limit, of the borders, and of the cut mesh."""
        lines = math.sqrt(self.source_count - 1)
        sweep = sweep_seconds(self.size.faces, EXACT, self.share)
        crossed = faces_crossed(self.size.faces, lines, self.share)
        return 3 * sweep + PER_FACE_DIVIDED * crossed + PER_FACE_STORED * self.size.faces

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep, then cut along the borders."""
        request, mesh = self.request, opened.mesh
        chord_error = resolved_chord_error(mesh, request.chord_error)
        starts = to_sources(mesh, request.sources, points)
        field = solve_field(
            opened, EXACT, starts, context.part(0, 2), max_distance=request.max_distance
        )
        cells = field.cells(chord_error, **context.part(1, 2).options)
        centroids = None
        if not any(isinstance(start.point, gc.Curve) for start in starts):
            with naming((gc.errors.NoTangentPlane, "/sources")):
                centroids = [
                    None if point is None else describe_point(mesh, point)
                    for point in cells.centroids
                ]
        pairs = zip(cells.adjacency.tolist(), cells.border_lengths.tolist(), strict=True)
        members = self.members(
            opened,
            chord_error=chord_error,
            sources=[describe_source(mesh, start) for start in starts],
            areas=cells.areas.tolist(),
            centroids=centroids,
            neighbours=[{"sources": pair, "length": length} for pair, length in pairs],
        )
        rows = [
            {**(each or {}), "area": area}
            for each, area in zip(centroids or [None] * len(cells), members["areas"], strict=True)
        ]
        return Answer(
            members, shown=("areas", "centroids"), table=table_of_points("source", rows, "area")
        )

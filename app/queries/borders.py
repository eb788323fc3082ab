"""Borders between the territories of sources."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import Answer
from app.queries.accuracy import affinity_keys_of, expected_stats, solve_field, stats_of
from app.queries.base import ExecutionContext, Forecast, Query
from app.queries.cost_model import (
    FACES_ON_LEVEL,
    PER_FACE_DIVIDED,
    PER_POINT,
    PER_WINDOW_DIVIDED,
    SEGMENTS_IN_FACE,
    Cost,
    rough_share,
    share_reached,
    straight_to_nearest,
    sweep_cost,
)
from app.queries.lines import (
    OFFERS,
    VALUES_OF_LINE_POINT,
    describe_line,
    resolved_chord_error,
    straight_line,
)
from app.queries.points import (
    SurfacePoints,
    describe_source,
    point_count,
    points_in_sources,
    to_sources,
)
from app.queries.validation import (
    MeshSize,
    WrittenPoints,
    check_count,
    check_json_size,
)
from app.queries.views import lines_of_borders
from app.schemas.requests import Accuracy, BordersRequest
from app.settings import Settings
from app.store.meshes import OpenMesh

EXACT = Accuracy()


class BordersQuery(Query[BordersRequest]):
    """The points that are equally near to two of ``sources``, as polylines."""

    kind = "borders"
    model = BordersRequest
    offers = OFFERS
    hint = "set a larger chord_error, or a max_distance"

    def check_limits(self, size: MeshSize, settings: Settings) -> None:
        """Refuse too many sources."""
        check_count("sources", point_count(*self.request.sources), settings, "max_sources")

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The exact field of these sources, and the mesh."""
        return affinity_keys_of(self, self.request.sources)

    def written_points(self) -> WrittenPoints:
        """Yield the sources."""
        return points_in_sources(self.request.sources)

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of two sweeps to the limit, and of the lines."""
        request = self.request
        share = rough_share(size, point_count(*request.sources), request.max_distance)
        lines = math.sqrt(len(request.sources) - 1)  # as the length of all borders grows
        crossed = min(1.0, lines * FACES_ON_LEVEL / math.sqrt(size.faces)) * share
        sweep = sweep_cost(size.faces, EXACT, share, crossed=crossed)
        each = _seconds_per_face(share * size.faces, len(request.sources))
        return sweep.seconds + each * crossed * size.faces

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep, then draw the borders, if they fit into the answer."""
        request = self.request
        chord_error = resolved_chord_error(opened.mesh, request.chord_error)
        starts = to_sources(opened.mesh, request.sources, points)
        field = solve_field(
            opened, EXACT, starts, context.part(0, 2), max_distance=request.max_distance
        )
        borders = field.borders(chord_error, **context.part(1, 2).options)
        values = VALUES_OF_LINE_POINT * sum(len(border.points) for border in borders)
        check_json_size(values, context.max_values, self.hint)
        found = [describe_border(border) for border in borders]
        return self._answer(opened, starts, chord_error, found, stats_of(field.stats))

    def forecast(self, opened: OpenMesh, points: SurfacePoints) -> Forecast:
        """Return the cost of two sweeps and of the lines, if geodesics were straight."""
        request, mesh = self.request, opened.mesh
        chord_error = resolved_chord_error(mesh, request.chord_error)
        starts = to_sources(mesh, request.sources, points)
        share = share_reached(mesh, len(points), request.max_distance)
        straight, nearest = straight_to_nearest(mesh, points, None, request.max_distance)
        faces = _divided_faces(mesh, straight, nearest) if len(starts) > 1 else np.empty(0, int)
        found = [{"sources": (0, 1), **straight_line(mesh, faces, 1.0)}] if len(faces) else []
        sweep = sweep_cost(len(mesh.faces), EXACT, share, crossed=len(faces) / len(mesh.faces))
        seconds = sweep.seconds + PER_POINT * len(points)
        seconds += _seconds_per_face(share * len(mesh.faces), len(starts)) * len(faces)
        answer = self._answer(opened, starts, chord_error, found, expected_stats(mesh, share))
        return Forecast(Cost(seconds, sweep.memory_bytes), answer, SEGMENTS_IN_FACE)

    def _answer(
        self,
        opened: OpenMesh,
        starts: Sequence[gc.Source],
        chord_error: float,
        found: Sequence[Mapping[str, Any]],
        stats: Mapping[str, Any],
    ) -> Answer:
        return Answer(
            {
                "kind": self.kind,
                "mesh_id": self.mesh_id,
                "chord_error": chord_error,
                "sources": [describe_source(opened.mesh, start) for start in starts],
                "borders": found,
                "stats": stats,
                "warnings": opened.warnings,
            },
            shown=("borders",),
            lines=lambda: lines_of_borders(found),
        )


def describe_border(border: gc.Border) -> dict[str, Any]:
    """Return the members of a border."""
    return {"sources": border.sources, **describe_line(border)}


def _seconds_per_face(faces: float, sources: int) -> float:
    """Return the seconds for a face that borders cross, of all the ``faces`` that are reached.

    The windows over an edge grow with the distance to its source.
    """
    return PER_FACE_DIVIDED + PER_WINDOW_DIVIDED * math.sqrt(faces / sources)


def _divided_faces(
    mesh: gc.TriangleMesh, distances: NDArray[np.float64], nearest: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the faces whose corners are nearest to different points."""
    corners = nearest[mesh.faces]
    differ = (corners != corners[:, :1]).any(axis=1)
    return np.flatnonzero(differ & np.isfinite(distances[mesh.faces]).all(axis=1))

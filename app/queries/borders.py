"""Borders between the territories of sources."""

import math

from app.encoding import Answer
from app.queries.accuracy import solve_field, stats_of
from app.queries.base import ExecutionContext
from app.queries.cost_model import PER_FACE_DIVIDED, faces_crossed, sweep_seconds
from app.queries.from_sources import FromSources
from app.queries.lines import (
    OFFERS,
    are_located,
    count_values,
    describe_line,
    resolved_chord_error,
)
from app.queries.points import (
    SurfacePoints,
    describe_source,
    to_sources,
)
from app.queries.validation import (
    check_json_size,
)
from app.queries.views import lines_of_borders
from app.schemas.requests import Accuracy, BordersRequest
from app.store.meshes import OpenMesh

EXACT = Accuracy()


class BordersQuery(FromSources[BordersRequest]):
    """The points that are equally near to two of ``sources``, as polylines."""

    kind = "borders"
    model = BordersRequest
    offers = OFFERS
    hint = "set a larger chord_error, or a max_distance"

    def rough_seconds(self) -> float:
        """Return the cost of two sweeps to the limit, and of the lines."""
        request = self.request
        lines = math.sqrt(len(request.sources) - 1)  # as the length of all borders grows
        sweep = sweep_seconds(self.size.faces, EXACT, self.share)
        return 2 * sweep + PER_FACE_DIVIDED * faces_crossed(self.size.faces, lines, self.share)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep, then draw the borders, if they fit into the answer."""
        request = self.request
        chord_error = resolved_chord_error(opened.mesh, request.chord_error)
        starts = to_sources(opened.mesh, request.sources, points)
        field = solve_field(
            opened, EXACT, starts, context.part(0, 2), max_distance=request.max_distance
        )
        borders = field.borders(chord_error, **context.part(1, 2).options)
        located = are_located(opened.mesh, request)
        check_json_size(count_values(borders, located=located), context.max_values, self.hint)
        found = [
            {"sources": border.sources, **describe_line(border, located=located)}
            for border in borders
        ]
        members = self.members(
            opened,
            chord_error=chord_error,
            sources=[describe_source(opened.mesh, start) for start in starts],
            borders=found,
            stats=stats_of(field.stats),
        )
        return Answer(
            members, shown=("borders",), lines=lambda: lines_of_borders(found, located=located)
        )

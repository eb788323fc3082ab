"""The boundary of the surface, as curves along its edges."""

from app.encoding import Answer
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import PER_FACE_SCANNED
from app.queries.lines import OFFERS, are_located, count_values, describe_line
from app.queries.points import SurfacePoints
from app.queries.validation import check_json_size
from app.queries.views import lines_of_boundaries
from app.schemas.requests import BoundariesRequest
from app.store.meshes import OpenMesh


class BoundariesQuery(Query[BoundariesRequest]):
    """The curves that bound the surface, longest first."""

    kind = "boundaries"
    model = BoundariesRequest
    offers = OFFERS
    hint = "ask for obj or csv, with `Accept` or with ?format="

    def rough_seconds(self) -> float:
        """Return the cost of a look at all faces."""
        return PER_FACE_SCANNED * self.size.faces

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Follow the edges that have one face."""
        mesh = opened.mesh
        curves = mesh.boundaries()
        located = are_located(mesh, self.request)
        check_json_size(count_values(curves, located=located), context.max_values, self.hint)
        found = [
            {
                **describe_line(curve, located=located),
                "vertices": [point.vertex_index for point in curve.locations],
            }
            for curve in curves
        ]
        members = self.members(opened, boundaries=found)
        return Answer(
            members,
            shown=("boundaries",),
            lines=lambda: lines_of_boundaries(found, located=located),
        )

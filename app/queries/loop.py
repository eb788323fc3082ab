"""Loops that cannot be shrunk to a point, and curves pulled tight."""

from collections.abc import Sequence
from itertools import chain

import geodesic_core as gc
from app.encoding import Answer
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import (
    PER_FACE_TRACED,
    PER_PATH,
    PER_POINT,
    SWEEPS_OF_LOOPS,
    sweep_seconds,
)
from app.queries.lines import OFFERS, are_located, count_values, describe_line
from app.queries.points import SurfacePoints, points_in_curves, split_points, to_curves
from app.queries.validation import WrittenPoints, invalid_fields, naming
from app.queries.views import lines_of_curves
from app.schemas.requests import Accuracy, LoopRequest
from app.store.meshes import OpenMesh


class LoopQuery(Query[LoopRequest]):
    """The shortest loop ``through`` a point, ``curves`` pulled tight, or the loops of handles."""

    kind = "loop"
    model = LoopRequest
    offers = OFFERS
    hint = "ask for obj or csv, with `Accept` or with ?format="

    @classmethod
    def normalized(cls, request: LoopRequest) -> LoopRequest:
        """Refuse a request for two kinds of loops at once."""
        if request.through is not None and request.curves is not None:
            raise invalid_fields(["/through", "/curves"], "give at most one of the two")
        if request.free_ends and request.curves is None:
            raise invalid_fields(["/free_ends"], "loops have no ends: give curves to pull tight")
        return request

    def written_points(self) -> WrittenPoints:
        """Yield the point, or those of all curves."""
        request = self.request
        through = [] if request.through is None else [("/through", request.through)]
        return chain(through, points_in_curves(request.curves or ()))

    def rough_seconds(self) -> float:
        """Return the cost of some sweeps; or of curves, by the faces that they cross."""
        curves = self.request.curves
        if curves is None:
            return SWEEPS_OF_LOOPS * sweep_seconds(self.size.faces, Accuracy(), 1.0)
        crossed = sum(len(curve.polyline) for curve in curves)
        return PER_PATH * len(curves) + (PER_POINT + PER_FACE_TRACED) * crossed

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Look for loops, or pull curves tight one by one."""
        loops = self._loops(opened.mesh, points, context)
        located = are_located(opened.mesh, self.request)
        found = [describe_line(loop, located=located) for loop in loops]
        members = self.members(opened, lines=found)
        return Answer(
            members,
            shown=("lines",),
            values=count_values(loops, located=located),
            lines=lambda: lines_of_curves(found, "line", located=located),
        )

    def _loops(
        self, mesh: gc.TriangleMesh, points: SurfacePoints, context: ExecutionContext
    ) -> Sequence[gc.SurfaceCurve]:
        request = self.request
        if request.through is not None:
            with naming((gc.errors.NoLoop, "/through")):
                return [gc.shortest_loop(mesh, points[0], **context.options)]
        if request.curves is None:
            return gc.handle_loops(mesh, **context.options)
        curves = to_curves(mesh, request.curves, split_points(request.curves, points))
        tight = []
        for i, curve in enumerate(curves):
            where = f"/curves/{i}"
            with naming((gc.errors.NoLoop, where), (gc.errors.InvalidArgument, where)):
                part = context.part(i, len(curves))
                tight.append(gc.straighten(curve, free_ends=request.free_ends, **part.options))
        return tight

"""The steps of the search for a path."""

from itertools import chain

import geodesic_core as gc
from app.encoding import JSON, Answer
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import search_seconds
from app.queries.points import SurfacePoints, numbered
from app.queries.validation import WrittenPoints, check_count
from app.schemas.requests import StepsRequest
from app.settings import Settings
from app.store.meshes import OpenMesh


class StepsQuery(Query[StepsRequest]):
    """What the search for an exact path does, step by step."""

    kind = "steps"
    model = StepsRequest
    offers = (JSON,)
    hint = "ask with fewer waypoints at once"

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many waypoints."""
        check_count("waypoints", len(self.request.waypoints), settings, "max_waypoints")

    def written_points(self) -> WrittenPoints:
        """Yield the source, the target, then the waypoints."""
        ends = ("/source", self.request.source), ("/target", self.request.target)
        return chain(ends, numbered("/waypoints", self.request.waypoints))

    def rough_seconds(self) -> float:
        """Return the cost of a search for each leg."""
        return search_seconds(self.size.faces, 1 + len(self.request.waypoints))

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Search anew: what a solver has learnt from other paths would change the steps."""
        source, target, *waypoints = points
        limit = self.request.max_distance
        steps: tuple[gc.SearchStep, ...] = ()
        try:
            path = gc.shortest_path(
                opened.mesh, source, target, waypoints, limit, explain=True, **context.options
            )
            steps = path.steps or ()
        except gc.errors.NoPath:
            pass  # the path itself tells why
        names = "leg", "name", "bound", "windows", "faces"
        found = [{name: getattr(step, name) for name in names} for step in steps]
        members = self.members(opened, steps=found)
        return Answer(members, values=sum(step.faces.size for step in steps))

"""The steps of an exact sweep: its windows, its front, its pseudosources."""

import math

import geodesic_core as gc
from app.encoding import JSON, Answer, Indices
from app.errors import problem
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import PER_WINDOW_FOLLOWED, sweep_seconds
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.validation import WrittenPoints, check_count, check_json_size
from app.schemas.requests import Accuracy, SweepRequest
from app.settings import Settings
from app.store.meshes import OpenMesh

_COUNTS = "created", "crossed", "waiting", "trimmed"
_INDICES = "pseudosources", "crossed", "last"


class SweepQuery(Query[SweepRequest]):
    """What an exact sweep from ``sources`` does, step by step."""

    kind = "sweep"
    model = SweepRequest
    offers = (JSON,)
    hint = "simplify the mesh"

    def check_limits(self, settings: Settings) -> None:
        """Refuse too many sources, and too many faces."""
        check_count("sources", len(self.request.sources), settings, "max_sources")
        faces, limit = self.size.faces, gc.SweepSteps.most_faces
        if faces > limit:
            detail = f"{faces} faces; a sweep can be followed on at most {limit}"
            hint = "simplify the mesh, or cut a part out"
            raise problem("limit_exceeded", detail, limit=limit, actual=faces, hint=hint)

    def written_points(self) -> WrittenPoints:
        """Yield the sources."""
        return numbered("/sources", self.request.sources)

    def rough_seconds(self) -> float:
        """Return the cost of two sweeps, and of telling the steps of all windows."""
        faces = self.size.faces
        told = PER_WINDOW_FOLLOWED * faces * math.sqrt(faces)
        return 2 * sweep_seconds(faces, Accuracy(), 1.0) + told

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Follow the sweep, and tell all of it if that fits into the answer."""
        mesh = opened.mesh
        steps = gc.sweep_steps(mesh, points, self.request.steps, **context.options)
        columns = vars(steps.windows)
        values = len(columns) * len(steps.windows)
        check_json_size(values, context.max_values, self.hint)
        members = self.members(
            opened,
            sources=[describe_point(mesh, point) for point in points],
            fronts=steps.fronts,
            **{name: getattr(steps, name) for name in _COUNTS},
            distances=steps.distances,
            settled=Indices(steps.settled),
            windows={**columns, **{name: Indices(columns[name]) for name in _INDICES}},
        )
        return Answer(members, values=values)

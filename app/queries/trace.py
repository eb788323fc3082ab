"""Straightest lines: from points in directions, for some lengths."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import NPY, OCTETS, Answer, Elements, Line
from app.errors import pointer
from app.queries.base import VALUES_OF_POINT, ExecutionContext, Query
from app.queries.cost_model import PER_FACE_TRACED, PER_PATH, PER_POINT
from app.queries.lines import OFFERS
from app.queries.outline import points_of, polyline_of
from app.queries.points import SurfacePoints, describe_point, numbered
from app.queries.validation import WrittenPoints, invalid_fields, naming
from app.queries.views import polyline
from app.schemas.requests import TraceRequest
from app.store.meshes import OpenMesh

T = TypeVar("T")

_FOR_EACH_LINE = "starts", "directions", "lengths"
"""The lists of a request"""


class TraceQuery(Query[TraceRequest]):
    """The lines that go straight on from ``starts``."""

    kind = "trace"
    model = TraceRequest
    offers = (*OFFERS, NPY, OCTETS)
    hint = "ask for fewer or for shorter lines at once"

    @classmethod
    def normalized(cls, request: TraceRequest) -> TraceRequest:
        """Refuse lists that have neither one item nor as many as there are lines."""
        counts = {name: len(getattr(request, name)) for name in _FOR_EACH_LINE}
        most = max(counts.values())
        wrong = [pointer(name) for name, count in counts.items() if count not in (1, most)]
        if wrong:
            raise invalid_fields(wrong, f"give one for all lines, or one for each of {most}")
        return request

    @property
    def _count(self) -> int:
        return max(len(getattr(self.request, name)) for name in _FOR_EACH_LINE)

    def value_count(self) -> int:
        """Return the least number of values: those of the ends of the lines."""
        return VALUES_OF_POINT * self._count

    def written_points(self) -> WrittenPoints:
        """Yield the starts."""
        return numbered("/starts", self.request.starts)

    def rough_seconds(self) -> float:
        """Return the cost of each line, and of the faces that they cross."""
        whole = sum(_for_each(self.request.lengths, self._count))
        crossed = whole / self.size.edge if self.size.edge > 0.0 else 0.0
        return (PER_PATH + PER_POINT) * self._count + PER_FACE_TRACED * crossed

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Trace all lines at once; describe them only for a format that shows them."""
        request, count = self.request, self._count
        directions: Sequence[Any] = request.directions
        with naming(
            (gc.errors.NoTangentPlane, _pointer_into("starts", points)),
            (gc.errors.NoDirection, _pointer_into("directions", request.directions)),
            (gc.errors.NotEmbedded, "/directions"),
        ):
            traced = gc.trace(
                opened.mesh,
                _for_each(points, count),
                _for_each(directions, count),
                _for_each(request.lengths, count),
                at_vertices=request.at_vertices,
                **context.options,
            )
        lines = cast(list[gc.StraightLine], traced)  # as there are several starts
        members = self.members(
            opened,
            starts=[describe_point(opened.mesh, point) for point in points],
            lines=Elements(count, lambda part: [describe_line(line) for line in lines[part]]),
        )
        return Answer(
            members,
            ("lines",),
            ("lines",),
            VALUES_OF_POINT * sum(len(line.locations) for line in lines),
            array=lambda: rows_of(lines),
            lines=lambda: [line_of(describe_line(line), i) for i, line in enumerate(lines)],
        )


def describe_line(line: gc.StraightLine) -> dict[str, Any]:
    """Return the members of a line."""
    direction = None if math.isnan(line.end_direction) else line.end_direction
    return {"stopped": line.stopped, "end_direction": direction, **polyline_of(line)}


def line_of(described: Mapping[str, Any], number: int) -> Line:
    """Return a described line for drawings and tables."""
    names = "stopped", "length", "end_direction"
    properties = {"line": number, **{name: described[name] for name in names}}
    return polyline(described, properties, f"line_{number}")


def rows_of(lines: Sequence[gc.StraightLine]) -> NDArray[np.float64]:
    """Return the numbers of the table, (K, 11): a row for each point."""
    rows = [np.empty((0, 11))]
    for i, line in enumerate(lines):
        places, count = line.locations, len(line.locations)
        about = np.broadcast_to((i, line.length, line.end_direction), (count, 3))
        points = points_of(line)
        if points is None:
            points = np.full((count, 3), np.nan)
        faces = [place.face_index for place in places]
        weights = [place.barycentric for place in places]
        rows.append(np.column_stack([about, np.arange(count), points, faces, weights]))
    return np.concatenate(rows)


def _for_each(given: Sequence[T], count: int) -> Sequence[T]:
    """Return an item for each line; one may be for all."""
    return list(given) * count if len(given) == 1 else given


def _pointer_into(name: str, given: Sequence[Any]) -> str:
    """Return the pointer to the item of a line, as `naming` takes it."""
    return f"/{name}/0" if len(given) == 1 else f"/{name}/{{index}}"

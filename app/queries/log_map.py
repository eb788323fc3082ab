"""The logarithmic map: where all vertices lie as seen from a source."""

from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, JSON, NPY, OCTETS, PLY, Answer, Indices
from app.encoding.views import Values
from app.queries.base import ExecutionContext, Query
from app.queries.cost_model import DIRECTED, share_reached, sweep_seconds
from app.queries.points import SurfacePoints, components_of, count_unreachable, describe_point
from app.queries.validation import WrittenPoints, naming
from app.queries.views import surface_of, table_of_distances
from app.schemas.requests import Accuracy, LogMapRequest
from app.store.meshes import OpenMesh

_COLUMNS = "distances", "angles", "coordinates", "bends"
"""The members with a row for each vertex"""


class LogMapQuery(Query[LogMapRequest]):
    """Distance and direction of all vertices from a point."""

    kind = "log_map"
    model = LogMapRequest
    offers = JSON, NPY, OCTETS, CSV, PLY

    def value_count(self) -> int:
        """Return the number of values of all vertices: coordinates are two."""
        return (1 + len(_COLUMNS)) * self.size.vertices

    def written_points(self) -> WrittenPoints:
        """Yield the source, and the point to look at, if any."""
        axis = self.request.x_axis
        at_axis = () if axis is None or isinstance(axis, tuple) else (("/x_axis", axis),)
        return chain([("/source", self.request.source)], at_axis)

    def rough_seconds(self) -> float:
        """Return the cost of a sweep to the limit."""
        share = share_reached(self.size, 1, self.request.max_distance)
        return DIRECTED * sweep_seconds(self.size.faces, Accuracy(), share)

    def solve(self, opened: OpenMesh, points: SurfacePoints, context: ExecutionContext) -> Answer:
        """Sweep once."""
        request, mesh = self.request, opened.mesh
        source, *looked_at = points
        axis = request.x_axis
        vector = axis if isinstance(axis, tuple) else None
        with naming(
            (gc.errors.NoTangentPlane, "/source"),
            (gc.errors.InvalidPoint, "/x_axis"),
            (gc.errors.NoDirection, "/x_axis"),
            (gc.errors.NotEmbedded, "/x_axis"),
            (gc.errors.InvalidArgument, "/rescale"),
        ):
            found = gc.log_map(
                mesh,
                source,
                x_axis=looked_at[0] if looked_at else vector,
                rescale=request.rescale,
                max_distance=request.max_distance,
                **context.options,
            )
        unreached = np.isinf(found.distances)
        connected = mesh.components == components_of(mesh, [source])[0]
        coordinates = found.coordinates
        members = self.members(
            opened,
            source=describe_point(mesh, source),
            total_angle=found.total_angle,
            distances=found.distances,
            angles=found.angles,
            coordinates=coordinates,
            bends=Indices(found.bends),
            unreachable=count_unreachable(unreached, connected),
        )
        columns: dict[str, Values] = {
            "distance": found.distances,
            "angle": found.angles,
            "coordinate_x": coordinates[:, 0],
            "coordinate_y": coordinates[:, 1],
            "bends": members["bends"],
        }

        def array() -> NDArray[Any]:
            return np.column_stack([found.distances, found.angles, coordinates, found.bends])

        return Answer(
            members,
            _COLUMNS,
            _COLUMNS,
            array=array,
            table=table_of_distances("vertex", columns),
            surface=surface_of(mesh, columns),
        )

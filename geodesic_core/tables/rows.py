"""Rows of a table: the distances from one source to some targets, by each method."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.fields.distance_field import DistanceField
from geodesic_core.fields.sources import Ends
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.search.target_sweep import TargetSweep

Method = Literal["exact", "approximate", "fast"]

Solve = Callable[[SurfacePoint, Sequence[SurfacePoint], Control], DistanceField]
"""Function that returns the field of a source, whose sweep finds also some points in faces"""


class Rows(Protocol):
    """A solver of rows, for one thread."""

    def distances(self, source: int, targets: Ints, control: Control) -> Floats:
        """Return the distances from a source to targets; infinite where out of reach."""


@dataclass(frozen=True)
class ExactRows:
    """Exact rows, by sweeps that reuse their memory and end at the farthest target."""

    ends: Ends
    limit: float
    sweep: TargetSweep

    def distances(self, source: int, targets: Ints, control: Control) -> Floats:
        """Return the distances from a source to targets; infinite where out of reach."""
        row = np.full(len(targets), np.inf)
        reachable = self.ends.target_components[targets] == self.ends.source_components[source]
        near = targets if reachable.all() else targets[reachable]
        if len(near):
            row[reachable] = self.sweep.distances(
                self.ends, source, near, len(near), self.limit, control
            )
        return row


@dataclass(frozen=True)
class FieldRows:
    """Rows of an approximate or a fast solver, by a field for each."""

    ends: Ends
    solve: Solve

    @cached_property
    def _vertices(self) -> Ints:
        """The vertex of each target; -1 for another point."""
        vertices = (point.vertex_index for point in self.ends.targets)
        return np.array([-1 if vertex is None else vertex for vertex in vertices], np.int32)

    def distances(self, source: int, targets: Ints, control: Control) -> Floats:
        """Return the distances from a source to targets; infinite where out of reach."""
        vertices = self._vertices[targets]
        others = np.flatnonzero(vertices < 0)
        points = [self.ends.targets[target] for target in targets[others]]
        field = self.solve(self.ends.sources[source], points, control)
        row = field.distances[vertices]
        row[others] = [field.distance_at(point) for point in points]
        return row

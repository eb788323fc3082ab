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

Solve = Callable[[SurfacePoint, Sequence[SurfacePoint], float, Control], DistanceField]
"""Function that returns the field of a source up to a limit; its sweep also finds some points in
faces"""


class Rows(Protocol):
    """A solver of rows, for one thread."""

    @property
    def nbytes(self) -> int:
        """Memory of the state of a sweep, bytes; it may grow."""

    def distances(self, source: int, targets: Ints, control: Control) -> Floats:
        """Return the distances from a source to targets; infinite where out of reach."""


@dataclass(frozen=True)
class ExactRows:
    """Exact rows, by sweeps that reuse their memory and end at the farthest target."""

    ends: Ends
    limit: float
    sweep: TargetSweep

    @property
    def nbytes(self) -> int:
        """Memory of the state of a sweep, bytes; it may grow."""
        return self.sweep.nbytes

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
    limit: float
    solve: Solve

    @cached_property
    def nbytes(self) -> int:
        """Memory of the state of a sweep, bytes, as one that ends at once shows; it may grow."""
        return self.solve(self.ends.sources[0], (), 0.0, Control()).stats.peak_bytes

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
        field = self.solve(self.ends.sources[source], points, self.limit, control)
        row = field.distances[vertices]
        row[others] = [field.distance_at(point) for point in points]
        return row


def rows_of(
    ends: Ends, limit: float, solve: Solve | None, target_sweep: Callable[[], TargetSweep]
) -> Rows:
    """Return a solver of rows: by the fields of ``solve``, exactly where it is None."""
    if solve is None:
        return ExactRows(ends, limit, target_sweep())
    return FieldRows(ends, limit, solve)

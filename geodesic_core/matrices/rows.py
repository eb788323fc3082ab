"""Rows of a table: the distances from one source to some targets, by each method."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.fields.distance_field import DistanceField, solve
from geodesic_core.fields.methods import SweepOf
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import Ends
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.fields.vertex_points import vertices_of
from geodesic_core.mesh.surface_point import Points, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.target_sweep import TargetSweep


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
    """Rows of an approximate or a fast method, by a field for each."""

    mesh: TriangleMesh
    ends: Ends
    limit: float
    sweep_of: SweepOf

    @cached_property
    def nbytes(self) -> int:
        """Memory of the state of a sweep, bytes, as one that ends at once shows; it may grow."""
        return self._field(self.ends.sources[0], (), 0.0, Control()).stats.peak_bytes

    @cached_property
    def _vertices(self) -> Ints:
        """The vertex of each target; -1 for another point."""
        return vertices_of(self.ends.targets)

    def distances(self, source: int, targets: Ints, control: Control) -> Floats:
        """Return the distances from a source to targets; infinite where out of reach."""
        vertices = self._vertices[targets]
        others = np.flatnonzero(vertices < 0)
        points = [self.ends.targets[target] for target in targets[others]]
        field = self._field(self.ends.sources[source], points, self.limit, control)
        row = field.distances[vertices]
        row[others] = [field.distance_at(point) for point in points]
        return row

    def _field(
        self, source: SurfacePoint, targets: Points, limit: float, control: Control
    ) -> DistanceField:
        question = Question.of(self.mesh, source, targets, limit, control)
        return solve(self.sweep_of(question), "distances", control)


def rows_of(
    mesh: TriangleMesh,
    ends: Ends,
    limit: float,
    sweep_of: SweepOf,
    target_sweep: Callable[[], TargetSweep],
) -> Rows:
    """Return a solver of rows, by the sweep of a method; ``target_sweep`` is for exact ones."""
    if sweep_of is ExactSweep:
        return ExactRows(ends, limit, target_sweep())
    return FieldRows(mesh, ends, limit, sweep_of)

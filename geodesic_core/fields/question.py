"""Questions: what a sweep over all of a mesh is asked, checked and canonical."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats
from geodesic_core.control import Control
from geodesic_core.fields.sources import Nodes, as_sources, component_of, nodes_of
from geodesic_core.kernels.front.bounds import Bounds, with_parallel_windows
from geodesic_core.mesh.canonical import each_of
from geodesic_core.mesh.curve import Polyline, polylines_from_arrays, polylines_to_arrays
from geodesic_core.mesh.surface_curve import Sources
from geodesic_core.mesh.surface_point import Curve, Points, Source, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Question:
    """Sources, targets and a limit, on a mesh with the barriers of the call."""

    mesh: TriangleMesh
    sources: tuple[Source, ...]
    """As they were given"""
    polylines: tuple[Polyline, ...]
    """Canonical points of each source"""
    targets: tuple[SurfacePoint, ...]
    """Canonical points that the sweep is to reach as well"""
    max_distance: float
    """Limit of the sweep, mesh units; may be infinite"""
    nodes: Nodes
    """Of the sources and the targets"""

    @classmethod
    def of(
        cls,
        mesh: TriangleMesh,
        sources: Sources,
        targets: Points,
        max_distance: float,
        control: Control,
    ) -> "Question":
        """Check the sources and the targets of a question, and return it.

        Raises
        ------
        InvalidPoint, InvalidArgument
            There are no sources, a point is not on the mesh, or a start distance is out of its
            domain.
        Cancelled, DeadlineExceeded
            As the control says.
        """
        given, polylines = as_sources(mesh, sources, control)
        canonical = tuple(
            mesh.point(point, f"target {i}")
            for i, point in enumerate(control.watched(each_of(targets, "target")))
        )
        nodes = nodes_of(mesh, polylines, canonical, control)
        return cls(mesh, given, polylines, canonical, max_distance, nodes)

    @cached_property
    def start_distances(self) -> Floats:
        """(N,) of the sources, mesh units."""
        return np.array([source.start_distance for source in self.sources])

    @property
    def has_curves(self) -> bool:
        """True where a source is more than a point."""
        return len(self.nodes.segments) > 0

    @cached_property
    def node_of_target(self) -> Mapping[SurfacePoint, int]:
        """Nodes of the targets."""
        return dict(zip(self.targets, self.nodes.targets.tolist(), strict=True))

    def node(self, point: SurfacePoint) -> int | None:
        """Return the node of a canonical point; None where the sweep has none there."""
        if point.vertex_index is not None:
            return int(self.mesh.topology.inner_vertex[point.vertex_index])
        return self.node_of_target.get(point)

    @cached_property
    def reachable(self) -> int:
        """Number of vertices in the components of the sources."""
        return int(self.mesh.component_sizes[list(self.nodes.components)].sum())

    def connects(self, point: SurfacePoint) -> bool:
        """Tell whether a canonical point is in the component of a source."""
        return component_of(self.mesh, point) in self.nodes.components

    def bounds(self, of_points: Bounds) -> Bounds:
        """Return the bounds of its sweep from those that it has where all sources are points."""
        if not self.has_curves:
            return of_points
        return with_parallel_windows(of_points, self.nodes.first_segment)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the question as arrays, for a store."""
        return {
            **polylines_to_arrays("source", self.polylines),
            **polylines_to_arrays("target", [(target,) for target in self.targets]),
            "start_distances": self.start_distances,
            "max_distance": np.array(self.max_distance),
        }

    @classmethod
    def from_arrays(cls, mesh: TriangleMesh, arrays: Mapping[str, NDArray[Any]]) -> "Question":
        """Return the question that `arrays` hold; its sources are spelled canonically."""
        polylines = polylines_from_arrays("source", arrays)
        targets = tuple(point for (point,) in polylines_from_arrays("target", arrays))
        sources = tuple(
            Source(line[0] if len(line) == 1 else Curve(line), start)
            for line, start in zip(polylines, arrays["start_distances"].tolist(), strict=True)
        )
        nodes = nodes_of(mesh, polylines, targets, Control())
        return cls(mesh, sources, polylines, targets, float(arrays["max_distance"]), nodes)

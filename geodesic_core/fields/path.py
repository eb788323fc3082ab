"""Paths over the surface, and how they are made from backtraced crossings."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.errors import InternalError
from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.mesh import locations
from geodesic_core.kernels.mesh.locations import Locations
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths import backtracing
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.mesh.curve import foot_on
from geodesic_core.mesh.surface_curve import SurfaceCurve, in_space, length_on, point_of
from geodesic_core.mesh.transport import carried_along
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import PATH_LENGTH, ROUNDED_POSITION
from geodesic_core.validation import as_angle


@dataclass(frozen=True, slots=True)
class ErrorBound:
    """Bound of the difference between an answer and the exact one.

    ``value`` is a share of the exact answer where ``type`` is ``"relative"``, else mesh units.
    ``kind`` tells whether the bound is proved in general, estimated, or certified: proved for this
    answer, rounding included, see `DistanceField.certify`. For approximate distances it is proved
    that they are too short by no more than the bound. That they are never too long is argued and
    measured, but not proved.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, 0).error_bound
    ErrorBound(type='relative', value=0.0, kind='guaranteed')
    """

    type: Literal["relative", "absolute"]
    value: float
    kind: Literal["guaranteed", "estimated", "certified"]

    def __str__(self) -> str:
        if self.value == 0.0 and self.kind == "guaranteed":
            return "exact"
        return f"{self.kind} {self.type} error {self.value:g}"


EXACT = ErrorBound("relative", 0.0, "guaranteed")
"""The bound of exact answers: floating-point rounding aside, there is no error."""


StepName = Literal[
    "dijkstra", "shorten", "approximate", "fast", "backtrace", "exact", "path", "straighten"
]


@dataclass(frozen=True, slots=True, eq=False)
class SearchStep:
    """Step of the search between two points (section 5, figure 10).

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> [step.name for step in gc.shortest_path(mesh, 0, 3, explain=True).steps]
    ['dijkstra', 'shorten', 'approximate', 'backtrace', 'exact', 'path']
    """

    leg: int
    """Number of the leg, from one stop to the next, counted from 0."""
    name: StepName
    seconds: float
    bound: float
    """The least upper bound of the distance that is known after the step, mesh units; after
    "exact", the distance."""
    windows: int
    """Windows created."""
    faces: Ints
    """(N,) int32: the region that was visited."""


@dataclass(frozen=True, eq=False, repr=False)
class GeodesicPath(SurfaceCurve):
    """A path over the surface, from its source to its target.

    An exact field gives shortest paths. An approximate one gives paths whose length U is an upper
    bound of the exact distance, as the field's value D is a lower bound: ``error_bound`` holds
    (U - D) / D. The length of an exact path is the distance; its points were rounded.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)
    >>> path = gc.shortest_path(mesh, 1, 2)
    >>> path.points.tolist()
    [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0]]
    >>> path.faces.tolist()
    [0, 1]
    >>> str(path.locations[1])
    'the point (0.5, 0.0, 0.5) of face 0'
    """

    error_bound: ErrorBound
    steps: tuple[SearchStep, ...] | None
    """Steps of the search between two points, leg by leg; None without ``explain``."""

    def reversed(self) -> "GeodesicPath":
        """Return the path from its target to its source.

        Returns
        -------
        GeodesicPath
            With the same length and bound.

        Examples
        --------
        >>> gc.shortest_path(gc.samples.plane(2), 0, 3).reversed().points.tolist()
        [[1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
        """
        turned = super().reversed()
        return GeodesicPath(**vars(turned), error_bound=self.error_bound, steps=self.steps)

    def transport(self, angle: float) -> float:
        """Return a vector at the first point, carried along the path to the last one.

        As `DistanceField.transport` does; along any path of a mesh.

        Parameters
        ----------
        angle
            Radians, in the frame of the first point as in `log_map`.

        Returns
        -------
        float
            Radians, in the frame of the last point.

        Raises
        ------
        InvalidPoint
            One of its ends, or a vertex that it passes through, has no tangent plane.
        InvalidArgument
            The angle is not a finite number. Or the path is a copy or comes from a pickle, and has
            no mesh.

        Notes
        -----
        O(K).

        Examples
        --------
        >>> gc.shortest_path(gc.samples.plane(2), 0, 3).transport(np.pi / 4) == 5 * np.pi / 4
        True
        """
        return carried_along(self.on_mesh(), self.locations, self.faces, as_angle(angle))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.summary}, {self.error_bound})"

    @property
    def _shown(self) -> dict[str, Any]:
        ends = {"from": self.locations[0], "to": self.locations[-1], "length": self.length}
        return ends | {"points": len(self.locations), "accuracy": self.error_bound}

    @property
    def _properties(self) -> dict[str, Any]:
        return {"length": self.length, "error_bound": asdict(self.error_bound)}


def trace(mesh: TriangleMesh, winners: Winners, v: int) -> tuple[Ints, Floats, Ints]:
    """Trace the path from node v to its source: nodes, parameters and inner faces."""
    room = 256
    while True:
        nodes, parameters = np.empty(room, np.int32), np.empty(room)
        faces = np.empty(room, np.int32)
        outcome, count = backtracing.trace_path(mesh.topology, winners, v, nodes, parameters, faces)
        if outcome == Outcome.FINISHED:
            return nodes[:count], parameters[:count], faces[: count - 1]
        # A shortest path crosses a face at most once, and an approximate one hardly more often:
        # a longer walk is lost as well.
        if outcome == Outcome.LOST or room > 4 * len(mesh.faces) + 256:
            raise InternalError(
                f"the path to node {v} left the surface after {count} points; "
                f"please report this mesh"
            )
        room *= 4


def traced_path(
    mesh: TriangleMesh, winners: Winners, nodes_of_sweep: Nodes, v: int, bound: ErrorBound
) -> GeodesicPath:
    """Return the path from its source to node v; O(faces crossed)."""
    located, faces = located_path(mesh, winners, nodes_of_sweep, v)
    length = length_on(mesh, located, faces)
    return GeodesicPath(mesh, faces, False, length, in_space(mesh, located), bound, None)


def located_path(
    mesh: TriangleMesh, winners: Winners, nodes_of_sweep: Nodes, v: int
) -> tuple[Locations, Ints]:
    """Return the points of the path from its source to node v, and the faces between them."""
    nodes, parameters, crossed = trace(mesh, winners, v)
    count = len(nodes)
    faces, vertices = np.empty(count, np.int32), np.empty(count, np.int64)
    weights, points = np.empty((count, 3)), np.empty((count, 3))
    nodes, parameters = nodes[::-1].copy(), parameters[::-1].copy()
    located = Locations(faces, weights, vertices, points)
    locations.locate_nodes(mesh.embedding, mesh.faces, nodes, parameters, located)
    for i in (count - 1, 0):
        node = -1 - int(nodes[i])
        if node < len(mesh.vertices):
            continue
        segment = nodes_of_sweep.segment(node)
        if segment is None:
            point = nodes_of_sweep.site(node)
        else:
            after = point_of(located, 1)
            point = foot_on(mesh, segment, int(crossed[-1]), after)
        points[i] = mesh.position_from_origin(point)
        faces[i], weights[i] = point.face_index, point.barycentric
        vertices[i] = -1 if point.vertex_index is None else point.vertex_index
    between = np.empty(count - 1, np.int32)
    count = locations.drop_repeats(mesh.topology.outer_face, crossed, located, between)
    located = Locations(faces[:count], weights[:count], vertices[:count], points[:count])
    return located, between[: count - 1]


def rounding_of(mesh: TriangleMesh, distance: float) -> float:
    """Return how much the length of a path may differ from a distance by rounding, mesh units."""
    return PATH_LENGTH * distance + ROUNDED_POSITION * mesh.extent


def joined(legs: Sequence[GeodesicPath]) -> GeodesicPath:
    """Return paths of one method, each from the end of the one before, as one path."""

    def chained(arrays: Sequence[Any]) -> Any:  # a leg begins where the one before ends
        return np.concatenate([arrays[0], *(array[1:] for array in arrays[1:])])

    steps = [replace(step, leg=i) for i, leg in enumerate(legs) for step in (leg.steps or ())]
    return GeodesicPath(
        mesh=legs[0].mesh,
        faces=np.concatenate([leg.faces for leg in legs]),
        closed=False,
        length=sum(leg.length for leg in legs),
        located=Locations(*map(chained, zip(*(leg.located for leg in legs), strict=True))),
        error_bound=legs[0].error_bound,
        steps=tuple(steps) or None,
    )

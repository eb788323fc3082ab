"""Sources, and the nodes of a sweep: vertices, sites, and the segments of curves."""

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import BlockedSource, InvalidArgument, InvalidPoint, NoPath
from geodesic_core.fields.vertex_points import VertexPoints
from geodesic_core.kernels.front.state import NO_SITES, SEGMENT, SEGMENT_ENDS, SITE, Sites
from geodesic_core.kernels.mesh.half_edges import TAIL
from geodesic_core.mesh.barriers import walled_in
from geodesic_core.mesh.canonical import each_of, half_edges_around
from geodesic_core.mesh.curve import (
    Polyline,
    SegmentInFace,
    polyline_of,
    segments_of,
    weights_by_face,
)
from geodesic_core.mesh.edge_lengths import flat_points
from geodesic_core.mesh.surface_curve import SurfaceCurve, as_written
from geodesic_core.mesh.surface_point import UNPLACED, Curve, Points, Source, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.validation import is_number, unboxed


@dataclass(frozen=True)
class Nodes:
    """Nodes of the sources and the targets of a sweep."""

    sources: Ints
    """(N,) nodes of the points and segments of the sources: an inner vertex, or a number beyond the
    vertices"""
    source_indices: Ints
    """(N,) index of the source that each belongs to"""
    targets: Ints
    """(M,) node of each target"""
    sites: Sites
    first_target: int
    """First row of a target among those of the sites"""
    points: tuple[SurfacePoint, ...]
    """Points that became sites, in the order of their nodes"""
    segments: tuple[SegmentInFace, ...]
    """Segments of curves, in the order of their nodes, each in one of its faces"""
    first_segment: int
    """Node of the first segment"""
    components: tuple[int, ...]
    """Connected components with a source"""
    added: tuple[SurfacePoint, ...] = ()
    """Points that became nodes after the sweep, numbered after all others"""

    @property
    def has_site_targets(self) -> bool:
        """True where a target is neither vertex nor segment."""
        return len(self.sites.ints) > self.first_target

    def segment(self, node: int) -> SegmentInFace | None:
        """Return the segment of a node; None if it has none."""
        rank = node - self.first_segment
        return self.segments[rank] if 0 <= rank < len(self.segments) else None

    def site(self, node: int) -> SurfacePoint:
        """Return the point of a node that is neither vertex nor segment."""
        rank = node - self.first_segment
        if rank < 0:
            return self.points[len(self.points) + rank]
        return self.added[rank - len(self.segments)]


@dataclass(frozen=True)
class Ends:
    """The ends of several sweeps, each from one source to some of the targets."""

    sources: Sequence[SurfacePoint]
    targets: Sequence[SurfacePoint]
    source_components: Ints
    """(N,): the connected component of each source"""
    target_components: Ints
    corners: Ints
    """(M, 3): the inner vertices around each target, or itself"""
    reaches: Floats
    """(M, 3): how far each is, mesh units"""
    nodes: Nodes
    """Of all sources and all targets"""


def ends_of(
    mesh: TriangleMesh,
    sources: Sequence[SurfacePoint],
    targets: Sequence[SurfacePoint],
    control: Control,
) -> Ends:
    """Return the ends of sweeps from canonical points to canonical points.

    Raises
    ------
    Cancelled, DeadlineExceeded
        As the control says.
    """
    corners, reaches = np.empty((len(targets), 3), np.int32), np.zeros((len(targets), 3))
    if isinstance(targets, VertexPoints):
        corners[:] = mesh.topology.inner_vertex[targets.vertices][:, None]
    else:
        for i, target in enumerate(control.watched(targets)):
            corners[i], reaches[i] = corners_of(mesh, target)
    return Ends(
        sources=sources,
        targets=targets,
        source_components=components_of(mesh, sources, control),
        target_components=components_of(mesh, targets, control),
        corners=corners,
        reaches=reaches,
        nodes=nodes_of(
            mesh,
            sources if isinstance(sources, VertexPoints) else [(source,) for source in sources],
            targets,
            control,
        ),
    )


def nodes_of(
    mesh: TriangleMesh,
    sources: Sequence[Polyline] | VertexPoints,
    targets: Sequence[SurfacePoint],
    control: Control,
) -> Nodes:
    """Return the nodes of sources, each given by its canonical points, and of targets.

    A point for each of many vertices would take longer than a small sweep from it.

    Raises
    ------
    Cancelled, DeadlineExceeded
        As the control says.
    """
    vertices, watched = len(mesh.vertices), control.watched
    lines = () if isinstance(sources, VertexPoints) else sources
    sited: list[SurfacePoint] = []
    rows: list[tuple[int, int, int]] = []
    weights: list[tuple[float, ...]] = []

    def node_of(point: SurfacePoint) -> int:
        if point.vertex_index is not None:
            return int(mesh.topology.inner_vertex[point.vertex_index])
        node = vertices + len(sited)
        sited.append(point)
        for face, at_corners in weights_by_face(mesh, point).items():
            rows.append((node, face, -1))
            weights.append(at_corners)
        return node

    started = [
        (node_of(point), i)
        for i, line in enumerate(lines)
        for point in watched(dict.fromkeys(line))
    ]
    first_target = len(rows)
    ends = (
        mesh.topology.inner_vertex[targets.vertices]
        if isinstance(targets, VertexPoints)
        else [node_of(point) for point in watched(targets)]
    )
    segments = [
        (i, parts) for i, line in enumerate(lines) for parts in segments_of(mesh, watched(line))
    ]
    first_segment = vertices + len(sited)
    started += [(first_segment + k, i) for k, (i, _) in enumerate(segments)]
    in_faces = [
        (first_segment + k, part) for k, (_, parts) in enumerate(segments) for part in parts
    ]
    source_nodes = np.array([node for node, _ in started], np.int32)
    source_indices = np.array([source for _, source in started], np.int32)
    components = {component_of(mesh, line[0]) for line in watched(lines)}
    if isinstance(sources, VertexPoints):
        source_nodes = mesh.topology.inner_vertex[sources.vertices]
        source_indices = np.arange(len(sources), dtype=np.int32)
        components = set(mesh.components[sources.vertices].tolist())
    return Nodes(
        sources=source_nodes,
        source_indices=source_indices,
        targets=np.array(ends, np.int32),
        sites=_sites_of(mesh, len(sited) + len(segments), rows, weights, in_faces, watched),
        first_target=first_target,
        points=tuple(sited),
        segments=tuple(parts[0] for _, parts in segments),
        first_segment=first_segment,
        components=tuple(components),
    )


def _sites_of(
    mesh: TriangleMesh,
    nodes: int,
    rows: Sequence[tuple[int, int, int]],
    weights: Sequence[tuple[float, ...]],
    in_faces: Sequence[tuple[int, SegmentInFace]],
    watched: Callable[[Sequence[int]], Iterable[int]],
) -> Sites:
    """Return the sites of so many nodes: the rows of points, and the segments in each face."""
    faces = [face for _, face, _ in rows] + [part.face for _, part in in_faces]
    if not faces:
        return NO_SITES
    ends = [part.start + part.end for _, part in in_faces]
    return Sites(
        nodes=nodes,
        ints=np.array(rows, np.int32).reshape(-1, SITE),
        weights=np.array(weights).reshape(-1, 3),
        windows=sum(_edge_faces(mesh, face) for face in watched(faces)),
        segment_ints=np.array([(k, p.face) for k, p in in_faces], np.int32).reshape(-1, SEGMENT),
        segment_ends=np.array(ends).reshape(-1, SEGMENT_ENDS),
    )


def _edge_faces(mesh: TriangleMesh, face: int) -> int:
    """Return the number of faces at the three edges of an inner face, summed over the edges."""
    links = mesh.topology.links
    return sum(len(list(half_edges_around(links, h))) for h in range(3 * face, 3 * face + 3))


def as_sources(
    mesh: TriangleMesh, sources: Any, control: Control
) -> tuple[tuple[Source, ...], tuple[Polyline, ...]]:
    """Return the sources as records, and the canonical points of each.

    Raises
    ------
    InvalidPoint, InvalidArgument
        There are none, one is not on the mesh, or a start distance is out of its domain.
    Cancelled, DeadlineExceeded
        As the control says.
    """
    sources = unboxed(sources)
    if isinstance(sources, str | bytes):
        raise InvalidPoint(f"the source is {sources!r}; it must be a vertex index or a Source")
    if isinstance(sources, Source | SurfacePoint | Curve | SurfaceCurve) or not isinstance(
        sources, Iterable
    ):
        sources = [sources]
    checked, polylines = [], []
    for i, item in enumerate(control.watched(sources)):
        source = item if isinstance(item, Source) else Source(item)
        if isinstance(source.point, Curve | SurfaceCurve):
            curve = as_written(source.point)
            polylines.append(polyline_of(mesh, curve, f"source {i}", control))
        else:
            polylines.append((mesh.point(source.point, f"source {i}"),))
        start = source.start_distance
        if not is_number(start) or not (math.isfinite(start) and start >= 0.0):
            raise InvalidArgument(
                f"source {i} starts at {start!r}; it must be a finite number, 0 or more"
            )
        checked.append(source)
    if not checked:
        raise InvalidPoint("there are no sources: give at least one")
    _warn_of_walled_in(mesh, [line[0] for line in polylines])
    return tuple(checked), tuple(polylines)


_NAMED = 10
"""Sources that a warning names, at most"""


def _warn_of_walled_in(mesh: TriangleMesh, sources: Sequence[SurfacePoint]) -> None:
    """Warn of sources in blocked faces only; a curve is never there."""
    found = walled_in(mesh, sources)
    if not found:
        return
    names = [f"source {i}, {sources[i]}" for i in found[:_NAMED]]
    names += [f"{len(found) - _NAMED} more"] if len(found) > _NAMED else []
    verb, them = ("lies", "it") if len(found) == 1 else ("lie", "them")
    message = f"{'; '.join(names)}, {verb} in blocked faces only: no path leaves {them}"
    warnings.warn(message, BlockedSource, stacklevel=2)


def as_points(
    mesh: TriangleMesh, points: Points, name: str, control: Control
) -> Sequence[SurfacePoint]:
    """Return canonical points; ``name`` is how messages call one of them.

    Raises
    ------
    InvalidArgument
        There are none.
    InvalidPoint
        One is not a point of the mesh.
    Cancelled, DeadlineExceeded
        As the control says.
    """
    given = each_of(points, name)
    vertices = VertexPoints.of(mesh, given)
    if vertices is not None:
        control.checkpoint(0.0)
        return vertices
    canonical = [mesh.point(point, f"{name} {i}") for i, point in enumerate(control.watched(given))]
    if not canonical:
        raise InvalidArgument(f"there are no {name}s: give at least one")
    return canonical


def component_of(mesh: TriangleMesh, point: SurfacePoint) -> int:
    """Return the connected component of a canonical point."""
    vertex = point.vertex_index
    if vertex is None:
        vertex = int(mesh.faces[point.face_index, 0])
    return int(mesh.components[vertex])


def components_of(mesh: TriangleMesh, points: Sequence[SurfacePoint], control: Control) -> Ints:
    """Return the connected components of canonical points, (N,).

    Raises
    ------
    Cancelled, DeadlineExceeded
        As the control says.
    """
    if isinstance(points, VertexPoints):
        return mesh.components[points.vertices].astype(np.int32)
    return np.array([component_of(mesh, point) for point in control.watched(points)], np.int32)


def disconnected(mesh: TriangleMesh, message: str, *points: SurfacePoint) -> NoPath:
    """Return the error of canonical points that are not connected, with the likely reason."""
    lonely = [point for point in points if point.face_index == UNPLACED]
    blocked = len(mesh.barriers)
    if lonely:
        message += f": {lonely[0]} belongs to no {'free face' if blocked else 'face'}"
    elif blocked:
        message += f", among {blocked} blocked {'face' if blocked == 1 else 'faces'}"
    return NoPath(message, "disconnected")


def corners_of(mesh: TriangleMesh, point: SurfacePoint) -> tuple[Ints, Floats]:
    """Return the inner vertices around a canonical point, or at it, and how far each is."""
    inner = mesh.topology.inner_vertex
    if point.vertex_index is not None:
        return inner[[point.vertex_index]], np.zeros(1)
    corners = inner[mesh.faces[point.face_index]]
    if mesh.lengths is not None:
        return _corners_laid_flat(mesh, point)
    away = mesh.positions[corners] - mesh.position_from_origin(point)
    return corners, np.linalg.norm(away, axis=1)


def _corners_laid_flat(mesh: TriangleMesh, point: SurfacePoint) -> tuple[Ints, Floats]:
    """Return the same of a point in a face, whose corners have no positions with its lengths."""
    face = int(mesh.inner_face[point.face_index])
    corners = mesh.topology.links[3 * face : 3 * face + 3, TAIL]
    weights = np.array(weights_by_face(mesh, point)[face])
    return corners, np.hypot(*flat_points(mesh.topology, np.full(3, face), weights - np.eye(3)).T)

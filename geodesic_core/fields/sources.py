"""From points and curves to the nodes of a sweep: vertices, sites, and the pieces of curves."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.errors import InvalidArgument, InvalidPoint, NoPath
from geodesic_core.kernels.sweep.state import NODE, SEGMENT, SEGMENT_ENDS, SITE, Sites
from geodesic_core.mesh.canonical import half_edges_around
from geodesic_core.mesh.curve import (
    Curve,
    PieceInFace,
    Polyline,
    pieces_of,
    polyline_of,
    weights_by_face,
)
from geodesic_core.mesh.surface_point import UNPLACED, Point, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.validation import is_number


@dataclass(frozen=True, slots=True)
class Source:
    """A source, and the distance at which it starts (mesh units, 0 or more)."""

    point: Point | Curve
    start_distance: float = 0.0


Sources = Point | Curve | Source | Sequence[Point | Curve | Source]


@dataclass(frozen=True)
class Nodes:
    """The nodes of the sources of a sweep, and of what it is to reach."""

    sources: Ints
    """(N,): an inner vertex, or a number beyond the vertices, for each point and each piece of the
    sources"""
    origins: Ints
    """(N,): which of the sources each belongs to"""
    targets: Ints
    """(M,): the same for each target"""
    sites: Sites
    first_target: int
    """Row of the first target among those of the sites."""
    points: tuple[SurfacePoint, ...]
    """Those that became sites, in the order of their nodes."""
    positions: Floats
    """(sites, 3), mesh units"""
    pieces: tuple[PieceInFace, ...]
    """The pieces of curves, in the order of their nodes, each in one of its faces."""
    first_piece: int
    """The node of the first"""
    components: tuple[int, ...]
    """Those of the mesh with a source in them"""

    @property
    def has_sited_targets(self) -> bool:
        """Whether a target is neither vertex nor piece."""
        return len(self.sites.ints) > self.first_target

    def piece(self, node: int) -> PieceInFace | None:
        """Return the piece of a node; None if it is none."""
        rank = node - self.first_piece
        return self.pieces[rank] if 0 <= rank < len(self.pieces) else None

    def site(self, node: int) -> tuple[SurfacePoint, Floats]:
        """Return the point of a node that is neither vertex nor piece, and its position."""
        # What is asked for after a sweep comes behind its pieces.
        rank = node - self.first_piece
        rank += self.sites.nodes - len(self.pieces) - (len(self.pieces) if rank >= 0 else 0)
        return self.points[rank], self.positions[rank]


@dataclass(frozen=True)
class Ends:
    """The ends of several sweeps, each from one source to some of the targets."""

    sources: tuple[SurfacePoint, ...]
    targets: tuple[SurfacePoint, ...]
    source_components: Ints
    """(N,): the connected component of each source"""
    target_components: Ints
    corners: Ints
    """(M, 3): the inner vertices around each target, or itself"""
    reaches: Floats
    """(M, 3): how far each is, mesh units"""
    nodes: Nodes
    """Of all sources and all targets"""

    def targets_connected_to(self, source: int) -> Ints:
        """Return the targets in the component of a source."""
        connected = self.target_components == self.source_components[source]
        return np.flatnonzero(connected).astype(np.int32)

    def between(self, source: int, targets: Ints) -> Nodes:
        """Return the nodes of a sweep from one source to some targets."""
        nodes = self.nodes
        ints = nodes.sites.ints
        start, ends = nodes.sources[[source]], nodes.targets[targets]  # without curves, one each
        first = np.flatnonzero(ints[: nodes.first_target, NODE] == start)
        second = nodes.first_target + np.flatnonzero(
            np.isin(ints[nodes.first_target :, NODE], ends)
        )
        rows = np.concatenate([first, second])
        return replace(
            nodes,
            sources=start,
            origins=np.zeros(1, np.int32),
            targets=ends,
            sites=nodes.sites._replace(ints=ints[rows], weights=nodes.sites.weights[rows]),
            first_target=len(first),
            components=(int(self.source_components[source]),),
        )


def ends_of(
    mesh: TriangleMesh, sources: Sequence[SurfacePoint], targets: Sequence[SurfacePoint]
) -> Ends:
    """Return the ends of sweeps from canonical points to canonical points."""
    corners, reaches = np.empty((len(targets), 3), np.int32), np.empty((len(targets), 3))
    for i, target in enumerate(targets):
        corners[i], reaches[i] = corners_of(mesh, target)
    return Ends(
        sources=tuple(sources),
        targets=tuple(targets),
        source_components=np.array([component_of(mesh, point) for point in sources], np.int32),
        target_components=np.array([component_of(mesh, point) for point in targets], np.int32),
        corners=corners,
        reaches=reaches,
        nodes=nodes_of(mesh, [(source,) for source in sources], targets),
    )


def nodes_of(
    mesh: TriangleMesh, sources: Sequence[Polyline], targets: Sequence[SurfacePoint]
) -> Nodes:
    """Return the nodes of sources, which are points or curves, and of canonical points."""
    vertices = len(mesh.vertices)
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

    starts = [
        (node_of(point), i) for i, line in enumerate(sources) for point in dict.fromkeys(line)
    ]
    first_target = len(rows)
    ends = [node_of(point) for point in targets]
    pieces = [(i, piece) for i, line in enumerate(sources) for piece in pieces_of(mesh, line)]
    first_piece = vertices + len(sited)
    starts += [(first_piece + k, i) for k, (i, _) in enumerate(pieces)]
    in_faces = [(first_piece + k, part) for k, (_, piece) in enumerate(pieces) for part in piece]
    faces = [face for _, face, _ in rows] + [part.face for _, part in in_faces]
    return Nodes(
        sources=np.array([node for node, _ in starts], np.int32),
        origins=np.array([origin for _, origin in starts], np.int32),
        targets=np.array(ends, np.int32),
        sites=Sites(
            nodes=len(sited) + len(pieces),
            ints=np.array(rows, np.int32).reshape(-1, SITE),
            weights=np.array(weights).reshape(-1, 3),
            windows=sum(_edge_faces(mesh, face) for face in faces),
            segment_ints=np.array([(k, part.face) for k, part in in_faces], np.int32).reshape(
                -1, SEGMENT
            ),
            segment_ends=np.array([part.start + part.end for _, part in in_faces]).reshape(
                -1, SEGMENT_ENDS
            ),
        ),
        first_target=first_target,
        points=tuple(sited),
        positions=np.array([mesh.position(point) for point in sited]).reshape(-1, 3),
        pieces=tuple(piece[0] for _, piece in pieces),
        first_piece=first_piece,
        components=tuple({component_of(mesh, line[0]) for line in sources}),
    )


def _edge_faces(mesh: TriangleMesh, face: int) -> int:
    """Return how many faces the three edges of an inner face have, each edge's counted."""
    links = mesh.topology.links
    return sum(len(list(half_edges_around(links, h))) for h in range(3 * face, 3 * face + 3))


def as_sources(mesh: TriangleMesh, sources: Any) -> tuple[tuple[Source, ...], tuple[Polyline, ...]]:
    """Return the sources, and their canonical points."""
    if isinstance(sources, str | bytes):
        raise InvalidPoint(f"the source is {sources!r}; it must be a vertex index or a Source")
    if isinstance(sources, Source | SurfacePoint | Curve) or not isinstance(sources, Iterable):
        sources = [sources]
    found, places = [], []
    for i, item in enumerate(sources):
        source = item if isinstance(item, Source) else Source(item)
        if isinstance(source.point, Curve):
            places.append(polyline_of(mesh, source.point, f"source {i}"))
        else:
            places.append((mesh.point(source.point, f"source {i}"),))
        start = source.start_distance
        if not is_number(start) or not (math.isfinite(start) and start >= 0.0):
            raise InvalidArgument(
                f"source {i} starts at {start!r}; it must be a finite number, 0 or more"
            )
        found.append(source)
    if not found:
        raise InvalidPoint("there are no sources: give at least one")
    return tuple(found), tuple(places)


def as_points(
    mesh: TriangleMesh, points: Iterable[int | SurfacePoint], name: str
) -> list[SurfacePoint]:
    """Return canonical points; ``name`` is how messages call one of them.

    Raises
    ------
    InvalidArgument
        There are none.
    InvalidPoint
        One is not a point of the mesh.
    """
    if isinstance(points, str | bytes) or not isinstance(points, Iterable):
        raise InvalidArgument(f"{name}s is {points!r}; it must be a sequence of points")
    places = [mesh.point(point, f"{name} {i}") for i, point in enumerate(points)]
    if not places:
        raise InvalidArgument(f"there are no {name}s: give at least one")
    return places


def component_of(mesh: TriangleMesh, point: SurfacePoint) -> int:
    """Return the connected component of a canonical point."""
    vertex = point.vertex_index
    if vertex is None:
        vertex = int(mesh.faces[point.face_index, 0])
    return int(mesh.components[vertex])


def disconnected(mesh: TriangleMesh, message: str, *points: SurfacePoint) -> NoPath:
    """Return the error of canonical points that are not connected, and why they may not be."""
    lonely = [point for point in points if point.face_index == UNPLACED]
    blocked = len(mesh.barriers)
    if lonely:
        message += f": {lonely[0]} belongs to no {'free face' if blocked else 'face'}"
    elif blocked:
        message += f", among {blocked} blocked {'face' if blocked == 1 else 'faces'}"
    return NoPath(message, "disconnected")


def corners_of(mesh: TriangleMesh, point: SurfacePoint) -> tuple[Ints, Floats]:
    """Return the inner vertices around a canonical point, or itself, and how far each is."""
    inner = mesh.topology.inner_vertex
    if point.vertex_index is not None:
        return inner[[point.vertex_index]], np.zeros(1)
    corners = mesh.faces[point.face_index]
    away = mesh.vertices[corners] - mesh.position(point)
    return inner[corners], np.linalg.norm(away, axis=1)
